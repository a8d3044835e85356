"""D-MiSo's own transfer, beside its formula written out once more."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gasp_core import EngineAccuracy, RecordingChoice, Reduction, Swing, simulate
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices
from gasp_core.recording.verifying import verify
from gasp_core.reduction.all_vertices import block_of
from gasp_core.reduction.attached import Attached
from gasp_core.reduction.cores import sample_cores

D_MISO = Reduction(mode="cores", count=12, transfer="d-miso")


def sampled(cloud, vertices=4, count=80):
    block = block_of(cloud(count), vertices)
    sample = sample_cores(block, D_MISO, 0.02, 0.1)
    assert isinstance(sample.carrier, Attached)
    return block, sample


def turned(points):
    half = math.radians(50)
    turn = rotation_matrices([[math.cos(half), 0, math.sin(half) * 0.6, math.sin(half) * 0.8]])[0]
    return points @ turn.T + [1, 2, 3]


@pytest.mark.parametrize("vertices", [3, 4])
def test_rigid_motion_and_none(cloud, vertices):
    block, sample = sampled(cloud, vertices)
    still = sample.carrier.carry(block.rest, np.zeros((36, 3)))
    np.testing.assert_array_equal(still, block.rest)
    moved = sample.carrier.carry(block.rest, turned(sample.positions) - sample.positions)
    np.testing.assert_allclose(moved, turned(block.rest), atol=1e-12)


def test_it_is_the_published_rule(cloud):
    """v1' + a_n n + a_2 e2 + a_3 e3, edges of length one; a frame from n and e2; scales as the edges' lengths."""
    block, sample = sampled(cloud)
    rng = np.random.default_rng(0)
    moves = 0.2 * rng.normal(size=(12, 3, 3))
    found = sample.carrier.carry(block.rest, moves.reshape(-1, 3))
    corners = sample.positions.reshape(12, 3, 3)

    def axes(triangle):
        e2, e3 = triangle[1] - triangle[0], triangle[2] - triangle[0]
        n = np.cross(e2, e3)
        lengths = np.linalg.norm(e2), np.linalg.norm(e3)
        n, e2, e3 = n / np.linalg.norm(n), e2 / lengths[0], e3 / lengths[1]
        return np.array([n, e2, e3]), np.array([n, e2, np.cross(n, e2)]), np.array([1.0, *lengths])

    for row, (simplex, label) in enumerate(zip(block.rest, sample.carrier.labels)):
        own, now = corners[label], corners[label] + moves[label]
        (skew, frame, long), (skew_now, frame_now, long_now) = axes(own), axes(now)
        a = np.linalg.inv(skew.T) @ (simplex[0] - own[0])
        mean = now[0] + a @ skew_now
        np.testing.assert_allclose(found[row, 0], mean, atol=1e-12)
        for vertex in (1, 2, 3):
            along = frame @ (simplex[vertex] - simplex[0])
            expected = mean + (along * long_now / long) @ frame_now
            np.testing.assert_allclose(found[row, vertex], expected, atol=1e-12)


def test_no_mean_goes_with_a_stretch(cloud):
    """What is wrong with it: matter twice as wide has its Gaussians where they were about their core's mean."""
    block, sample = sampled(cloud)
    moved = sample.carrier.carry(block.rest, sample.positions)
    own = sample.positions.reshape(12, 3, 3)[sample.carrier.labels, 0]
    np.testing.assert_allclose(moved[:, 0] - 2 * own, block.rest[:, 0] - own, atol=1e-12)


def test_corners_are_the_mean_and_two_axes(cloud):
    _, sample = sampled(cloud)
    corners = sample.positions.reshape(12, 3, 3)
    edges = corners[:, 1:] - corners[:, :1]
    assert np.abs(np.einsum("ci,ci->c", edges[:, 0], edges[:, 1])).max() < 1e-12
    longer, shorter = np.linalg.norm(edges, axis=2).T
    assert (longer >= shorter - 1e-12).all()
    assert sample.volumes.shape == (36,) and (sample.volumes > 0).all()
    lone = sample_cores(block_of(cloud(1), 3), D_MISO, 0.0, 0.1)
    assert np.isfinite(lone.carrier.carry(block_of(cloud(1), 3).rest, np.ones((3, 3)))).all()


def test_velocities_of_a_spin(cloud):
    block, sample = sampled(cloud)
    spin = np.array([1.0, -2.0, 0.5])
    found = sample.carrier.gather(block.rest, np.cross(spin, block.rest))
    np.testing.assert_allclose(found, np.cross(spin, sample.positions), atol=1e-9)


def test_a_run_goes_on_to_the_bit(scene_of, cloud, tmp_path):
    choice = {"reduction": D_MISO, "duration": 0.16, "frame_rate": 25, "angular_velocity": (0, 5, 0)}
    choice |= {"accuracy": EngineAccuracy(resolution=8), "recording": RecordingChoice(checkpoint_frames=1)}
    scene = scene_of(cloud(60), **choice)
    whole = simulate(scene, "reference-mpm", tmp_path / "whole.gasp", progress=False)
    simulate(scene, "reference-mpm", tmp_path / "parts.gasp", frames=3, progress=False)
    parts = simulate(scene, "reference-mpm", tmp_path / "parts.gasp", resume=True, progress=False)
    for frame in range(whole.frame_count):
        assert np.array_equal(parts.simplices(frame)["thing"], whole.simplices(frame)["thing"])
    assert verify(whole.path).damaged == ()
    assert whole.bodies[0].carrier.kind == "d-miso"


def test_what_it_does_not_do_is_refused(scene_of, cloud):
    with pytest.raises(SceneError, match="levels must be 1"):
        Reduction(mode="cores", count=5, transfer="d-miso", levels=2)
    swing = Swing(axis=(0, 1, 0), pivot=(0, 0, 0), amplitude=10, frequency=1)
    with pytest.raises(SceneError, match=r'cannot be carried by reduction\.transfer "d-miso"'):
        scene_of(cloud(20), motion=swing, reduction=D_MISO)
