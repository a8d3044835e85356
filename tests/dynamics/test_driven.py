"""The composition `driven`: parts that go with psi, the rest of the object moved by an engine."""

from __future__ import annotations

import dataclasses
import math
import shutil

import flying_points
import numpy as np
import pytest
from scripted_engine import Scripted
from splat_shells import SHAPES, shell

import gasp_core
from gasp_core import (
    BoxShape,
    EngineAccuracy,
    FrameSequence,
    HalfSpace,
    Part,
    PythonMotion,
    Recording,
    RecordingChoice,
    Reduction,
    Swing,
    simulate,
    write_splat,
)
from gasp_core.contract import Driven, Elastic, PointState
from gasp_core.errors import RecordingError, SceneError, UnsupportedSceneError
from gasp_core.games import to_simplices
from gasp_core.gaussians import Gaussians, rotation_matrices
from gasp_core.recording.verifying import verify
from gasp_core.stepping.led_points import LedPoints

TIME, RATE = 0.32, 25.0
LEFT = Part(name="left", region=HalfSpace(point=(0, 0, 0), normal=(1, 0, 0)), driven=True)
ALL_OF_IT = Part(name="all", region=BoxShape(center=(0, 0, 0), half_extents=(9, 9, 9)), driven=True)
SWING = Swing(
    axis=(0, 1, 0), pivot=(0.1, 0, -0.4), amplitude=150, frequency=0.7, phase=20, start=0.3, composition="driven"
)
MODES = {
    "all": Reduction(mode="all"),
    "cores": Reduction(mode="cores", fraction=0.3),
    "frame": Reduction(mode="cores", fraction=0.3, transfer="frame"),
    "levels": Reduction(mode="cores", fraction=0.2, levels=2),
    "volume": Reduction(mode="volume"),
}
every_mode = pytest.mark.parametrize("reduction", MODES.values(), ids=MODES)
COARSE = EngineAccuracy(resolution=8)
STILL = (0.0, 0.0, 0.0)


def splat_for(reduction, cloud, count=200):
    if reduction.mode != "volume":
        return cloud(count)
    ball = shell(SHAPES["sphere"], count=10 * count)
    return ball.with_(means=ball.means - [0, 0, 0.5])


def turned_by(degrees):
    half = math.radians(degrees) / 2
    return rotation_matrices(np.array([[math.cos(half), 0, math.sin(half), 0]]))[0]


def swung(points, s):
    angle = SWING.amplitude * math.sin(2 * np.pi * SWING.frequency * s + np.radians(SWING.phase))
    return SWING.pivot + (points - SWING.pivot) @ turned_by(angle).T


def flow(points, s):
    """No affine map of the whole, nor the same to any two points."""
    x, y, z = np.moveaxis(points, -1, 0)
    return points + np.stack([0.3 * s * np.sin(2 * y), 0.2 * s * x * z, 0.25 * np.sin(s) * x**2], axis=-1)


class Falling(Scripted):
    """Led points are led; all others move by (0, 0, -t), exactly."""

    def read(self, fields):
        positions = self.problem.points.reference_positions - [0, 0, self.time]
        led = LedPoints.of(self.problem)
        assert led is not None
        positions[led.rows] = led.positions(self.time)
        return PointState(time=self.time, positions=positions)

    def checkpoint(self):
        return {}


def descriptor(*, leads=True):
    own = flying_points.descriptor(checkpoints=False, fields=frozenset())
    return dataclasses.replace(own, capabilities=dataclasses.replace(own.capabilities, trajectories=leads))


@pytest.fixture
def record(tmp_path, scene_of):
    count = iter(range(1000))

    def go(splat, motion, engine=None, parts=(LEFT,), trust_code=False, **others) -> Recording:
        given = {"duration": TIME, "frame_rate": RATE, "gravity": STILL} | others
        scene = scene_of(splat, motion=motion, parts=parts, **given)
        out = tmp_path / f"{next(count)}.gasp"
        return simulate(scene, engine or (descriptor(), Falling()), out, trust_code=trust_code, progress=False)

    return go


@every_mode
@pytest.mark.parametrize("vertices", [pytest.param(3, marks=pytest.mark.thorough), 4])
def test_driven_gaussians_are_where_psi_has_them(record, cloud, reduction, vertices):
    """To the rounding of float32, however the points that stand for them are reduced; the others are physics."""
    splat = splat_for(reduction, cloud)
    motion = PythonMotion(function=flow, composition="driven", start=0.5, rate=2.0)
    run = record(splat, motion, vertices=vertices, reduction=reduction, accuracy=COARSE)
    begun, driven = to_simplices(splat, vertices), splat.means[:, 0] <= 0
    rest = flow(begun, 0.5)
    driven = rest[:, 0, 0] <= 0
    found = run.simplices(run.frame_count - 1)["thing"]
    expected = flow(begun, 0.5 + 2 * TIME)
    assert 10 < driven.sum() < len(splat) - 10
    assert np.abs(found[driven, 0] - expected[driven, 0]).max() < 1e-6
    edges = [s[:, 1:] - s[:, :1] for s in (found, expected)]
    covariances = [np.einsum("nki,nkj->nij", e, e)[driven] for e in edges]
    assert np.abs(covariances[0] - covariances[1]).max() < 1e-6
    if reduction.mode == "all":
        assert np.abs(found[~driven] - (run.simplices(0)["thing"][~driven] - [0, 0, TIME])).max() < 1e-6
    gaussians = run.gaussians(run.frame_count - 1)
    assert np.abs(gaussians.means[driven] - expected[driven, 0]).max() < 1e-6
    assert run.diagnostics(run.frame_count - 1)["degenerate"] == 0


@every_mode
def test_points_of_what_swings_swing(record, cloud, reduction):
    """By 150 degrees: corners of cores, flat ones too, and what fills a body turn as rigid matter does."""
    splat = splat_for(reduction, cloud)
    run = record(splat, SWING, parts=(ALL_OF_IT,), reduction=reduction, accuracy=COARSE)
    last = run.frame_count - 1
    start = (
        SWING.pivot
        + (run.start_points - SWING.pivot)
        @ turned_by(-SWING.amplitude * math.sin(2 * np.pi * SWING.frequency * SWING.start + np.radians(SWING.phase))).T
    )
    expected = swung(start, SWING.start + TIME)
    assert np.abs(expected - run.start_points).max() > 0.5
    assert np.abs(run.points(last) - expected).max() < 1e-5


def test_a_constant_psi_holds_what_is_driven(record, cloud):
    """With rate = 0 nothing driven moves, but for a common translation that is taken away and added again."""
    splat = cloud(200)
    run = record(splat, dataclasses.replace(SWING, rate=0.0), "reference-mpm", accuracy=COARSE, gravity=(0, 0, -9.81))
    first, last = run.simplices(0)["thing"], run.simplices(run.frame_count - 1)["thing"]
    driven = first[:, 0, 0] <= 0
    assert np.abs(first - last)[driven].max() < 1e-15
    assert (first - last)[~driven, 0, 2].max() > 0.02


@pytest.mark.parametrize("reduction", [MODES["all"], MODES["cores"], MODES["volume"]], ids=["all", "cores", "volume"])
def test_a_body_that_is_driven_as_a_whole_moves_as_psi(record, cloud, reduction):
    """Under an engine, in its gravity: rigid psi of all of the matter is psi."""
    splat = splat_for(reduction, cloud, 100)
    run = record(
        splat, SWING, "reference-mpm", (ALL_OF_IT,), reduction=reduction, accuracy=COARSE, gravity=(0, 0, -9.81)
    )
    found = run.simplices(run.frame_count - 1)["thing"]
    expected = swung(to_simplices(splat, found.shape[1]), SWING.start + TIME)
    assert np.abs(found[:, 0] - expected[:, 0]).max() < 1e-5


def lattice(extents, step):
    """Round Gaussians that fill a box from the origin on."""
    axes = [np.arange(step / 2, extent, step) for extent in extents]
    means = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(means)
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), 0.3 * step),
        opacities=np.full(count, 0.9),
        harmonics=np.zeros((count, 1, 3)),
    )


def test_the_free_end_lags_as_behind_a_drive_of_the_engines_own(scene_of, tmp_path):
    """A bar whose one end moves aside at once, by psi or by a drive.

    The two hold nodes by different rules, and by which nodes are held a clamp of something two cells thick is felt up
    to a fifth of a cell elsewhere (`gasp_core.stepping.held_matter`: 4.3 to 9.1 % of a drop that goes as the length to
    the power of 3 and more): the far end of one is behind that of the other by what a wave of shear takes for as much.
    """
    resolution, speed, modulus, density = 10, 0.25, 2e4, 1000.0
    end = BoxShape(center=(0.1, 0.1, 0.1), half_extents=(0.1, 0.5, 0.5))
    splat = lattice((1.0, 0.2, 0.2), 0.05)
    choice = {
        "material": Elastic(density=density, youngs_modulus=modulus, poissons_ratio=0.3),
        "gravity": STILL,
        "duration": 0.4,
        "frame_rate": RATE,
        "accuracy": EngineAccuracy(resolution=resolution),
    }
    psi = PythonMotion(
        function=lambda points, s: points + np.array([0, speed, 0]) * s, composition="driven", start_velocity=False
    )
    led = scene_of(splat, motion=psi, parts=(Part(name="end", region=end, driven=True),), **choice)
    drive = Driven(region=end, velocity=(0, speed, 0), start=0.0, end=1.0)
    own = scene_of(splat, drives=(drive,), **choice)
    ways = []
    for name, scene in (("led", led), ("own", own)):
        run = simulate(scene, "reference-mpm", tmp_path / f"{name}.gasp", progress=False)
        far = run.start_points[:, 0] > 0.95
        ways.append([float((run.points(k)[far] - run.start_points[far])[:, 1].mean()) for k in range(run.frame_count)])
    late = 0.2 / resolution / math.sqrt(modulus / 2.6 / density)
    # It hangs behind: at the end it has gone the other way.
    assert min(ways[0]) < -0.01
    assert np.abs(np.subtract(*ways)).max() < speed * late


def test_what_is_free_begins_with_the_velocity_of_psi(record, cloud):
    engine = Falling()
    record(cloud(200), dataclasses.replace(SWING, rate=2.0), (descriptor(), engine))
    phase = 2 * np.pi * SWING.frequency * SWING.start + np.radians(SWING.phase)
    speed = 2 * np.radians(SWING.amplitude) * 2 * np.pi * SWING.frequency * math.cos(phase)
    points = engine.problem.points
    expected = speed * np.cross([0, 1, 0], points.reference_positions - SWING.pivot)
    np.testing.assert_allclose(points.initial_velocities, expected, atol=1e-5 * np.abs(expected).max())


def test_a_schedule_says_which_time_it_is(record, cloud):
    """Forth, a rest, and back."""
    schedule = ((0.0, 0.3), (0.08, 0.5), (0.16, 0.5), (0.24, 0.1))
    motion = dataclasses.replace(SWING, start=0.0, schedule=schedule)
    splat = cloud(100)
    run = record(splat, motion, parts=(ALL_OF_IT,))
    for frame, s in ((0, 0.3), (1, 0.4), (2, 0.5), (3, 0.5), (4, 0.5), (5, 0.3), (6, 0.1), (8, 0.1)):
        expected = swung(to_simplices(splat, 4), s)
        assert np.abs(run.simplices(frame)["thing"][:, 0] - expected[:, 0]).max() < 1e-6, frame
    assert motion.rate_at_start == pytest.approx(2.5)


def test_frames_drive_too(record, cloud, tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    splat = cloud(100)
    for index in range(4):
        write_splat(folder / f"{index}.ply", splat.with_(means=flow(splat.means, index / 10)))
    run = record(folder, FrameSequence(frame_rate=10, composition="driven"), up="+z")
    driven = splat.means[:, 0] <= 0
    before, after = flow(splat.means, 0.2), flow(splat.means, 0.3)
    expected = before + 0.8 * (after - before)
    found = run.simplices(7)["thing"][:, 0]
    assert np.abs(found - expected)[driven].max() < 2e-6


def test_a_recording_keeps_the_driven_ones_alone(record, cloud):
    """Of a formula what it is applied to, of a function how far each has gone: of those that are driven."""
    splat = cloud(100)
    python = PythonMotion(function=flow, composition="driven")
    for motion in (SWING, python):
        run = record(splat, motion)
        driven = run.bodies[0].driven
        assert driven is not None and 5 < len(driven) < 90
        drift = run.bodies[0].drift
        assert (drift is None) == (motion is python)
        assert drift is None or len(drift.rows) == len(driven)
        assert verify(run.path).damaged == ()


@pytest.mark.parametrize("rows", [[-1, 2], [2, 1], [5, 500], []])
def test_damaged_rows_are_refused(record, cloud, rows):
    from gasp_core.recording.drifting import driven_rows

    class Store:
        root = "run.gasp"

        def has(self, name):
            return True

        def array(self, name, shape, kinds):
            return np.array(rows, dtype=np.int64)

    entry = record(cloud(50), SWING).header.bodies[0]
    with pytest.raises(RecordingError, match="driven is damaged"):
        driven_rows(Store(), 0, entry, 50)


def test_a_run_goes_on_to_the_bit_and_may_be_made_longer(scene_of, cloud, tmp_path):
    choice = {"gravity": (0, 0, -9.81), "accuracy": COARSE, "recording": RecordingChoice(checkpoint_frames=1)}
    splat, motion = cloud(60), dataclasses.replace(SWING, rate=0.5)

    def scene(duration):
        return scene_of(splat, motion=motion, parts=(LEFT,), duration=duration, frame_rate=RATE, **choice)

    whole = simulate(scene(0.24), "reference-mpm", tmp_path / "whole.gasp", progress=False)
    for stop in (2, 4):
        simulate(scene(0.12), "reference-mpm", tmp_path / "parts.gasp", frames=stop, resume=True, progress=False)
    parts = simulate(scene(0.24), "reference-mpm", tmp_path / "parts.gasp", resume=True, progress=False)
    assert parts.frame_count == whole.frame_count == 7
    for frame in range(7):
        assert np.array_equal(parts.simplices(frame)["thing"], whole.simplices(frame)["thing"]), frame


def resumed_of(scene, path, **choice):
    return simulate(scene, "reference-mpm", path, resume=True, progress=False, **choice)


@pytest.fixture
def swinging(scene_of, cloud, tmp_path):
    """The scene of a duration, driven, and all seven frames of the longer one, which never stopped."""
    choice = {"gravity": (0, 0, -9.81), "accuracy": COARSE, "recording": RecordingChoice(checkpoint_frames=1)}
    splat, motion = cloud(60), dataclasses.replace(SWING, rate=0.5)

    def scene(duration):
        return scene_of(splat, motion=motion, parts=(LEFT,), duration=duration, frame_rate=RATE, **choice)

    return scene, simulate(scene(0.24), "reference-mpm", tmp_path / "whole.gasp", progress=False)


def same_frames(found, whole, count):
    assert found.frame_count == count
    for frame in range(count):
        assert np.array_equal(found.simplices(frame)["thing"], whole.simplices(frame)["thing"]), frame


def test_frames_that_are_damaged_are_made_again_with_what_drives_them(swinging, tmp_path):
    """All are there, and yet something is left to do."""
    scene, whole = swinging
    path = shutil.copytree(whole.path, tmp_path / "damaged.gasp")
    next(path.glob("frames/displacements/c.5.*")).write_bytes(b"torn")
    again = resumed_of(scene(0.24), path)
    assert again.status == "complete"
    same_frames(again, whole, 7)


def test_frames_without_a_checkpoint_are_made_again_with_what_drives_them(swinging, tmp_path):
    """More are there than are asked for, and of a run that is to be longer none but the first can be kept."""
    scene, whole = swinging
    path = tmp_path / "parts.gasp"
    assert resumed_of(scene(0.16), path).frame_count == 5
    for checkpoint in (path / "checkpoints").iterdir():
        if checkpoint.is_dir():
            shutil.rmtree(checkpoint)
    same_frames(resumed_of(scene(0.24), path, frames=4), whole, 4)
    same_frames(resumed_of(scene(0.24), path), whole, 7)


def test_where_psi_fails_on_the_way_back_in_that_is_told_and_nothing_stays_locked(scene_of, cloud, tmp_path):
    path, splat, failing = tmp_path / "run.gasp", cloud(60), []

    def psi(points, s):
        if failing and s > 0.1:
            raise RuntimeError("out of breath")
        return flow(points, s)

    motion = PythonMotion(function=psi, composition="driven")
    scene = scene_of(splat, motion=motion, parts=(LEFT,), duration=0.16, frame_rate=RATE, accuracy=COARSE)
    assert resumed_of(scene, path, frames=3).frame_count == 3
    failing.append(True)
    with pytest.raises(SceneError, match="out of breath"):
        resumed_of(scene, path)
    stopped = Recording.open(path)
    assert stopped.status == "incomplete" and "out of breath" in stopped.reason
    failing.clear()
    assert resumed_of(scene, path).status == "complete"


@pytest.mark.parametrize("place", ["region", "labels"])
def test_a_function_that_a_scene_names_drives_too(record, cloud, tmp_path, place):
    """All else of the scene is looked at before it is imported, and where the parts are is for it to say."""
    (tmp_path / "mover.py").write_text("def psi(simplices, time):\n    return simplices + [0, 0, time]\n")
    splat = cloud(60)
    labels = (splat.means[:, 0] <= 0).astype(np.int64)
    part = LEFT if place == "region" else Part(labels=labels, label=1, driven=True)
    motion = PythonMotion(function=f"{tmp_path / 'mover.py'}:psi", composition="driven")
    run = record(splat, motion, parts=(part,), trust_code=True)
    driven = labels == 1
    found = run.simplices(run.frame_count - 1)["thing"][driven, 0] - splat.means[driven]
    np.testing.assert_allclose(found, np.tile([0, 0, TIME], (driven.sum(), 1)), atol=1e-6)


def test_where_psi_stands_still_nothing_has_a_velocity(record, cloud, tmp_path):
    """Beyond its last frame, whatever the schedule says."""
    folder = tmp_path / "frames"
    folder.mkdir()
    splat = cloud(60)
    for index in range(4):
        write_splat(folder / f"{index}.ply", splat.with_(means=flow(splat.means, index / 10)))
    engine = Falling()
    motion = FrameSequence(frame_rate=10, composition="driven", schedule=((0, 5), (10, 4)))
    record(folder, motion, (descriptor(), engine), up="+z")
    assert not engine.problem.points.initial_velocities.any()


def test_what_psi_flattens_is_not_crushed(record, cloud):
    """Its shape is somebody's wish."""
    flattening = PythonMotion(function=lambda points, s: points * [1, 1, 1 - 0.99 * s / TIME], composition="driven")
    run = record(cloud(60), flattening, parts=(ALL_OF_IT,))
    assert run.status == "complete"


def test_a_run_that_is_made_longer_is_of_the_same_problem(scene_of, cloud):
    from gasp_core.reduction.leading import trajectories_of
    from gasp_core.simulation.splat_sources import prepare
    from gasp_core.stepping.forcing import problem_fingerprint

    prints = set()
    for duration in (0.08, 0.2):
        scene = scene_of(cloud(30), motion=SWING, parts=(LEFT,), duration=duration, frame_rate=RATE, accuracy=COARSE)
        assembly = prepare(scene).assembly
        trajectories = trajectories_of(scene, assembly.leads, lambda frame, last: None)
        prints.add(problem_fingerprint(dataclasses.replace(assembly.problem, trajectories=trajectories)))
    assert len(prints) == 1


# What is refused.


def test_an_engine_that_leads_nothing_is_told_apart(record, cloud):
    with pytest.raises(UnsupportedSceneError, match=r"leads no points along trajectories.*reference-mpm"):
        record(cloud(50), SWING, (descriptor(leads=False), Falling()))


@pytest.mark.parametrize(
    ("motion", "part", "says"),
    [
        (SWING, dataclasses.replace(LEFT, driven=False, pinned=True), "drives nothing.*driven = true"),
        (dataclasses.replace(SWING, composition="carried"), LEFT, "nothing drives it"),
        (None, LEFT, "nothing drives it"),
    ],
)
def test_parts_and_motion_go_together(scene_of, cloud, motion, part, says):
    with pytest.raises(SceneError, match=says):
        scene_of(cloud(20), motion=motion, parts=(part,))


@pytest.mark.parametrize("other", ["pinned", "rigid"])
def test_a_driven_part_is_nothing_else(other):
    with pytest.raises(SceneError, match=f"driven contradicts {other}"):
        Part(component=1, driven=True, **{other: True})


def test_a_rigid_object_is_not_driven_in_part(record, cloud):
    rigid = gasp_core.contract.Rigid(density=500.0)
    with pytest.raises(SceneError, match="rigid bodies cannot be led"):
        record(cloud(50), SWING, "reference-mpm", material=rigid, accuracy=COARSE)


def test_a_part_that_no_point_is_of_is_refused(record, cloud):
    ball = splat_for(MODES["volume"], cloud)
    nowhere = BoxShape(
        center=tuple(float(x) for x in ball.means[np.argmax(ball.means[:, 2])]), half_extents=(0.01,) * 3
    )
    parts, choices = (Part(region=nowhere, driven=True),), {"reduction": MODES["volume"], "accuracy": COARSE}
    with pytest.raises(SceneError, match="finer than what is simulated"):
        record(ball, PythonMotion(function=flow, composition="driven"), parts=parts, **choices)


def test_a_table_that_nobody_could_hold_is_refused(record, cloud, monkeypatch):
    monkeypatch.setattr("gasp_core.reduction.leading._MOST_BYTES", 1000)
    with pytest.raises(SceneError, match=r"driven points over 9 frames.*cores"):
        record(cloud(100), SWING)


def test_a_driven_part_may_have_a_material(record, cloud):
    """The material of a driven part is said like any other."""
    part = dataclasses.replace(LEFT, material=Elastic(density=900, youngs_modulus=1e6, poissons_ratio=0.3, name="gum"))
    run = record(cloud(50), SWING, parts=(part,), accuracy=COARSE)
    assert "driven" in " ".join(run.notes) and "gum" in " ".join(run.notes)
