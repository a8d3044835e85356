from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gasp_core import Elastic, EngineChoice, Gaussians, Recording, Scene, SplatObject, simulate
from gasp_core.accuracy.trajectories import diagonal_of, distance, distance_from
from gasp_core.contract import (
    Determinism,
    EngineCapabilities,
    EngineDescriptor,
    PointState,
    Precision,
    Status,
    StepReport,
)
from gasp_core.errors import AccuracyError, RecordingError

MATERIAL = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


class Moved:
    """An engine that puts the points where a function of them and the time says."""

    def __init__(self, motion):
        self.motion = motion

    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        return Session(problem, self.motion)


class Session:
    def __init__(self, problem, motion):
        self.rest, self.motion, self.time = problem.points.reference_positions, motion, 0.0

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        pass

    def advance_to(self, time):
        self.time = time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=0.1, largest_substep=0.1)

    def read(self, fields):
        return PointState(time=self.time, positions=self.motion(self.rest, self.time))


def splat(count=30, seed=0, flat=False):
    rng = np.random.default_rng(seed)
    scales = np.exp(rng.uniform(-4, -2, size=(count, 3)))
    if flat:
        scales[:, 2] = 1e-9
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=rng.uniform(0.2, 1, size=count),
        harmonics=np.zeros((count, 1, 3)),
    )


def scene_of(*objects, frame_rate=10.0, **others):
    items = tuple(
        SplatObject(name=name, splat=gaussians, material=MATERIAL, **others)
        for name, gaussians in dict(objects).items()
    )
    return Scene(duration=0.3, frame_rate=frame_rate, gravity=(0, 0, 0), objects=items)


@pytest.fixture
def run(tmp_path):
    """Runs a scene with a motion."""
    capabilities = EngineCapabilities(
        materials=frozenset({Elastic}),
        collider_shapes=frozenset(),
        contact_conditions=frozenset(),
        drives=frozenset(),
        force_fields=frozenset(),
        output_fields=frozenset(),
        conserved=frozenset(),
        devices=("cpu",),
        precisions=(Precision.FLOAT64,),
        determinism=Determinism.BITWISE,
    )
    descriptor = EngineDescriptor(
        name="moved", summary="as told", contract_version=(1, 0), capabilities=capabilities, factory="none:None"
    )
    made = []

    def go(scene, motion=lambda rest, time: rest, **options):
        made.append(tmp_path / f"{len(made)}.gasp")
        scene = dataclasses.replace(scene, engine=EngineChoice(name="moved"))
        return simulate(scene, (descriptor, Moved(motion)), out=made[-1], progress=False, **options)

    return go


def turned(rest, time):
    return rest @ Rotation.from_rotvec([0.1 * time, -2 * time, 3 * time]).as_matrix().T + [time, 0, -(time**2)]


def swollen(rest, time):
    return rest * (1 + 0.1 * time) + 0.01 * time * np.sin(7 * rest[:, ::-1])


def test_a_run_is_no_distance_from_itself(run):
    still = run(scene_of(("thing", splat())))
    found = distance(still, still)
    assert (found.rms, found.p95, found.shape_rms, found.centre_of_mass) == (0, 0, 0, 0)
    assert found.frames == (0, 1, 2, 3)
    assert np.allclose(found.times, [0, 0.1, 0.2, 0.3])
    assert found.vertices == 4 * 30


def test_a_rigid_motion_leaves_the_shape_alone(run):
    """Recordings keep float32 displacements of up to 2 m: 1e-7 of them."""
    scene = scene_of(("thing", splat()))
    found = distance(run(scene), run(scene, turned))
    assert found.shape_rms < 1e-6 < 0.1 < found.rms
    assert found.shape_share == found.shape_rms / found.diagonal
    assert found.rms_share > 0.01


def test_a_shift_is_one_of_the_centre_and_of_every_vertex(run):
    scene = scene_of(("thing", splat()))
    found = distance(run(scene), run(scene, lambda rest, time: rest + [0.3 * time, 0.4 * time, 0]), frames=[2, 3])
    # The common displacement is kept in double.
    assert np.allclose(found.per_frame.centre_of_mass, [0.1, 0.15], rtol=1e-12)
    assert np.allclose(found.per_frame.rms, found.per_frame.centre_of_mass, rtol=1e-9)
    assert np.allclose(found.per_frame.p95, found.per_frame.rms, rtol=1e-9)
    assert np.isclose(found.rms, np.sqrt((0.1**2 + 0.15**2) / 2), rtol=1e-9)
    assert np.isclose(found.p95, 0.15, rtol=1e-3), "to half a bin"
    assert found.shape_rms < 1e-12


def test_a_mirrored_body_is_not_called_the_same_shape(run):
    scene = scene_of(("thing", splat()))
    found = distance(run(scene), run(scene, lambda rest, time: rest * [1, 1, 1 - 2 * (time > 0)]), frames=[3])
    assert found.shape_rms > 0.1


def test_it_is_the_same_from_either_side(run):
    scene = scene_of(("thing", splat()))
    one, other = run(scene, turned), run(scene, swollen)
    there, back = distance(one, other), distance(other, one)
    for name in ("rms", "p95", "shape_rms", "centre_of_mass"):
        assert np.isclose(getattr(there, name), getattr(back, name), rtol=1e-12), name


def test_bodies_are_told_apart_and_together(run):
    scene = scene_of(("big", splat(40)), ("small", splat(20, seed=1)), rotation=(0, 0, 30))
    counts = (4 * 40, 4 * 20)

    def small_moves(rest, time):
        return rest + np.repeat([[0.0], [time]], counts, axis=0)

    found = distance(run(scene), run(scene, small_moves), frames=[1])
    assert found.bodies["big"].rms == 0
    assert np.isclose(found.bodies["small"].rms, 0.1 * np.sqrt(3), rtol=1e-9)
    share = np.sqrt(counts[1] / sum(counts))
    assert np.isclose(found.rms, share * found.bodies["small"].rms, rtol=1e-9)
    assert np.isclose(found.centre_of_mass, found.rms, rtol=1e-9)
    assert found.vertices == sum(counts)
    assert found.diagonal == max(body.diagonal for body in found.bodies.values())


def test_the_percentile_over_frames_is_that_of_all_offsets(run):
    scene = scene_of(("thing", splat(200)))
    still, other = run(scene), run(scene, swollen)
    found = distance(still, other)
    offsets = [np.linalg.norm(other.simplices(k)["thing"] - still.simplices(k)["thing"], axis=-1) for k in range(4)]
    # Half a bin is 0.07 %; between two neighbours of 2,400 lie 0.1 % here.
    assert np.isclose(found.p95, np.quantile(offsets, 0.95), rtol=3e-3)


def test_a_run_that_ended_early_is_compared_as_far_as_it_went(run):
    scene = scene_of(("thing", splat()))
    assert distance(run(scene), run(scene, turned, frames=2)).frames == (0, 1)
    with pytest.raises(RecordingError, match="has no frame 3"):
        distance(run(scene), run(scene, frames=2), frames=[3])
    with pytest.raises(AccuracyError, match="no frame was named"):
        distance(run(scene), run(scene), frames=[])


def test_what_is_not_the_same_is_refused(run):
    scene = scene_of(("thing", splat()))
    still = run(scene)
    for match, other in {
        "thing move in the one, other in the other": scene_of(("other", splat())),
        '"thing" 30 move in the one, 31': scene_of(("thing", splat(31))),
        "of other shapes, or in another order": scene_of(("thing", splat(seed=1))),
        "have 4 vertices in the one, 3 in the other": scene_of(("thing", splat()), vertices=3),
        "20 frames a second": scene_of(("thing", splat()), frame_rate=20.0),
    }.items():
        with pytest.raises(AccuracyError, match=match):
            distance(still, run(other))
    empty = run(scene)
    shutil.rmtree(empty.path / "commits")
    with pytest.raises(AccuracyError, match="has no frame yet"):
        distance(still, Recording.open(empty.path))


def test_one_flat_gaussian_has_a_diagonal_too(run):
    found = distance(*(run(scene_of(("dot", splat(1, flat=True))), motion) for motion in (turned, swollen)))
    assert found.diagonal > 0 and np.isfinite(found.rms_share)
    assert found.shape_rms <= found.rms
    assert diagonal_of(np.zeros((2, 3, 3))) == 1.0


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    angles=st.tuples(*[st.floats(-3, 3)] * 3),
    shift=st.tuples(*[st.floats(-1e4, 1e4)] * 3),
)
def test_any_rigid_motion_anywhere(recorded, seed, angles, shift):
    """Far away a place is known to 1e4 * 2^-53 = 1e-12 m, and so is the shape; the rest is what float64 gives."""
    rest = recorded.simplices(0)["thing"]
    extent = np.ptp(rest, axis=(0, 1)).max()
    noise = np.random.default_rng(seed).normal(size=rest.shape) * 1e-3
    turn = Rotation.from_rotvec(angles).as_matrix()
    rigid = distance_from(recorded, lambda frame: {"thing": rest @ turn.T + shift}, [0])
    assert rigid.shape_rms < 1e-14 * extent + 1e-15 * np.abs(shift).max() * 10
    bent = distance_from(recorded, lambda frame: {"thing": (rest + noise) @ turn.T + shift}, [0])
    straight = distance_from(recorded, lambda frame: {"thing": rest + noise}, [0])
    assert np.isclose(bent.shape_rms, straight.shape_rms, rtol=1e-6)
    assert straight.shape_rms <= straight.rms * (1 + 1e-12)
    # What is not centre is about the centre: squares add up to no more than the whole.
    assert straight.shape_rms**2 + straight.centre_of_mass**2 <= straight.rms**2 * (1 + 1e-9)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    from gasp_core.discovery.registry import discover

    assert "reference-mpm" in discover().engines
    scene = scene_of(("thing", splat()))
    return simulate(scene, "reference-mpm", out=tmp_path_factory.mktemp("still") / "a.gasp", frames=1, progress=False)
