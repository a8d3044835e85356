"""The proof that an engine can be written outside this repository, with built wheels alone.

`python conformance_tests/tests/template_outside.py` does in a temporary folder what docs/writing_an_engine.md says, by
the very commands that are printed there: builds the wheels of core and suite, installs them into an environment that
holds nothing else, begins an engine there and installs it, and runs the suite. Before that last command
everything but the environment is deleted, so that only what the wheels brought can be used.

Dependencies are installed by the wheels' own metadata, in the versions of requirements.lock: a requirement that is
missing there shows, as it would not in an environment that has everything already.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "docs" / "writing_an_engine.md"

ALONE = """
find . -mindepth 1 -maxdepth 1 ! -name .venv -exec rm -r {} +
.venv/bin/pip check
.venv/bin/python - <<'END'
import sys
from importlib import import_module, metadata
for name in ("gasp_core", "gasp_conformance", "my_engine"):
    home = import_module(name).__file__
    assert home.startswith(sys.prefix), f"{name} is that of {home}, not the wheel's"
own = sorted(one.name for one in metadata.distributions() if one.entry_points.select(group="gasp"))
assert own == ["gasp-conformance", "my-engine"], own
END
"""
"""Between building and running: the sources go away, and what is left is what the wheels brought."""


def commands() -> list[str]:
    """The document's shell commands, block by block."""
    return re.findall(r"^```sh\n(.*?)^```$", DOCUMENT.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def pins() -> str:
    """The versions of requirements.lock as constraints; hashes would be asked of our own wheels, too."""
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    return "".join(f"{line.removesuffix(chr(92)).strip()}\n" for line in lines if not line.startswith(" "))


def run(script: str, folder: Path) -> int:
    """Run shell commands in a folder as somebody would who has nothing of ours but the repository."""
    constraints = folder.parent / "constraints.txt"
    constraints.write_text(pins(), encoding="utf-8")
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    environment |= {
        "GASP": str(ROOT),
        "PIP_CONSTRAINT": str(constraints),
        # So that python3 is an interpreter that GASP runs on.
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    return subprocess.run(["sh", "-eux", "-c", script], cwd=folder, env=environment).returncode


def main() -> int:
    """Follow the document in a temporary folder; the exit status is that of the suite."""
    *building, checking = commands()
    with tempfile.TemporaryDirectory(prefix="gasp-template-") as name:
        folder = Path(name, "outside")
        folder.mkdir()
        return run("\n".join([*building, ALONE, checking]), folder)


if __name__ == "__main__":
    sys.exit(main())
