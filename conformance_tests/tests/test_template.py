"""docs/writing_an_engine.md does what it says, outside this repository."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent


def _proof() -> Any:
    # Test folders are no packages (importlib mode): a neighbour is found by its file.
    spec = importlib.util.spec_from_file_location("template_outside", HERE / "template_outside.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PROOF = _proof()


@pytest.mark.thorough
def test_the_last_command_is_the_suite_and_every_check_it_speaks_of_is_there() -> None:
    assert PROOF.commands()[-1] == ".venv/bin/gasp-conformance my-engine --quick\n"
    listing = subprocess.run(
        [sys.executable, "-m", "gasp_conformance", "reference-mpm", "--list"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    known = {line.split("  ")[1].strip() for line in map(_squeezed, listing.splitlines()) if line.count("  ") >= 2}
    text = PROOF.DOCUMENT.read_text(encoding="utf-8")
    spoken_of = set(re.findall(r"^\| [^|]* \| `([^`]+)` \|$", text, flags=re.MULTILINE))
    spoken_of |= set(re.findall(r'^check = "([^"]+)"$', text, flags=re.MULTILINE))
    assert spoken_of and not spoken_of - known


def _squeezed(line: str) -> str:
    """With two spaces between columns, however wide they are."""
    return re.sub(r" {2,}", "  ", line)


@pytest.mark.slow
def test_a_new_engine_passes_from_built_wheels_alone() -> None:
    assert PROOF.main() == 0
