"""The reduction `mesh`: vertices are moved, what the mesh encloses too, and Gaussians go with the faces."""

from __future__ import annotations

import dataclasses
import math

import flying_points
import numpy as np
import pytest
from scripted_engine import Scripted

from gasp_core import (
    Bend,
    Elastic,
    EngineAccuracy,
    FrameSequence,
    Part,
    PythonMotion,
    RecordingChoice,
    Reduction,
    Scene,
    SplatObject,
    Swing,
    Wave,
    load_scene,
    scene_to_toml,
    simulate,
)
from gasp_core.contract import BoxShape, PointState
from gasp_core.dynamics.placed_scene import place_scene
from gasp_core.errors import RecordingError, SceneError, SplatFormatError
from gasp_core.gaussians import rotation_matrices
from gasp_core.io import write_splat
from gasp_core.io.mesh_splats import splat_of_mesh
from gasp_core.io.meshes import face_areas
from gasp_core.io.painted_meshes import PaintedMesh
from gasp_core.recording.verifying import verify
from gasp_core.reduction.leading import trajectories_of
from gasp_core.reduction.mesh import OnFaces
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.placed_mesh import mesh_of, welded
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.body_faces import body_faces

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")

GRADIENT = np.array([[1.2, 0.4, 0], [0, 0.8, -0.3], [0.1, 0, 1.1]])
SHIFT = np.array([0.3, -0.2, 0.5])
TIME = 0.12
COARSE = EngineAccuracy(resolution=8)


class Affine(Scripted):
    """x -> (1 + share (G - 1)) x + share SHIFT."""

    def read(self, fields):
        share = self.time / TIME
        rest = self.problem.points.reference_positions
        return PointState(time=self.time, positions=rest + share * (rest @ (GRADIENT - np.eye(3)).T + SHIFT))


def ball(radius=1.0):
    return trimesh.creation.icosphere(subdivisions=3, radius=radius)


def splat_on(mesh, count=300):
    """Flat ones on the faces."""
    faces = np.asarray(mesh.faces)
    painted = PaintedMesh(
        vertices=np.asarray(mesh.vertices), faces=faces, corner_colours=np.full((len(faces), 3, 3), 0.5), textures=(),
        texture_of=np.full(len(faces), -1), places=np.zeros((len(faces), 3, 2)),
    )  # fmt: skip
    return splat_of_mesh(painted, count).gaussians


def round_ones(cloud, count=60):
    """Not flat, and up to a tenth off the surface of a ball."""
    splat = cloud(count)
    ways = splat.means / np.linalg.norm(splat.means, axis=1, keepdims=True)
    return splat.with_(means=ways * np.linspace(0.9, 1.1, count)[:, None], scales=0.1 * splat.scales)


@pytest.fixture
def file_of(tmp_path):
    def write(mesh, name="mesh.ply"):
        mesh.export(tmp_path / name)
        return tmp_path / name

    return write


@pytest.fixture
def record(scene_of, tmp_path):
    count = iter(range(1000))

    def go(splat, file, engine=None, *, points=None, **others):
        given = {"duration": TIME, "frame_rate": 25, "gravity": (0, 0, 0), "accuracy": COARSE}
        given["reduction"] = Reduction(mode="mesh", mesh=file, points=points)
        engine = engine or (flying_points.descriptor(checkpoints=False, fields=frozenset()), Affine())
        return simulate(scene_of(splat, **(given | others)), engine, tmp_path / f"{next(count)}.gasp", progress=False)

    return go


@pytest.mark.parametrize("points", ["vertices", "filled"])
def test_an_affine_motion_is_theirs(record, file_of, points):
    """To the rounding of displacements of about 1 in float32, 6e-8, over edges of a tenth of that for covariances."""
    mesh = ball()
    splat = splat_on(mesh)
    run = record(splat, file_of(mesh), points=points)
    found = run.gaussians(run.frame_count - 1)
    assert np.abs(found.means - (splat.means @ GRADIENT.T + SHIFT)).max() < 1e-6
    expected = GRADIENT @ splat.covariances() @ GRADIENT.T
    assert np.abs(found.covariances() - expected).max() < 2e-6 * np.abs(expected).max()
    assert verify(run.path).damaged == ()
    carrier = run.bodies[0].carrier
    assert isinstance(carrier, OnFaces)
    assert (len(carrier.points) > len(mesh.vertices)) == (points == "filled")


def test_those_beside_the_faces_turn_with_them(record, cloud, file_of):
    """Tetrahedra, up to a tenth off: what stands on a face is as long as it was where nothing is stretched."""
    half = math.radians(80) / 2
    turn = rotation_matrices([[math.cos(half), 0.6 * math.sin(half), 0.8 * math.sin(half), 0]])[0]
    splat = round_ones(cloud)

    class Turned(Scripted):
        def read(self, fields):
            rest = self.problem.points.reference_positions
            return PointState(time=self.time, positions=rest @ turn.T if self.time else rest)

    engine = (flying_points.descriptor(checkpoints=False, fields=frozenset()), Turned())
    run = record(splat, file_of(ball()), engine, vertices=4)
    found = run.gaussians(run.frame_count - 1)
    assert np.abs(found.means - splat.means @ turn.T).max() < 1e-6
    expected = turn @ splat.covariances() @ turn.T
    assert np.abs(found.covariances() - expected).max() < 1e-5 * np.abs(expected).max()
    np.testing.assert_allclose(run.gaussians(0).means, splat.means, atol=1e-15)


@pytest.mark.parametrize("resolution", [8, 24])
def test_a_closed_mesh_has_the_mass_of_what_it_encloses(scene_of, cloud, file_of, resolution):
    """Cells that the surface cuts have their shares to .2 of a cell of the grid of distances, two to one of the
    engine's, where it turns sharply: as a share of the volume, three times .1 of its cells' width in radii at most."""
    mesh = ball()
    choice = Reduction(mode="mesh", mesh=file_of(mesh))
    accuracy = EngineAccuracy(resolution=resolution)
    assembly = prepare(scene_of(splat_on(mesh), reduction=choice, accuracy=accuracy)).assembly
    volume = assembly.problem.points.reference_volumes.sum()
    assert abs(volume / mesh.volume - 1) < 0.3 * 2 / resolution
    assert (assembly.problem.points.reference_volumes > 0).all()
    assert f"{len(mesh.vertices):,} vertices of its mesh and" in assembly.bodies[0].notes[0]
    assert not body_faces(assembly.problem)
    hollow = Reduction(mode="mesh", mesh=file_of(mesh), points="vertices")
    shell = prepare(scene_of(splat_on(mesh), reduction=hollow, accuracy=COARSE)).assembly
    assert len(shell.problem.points) == len(mesh.vertices) and not body_faces(shell.problem)


def test_an_open_mesh_is_a_sheet(scene_of, file_of):
    cloth = trimesh.creation.box(extents=(1, 1, 0.2)).subdivide().subdivide().subdivide()
    top = np.asarray(cloth.triangles_center)[:, 2] > 0.0999
    sheet = cloth.submesh([np.flatnonzero(top)])[0]
    choice = Reduction(mode="mesh", mesh=file_of(sheet))
    assembly = prepare(scene_of(splat_on(sheet), reduction=choice, accuracy=COARSE)).assembly
    assert len(assembly.problem.points) == len(welded(sheet.vertices, sheet.faces)[0])
    assert "a sheet" in assembly.bodies[0].notes[0]
    # Engines that step cloth are told its faces, as those of the points that they are given.
    faces = body_faces(assembly.problem)[0]
    placed = assembly.problem.points.reference_positions
    area = face_areas(placed, faces).sum()
    assert len(faces) == len(sheet.faces)
    assert area == pytest.approx(np.ptp(placed[:, 0]) * np.ptp(placed[:, 1]), rel=1e-9)
    with pytest.raises(SceneError, match="encloses next to nothing"):
        prepare(scene_of(splat_on(sheet), reduction=dataclasses.replace(choice, points="filled"), accuracy=COARSE))
    finer = prepare(scene_of(splat_on(sheet), reduction=choice, accuracy=EngineAccuracy(resolution=64))).assembly
    assert "cells apart" in finer.bodies[0].notes[1]


def test_a_mesh_with_a_hole_is_filled_where_asked(scene_of, file_of):
    mesh = ball()
    holed = mesh.submesh([np.arange(6, len(mesh.faces))])[0]
    choice = Reduction(mode="mesh", mesh=file_of(holed), points="filled")
    assembly = prepare(scene_of(splat_on(holed), reduction=choice, accuracy=COARSE)).assembly
    assert abs(assembly.problem.points.reference_volumes.sum() / mesh.volume - 1) < 0.08
    assert "as a soap film" in assembly.bodies[0].notes[1]


def test_a_seam_of_a_texture_is_none_of_matter():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1 + 1e-9, 0, 0], [0, 1, 1e-12], [1, 1, 0], [0, 0, 0]])
    faces = np.array([[0, 1, 2], [3, 5, 4], [0, 6, 1]])
    places, joined = welded(vertices, faces)
    assert len(places) == 4 and joined.shape == (2, 3)
    np.testing.assert_allclose(places[joined], vertices[faces[:2]], atol=1e-8)


def test_it_lies_as_its_splat_does(scene_of, file_of, tmp_path):
    """A mesh whose +y is up, and a splat of it that lies as trained ones do, scaled, turned and put somewhere."""
    mesh = trimesh.creation.box(extents=(0.2, 1.0, 0.4)).subdivide().subdivide()
    mesh.apply_translation((0.3, 0.1, 0.0))
    splat = splat_on(mesh)
    write_splat(tmp_path / "a.ply", turned_for_files(splat))
    choice = Reduction(mode="mesh", mesh=file_of(mesh), mesh_up="+y")
    scene = scene_of(
        tmp_path / "a.ply", reduction=choice, height=2.0, position=(1, 2, 0.5), rotation=(0, 0, 30), accuracy=COARSE
    )
    (placed,) = place_scene(scene).objects
    vertices = mesh_of(placed).vertices
    np.testing.assert_allclose(vertices.min(axis=0)[2], 0.5, atol=0.02)
    np.testing.assert_allclose(np.ptp(vertices[:, 2]), 2.0, rtol=0.05)
    # Each Gaussian lies on its face.
    carrier = prepare(scene).assembly.bodies[0].carrier
    assert isinstance(carrier, OnFaces)
    assert np.abs(carrier.coefficients[:, 0, 2]).max() < 1e-5
    with pytest.raises(SceneError, match="diagonals of its mesh away"):
        far = trimesh.creation.box().apply_translation((50, 0, 0))
        prepare(scene_of(splat, reduction=Reduction(mode="mesh", mesh=file_of(far, "far.ply"))))


def turned_for_files(splat):
    from gasp_core.scene.placement import turned

    found = turned(splat, "+y", "-y")
    names = [field.name for field in dataclasses.fields(found)]
    return found.with_(**{name: getattr(found, name).astype("f4") for name in names})


def moving(points, s):
    """Affine, and more."""
    return points + s * (points @ (GRADIENT - np.eye(3)).T) + np.stack([0.05 * s * points[..., 1] ** 2] * 3, axis=-1)


@pytest.mark.parametrize("composition", ["frozen", "carried"])
def test_psi_and_then_phi(record, file_of, composition):
    """Nothing moves but psi: Gaussians are where it has them."""
    splat = splat_on(ball())
    swing = Swing(axis=(0, 1, 0), pivot=(0, 0, 0), amplitude=40, frequency=2, composition=composition)

    class Still(Scripted):
        def read(self, fields):
            return PointState(time=self.time, positions=self.problem.points.reference_positions.copy())

    engine = (flying_points.descriptor(checkpoints=False, fields=frozenset()), Still())
    run = record(splat, file_of(ball()), engine, motion=swing)
    found = run.gaussians(run.frame_count - 1)
    angle = math.radians(40) * math.sin(2 * np.pi * 2 * TIME) if composition == "carried" else 0.0
    turn = rotation_matrices([[math.cos(angle / 2), 0, math.sin(angle / 2), 0]])[0]
    assert np.abs(found.means - splat.means @ turn.T).max() < 1e-5


AT_START = {"phase": 90, "frequency": 1, "axis": (0, 1, 0)}
FORMULAS = {
    "swing": (Swing, {"pivot": (0.4, 0, 1), "amplitude": 40}),
    "bend": (Bend, {"pivot": (0, 0, 0.5), "amplitude": 30, "length": 1.5}),
    "wave": (Wave, {"amplitude": 0.3, "wavelength": 3, "direction": (1, 0, 0)}),
}


def begun(places, motion):
    """Where a formula whose axis is +y has places of the world at its greatest."""
    if isinstance(motion, Wave):
        return places + [0, 1, 0] * (0.3 * np.cos(2 * np.pi * places[:, :1] / 3))
    arms = places - motion.pivot
    share = (np.maximum(arms[:, 2], 0) / 1.5) ** 2 if isinstance(motion, Bend) else np.ones(len(places))
    angles = math.radians(motion.amplitude) * share
    x, y, z = arms.T
    turned = np.stack([x * np.cos(angles) + z * np.sin(angles), y, z * np.cos(angles) - x * np.sin(angles)], axis=1)
    return turned + motion.pivot


@pytest.mark.parametrize("composition", ["frozen", "carried", "driven"])
@pytest.mark.parametrize("kind", FORMULAS)
def test_a_formula_has_moved_the_mesh_too_when_physics_begins(scene_of, file_of, kind, composition):
    """Vertices are where it has them, and what was filled is what they enclose then."""
    mesh, (formula, given) = ball(), FORMULAS[kind]
    motion = formula(**AT_START, **given, composition=composition)
    half = BoxShape(center=(0, -1, 1), half_extents=(3, 1, 3))
    scene = scene_of(
        splat_on(mesh, 2_000), reduction=Reduction(mode="mesh", mesh=file_of(mesh)), accuracy=COARSE,
        position=(0.2, 0, 0), metres_per_unit=0.9, motion=motion,
        parts=(Part(region=half, driven=True),) if composition == "driven" else (),
    )  # fmt: skip
    (placed,) = place_scene(dataclasses.replace(scene, objects=(unmoved(scene.objects[0]),))).objects
    expected = begun(mesh_of(placed).vertices, motion)
    assembly = prepare(scene).assembly
    points = assembly.problem.points.reference_positions
    np.testing.assert_allclose(points[: len(expected)], expected, atol=1e-12)
    full = trimesh.Trimesh(expected, np.asarray(mesh_of(placed).faces))
    volumes = assembly.problem.points.reference_volumes
    # As of a ball that stands still; the middle is off by less than what is missing on one side.
    assert abs(volumes.sum() / full.volume - 1) < 0.3 * 2 / 8
    assert np.abs(volumes @ points / volumes.sum() - full.center_mass).max() < 0.3 * 2 / 8 * 0.9
    # Each Gaussian is beside its face, but for how far a bent face is from a flat one.
    carrier = assembly.bodies[0].carrier
    assert isinstance(carrier, OnFaces)
    assert np.abs(carrier.coefficients[:, 0, 2]).max() < (1e-6 if kind == "swing" else 0.05)


def unmoved(item):
    return dataclasses.replace(item, motion=None, parts=())


def test_what_is_led_begins_where_psi_has_it_and_goes_on_from_there(scene_of, file_of):
    """A swing is rigid, so that the points of the driven half are where it has them to the rounding of float32."""
    from gasp_core.stepping.led_points import LedPoints

    mesh = ball()
    motion = Swing(**AT_START, **FORMULAS["swing"][1], composition="driven")
    half = BoxShape(center=(0, -1, 1), half_extents=(3, 1, 3))
    scene = scene_of(
        splat_on(mesh), reduction=Reduction(mode="mesh", mesh=file_of(mesh)), accuracy=COARSE, motion=motion,
        parts=(Part(region=half, driven=True),), duration=0.2,
    )  # fmt: skip
    assembly = prepare(scene).assembly
    trajectories = trajectories_of(scene, assembly.leads, lambda frame, count: None)
    led = LedPoints.of(dataclasses.replace(assembly.problem, trajectories=trajectories))
    assert led is not None
    vertices = led.rows < len(mesh.vertices)
    now = dataclasses.replace(motion, amplitude=40 * math.cos(2 * np.pi * 0.2))
    rest = welded(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces))[0][led.rows[vertices]]
    assert vertices.sum() > 100
    np.testing.assert_allclose(led.positions(0.2)[vertices], begun(rest, now), atol=1e-6)


def test_a_motion_without_a_formula_is_refused_where_it_has_left_its_mesh(scene_of, file_of, tmp_path):
    mesh = ball()
    splat, choice = splat_on(mesh), Reduction(mode="mesh", mesh=file_of(mesh))
    (tmp_path / "frames").mkdir()
    for number in range(3):
        shifted = splat.with_(means=(splat.means + [0.1 * number, 0, 0]).astype("f4"))
        write_splat(tmp_path / "frames" / f"{number}.ply", shifted)
    frames = {"splat": tmp_path / "frames", "up": "+z", "height": 0.5, "position": (3, 2, 1), "rotation": (0, 0, 30)}
    for given, motion, moves in [
        ({"splat": splat}, PythonMotion(function=moving), {"start": 0.5}),
        (frames, FrameSequence(frame_rate=10), {"schedule": ((0, 0.1), (1, 0.2))}),
    ]:
        scene = scene_of(**given, reduction=choice, accuracy=COARSE, motion=motion)
        prepare(scene)
        gone = dataclasses.replace(motion, **moves)
        with pytest.raises(SceneError, match=rf'kind "{motion.kind}" starts up to 0\..* m from where its file has it'):
            prepare(dataclasses.replace(scene, objects=(dataclasses.replace(scene.objects[0], motion=gone),)))


def test_velocities_of_psi_reach_vertices_and_inside(scene_of, file_of):
    """Of an affine psi those of every point; else those of the surface: an affine fit to .05 y^2 over places within two
    edges of h = .14 is off by no more than twice its range there, 2 x .05 (2 h)^2."""
    mesh = ball()
    carrier = prepare(
        scene_of(splat_on(mesh, 2_000), reduction=Reduction(mode="mesh", mesh=file_of(mesh)), accuracy=COARSE)
    ).assembly
    body = carrier.bodies[0]
    rest, points = body.block.rest, body.carrier.points
    linear = rest @ GRADIENT.T + SHIFT
    np.testing.assert_allclose(body.carrier.gather(rest, linear), points @ GRADIENT.T + SHIFT, atol=1e-9)
    curved = moving(rest.reshape(-1, 3), 1.0).reshape(rest.shape)
    found, expected = body.carrier.gather(rest, curved), moving(points, 1.0)
    count = len(mesh.vertices)
    assert np.abs(found - expected)[:count].max() < 2 * 0.05 * (2 * 0.14) ** 2
    assert np.abs(found - expected)[count:].max() < 0.05


def test_parts_and_two_meshes_in_one_scene(file_of):
    """A part in a region holds points of the mesh and of the inside; each object has its own mesh."""
    small, large = ball(0.2), ball(0.4)
    region = BoxShape(center=(0, 0, -0.4), half_extents=(1, 1, 0.2))
    rubber = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)

    def thing(name, mesh, **others):
        choice = Reduction(mode="mesh", mesh=file_of(mesh, f"{name}.ply"))
        return SplatObject(name=name, splat=splat_on(mesh), material=rubber, reduction=choice, **others)

    scene = Scene(
        duration=0.1,
        frame_rate=25,
        objects=(
            thing("large", large, parts=(Part(name="foot", region=region, pinned=True),)),
            thing("small", small, position=(0, 0, 0.5)),
        ),
        accuracy=COARSE,
    )
    assembly = prepare(scene).assembly
    problem = assembly.problem
    assert [len(body.carrier.arrays()["corners"]) for body in assembly.bodies] == [
        len(splat_on(large)), len(splat_on(small)),
    ]  # fmt: skip
    (pinned,) = problem.drives
    own = problem.points.reference_positions[assembly.bodies[0].points]
    held = pinned.region.signed_distance(own) <= 0
    inside = np.linalg.norm(own, axis=1) < 0.35
    assert held[inside].any() and held[~inside].any() and not held.all()


@pytest.mark.thorough
def test_an_engine_moves_it_and_goes_on_to_the_bit(record, scene_of, file_of, tmp_path):
    mesh = ball(0.3)
    choice = Reduction(mode="mesh", mesh=file_of(mesh))
    scene = scene_of(
        splat_on(mesh), reduction=choice, duration=0.16, frame_rate=25, angular_velocity=(0, 5, 0), accuracy=COARSE,
        recording=RecordingChoice(checkpoint_frames=1),
    )  # fmt: skip
    whole = simulate(scene, "reference-mpm", tmp_path / "whole.gasp", progress=False)
    simulate(scene, "reference-mpm", tmp_path / "parts.gasp", frames=3, progress=False)
    parts = simulate(scene, "reference-mpm", tmp_path / "parts.gasp", resume=True, progress=False)
    for frame in range(whole.frame_count):
        assert np.array_equal(parts.simplices(frame)["thing"], whole.simplices(frame)["thing"])
    ball(0.31).export(choice.mesh)
    with pytest.raises(RecordingError, match="has changed since"):
        simulate(scene, "reference-mpm", tmp_path / "parts.gasp", resume=True, progress=False)


def test_scene_files(scene_of, file_of, tmp_path):
    """Written and read again; known by the content of the mesh, wherever it lies."""
    splat = splat_on(ball())
    write_splat(tmp_path / "a.ply", turned_for_files(splat))
    file_of(ball(), "own.obj")
    scene = scene_of(tmp_path / "a.ply", reduction=Reduction(mode="mesh", mesh=tmp_path / "own.obj", mesh_up="-y"))
    (tmp_path / "scene.toml").write_text(scene_to_toml(scene, tmp_path))
    assert 'mesh = "own.obj"' in (tmp_path / "scene.toml").read_text()
    again = load_scene(tmp_path / "scene.toml")
    assert again.objects[0].reduction.mesh == tmp_path / "own.obj"
    elsewhere = tmp_path / "moved"
    elsewhere.mkdir()
    for name in ("a.ply", "own.obj", "scene.toml"):
        (elsewhere / name).write_bytes((tmp_path / name).read_bytes())
    other = load_scene(elsewhere / "scene.toml")
    digests = [scene_digest(each, place_scene(each).digests) for each in (again, other)]
    assert digests[0] == digests[1]
    ball(1.001).export(elsewhere / "own.obj")
    assert scene_digest(other, place_scene(other).digests) != digests[0]


@pytest.mark.parametrize(
    "given, said",
    [
        ({}, "wants a file of triangles"),
        ({"mesh": "a.ply", "points": "regular"}, '"vertices" or "filled"'),
        ({"mesh": "a.ply", "mesh_up": "y"}, "must be one of"),
        ({"mesh": "a.ply", "count": 5}, "count has no meaning"),
    ],
)
def test_impossible_choices(given, said):
    with pytest.raises(SceneError, match=said):
        Reduction(mode="mesh", **given)


def test_bad_files_and_regions(scene_of, cloud, tmp_path):
    whole = Reduction(mode="mesh", mesh=tmp_path / "none.ply")
    with pytest.raises((SceneError, SplatFormatError), match=r"none\.ply"):
        prepare(scene_of(cloud(20), reduction=whole))
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nf 1 2 9\n")
    with pytest.raises(SplatFormatError, match=r"bad\.obj"):
        prepare(scene_of(cloud(20), reduction=Reduction(mode="mesh", mesh=tmp_path / "bad.obj")))
    with pytest.raises(SceneError, match="moves as a whole"):
        scene_of(cloud(20), reduction=whole, region=BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1)))
    with pytest.raises(SceneError, match="has no meaning"):
        Reduction(mode="all", mesh=tmp_path / "none.ply")


def test_a_named_function_drives_it(record, file_of):
    """`Part.driven`: points of the mesh and inside are led."""
    splat = splat_on(ball())
    region = BoxShape(center=(-1, 0, 0), half_extents=(1, 2, 2))
    motion = PythonMotion(function=moving, composition="driven")

    class Led(Scripted):
        def read(self, fields):
            from gasp_core.stepping.led_points import LedPoints

            led = LedPoints.of(self.problem)
            positions = self.problem.points.reference_positions.copy()
            assert led is not None
            positions[led.rows] = led.positions(self.time)
            return PointState(time=self.time, positions=positions)

    own = flying_points.descriptor(checkpoints=False, fields=frozenset())
    able = dataclasses.replace(own, capabilities=dataclasses.replace(own.capabilities, trajectories=True))
    run = record(splat, file_of(ball()), (able, Led()), motion=motion, parts=(Part(region=region, driven=True),))
    found = run.gaussians(run.frame_count - 1).means
    driven = splat.means[:, 0] <= 0
    assert np.abs(found - moving(splat.means, TIME))[driven].max() < 1e-6
