"""Frame 0 of a run is the file: every real splat, through placing, points, the engine's own arrays and back."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core import read_splat
from gasp_core.contract import EngineAccuracy, Field, Precision
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.harmonics import turn_coefficients
from gasp_core.reduction.bodies import moved_gaussians
from gasp_core.scene.placement import upright
from gasp_core.simulation.splat_sources import prepare

# Several times as large as the others, each the same kind of file as one that is quick.
LARGE = ["splats/playbot/0_0", "splats/playbot/1_0", "splats/playbot/2_0", "meshlike/spot_100k.splat"]
AGAIN = ["splats/playbot_lod3_inria_sh2.ply", "splats/skull_inria_sh3.ply", "splats/statue-angel.compressed.ply"]
"""Others in another format."""
THOROUGH = ("skull", "statue-angel", "statue-massa", "statue-st-peter")
FILES = [
    "splats/fruit_drops_minimal.ply",
    "splats/guitar.compressed.ply",
    pytest.param("splats/plant.splat", marks=pytest.mark.thorough),
    *(pytest.param(f"splats/{name}.sog", marks=pytest.mark.thorough) for name in THOROUGH),
    "splats/train-1000.ply",
    *(pytest.param(f"splats/playbot/{level}_0", marks=pytest.mark.thorough) for level in (3, 4)),
    *(f"splats/playbot/{level}_0" for level in (5, 6)),
    "meshlike/spot_10k.splat",
    *(pytest.param(name, marks=pytest.mark.slow) for name in (*LARGE, *AGAIN)),
]
TURNED = [
    "splats/fruit_drops_minimal.ply",
    "splats/playbot/5_0",
    pytest.param("splats/skull_inria_sh3.ply", marks=pytest.mark.slow),
]
OPENED = [
    "splats/fruit_drops_minimal.ply",
    pytest.param("splats/playbot/3_0", marks=pytest.mark.thorough),
    "splats/statue-massa.sog",
    pytest.param("splats/skull.sog", marks=pytest.mark.slow),
]


def covariance_error(found, wanted):
    size = np.linalg.norm(wanted, axis=(1, 2))
    return (np.linalg.norm(found - wanted, axis=(1, 2)) / np.where(size > 0, size, 1)).max()


@pytest.mark.parametrize("name", FILES)
def test_frame_zero_is_the_file(name, data, scene_of, run, tmp_path):
    path = data / name
    splat = read_splat(path)
    frame = run(scene_of(path, up="+z", duration=0.04), tmp_path / "a.gasp", frames=1).gaussians(0)
    extent = np.ptp(splat.means, axis=0).max()
    assert np.abs(frame.means - splat.means).max() <= 1e-6 * extent
    assert covariance_error(frame.covariances(), splat.covariances()) <= 1e-3
    np.testing.assert_array_equal(frame.harmonics, splat.harmonics)
    np.testing.assert_array_equal(frame.opacities, splat.opacities)


@pytest.mark.parametrize("name", TURNED)
def test_frame_zero_is_the_file_set_upright(name, data, scene_of, run, tmp_path):
    path = data / name
    splat = read_splat(path)
    frame = run(scene_of(path, duration=0.04), tmp_path / "a.gasp", frames=1).gaussians(0)
    turn = upright("-y")
    extent = np.ptp(splat.means, axis=0).max()
    assert np.abs(frame.means - splat.means @ turn.T).max() <= 1e-6 * extent
    assert covariance_error(frame.covariances(), turn @ splat.covariances() @ turn.T) <= 1e-3
    turned = turn_coefficients(splat.harmonics, np.broadcast_to(turn, (len(splat), 3, 3)))
    np.testing.assert_array_equal(frame.harmonics, turned)


@pytest.mark.parametrize("name", OPENED)
def test_what_a_float32_engine_holds_at_the_start_is_the_file(name, data, scene_of):
    registry = discover()
    if "taichi-mpm" not in registry.engines:
        pytest.skip("taichi-mpm is not installed")
    splat = read_splat(data / name)
    scene = scene_of(data / name, up="+z")
    prepared = prepare(scene)
    assembly = prepared.assembly
    (body,) = assembly.bodies
    with open_engine(registry.offer("taichi-mpm")).open(
        assembly.problem,
        device="cpu",
        precision=Precision.FLOAT32,
        seed=0,
        accuracy=EngineAccuracy(spacing=assembly.spacing),
        options=None,
    ) as session:
        positions = session.read(frozenset({Field.POSITIONS})).positions
    moved = moved_gaussians(body, positions - assembly.problem.points.reference_positions, scene.maps)
    extent = np.ptp(splat.means, axis=0).max()
    assert (
        np.abs(moved.gaussians.means + body.block.centre - splat.means[prepared.objects[0].rows]).max() <= 1e-6 * extent
    )
    assert covariance_error(moved.gaussians.covariances(), splat.covariances()[prepared.objects[0].rows]) <= 1e-3
    np.testing.assert_array_equal(moved.gaussians.harmonics, splat.harmonics[prepared.objects[0].rows])
