import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from gasp_core.cli.main import main
from gasp_core.discovery.registry import discover

FAKES = Path(__file__).parents[1] / "fake_plugins"


def forget_fakes():
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture
def installed(monkeypatch):
    """Put distributions of the tests on the import path, as if installed, and discover what there is then."""

    def install(*names):
        for name in names:
            assert (FAKES / name).is_dir()
            monkeypatch.syspath_prepend(FAKES / name)
        forget_fakes()
        return discover()

    yield install
    forget_fakes()


@pytest.fixture
def in_process_of_its_own():
    """Run Python code in a fresh interpreter in which these distributions of the tests are installed."""

    def run(arguments, *names):
        path = os.pathsep.join([*(str(FAKES / name) for name in names), *filter(None, [os.environ.get("PYTHONPATH")])])
        return subprocess.run(
            [sys.executable, *arguments],
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=120,
        )

    return run


@pytest.fixture
def listed(in_process_of_its_own):
    """What ``gasp engines --json`` says where these distributions are installed, by name and distribution."""

    def rows(*names):
        done = in_process_of_its_own(["-m", "gasp_core.cli.main", "engines", "--json"], *names)
        assert done.returncode == 0, done.stderr
        return {(row["name"], row["distribution"]): row for row in json.loads(done.stdout)["engines"]}

    return rows


@pytest.fixture
def new_engine(tmp_path, monkeypatch):
    """Begin an engine with ``gasp engines new`` and return its folder, which is a place for the import path."""

    def begin(name="my-engine", **texts):
        """`texts` replaces what stands in files of the package, by their stems: pairs of old and new."""
        monkeypatch.chdir(tmp_path)
        assert main(["engines", "new", name]) == 0
        folder = tmp_path / name
        for stem, (old, new) in texts.items():
            file = folder / name.replace("-", "_") / f"{stem}.py"
            before = file.read_text(encoding="utf-8")
            assert old in before
            file.write_text(before.replace(old, new), encoding="utf-8")
        _as_if_installed(folder)
        return folder

    return begin


def _as_if_installed(folder):
    """What `pip install -e` would leave beside it, from its pyproject.toml."""
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    metadata = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    metadata.mkdir()
    required = "".join(f"Requires-Dist: {requirement}\n" for requirement in project["dependencies"])
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n{required}"
    )
    entries = "".join(f"{name} = {module}\n" for name, module in project["entry-points"]["gasp"].items())
    (metadata / "entry_points.txt").write_text(f"[gasp]\n{entries}")
