from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core import Elastic, EngineAccuracy, Fluid, MapChoice, Reduction, Scene, SplatObject
from gasp_core.errors import SceneError
from gasp_core.games import to_simplices
from gasp_core.reduction.all_vertices import rigid_velocities
from gasp_core.reduction.assembly import assemble
from gasp_core.reduction.bodies import moved_gaussians, moved_simplices
from gasp_core.reduction.occupancy import cell_volumes
from gasp_core.scene.selection import place_object
from gasp_core.stepping.grid import grid_node

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


def assembled(*items, **options):
    scene = Scene(duration=1, frame_rate=1, objects=items, **options)
    return assemble(scene, [place_object(item, item.splat) for item in items])


@given(st.integers(0, 10_000), st.integers(1, 300), st.floats(0.05, 1.0))
def test_volumes_are_those_of_the_occupied_cells(seed, count, spacing):
    points = np.random.default_rng(seed).uniform(size=(count, 3))
    volumes = cell_volumes(points, spacing)
    cells = {tuple(cell) for cell in np.floor((points - points.min(axis=0)) / spacing).astype(int)}
    # A sum of `count` doubles.
    np.testing.assert_allclose(volumes.sum(), len(cells) * spacing**3, rtol=count * 2.3e-16)
    assert (volumes > 0).all()


def test_a_duplicate_splits_its_volume_and_far_apart_points_do_not_overflow():
    points = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    assert np.array_equal(cell_volumes(points, 0.5), [0.0625, 0.0625, 0.125])
    points = np.array([[0.0, 0, 0], [1e9, 1e9, 1e9], [1e9, 1e9, 1e9]])
    assert np.array_equal(cell_volumes(points, 1.0), [1.0, 0.5, 0.5])


@pytest.mark.parametrize("cells", [1, 3, 7, 16, 48, 1000])
@pytest.mark.parametrize("shift", [0.0, 0.1, -1e3])
def test_what_lies_on_the_last_face_begins_no_new_cell(cells, shift):
    """A bar has the length of its points however finely it is divided, 4,001 of them from end to end.

    A double at 1e3 is known to 1e-13, far less than the billionth of a cell that counts as on the face.
    """
    bar = np.zeros((4001, 3))
    bar[:, 0] = shift + np.linspace(0, 2.0, 4001)
    spacing = 2.0 / cells
    np.testing.assert_allclose(cell_volumes(bar, spacing).sum(), cells * spacing**3, rtol=1e-10)
    beyond = np.concatenate([bar, bar[-1:] + [1e-3 * spacing, 0, 0]])
    np.testing.assert_allclose(cell_volumes(beyond, spacing).sum(), (cells + 1) * spacing**3, rtol=1e-10)


def test_rigid_velocities_turn_about_the_centre_of_volume(cloud):
    points = cloud().means
    volumes = np.random.default_rng(0).uniform(0.1, 1, size=len(points))
    velocities = rigid_velocities(points, volumes, (1.0, 2.0, 3.0), (0.0, 0.0, 2.0))
    # Momentum is that of the translation alone; angular momentum about the centre is along z for ... a sum of 40.
    np.testing.assert_allclose(np.average(velocities, axis=0, weights=volumes), (1, 2, 3), atol=1e-13)
    offset = points - np.average(points, axis=0, weights=volumes)
    np.testing.assert_allclose(velocities - [1, 2, 3], np.cross([0, 0, 2.0], offset), atol=1e-13)


def test_the_grid_lies_where_it_does_with_every_vertex_however_few_cores_there_are(cloud):
    """A tenth of a cell to the side is another contact: two runs that differ in that alone soon differ in all."""
    first, second = cloud(200, seed=1), cloud(150, seed=2)
    second = second.with_(means=second.means + [5.0, 1.0, 2.0])
    nodes = {}
    for mode in (Reduction(), Reduction(mode="cores", count=7), Reduction(mode="cores", count=60, levels=2)):
        items = [
            SplatObject(name=name, splat=splat, material=JELLY, reduction=mode)
            for name, splat in (("a", first), ("b", second))
        ]
        assembly = assembled(*items, accuracy=EngineAccuracy(resolution=16))
        nodes[mode] = grid_node(assembly.problem, assembly.spacing)
        if mode == Reduction():
            points = assembly.problem.points.reference_positions
            assert np.array_equal(nodes[mode], (points.min(axis=0) + points.max(axis=0)) / 2)
        assert np.array_equal(nodes[mode], nodes[Reduction()])


@pytest.mark.parametrize("vertices", [3, 4])
def test_points_are_the_vertices_with_short_edges_lengthened(cloud, vertices):
    splat = cloud()
    item = SplatObject(name="a", splat=splat, material=JELLY, vertices=vertices)
    assembly = assembled(item, accuracy=EngineAccuracy(resolution=16))
    assert assembly.spacing == pytest.approx(np.ptp(splat.means, axis=0).max() / 16, rel=1e-15)
    points = assembly.problem.points.reference_positions.reshape(-1, vertices, 3)
    plain = to_simplices(splat, vertices)
    np.testing.assert_allclose(points[:, 0], plain[:, 0], atol=1e-15)
    lengths = np.linalg.norm(points[:, 1:] - points[:, :1], axis=2)
    wanted = np.maximum(np.linalg.norm(plain[:, 1:] - plain[:, :1], axis=2), assembly.spacing / 4)
    np.testing.assert_allclose(lengths, wanted, atol=1e-14)


def test_no_floor_gives_the_papers_points(cloud):
    splat = cloud()
    assembly = assembled(SplatObject(name="a", splat=splat, material=JELLY), maps=MapChoice(edge_floor=0.0, vertices=3))
    np.testing.assert_allclose(
        assembly.problem.points.reference_positions, to_simplices(splat, 3).reshape(-1, 3), atol=1e-15
    )


def test_several_objects_share_a_problem(cloud):
    water = Fluid(density=1000, bulk_modulus=1e5)
    first = SplatObject(name="a", splat=cloud(10, 1), material=JELLY, vertices=3)
    second = SplatObject(name="b", splat=cloud(20, 2), material=water, vertices=4, velocity=(1, 0, 0))
    ground = SplatObject(name="g", splat=cloud(5, 3), static=True)
    third = SplatObject(name="c", splat=cloud(30, 4), material=JELLY, vertices=3)
    assembly = assembled(first, second, ground, third)
    points = assembly.problem.points
    assert assembly.problem.materials == (JELLY, water)
    assert np.array_equal(np.bincount(points.body_ids), [30, 80, 90])
    assert np.array_equal(points.material_ids, np.repeat([0, 1, 0], [30, 80, 90]))
    assert np.array_equal(points.initial_velocities[30:110], np.tile([1.0, 0, 0], (80, 1)))
    assert [body.name for body in assembly.bodies] == ["a", "b", "c"]
    assert np.array_equal(assembly.bodies[2].rows, np.arange(35, 65))


def test_all_static_is_refused(cloud):
    with pytest.raises(SceneError, match="every object is static"):
        assembled(SplatObject(name="g", splat=cloud(), static=True))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_gaussians_have_a_spacing(cloud, count):
    assembly = assembled(SplatObject(name="a", splat=cloud(count), material=JELLY))
    assert assembly.spacing > 0
    assert np.isfinite(assembly.problem.masses).all()


@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_displacement_zero_is_the_rest_state_to_the_last_bit_wherever_it_lies(cloud, offset):
    splat = cloud(degree=3)
    splat = splat.with_(means=splat.means + offset)
    assembly = assembled(SplatObject(name="a", splat=splat, material=JELLY, vertices=4))
    body = assembly.bodies[0]
    zeros = np.zeros((len(assembly.problem.points), 3), dtype=np.float32)
    assert np.array_equal(moved_simplices(body, zeros), body.block.rest)
    moved = moved_gaussians(body, zeros, MapChoice(alpha=1.0))
    assert not moved.clipped.any() and not moved.degenerate.any()
    assert np.array_equal(moved.gaussians.harmonics, splat.harmonics)
    expected = splat.covariances()
    error = np.abs(moved.gaussians.covariances() - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
    # An eigen-decomposition in double precision of matrices whose condition is up to exp(8).
    assert error.max() < 1e-12


@pytest.mark.parametrize("vertices", [3, 4])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_an_affine_motion_through_float32_displacements(cloud, vertices, offset):
    """float32 knows a displacement of order 1 to 6e-8; edges have at least a quarter of 1/64 after magnification.

    So an edge is off by 6e-8 * 256 * 2 / |F^-1| at worst, below 1e-3 with room for a squeeze by 10.
    """
    splat = cloud(100)
    if vertices == 3:
        flat = splat.scales.copy()
        flat[:, 0] = 0
        splat = splat.with_(scales=flat)
    splat = splat.with_(means=splat.means + offset)
    assembly = assembled(SplatObject(name="a", splat=splat, material=JELLY, vertices=vertices))
    body = assembly.bodies[0]
    gradient = np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.1]])
    start = assembly.problem.points.reference_positions
    shift = (start - offset) @ (gradient - np.eye(3)).T
    relative = (shift - shift.mean(axis=0)).astype(np.float32)
    moved = moved_gaussians(body, relative, MapChoice(alpha=math.inf))
    expected = gradient @ splat.covariances() @ gradient.T
    error = np.abs(moved.gaussians.covariances() - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
    assert error.max() < 1e-3
