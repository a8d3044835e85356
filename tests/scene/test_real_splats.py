from __future__ import annotations

import numpy as np
import pytest

from gasp_core import read_splat
from gasp_core.harmonics import turn_coefficients
from gasp_core.scene.placement import upright

FILES = [
    "splats/fruit_drops_minimal.ply",
    "splats/train-1000.ply",
    "splats/playbot/5_0",
    "meshlike/spot_10k.splat",
    "splats/statue-massa.sog",
    "splats/skull_inria_sh3.ply",
    "splats/plant.splat",
    "splats/guitar.compressed.ply",
]


@pytest.mark.parametrize("name", FILES)
def test_frame_zero_is_the_file(name, data, scene_of, run, tmp_path):
    path = data / name
    splat = read_splat(path)
    frame = run(scene_of(path, duration=0.04), tmp_path / "a.gasp", frames=1).gaussians(0)
    turn = upright("-y")
    extent = np.ptp(splat.means, axis=0).max()
    assert np.abs(frame.means - splat.means @ turn.T).max() <= 1e-6 * extent
    expected = turn @ splat.covariances() @ turn.T
    size = np.abs(expected).max(axis=(1, 2))
    assert (np.abs(frame.covariances() - expected).max(axis=(1, 2)) / np.where(size > 0, size, 1)).max() <= 1e-3
    turned = turn_coefficients(splat.harmonics, np.broadcast_to(turn, (len(splat), 3, 3)))
    assert np.array_equal(frame.harmonics, turned)
