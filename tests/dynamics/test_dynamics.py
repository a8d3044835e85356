"""phi after psi: what moves by itself, recorded under engines whose motion is known."""

from __future__ import annotations

import dataclasses
import math
from functools import partial

import flying_points
import numpy as np
import pytest
from scripted_engine import Scripted
from splat_shells import SHAPES, shell

from gasp_core import (
    Bend,
    EngineAccuracy,
    Floaters,
    FrameSequence,
    Gaussians,
    HalfSpace,
    MapChoice,
    PythonMotion,
    Recording,
    RecordingChoice,
    Reduction,
    Swing,
    Wave,
    simulate,
    write_splat,
)
from gasp_core.contract import PointState
from gasp_core.dynamics.function_motion import CallableMotion
from gasp_core.errors import GaspError, RecordingError, SceneError
from gasp_core.games import to_simplices
from gasp_core.gaussians import rotation_matrices, rotation_quaternions
from gasp_core.harmonics import turn_coefficients

TIME = 0.32
RATE = 25.0
SWING = Swing(axis=(0, 1, 0), pivot=(0.1, 0, -0.4), amplitude=50, frequency=0.7, phase=20, start=0.3, rate=1.5)
BEND = Bend(axis=(1, 0.3, 0), pivot=(0, 0, -0.5), amplitude=30, frequency=1.1, length=1.0)
WAVE = Wave(axis=(0, 0, 1), amplitude=0.1, frequency=2, wavelength=0.8, direction=(1, 0, 0), phase=70)
CORES = Reduction(mode="cores", fraction=0.3)
FRAME = Reduction(mode="cores", fraction=0.3, transfer="frame")
VOLUME = Reduction(mode="volume")
ALL = Reduction(mode="all")
MODES = {
    "all": ALL,
    "cores": CORES,
    "frame": FRAME,
    "levels": Reduction(mode="cores", fraction=0.2, levels=2),
    "volume": VOLUME,
}
every_mode = pytest.mark.parametrize("reduction", MODES.values(), ids=MODES)
# Points of a volume are the same, however many corners a simplex has.
KINDS = [
    pytest.param(
        vertices,
        reduction,
        id=f"{vertices}-{name}",
        marks=pytest.mark.thorough if (vertices, reduction) == (3, VOLUME) else (),
    )
    for vertices in (3, 4)
    for name, reduction in MODES.items()
]
every_kind = pytest.mark.parametrize(("vertices", "reduction"), KINDS)
FINE = EngineAccuracy(spacing=0.05)
COARSE = EngineAccuracy(resolution=8)


def splat_for(reduction, cloud, count):
    """A cloud; Gaussians that enclose a ball about the origin for points that are to fill it."""
    if reduction is not VOLUME:
        return cloud(count)
    ball = shell(SHAPES["sphere"], count=10 * count)
    return ball.with_(means=ball.means - [0, 0, 0.5])


def turn(axis, degrees):
    half = math.radians(degrees) / 2
    axis = np.asarray(axis) / np.linalg.norm(axis)
    return rotation_matrices(np.array([[math.cos(half), *(math.sin(half) * axis)]]))[0]


def flow(points, s):
    """A motion that is no affine map of the whole, nor the same to any two points."""
    x, y, z = np.moveaxis(points, -1, 0)
    return points + np.stack([0.3 * s * np.sin(2 * y), 0.2 * s * x * z, 0.25 * np.sin(s) * x**2], axis=-1)


def expected_psi(motion, points, s):
    """The formulas of docs/scene.md, written out once more."""
    if isinstance(motion, PythonMotion):
        return flow(points, s)
    pivot, axis = np.asarray(motion.pivot), np.asarray(motion.axis)
    if isinstance(motion, Wave):
        d = (points - pivot) @ motion.direction
        phase = 2 * np.pi * (motion.frequency * s - d / motion.wavelength) + np.radians(motion.phase)
        return points + motion.amplitude * np.sin(phase)[..., None] * axis
    angle = motion.amplitude * math.sin(2 * np.pi * motion.frequency * s + np.radians(motion.phase))
    if not isinstance(motion, Bend):
        return pivot + (points - pivot) @ turn(axis, angle).T
    heights = np.maximum((points - pivot) @ motion.direction / motion.length, 0) ** 2
    turned = [turn(axis, angle * h) @ (p - pivot) for p, h in zip(points.reshape(-1, 3), heights.reshape(-1))]
    return pivot + np.reshape(turned, points.shape)


class Known(Scripted):
    """An engine whose phi is x -> gradient(t) x + shift(t)."""

    def __init__(self, gradient=lambda t: np.eye(3), shift=lambda t: np.zeros(3)):
        self.gradient, self.shift = gradient, shift

    def read(self, fields):
        moved = self.problem.points.reference_positions @ self.gradient(self.time).T + self.shift(self.time)
        return PointState(time=self.time, positions=moved)

    def moves(self, points):
        return points @ self.gradient(TIME).T + self.shift(TIME)

    def checkpoint(self):
        return {}


def turning(t):
    return turn((1, 2, 3), 400 * t)


def straining(t):
    return np.eye(3) + t * np.array([[0.5, 0.9, 0], [0, -0.4, 0.6], [0.3, 0, 0.2]])


RIGID = Known(turning, lambda t: np.array([2 * t, 0, -5 * t * t]))
AFFINE = Known(straining, lambda t: np.array([0, 3 * t, 0]))


@pytest.fixture
def record(tmp_path, scene_of):
    """Runs an object of a motion with a known engine to TIME."""
    count = iter(range(1000))

    def go(splat, motion, engine=None, trust_code=False, **others) -> Recording:
        scene = scene_of(splat, duration=TIME, frame_rate=RATE, motion=motion, gravity=(0, 0, 0), **others)
        chosen = (flying_points.descriptor(checkpoints=False, fields=frozenset()), engine or Known())
        out = tmp_path / f"{next(count)}.gasp"
        return simulate(scene, engine=chosen, out=out, trust_code=trust_code, progress=False)

    return go


def sheet(count=80, seed=1):
    """Flat Gaussians that all lie in one plane: no neighbourhood of it has a third direction."""
    rng = np.random.default_rng(seed)
    frame = turn((1, 1, 0), 35)
    angles = rng.uniform(0, 2 * np.pi, count)
    spins = np.stack([np.cos(angles / 2), np.zeros(count), np.zeros(count), np.sin(angles / 2)], axis=1)
    return Gaussians(
        means=np.c_[rng.uniform(-0.5, 0.5, (count, 2)), np.zeros(count)] @ frame.T,
        quaternions=rotation_quaternions(frame @ rotation_matrices(spins)),
        scales=np.c_[rng.uniform(0.01, 0.05, (count, 2)), np.zeros(count)],
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )


def moments(simplices):
    """Means and covariances: all there is to a Gaussian, whichever edges span it."""
    edges = simplices[:, 1:] - simplices[:, :1]
    return simplices[:, 0], np.einsum("nki,nkj->nij", edges, edges)


def assert_alike(found, expected, tolerance):
    """The same Gaussians, to a tolerance [m] of means and of edges of up to 0.3 m (twice their product)."""
    means, covariances = moments(found)
    expected_means, expected_covariances = moments(expected)
    assert np.abs(means - expected_means).max() < tolerance
    assert np.abs(covariances - expected_covariances).max() < 2 * 0.3 * tolerance


@every_kind
@pytest.mark.parametrize(
    "motion",
    [
        pytest.param(SWING, marks=pytest.mark.thorough),
        pytest.param(BEND, marks=pytest.mark.thorough),
        pytest.param(WAVE, marks=pytest.mark.thorough),
        PythonMotion(function=flow, start=0.5, rate=2.0),
    ],
)
def test_where_physics_does_nothing_it_is_psi(record, cloud, motion, vertices, reduction):
    """Displacements are float32: off by 6e-8 of themselves, at most about 1 m here."""
    splat = splat_for(reduction, cloud, 60)
    run = record(splat, motion, vertices=vertices, reduction=reduction, accuracy=COARSE)
    s = motion.start + motion.rate * TIME
    expected = expected_psi(motion, to_simplices(splat, vertices), s)
    found = run.simplices(run.frame_count - 1)["thing"]
    assert np.abs(expected[:, 0] - splat.means).max() > 0.05
    assert_alike(found, expected, 1e-6)
    if vertices == 4:
        covariances = run.gaussians(run.frame_count - 1).covariances()
        np.testing.assert_allclose(covariances, moments(expected)[1], atol=1e-6)


@every_kind
@pytest.mark.parametrize("shape", ["ball", pytest.param("sheet", marks=pytest.mark.thorough), "single"])
def test_a_rigid_motion_turns_psi(record, cloud, shape, vertices, reduction):
    """Points are known to 6e-8 of 1 m; a slope over a tenth of that, times a drift of half: some 3e-7."""
    splat = {
        "ball": splat_for(reduction, cloud, 200),
        "sheet": sheet(800 if reduction is VOLUME else 80),
        "single": sheet(1),
    }[shape]
    run = record(splat, SWING, RIGID, vertices=vertices, reduction=reduction, accuracy=EngineAccuracy(spacing=0.05))
    expected = RIGID.moves(expected_psi(SWING, to_simplices(splat, vertices), SWING.start + SWING.rate * TIME))
    assert_alike(run.simplices(run.frame_count - 1)["thing"], expected, 1e-5)


@pytest.mark.parametrize(("vertices", "reduction"), [kind for kind in KINDS if kind.values[1] in (ALL, CORES, VOLUME)])
def test_an_affine_motion_strains_psi(record, cloud, vertices, reduction):
    splat = splat_for(reduction, cloud, 200)
    motion = PythonMotion(function=flow)
    run = record(splat, motion, AFFINE, vertices=vertices, reduction=reduction, accuracy=EngineAccuracy(spacing=0.05))
    expected = AFFINE.moves(flow(to_simplices(splat, vertices), TIME))
    assert_alike(run.simplices(run.frame_count - 1)["thing"], expected, 1e-5)


@pytest.mark.parametrize("composition", ["carried", "frozen"])
@pytest.mark.parametrize("reduction", [ALL, CORES, VOLUME], ids=["all", "cores", "volume"])
def test_a_motion_that_stands_still_is_the_static_run(cloud, scene_of, tmp_path, reduction, composition):
    still = PythonMotion(function=lambda points, s: points, composition=composition)
    engine = {"accuracy": EngineAccuracy(resolution=8), "duration": 0.12, "velocity": (0.3, 0, 0)}
    splat = splat_for(reduction, cloud, 60)
    scenes = [scene_of(splat, motion=motion, reduction=reduction, **engine) for motion in (None, still)]
    static, moving = (
        simulate(scene, "reference-mpm", tmp_path / f"{index}.gasp", progress=False)
        for index, scene in enumerate(scenes)
    )
    for frame in range(static.frame_count):
        found, expected = moving.simplices(frame)["thing"], static.simplices(frame)["thing"]
        assert np.abs(found - expected).max() <= 1e-6


@pytest.mark.parametrize("reduction", [ALL, CORES, VOLUME], ids=["all", "cores", "volume"])
def test_free_fall_of_what_swings(cloud, scene_of, tmp_path, reduction):
    """x = psi(X, t) + v t + g t^2 / 2, less what symplectic Euler adds, g t dt / 2."""
    splat = splat_for(reduction, cloud, 60)
    scene = scene_of(
        splat,
        motion=SWING,
        velocity=(1, 0, 0),
        reduction=reduction,
        accuracy=EngineAccuracy(resolution=8),
        duration=TIME,
    )
    run = simulate(scene, "reference-mpm", tmp_path / "fall.gasp", progress=False)
    last = run.frame_count - 1
    t = run.times[last]
    swung = expected_psi(SWING, to_simplices(splat, 4), SWING.start + SWING.rate * t)
    step = max(frame["largest_substep"] for frame in run.diagnostics())
    expected = swung + t * np.array([1, 0, 0]) - [0, 0, 9.81 * t * (t + step) / 2]
    size = np.ptp(splat.means, axis=0).max()
    assert_alike(run.simplices(last)["thing"], expected, 1e-4 * size)
    assert 9.81 * t * step / 2 < 0.01 * size


@every_mode
@pytest.mark.parametrize("vertices", [3, 4])
def test_frozen_begins_where_psi_is_and_with_its_velocity(record, cloud, vertices, reduction):
    """A rigid swing: every point has omega x (x - pivot), those of cores too."""
    splat = splat_for(reduction, cloud, 200)
    motion = dataclasses.replace(SWING, composition="frozen")
    engine = Known()
    run = record(splat, motion, engine, vertices=vertices, reduction=reduction, accuracy=COARSE)
    begun = expected_psi(SWING, to_simplices(splat, vertices), SWING.start)
    for frame in (0, run.frame_count - 1):
        assert_alike(run.simplices(frame)["thing"], begun, 1e-6)
    phase = 2 * np.pi * SWING.frequency * SWING.start + np.radians(SWING.phase)
    speed = SWING.rate * np.radians(SWING.amplitude) * 2 * np.pi * SWING.frequency * math.cos(phase)
    expected = speed * np.cross([0, 1, 0], run.start_points - SWING.pivot)
    assert np.abs(expected).max() > 0.4
    np.testing.assert_allclose(engine.problem.points.initial_velocities, expected, atol=1e-6)


def test_frozen_without_the_velocity(record, cloud):
    engine = Known()
    record(cloud(), dataclasses.replace(SWING, composition="frozen", start_velocity=False), engine)
    assert not engine.problem.points.initial_velocities.any()


def test_carried_begins_at_rest(record, cloud):
    """Its velocity is in the displacement that is carried."""
    engine = Known()
    record(cloud(), SWING, engine)
    assert not engine.problem.points.initial_velocities.any()


@pytest.mark.parametrize("covariance", ["exact", "gram_schmidt"])
@pytest.mark.parametrize("vertices", [3, pytest.param(4, marks=pytest.mark.thorough)])
def test_the_control_rule_bounds_physics_and_not_psi(record, cloud, vertices, covariance):
    splat = cloud(60)
    growing = PythonMotion(function=lambda points, s: (1 + 10 * s) * points)
    maps = MapChoice(alpha=1.5, covariance=covariance)
    run = record(splat, growing, vertices=vertices, maps=maps)
    last = run.gaussians(run.frame_count - 1)
    assert run.diagnostics(run.frame_count - 1)["clipped"] == 0
    shown = 3 if vertices == 4 else 2
    grown = np.sort(last.scales, axis=1) / np.sort(splat.scales, axis=1)
    np.testing.assert_allclose(grown[:, 3 - shown :], 1 + 10 * TIME, rtol=1e-4)
    stretched = record(splat, growing, Known(lambda t: (1 + 10 * t) * np.eye(3)), vertices=vertices, maps=maps)
    clipped = stretched.gaussians(stretched.frame_count - 1)
    assert stretched.diagnostics(stretched.frame_count - 1)["clipped"] == len(splat)
    ratios = np.sort(clipped.scales, axis=1) / np.sort(splat.scales, axis=1)
    np.testing.assert_allclose(ratios[:, 3 - shown :], 1.5 * (1 + 10 * TIME), rtol=1e-4)


def test_colour_turns_with_psi(record, cloud):
    """Harmonics of a swing of so many degrees are those of the splat turned by as many."""
    splat = cloud(30, degree=2)
    run = record(splat, SWING)
    last = run.frame_count - 1
    angle = SWING.amplitude * math.sin(
        2 * np.pi * SWING.frequency * (SWING.start + SWING.rate * TIME) + np.radians(SWING.phase)
    )
    turns = np.broadcast_to(turn((0, 1, 0), angle), (len(splat), 3, 3))
    np.testing.assert_allclose(run.gaussians(last).harmonics, turn_coefficients(splat.harmonics, turns), atol=2e-6)


def test_a_placed_object_moves_in_the_frame_of_its_file(record, cloud):
    splat = cloud(60)
    put = {"rotation": (20, 30, 40), "metres_per_unit": 2.0, "up": "-y", "position": (3, 4, 5)}
    placement = record(splat, None, **put).placement("thing")
    run = record(splat, PythonMotion(function=flow), **put)
    expected = flow(to_simplices(splat, 4), TIME) @ (placement.scale * placement.rotation.T) + placement.translation
    assert_alike(run.simplices(run.frame_count - 1)["thing"], expected, 2e-6)


def test_far_from_the_origin_it_is_the_same(record, cloud):
    """At 1e4 m a double knows a place to 2e-12 m."""
    splat, far = cloud(60), np.array([1e4, -1e4, 1e4])
    there = dataclasses.replace(SWING, pivot=tuple(far + SWING.pivot))
    moved = [
        record(splat, motion, RIGID, rotation=(0, 0, 30), position=tuple(place)).simplices(8)["thing"] - place
        for motion, place in ((SWING, np.zeros(3)), (there, far))
    ]
    # The engine's own motion is about the world's origin.
    moved[1] -= RIGID.gradient(TIME) @ far - far
    assert_alike(moved[1], moved[0], 1e-5)


def test_what_psi_lets_vanish_is_no_fault(record, cloud):
    splat = cloud()
    run = record(splat, PythonMotion(function=lambda points, s: (1 - min(s / 0.2, 1)) * points), RIGID)
    last = run.gaussians(run.frame_count - 1)
    assert run.status == "complete"
    for field in dataclasses.fields(Gaussians):
        assert np.isfinite(getattr(last, field.name)).all()
    np.testing.assert_allclose(last.means, np.tile(RIGID.moves(np.zeros(3)), (40, 1)), atol=1e-5)


# Folders of frames.


@pytest.fixture
def frames(tmp_path, cloud):
    """Writes a splat as a folder of four frames that `flow` moves, 10 after 9."""

    def make(splat=None, name="frames"):
        folder = tmp_path / name
        folder.mkdir()
        splat = cloud(40) if splat is None else splat
        for index in range(4):
            write_splat(folder / f"f{8 + index}.ply", splat.with_(means=flow(splat.means, index / 10)))
        return folder

    return make


SEQUENCE = FrameSequence(frame_rate=10)


@pytest.mark.parametrize("time,share", [(0.1, 1.0), (0.16, 1.6), (0.32, 3.0), (0.04, 0.4)])
@pytest.mark.parametrize("vertices", [3, 4])
def test_a_folder_of_frames(record, frames, cloud, vertices, time, share):
    """Linear between frames, still after the last: at 0.32 s the folder has ended."""
    splat, folder = cloud(40), frames()
    motion = dataclasses.replace(SEQUENCE, rate=time / TIME)
    run = record(folder, motion, vertices=vertices, up="+z")
    corners = [to_simplices(splat.with_(means=flow(splat.means, k / 10)), vertices) for k in range(4)]
    below = min(int(share), 2)
    expected = corners[below] + (share - below) * (corners[below + 1] - corners[below])
    # The files hold float32: 6e-8 of 1.
    assert_alike(run.simplices(run.frame_count - 1)["thing"], expected, 2e-6)


def test_frames_that_are_all_alike_are_the_static_run(record, tmp_path, cloud):
    splat = cloud(40)
    folder = tmp_path / "alike"
    folder.mkdir()
    for index in range(3):
        write_splat(folder / f"{index}.ply", splat)
    write_splat(tmp_path / "one.ply", splat)
    found, expected = record(folder, SEQUENCE, RIGID), record(tmp_path / "one.ply", None, RIGID)
    last = found.frame_count - 1
    assert np.array_equal(found.simplices(last)["thing"], expected.simplices(last)["thing"])


def test_simulation_may_begin_between_two_frames(record, frames, cloud):
    splat, folder = cloud(40), frames()
    run = record(folder, dataclasses.replace(SEQUENCE, start=0.05, composition="frozen"), up="+z")
    first, second = (to_simplices(splat.with_(means=flow(splat.means, k / 10)), 4) for k in (0, 1))
    assert_alike(run.simplices(0)["thing"], (first + second) / 2, 2e-6)


def test_velocity_of_frames(record, frames, cloud):
    """Half way between two frames: their difference times the frame rate, in all corners (here they do not turn)."""
    splat, folder, engine = cloud(40), frames(), Known()
    motion = dataclasses.replace(SEQUENCE, start=0.1, composition="frozen", rate=2.0)
    record(folder, motion, engine, up="+z")
    expected = 2.0 * (flow(splat.means, 0.2) - flow(splat.means, 0.0)) / 0.2
    np.testing.assert_allclose(engine.problem.points.initial_velocities.reshape(40, 4, 3)[:, 0], expected, atol=1e-5)


def test_rows_that_are_not_the_same_gaussians_are_refused(record, frames, cloud):
    splat = cloud(400)
    folder = frames(splat)
    record(folder, SEQUENCE)
    shuffled = splat.select(np.random.default_rng(1).permutation(400))
    write_splat(folder / "f10.ply", shuffled)
    with pytest.raises(
        GaspError, match=r'f10\.ply: Gaussians that .* seem not to be the same .*; say match = "rows" if'
    ):
        record(folder, SEQUENCE)
    record(folder, dataclasses.replace(SEQUENCE, match="rows"))


def other_count(folder, splat):
    write_splat(folder / "f10.ply", splat.select(range(39)))


def other_degree(folder, splat):
    write_splat(folder / "f10.ply", splat.with_(harmonics=np.zeros((40, 4, 3))))


def no_splat(folder, splat):
    (folder / "f10.ply").write_bytes(b"not a splat")


def other_kind(folder, splat):
    (folder / "notes.txt").write_text("notes")


def emptied(folder, splat):
    for file in folder.iterdir():
        file.unlink()


def not_finite(folder, splat):
    write_splat(folder / "f10.ply", splat.with_(means=np.where(np.arange(40)[:, None] == 7, np.nan, splat.means)))


@pytest.mark.parametrize(
    "spoil,said",
    [
        (other_count, ["f10.ply", "39 Gaussians", "f8.ply", "40"]),
        (other_degree, ["f10.ply", "1 as its degree", "0"]),
        (no_splat, ["f10.ply", "does not begin as"]),
        (other_kind, ["several kinds", "notes.txt"]),
        (emptied, ["is empty"]),
        (not_finite, ["thing", "not finite at scene time 0.2 s", "1 of 40", "first 7"]),
    ],
)
def test_folders_that_are_none(record, frames, cloud, spoil, said):
    folder = frames()
    spoil(folder, cloud(40))
    motion = dataclasses.replace(SEQUENCE, start=0.2) if spoil is not_finite else SEQUENCE
    with pytest.raises(GaspError) as caught:
        record(folder, motion)
    for words in said:
        assert words in str(caught.value)


def test_what_systems_leave_in_a_folder_is_no_frame(record, frames):
    folder = frames()
    for name in (".DS_Store", "Thumbs.db", "desktop.ini"):
        (folder / name).write_bytes(b"\0")
    assert record(folder, SEQUENCE).status == "complete"


@pytest.mark.parametrize("schedule", [((0, math.nan), (0.3, 0.2)), ((0, 0), (math.inf, 1))])
def test_a_schedule_has_finite_numbers(schedule):
    with pytest.raises(SceneError, match=r"FrameSequence\.schedule must have finite numbers, found"):
        FrameSequence(frame_rate=10, schedule=schedule)


def test_a_file_is_no_folder_of_frames(record, tmp_path, cloud):
    write_splat(tmp_path / "one.ply", cloud())
    with pytest.raises(GaspError, match="is no folder"):
        record(tmp_path / "one.ply", SEQUENCE)


# Python functions.


def fails(points, s):
    if s > 0.1:
        raise RuntimeError("no weights\nfound")
    return points


def other_shape(points, s):
    return points[:, 0] if s > 0.1 else points


def nan_later(points, s):
    points[3, 1] = np.nan if s > 0.1 else points[3, 1]
    return points


def leaves(points, s):
    if s > 0.1:
        raise SystemExit(3)
    return points


def ragged(points, s):
    return [[1, 2], [3]] if s > 0.1 else points


@pytest.mark.parametrize(
    "function,said",
    [
        (fails, ["RuntimeError: no weights found", "fails"]),
        (other_shape, ["(40, 3)", "(40, 4, 3)"]),
        (nan_later, ["not finite", "1 of 40", "first 3"]),
        (ragged, ["ValueError"]),
        (leaves, ["SystemExit: 3"]),
    ],
)
def test_functions_that_go_wrong_say_when_and_the_frames_are_kept(record, tmp_path, cloud, function, said):
    with pytest.raises(SceneError) as caught:
        record(cloud(), PythonMotion(function=function))
    for words in [*said, "scene time 0.12 s"]:
        assert words in str(caught.value)
    kept = Recording.open(tmp_path / "0.gasp")
    assert (kept.status, kept.frame_count) == ("incomplete", 3)
    assert "0.12 s" in kept.reason


@pytest.mark.parametrize(
    "text,said",
    [
        ("no_such_module_at_all:f", "cannot be imported: ModuleNotFoundError"),
        ("math:no_such", "math has no function no_such"),
        ("math:pi", "math has no function pi"),
    ],
)
def test_functions_that_are_not_there(record, cloud, text, said):
    with pytest.raises(SceneError, match=said):
        record(cloud(), PythonMotion(function=text), trust_code=True)


def test_a_function_may_work_in_place_and_give_the_same_array_again(record, cloud):
    splat, kept = cloud(), np.empty((40, 4, 3))

    def lazy(points, s):
        points += s
        kept[:] = points
        return kept

    motion = CallableMotion(PythonMotion(function=lazy), to_simplices(splat, 4))
    first, second = motion.simplices(0.0), motion.simplices(1.0)
    assert_alike(second, first + 1, 1e-9)
    run = record(splat, PythonMotion(function=lazy))
    expected = to_simplices(splat, 4) + TIME
    assert_alike(run.simplices(run.frame_count - 1)["thing"], expected, 1e-6)


def test_beyond_its_span_it_stands_still(record, cloud):
    splat = cloud()
    run = record(splat, PythonMotion(function=flow, span=(0.1, 0.2), start=0.0))
    simplices = to_simplices(splat, 4)
    assert_alike(run.simplices(0)["thing"], flow(simplices, 0.1), 1e-6)
    assert_alike(run.simplices(run.frame_count - 1)["thing"], flow(simplices, 0.2), 1e-6)


# Recordings.


SWAY = """
def sway(points, s):
    points[..., 0] += {amount} * s * points[..., 2]
    return points
"""


@pytest.mark.parametrize("reduction", [Reduction(), CORES], ids=["all", "cores"])
@pytest.mark.thorough
def test_gone_on_with_it_is_the_run_that_never_stopped(run, scene_of, tmp_path, reduction):
    trusting = partial(run, trust_code=True)
    module = tmp_path / "sway.py"
    module.write_text(SWAY.format(amount=0.5))
    motion = PythonMotion(function=f"{module}:sway", composition="carried")
    scene = scene_of(motion=motion, reduction=reduction, options={"spin": 2.0})
    whole = trusting(scene, tmp_path / "whole.gasp")
    trusting(scene, tmp_path / "parts.gasp", frames=4)
    longer = dataclasses.replace(scene, duration=scene.duration)
    parts = trusting(longer, tmp_path / "parts.gasp", resume=True)
    assert (parts.status, parts.frame_count) == ("complete", whole.frame_count)
    for frame in range(whole.frame_count):
        for field in dataclasses.fields(Gaussians):
            found, expected = (getattr(one.gaussians(frame), field.name) for one in (parts, whole))
            np.testing.assert_array_equal(found, expected)
    # The recording needs the function no more, and another place of it is the same scene.
    moved = tmp_path / "elsewhere.py"
    module.rename(moved)
    elsewhere = dataclasses.replace(scene, objects=(with_function(scene, moved),))
    trusting(elsewhere, tmp_path / "parts.gasp", resume=True)
    assert Recording.open(tmp_path / "whole.gasp").scene.objects[0].motion.composition == "carried"
    assert np.isfinite(Recording.open(tmp_path / "whole.gasp").gaussians(3).means).all()
    moved.write_text(SWAY.format(amount=0.6))
    with pytest.raises(RecordingError, match="has changed since it was recorded"):
        trusting(elsewhere, tmp_path / "parts.gasp", resume=True)


def with_function(scene, module):
    item = scene.objects[0]
    return dataclasses.replace(item, motion=dataclasses.replace(item.motion, function=f"{module}:sway"))


def test_changed_frames_are_not_gone_on_with(run, scene_of, frames, tmp_path, cloud):
    folder = frames()
    scene = scene_of(folder, motion=SEQUENCE)
    run(scene, tmp_path / "run.gasp", frames=3)
    write_splat(folder / "f11.ply", cloud(40, seed=5))
    with pytest.raises(RecordingError, match="has changed since it was recorded"):
        run(scene, tmp_path / "run.gasp", resume=True)


FLOW = PythonMotion(function=flow, start=0.1)
FLOWING = {"flowing": 25, "flowing too": 35}


def test_a_formula_is_kept_and_not_what_it_gives(record, cloud):
    run = record(cloud(60), SWING)
    assert not (run.path / "frames" / "drifts").exists()
    assert (record(cloud(60), FLOW).path / "frames" / "drifts").exists()


def test_a_static_object_beside_one_that_moves_by_itself(record, cloud, scene_of, tmp_path):
    """Bodies that drift by formulas, by functions, and not at all: each has its own rows."""
    scene = scene_of(cloud(30), duration=TIME, gravity=(0, 0, 0))
    first = scene.objects[0]
    second = dataclasses.replace(first, name="swinging", splat=cloud(50, seed=3), motion=SWING)
    third = dataclasses.replace(first, name="waving", splat=cloud(20, seed=4), motion=WAVE, vertices=3)
    flows = [dataclasses.replace(first, name=n, splat=cloud(c, seed=c), motion=FLOW) for n, c in FLOWING.items()]
    scene = dataclasses.replace(scene, objects=(flows[0], second, first, flows[1], third))
    engine = (flying_points.descriptor(checkpoints=False, fields=frozenset()), Known())
    run = simulate(scene, engine=engine, out=tmp_path / "three.gasp", progress=False)
    simplices = run.simplices(run.frame_count - 1)
    assert_alike(simplices["thing"], to_simplices(first.splat, 4), 1e-9)
    for item, count in ((second, 4), (third, 3), (flows[0], 4), (flows[1], 4)):
        s = item.motion.start + item.motion.rate * TIME
        assert_alike(simplices[item.name], expected_psi(item.motion, to_simplices(item.splat, count), s), 1e-6)


def test_a_region_of_what_is_frozen_is_where_psi_has_brought_it(record, cloud):
    splat = cloud(60)
    up = PythonMotion(function=lambda points, s: points + [0, 0, 5.0], composition="frozen")
    region = HalfSpace(point=(0, 0, 5), normal=(0, 0, 1))
    run = record(splat, up, region=region)
    np.testing.assert_array_equal(run.moving, splat.means[:, 2] <= 0)


REFUSED = [
    ({"motion": SWING, "static": True, "material": None}, "no meaning with static"),
    ({"motion": SEQUENCE}, "wants a folder of frames"),
    ({"motion": SWING, "floaters": Floaters.STILL}, 'tear it off what floaters = "still"'),
]


@pytest.mark.parametrize("others,said", REFUSED)
def test_what_contradicts_itself(scene_of, cloud, others, said):
    with pytest.raises(SceneError, match=said):
        scene_of(cloud(), **others)


def test_velocities_and_drifts_are_kept_side_by_side(run, scene_of, tmp_path):
    recording = run(scene_of(motion=SWING, recording=RecordingChoice(velocities=True)), tmp_path / "both.gasp")
    assert recording.velocities(3).shape == recording.start_points.shape
    assert np.isfinite(recording.gaussians(3).means).all()
