"""Rigid parts of objects that deform: bodies of their own, with a surface of their own."""

import numpy as np
import pytest
from scipy.spatial import KDTree
from splat_shells import SHAPES, shell

from gasp_core import (
    BoxShape,
    ContactCondition,
    ContactRule,
    Elastic,
    EngineAccuracy,
    Part,
    Reduction,
    Rigid,
    Scene,
    SplatObject,
)
from gasp_core.contract import BodyContact, SignedDistanceField
from gasp_core.reduction.assembly import assemble
from gasp_core.reduction.rigid_parts import loose_parts, part_shape, rigid_groups
from gasp_core.scene.selection import place_object
from gasp_core.stepping.body_shape import body_shapes

SOFT = Elastic(density=300, youngs_modulus=1e5, poissons_ratio=0.3)
HARD = Rigid(density=900)
MODES = {
    "all": Reduction(mode="all"),
    "cores": Reduction(mode="cores", fraction=0.1, levels=2),
    "volume": Reduction(mode="volume"),
}
LEFT = BoxShape(center=(-0.5, 0, 0.5), half_extents=(0.5, 1, 1))
UPPER = BoxShape(center=(0, 0, 1), half_extents=(1, 1, 0.5))
RIGHT = BoxShape(center=(0.5, 0, 0.5), half_extents=(0.25, 1, 1))


@pytest.fixture(scope="module")
def cube():
    """Standing on z = 0, from -0.5 to 0.5 in x and y."""
    return shell(SHAPES["cube"], count=4_000)


def assembled(splat, *parts, reduction=MODES["volume"], material=SOFT, others=(), contacts=(), **own):
    thing = SplatObject(name="thing", splat=splat, material=material, parts=parts, reduction=reduction, **own)
    items = [thing, *others]
    accuracy = EngineAccuracy(resolution=12)
    scene = Scene(duration=1, frame_rate=1, objects=tuple(items), accuracy=accuracy, contacts=tuple(contacts))
    return assemble(scene, [place_object(item, splat) for item in items])


def off_box(shape, lower, upper):
    """How far a shape's distances are off those of a box, near its surface: the distribution's 95th hundredth [m]."""
    middle, half = (np.asarray(upper) + lower) / 2, (np.asarray(upper) - lower) / 2
    places = np.random.default_rng(0).uniform([-0.7, -0.7, -0.2], [0.7, 0.7, 1.2], (2_000, 3))
    away = np.abs(places - middle) - half
    exact = np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(axis=1), 0)
    near = np.abs(exact) < 3 * shape.spacing
    return np.quantile(np.abs(shape.signed_distance(places)[near] - exact[near]), 0.95)


@pytest.mark.parametrize("mode", MODES)
def test_a_rigid_part_is_a_body_that_is_a_part_of_the_rest(cube, mode):
    assembly = assembled(cube, Part(name="pot", region=LEFT, material=HARD), reduction=MODES[mode])
    problem = assembly.problem
    assert problem.rigid_parts == {1: 0}
    assert assembly.body_names == ["thing", "thing"]
    assert len(assembly.bodies) == 1
    rigid = problem.points.body_ids == 1
    assert (rigid == (problem.points.material_ids == 1)).all()
    assert problem.masses[rigid].sum() == pytest.approx(900 * problem.points.reference_volumes[rigid].sum())
    assert any(note.startswith('part "pot", rigid: ') for note in assembly.bodies[0].notes)


def test_a_part_that_is_said_to_be_rigid_has_the_density_of_its_object(cube):
    assembly = assembled(cube, Part(region=LEFT, rigid=True))
    assert assembly.problem.materials == (SOFT, Rigid(density=300))
    assert assembly.problem.rigid_parts == {1: 0}


def test_what_is_in_no_part_may_be_what_is_rigid(cube):
    assembly = assembled(cube, Part(name="sole", region=LEFT, material=SOFT), material=HARD)
    points = assembly.problem.points
    assert assembly.problem.rigid_parts == {1: 0}
    # The number of the object itself is that of what deforms.
    assert {assembly.problem.materials[row] for row in points.material_ids[points.body_ids == 0]} == {SOFT}


def test_each_part_is_a_body_of_its_own(cube):
    parts = (Part(name="left", region=LEFT, material=HARD), Part(name="right", region=RIGHT, material=HARD))
    assembly = assembled(cube, *parts)
    points = assembly.problem.points
    assert assembly.problem.rigid_parts == {1: 0, 2: 0}
    middles = [points.reference_positions[points.body_ids == body, 0].mean() for body in range(3)]
    assert middles[1] < middles[0] < middles[2]


def test_parts_meet_others_as_their_object_does(cube):
    other = SplatObject(name="other", splat=cube, position=(2, 0, 0), material=SOFT, reduction=MODES["volume"])
    slip = ContactRule(between=("other", "thing"), contact=ContactCondition.SLIP)
    assembly = assembled(cube, Part(region=LEFT, material=HARD), others=[other], contacts=[slip])
    assert assembly.body_names == ["thing", "other", "thing"]
    assert assembly.problem.rigid_parts == {2: 0}
    slipping = BodyContact(contact=ContactCondition.SLIP)
    assert assembly.problem.pair_contacts == {(0, 1): slipping, (1, 2): slipping}


def test_the_surface_of_a_part_is_that_of_the_body_and_ends_where_the_part_does(cube):
    problem = assembled(cube, Part(region=LEFT, material=HARD)).problem
    shape = body_shapes(problem)[1]
    step = 1 / 24
    # Half of the distance between two layers of points is as near as the seam is known, and a voxel the rest.
    assert off_box(shape, (-0.5, -0.5, 0), (0, 0.5, 1)) < step / 2 + shape.spacing
    rigid = problem.points.body_ids == 1
    inside = shape.signed_distance(problem.points.reference_positions) < 0
    assert (inside == rigid).mean() > 0.97


def test_a_rigid_body_with_a_region_has_the_surface_the_mass_and_the_inertia_of_what_is_in_it(cube):
    problem = assembled(cube, material=HARD, region=UPPER).problem
    shape = body_shapes(problem)[0]
    # The cut goes through no voxel unseen: distances to it are exact, and the rest is as near as the solid is.
    assert off_box(shape, (-0.5, -0.5, 0.5), (0.5, 0.5, 1)) < shape.spacing
    # Layers of points lie 1/24 apart, so that the lowest is as much as that above the cut.
    places, masses, step = problem.points.reference_positions, problem.masses, 1 / 24
    assert 0.5 <= places[:, 2].min() < 0.5 + step
    assert masses.sum() == pytest.approx(900 * 0.5, rel=2 * step)
    centre = masses @ places / masses.sum()
    assert centre == pytest.approx([0, 0, 0.75], abs=step / 2)
    spread = masses @ (places - centre) ** 2 / masses.sum()
    # Of a box of sides 1, 1 and .5, each off by a step at the most: a twelfth of their squares.
    assert spread == pytest.approx([1 / 12, 1 / 12, 1 / 48], rel=4 * step)


@pytest.mark.parametrize("mode", ["cores", "all"])
def test_so_it_does_where_points_are_those_of_gaussians(cube, mode):
    shape = body_shapes(assembled(cube, material=HARD, region=UPPER, reduction=MODES[mode]).problem)[0]
    assert off_box(shape, (-0.5, -0.5, 0.5), (0.5, 0.5, 1)) < shape.spacing


def test_a_rigid_part_of_an_object_with_a_region_ends_where_that_does(cube):
    """Beyond it there is matter that stays still, and is nearer to the part's points than to others."""
    low = BoxShape(center=(0, 0, 0.5), half_extents=(1, 1, 0.25))
    shape = body_shapes(assembled(cube, Part(region=low, material=HARD), region=UPPER).problem)[1]
    assert off_box(shape, (-0.5, -0.5, 0.5), (0.5, 0.5, 0.75)) < 1 / 48 + shape.spacing


def test_a_rigid_part_goes_on_beyond_its_points_as_far_as_no_other_is_nearer(cube):
    """Ten cores are a third of the cube apart: between theirs and others' the seam is far from the points of both."""
    problem = assembled(cube, Part(region=LEFT, material=HARD), reduction=Reduction(mode="cores", count=10)).problem
    points, rigid = problem.points.reference_positions, problem.points.body_ids == 1
    assert_nearer(body_shapes(problem)[1], points[rigid], points[~rigid])


def test_so_it_does_where_it_is_a_single_point():
    """Whose half of a cube reaches to all but one of its sides."""
    cube = BoxShape(center=(0, 0, 0.5), half_extents=(0.5, 0.5, 0.5))
    whole = SignedDistanceField.sampled(cube, (-0.5, -0.5, 0), (0.5, 0.5, 1), 0.03)
    one, other = np.array([[-0.1, 0, 0.5]]), np.array([[0.1, 0, 0.5]])
    shape = part_shape(whole, one, other)
    assert shape is not None
    assert_nearer(shape, one, other)


def assert_nearer(shape, own, others):
    """What is inside of a cube of one metre, farther than a voxel from its surface and the seam, is in the shape where
    it is nearer to its own points."""
    places = np.random.default_rng(0).uniform([-0.5, -0.5, 0], [0.5, 0.5, 1], (4_000, 3))
    deep = SHAPES["cube"].distance(places) < -shape.spacing
    to_own, to_others = (KDTree(each).query(places)[0] for each in (own, others))
    chosen = deep & (np.abs(to_own - to_others) > 2 * shape.spacing)
    inside = shape.signed_distance(places) < 0
    assert chosen.sum() > 1_000
    assert np.array_equal(inside[chosen], (to_own < to_others)[chosen])


def test_few_gaussians_have_no_solid_and_a_part_of_them_no_surface_but_that_of_its_points(cube):
    few = cube.select(np.arange(0, len(cube), 40))
    problem = assembled(few, Part(region=LEFT, material=HARD), reduction=MODES["all"]).problem
    assert problem.rigid_parts == {1: 0}
    assert body_shapes(problem) == {}


def test_groups_are_numbered_by_their_parts():
    materials = (SOFT, HARD)
    rows = np.array([0, 1, 1, 0, 1])
    parts = np.array([-1, 2, 0, 1, 2])
    assert rigid_groups(materials, rows, parts).tolist() == [0, 2, 1, 0, 2]
    assert rigid_groups(materials, np.ones(5, dtype=int), parts).tolist() == [0] * 5
    assert rigid_groups(materials, np.zeros(5, dtype=int), parts).tolist() == [0] * 5


def test_a_part_that_nothing_deforming_is_beside_is_told():
    groups = np.array([0, 1, 1, 2])
    places = np.array([[0.0, 0, 0], [0.9, 0, 0], [5.0, 0, 0], [3.0, 0, 0]])
    assert loose_parts(groups, places, 1.0) == [2]
    assert loose_parts(np.zeros(4, dtype=int), places, 1.0) == []


def test_a_loose_part_is_told_of_by_name(cube):
    means = cube.means.copy()
    apart = np.concatenate([means, means[::4] + [3, 0, 0]])
    rows = np.concatenate([np.arange(len(cube)), np.arange(0, len(cube), 4)])
    both = cube.select(rows).with_(means=apart)
    far = BoxShape(center=(3, 0, 0.5), half_extents=(1, 1, 1))
    notes = assembled(both, Part(name="ball", region=far, material=HARD), reduction=MODES["all"]).bodies[0].notes
    (note,) = [each for each in notes if "goes its own way" in each]
    assert note.startswith('part "ball" is rigid, and nothing that deforms is within a cell of it')
