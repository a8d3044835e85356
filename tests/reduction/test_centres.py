"""The reduction `centres`: means are moved, covariances follow the deformation gradient."""

from __future__ import annotations

import dataclasses
import math

import flying_points
import numpy as np
import pytest
from scripted_engine import Scripted

from gasp_core import (
    EngineAccuracy,
    Gaussians,
    MapChoice,
    RecordingChoice,
    Reduction,
    Swing,
    simulate,
)
from gasp_core.contract import Field, PointState
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices, rotation_quaternions
from gasp_core.recording.verifying import verify
from gasp_core.reduction.all_vertices import block_of
from gasp_core.reduction.centres import sample_centres

CENTRES = Reduction(mode="centres")
TIME = 0.12
STRAIN = np.array([[1.2, 0.4, 0], [0, 0.8, -0.3], [0.1, 0, 1.1]])


class Known(Scripted):
    """x -> gradient(t) x + (0, 0, -t), its own F shown."""

    def __init__(self, gradient):
        self.gradient = gradient

    def read(self, fields):
        gradient = self.gradient(self.time / TIME)
        shown = (
            np.tile(gradient, (len(self.problem.points.reference_positions), 1, 1))
            if Field.DEFORMATION_GRADIENTS in fields
            else None
        )
        return PointState(
            time=self.time,
            positions=self.problem.points.reference_positions @ gradient.T - [0, 0, self.time],
            deformation_gradients=shown,
        )

    def checkpoint(self):
        return {}


def straining(share):
    return np.eye(3) + share * (STRAIN - np.eye(3))


def turning(share):
    half = share * math.radians(70)
    return rotation_matrices([[math.cos(half), 0, math.sin(half), 0]])[0]


@pytest.fixture
def record(scene_of, tmp_path):
    count = iter(range(1000))

    def go(splat, gradient, *, shows=True, **others):
        given = {"duration": TIME, "frame_rate": 25, "gravity": (0, 0, 0), "reduction": CENTRES} | others
        fields = frozenset({Field.DEFORMATION_GRADIENTS}) if shows else frozenset()
        engine = (flying_points.descriptor(checkpoints=False, fields=fields), Known(gradient))
        return simulate(scene_of(splat, **given), engine, tmp_path / f"{next(count)}.gasp", progress=False)

    return go


def sheet(count=60):
    """Flat Gaussians in one plane."""
    rng = np.random.default_rng(1)
    frame = turning(0.25)
    spins = rng.uniform(0, np.pi, count)
    turns = np.stack([np.cos(spins), np.zeros(count), np.zeros(count), np.sin(spins)], axis=1)
    return Gaussians(
        means=np.c_[rng.uniform(-0.5, 0.5, (count, 2)), np.zeros(count)] @ frame.T,
        quaternions=rotation_quaternions(frame @ rotation_matrices(turns)),
        scales=np.c_[rng.uniform(0.01, 0.05, (count, 2)), np.full(count, 1e-6)],
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )


@pytest.mark.parametrize("shows", [True, False], ids=["its F", "a fit"])
def test_covariances_are_F_Sigma_FT(record, cloud, shows):
    """To the rounding of displacements of about 1 in float32, 6e-8, over distances of a tenth of it for a fit."""
    splat = cloud(80)
    run = record(splat, straining, shows=shows)
    found = run.gaussians(run.frame_count - 1)
    expected = STRAIN @ splat.covariances() @ STRAIN.T
    assert run.bodies[0].strained == shows
    assert np.abs(found.means - (splat.means @ STRAIN.T - [0, 0, TIME])).max() < 1e-6
    assert np.abs(found.covariances() - expected).max() < 1e-6 * np.abs(expected).max() * (1 if shows else 10)
    np.testing.assert_allclose(run.gaussians(0).means, splat.means, atol=1e-15)
    assert verify(run.path).damaged == ()


@pytest.mark.parametrize("shows", [True, False], ids=["its F", "a fit"])
def test_flat_ones_in_a_plane_turn(record, shows):
    """Triangles: nothing tells the fit how matter deforms across the plane, so that its normal stays one."""
    splat = sheet()
    run = record(splat, turning, shows=shows, vertices=3)
    found = run.gaussians(run.frame_count - 1)
    turn = turning(1.0)
    expected = turn @ splat.covariances() @ turn.T
    assert np.abs(found.covariances() - expected).max() < 1e-5 * np.abs(expected).max()


def test_what_physics_stretches_is_bounded(record, cloud):
    splat = cloud(40)
    run = record(splat, lambda share: (1 + 1.5 * share) * np.eye(3), maps=MapChoice(alpha=1.5))
    last = run.frame_count - 1
    assert run.diagnostics(last)["clipped"] == 40
    ratios = np.sort(run.gaussians(last).scales, axis=1) / np.sort(splat.scales, axis=1)
    np.testing.assert_allclose(ratios, 1.5, rtol=1e-5)


def test_an_engine_moves_them(scene_of, cloud, tmp_path):
    """The covariances of a run are those of the F of the same session, read out by itself."""
    from gasp_core.contract import Precision
    from gasp_core.discovery.registry import discover
    from gasp_core.engines.opening import open_engine
    from gasp_core.simulation.splat_sources import prepare

    splat = cloud(60)
    scene = scene_of(
        splat,
        duration=0.08,
        frame_rate=25,
        reduction=CENTRES,
        angular_velocity=(0, 9, 0),
        accuracy=EngineAccuracy(resolution=8),
    )
    run = simulate(scene, "reference-mpm", tmp_path / "a.gasp", progress=False)
    assembly = prepare(scene).assembly
    engine = open_engine(discover().offer("reference-mpm"))
    options = {"device": "cpu", "precision": Precision.FLOAT64, "seed": 0, "options": None}
    with engine.open(assembly.problem, accuracy=assembly.accuracy, **options) as session:
        for frame in (1, 2):
            session.advance_to(scene.time_of(frame))
        gradients = session.read(frozenset({Field.DEFORMATION_GRADIENTS})).deformation_gradients
    expected = gradients @ splat.covariances() @ gradients.transpose(0, 2, 1)
    assert np.abs(gradients - np.eye(3)).max() > 0.3
    assert np.abs(run.gaussians(2).covariances() - expected).max() < 1e-6 * np.abs(expected).max()


def test_a_run_goes_on_to_the_bit(scene_of, cloud, tmp_path):
    choice = {"reduction": CENTRES, "duration": 0.16, "frame_rate": 25, "angular_velocity": (0, 5, 0)}
    choice |= {"accuracy": EngineAccuracy(resolution=8), "recording": RecordingChoice(checkpoint_frames=1)}
    scene = scene_of(cloud(40), **choice)
    whole = simulate(scene, "reference-mpm", tmp_path / "whole.gasp", progress=False)
    simulate(scene, "reference-mpm", tmp_path / "parts.gasp", frames=3, progress=False)
    parts = simulate(scene, "reference-mpm", tmp_path / "parts.gasp", resume=True, progress=False)
    for frame in range(whole.frame_count):
        assert np.array_equal(parts.simplices(frame)["thing"], whole.simplices(frame)["thing"])


def test_a_single_one_and_coincident_ones(cloud):
    for splat in (cloud(1), dataclasses.replace(cloud(20), means=np.zeros((20, 3)))):
        block = block_of(splat, 4)
        sample = sample_centres(block, 0.1)
        moved = sample.carrier.carry(block.rest, np.ones((len(splat), 3)))
        np.testing.assert_allclose(moved, block.rest + 1, atol=1e-12)


def test_a_psi_that_goes_on_is_refused(scene_of, cloud):
    swing = Swing(axis=(0, 1, 0), pivot=(0, 0, 0), amplitude=10, frequency=1)
    with pytest.raises(SceneError, match='"centres" knows no psi'):
        scene_of(cloud(20), motion=swing, reduction=CENTRES)
    scene_of(cloud(20), motion=dataclasses.replace(swing, composition="frozen"), reduction=CENTRES)
