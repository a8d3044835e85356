"""Every example runs as it stands; here coarsely and for a few frames."""

import dataclasses
import os
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

import gasp_core as gasp

EXAMPLES = Path(__file__).parents[2] / "examples"
DATA = Path(os.environ.get("GASP_DATA", Path(__file__).parents[3] / "shared" / "data"))


LONG = ("potted_plant", "sand_castle", "shaken_pot", "swaying_plant", "tumbling_pot")
"""Those of captures and of many bodies."""


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    for path in EXAMPLES.glob("*.*"):
        if path.suffix in (".py", ".toml"):
            shutil.copy(path, folder)
    for maker in ("make_toy.py", "make_ball.py", "make_castle.py", "make_dancer.py", "vibrating_bar.py"):
        runpy.run_path(str(folder / maker), run_name="__main__")
    return folder


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.name, marks=pytest.mark.thorough if path.stem in LONG else ())
        for path in sorted(EXAMPLES.glob("*.toml"))
    ],
)
def test_scene(name, examples, monkeypatch):
    if "$GASP_DATA" in (examples / name).read_text():
        if not DATA.is_dir():
            # Trained splats are no part of the repository.
            pytest.skip(f"no real splats at {DATA} (set GASP_DATA)")
        monkeypatch.setenv("GASP_DATA", str(DATA.absolute()))
    scene = gasp.load_scene(examples / name)
    coarse = dataclasses.replace(scene.accuracy, resolution=10)
    run = gasp.simulate(dataclasses.replace(scene, accuracy=coarse), frames=4, trust_code=True)
    assert run.frame_count == 4
    moved = run.gaussians(3)
    assert np.isfinite(moved.means).all()
    assert not np.array_equal(moved.means, run.gaussians(0).means)


def test_script(examples, monkeypatch):
    monkeypatch.chdir(examples)
    runpy.run_path(str(examples / "drop.py"), run_name="__main__")
    assert len(gasp.read_splat(examples / "toy_after.ply")) == 4000
