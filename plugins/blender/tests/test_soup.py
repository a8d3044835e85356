"""The soup of a splat through Blender itself: examples/blender_soup.py, run by Blender's Python as its reader would."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from gasp_core.cli.main import main
from gasp_core.discovery.environments import ready_python
from gasp_core.discovery.registry import discover
from gasp_core.io import read_splat, write_splat
from gasp_core.io.soups import read_positions, read_soup
from gasp_core.toy import make_toy

EXAMPLE = Path(__file__).parents[3] / "examples" / "blender_soup.py"


@pytest.fixture
def moved(kit, tmp_path, monkeypatch):
    """What Blender makes of the soup of `toy.ply`, (frames, vertices, 3)."""
    monkeypatch.chdir(tmp_path)
    write_splat(tmp_path / "toy.ply", make_toy(500))
    assert main(["soup", "export", "toy.ply", "--up", "+z"]) == 0
    python = ready_python(discover().descriptor("blender"))
    run = subprocess.run(
        [str(python), str(EXAMPLE), "--", "toy.soup.ply", "moved.npy"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-500:]
    return np.load("moved.npy")


def test_what_blender_has_not_moved_comes_back_to_the_last_bit(moved):
    np.save("unmoved.npy", moved[0])
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "unmoved.npy", "-o", "back.ply"]) == 0
    assert Path("back.ply").read_bytes() == Path("toy.ply").read_bytes()


def test_vertices_keep_their_order_and_what_is_twisted_is_a_splat_again(moved):
    """Every vertex goes around the vertical axis in its own height: the modifier works in float32."""
    before = read_positions(Path("toy.soup.ply"), read_soup(Path("toy.soup.ply"))).reshape(-1, 3)
    size = np.ptp(before, axis=0).max()
    heights = np.abs(moved[..., 2] - before[:, 2]).max()
    radii = np.abs(np.hypot(moved[..., 0], moved[..., 1]) - np.hypot(before[:, 0], before[:, 1])).max()
    assert max(heights, radii) <= 8 * 2.0**-24 * size
    assert np.linalg.norm(moved[-1] - before, axis=1).max() > 0.1 * size
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy"]) == 0
    frames = sorted(Path("toy_moved").iterdir())
    assert len(frames) == len(moved)
    assert np.isfinite(read_splat(frames[-1]).means).all()
