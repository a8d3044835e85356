"""A small scene file, the engines of the tests, and counts of how often a run was measured."""

import os
import sys
from pathlib import Path

import pytest

from gasp_core.discovery.registry import discover
from gasp_core.io import write_splat
from gasp_core.toy import make_toy

FAKES = Path(__file__).parents[2] / "fake_plugins"

SCENE = """
[scene]
schema = 2
duration = 0.16
frame_rate = 25

[[object]]
name = "toy"
splat = "toy.ply"
height = 0.3
up = "+z"
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }

[engine]
name = "frail"

[recording]
checkpoint_seconds = 1e9
"""


@pytest.fixture(autouse=True)
def installed(monkeypatch, tmp_path):
    """The engines of the tests, found by the processes that are started here too; a cache of the test's own."""
    for name in ("frail", "ballistic"):
        monkeypatch.syspath_prepend(FAKES / name)
    # Of Ray's workers too, which are nobody's children.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    discover.cache_clear()
    monkeypatch.setenv("GASP_CACHE", str(tmp_path / "cache"))
    yield
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture
def scene(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    write_splat(folder / "toy.ply", make_toy(64))
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


@pytest.fixture
def measured(tmp_path):
    """An observable that notes down each time it is asked, `Observable`, and a function that reads the notes."""
    from gasp_core.studies.sweep import load_observable

    notes, file = tmp_path / "notes", tmp_path / "mine.py"
    file.write_text(
        "def tip(recording):\n"
        f"    with open({str(notes)!r}, 'a') as stream:\n"
        "        stream.write(f\"{recording.header.engine.options['spin']:g}\\n\")\n"
        "    return recording.points(recording.frame_count - 1)[:, 2].max()\n"
    )
    return load_observable(f"{file}:tip"), lambda: notes.read_text().split() if notes.exists() else []
