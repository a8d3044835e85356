from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    ContactCondition,
    Elastic,
    HalfSpace,
    KeyframedMotion,
    PointCloud,
    PointProblem,
    Rigid,
    Side,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.simulation.initial_overlap import rigid_bodies_overlap, starts_in_another, starts_inside
from gasp_core.stepping.body_shape import BodyShape

FLOOR = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
TANK = Collider(shape=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 1.0, 1.0)), side=Side.INSIDE)


def told(positions, volumes, *colliders: Collider, bodies=0) -> list[tuple[int, str]]:
    count = len(positions)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=volumes,
        material_ids=np.zeros(count),
        body_ids=np.full(count, bodies),
    )
    soft = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
    names = [f"collider {number}" for number in range(1, 1 + len(colliders))]
    return list(starts_inside(PointProblem(points=points, materials=(soft,), colliders=colliders), 0.1, names))


def test_points_in_the_floor_are_told_with_their_mass_and_depth() -> None:
    ((body, line),) = told([[0.0, 0.0, 1.0], [0.0, 0.0, -0.3], [0.0, 0.0, -0.1]], [2.0, 1.0, 1.0], TANK, FLOOR)
    assert body == 0
    assert line.startswith("2 points, 50 % of its mass, start inside collider 2 (plane), the deepest by 0.3 m")
    assert "\n" not in line


def test_a_body_is_told_of_by_its_number_and_its_own_mass() -> None:
    places = [[0.0, 0.0, 0.5], [0.0, 0.0, -0.3], [0.0, 0.0, -0.2]]
    ((body, line),) = told(places, [9.0, 1.0, 1.0], FLOOR, bodies=[0, 1, 1])
    assert body == 1 and line.startswith("2 points, 100 % of its mass")


def test_points_outside_their_container_are_in_its_wall() -> None:
    ((_, line),) = told([[0.0, 0.0, 0.5], [1.2, 0.0, 0.0]], [1.0, 1.0], TANK, FLOOR)
    assert "inside collider 1 (box), the deepest by 0.2 m" in line


@pytest.mark.parametrize(("height", "lines"), [(-0.049, 0), (-0.051, 1)])
def test_a_touch_within_half_a_cell_is_none(height: float, lines: int) -> None:
    assert len(told([[0.0, 0.0, height]], [1.0], FLOOR, TANK)) == lines


RAISED = dataclasses.replace(FLOOR, motion=KeyframedMotion(times=(0.0, 1.0), places=((0, 0, -2), (0, 0, 0))))


def test_a_collider_is_where_its_motion_begins() -> None:
    """A floor that comes up from 2 m below."""
    assert told([[0.0, 0.0, -0.3]], [1.0], RAISED) == []
    ((_, line),) = told([[0.0, 0.0, -2.3]], [1.0], RAISED)
    assert "the deepest by 0.3 m" in line


def test_of_a_field_no_kind_is_told() -> None:
    ball = SignedDistanceField.sampled(SphereShape(center=(0, 0, 0), radius=0.5), (-1, -1, -1), (1, 1, 1), 0.1)
    ((_, line),) = told([[0.0, 0.0, 0.0]], [1.0], Collider(shape=ball))
    assert "start inside collider 1, the deepest by" in line


def rigid(positions, *colliders: Collider, bodies=0, hints=()) -> PointProblem:
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((len(positions), 3)),
        reference_volumes=np.full(len(positions), 1e-3),
        material_ids=np.zeros(len(positions)),
        body_ids=np.broadcast_to(bodies, len(positions)),
    )
    return PointProblem(points=points, materials=(Rigid(density=1000.0),), colliders=colliders, hints=hints)


def box_shape(low: float) -> tuple[BodyShape]:
    """Half a metre wide and high, from a height on."""
    box = BoxShape(center=(0.0, 0.0, low + 0.25), half_extents=(0.25, 0.25, 0.25))
    field = SignedDistanceField.sampled(box, (-0.25, -0.25, low), (0.25, 0.25, low + 0.5), 0.05)
    return (BodyShape(body=0, shape=field),)


def test_rigid_bodies_come_out_and_are_told_so() -> None:
    ((_, line),) = starts_inside(rigid([[0.0, 0.0, -0.3]], FLOOR), 0.1, ["collider 1"])
    assert "it is pushed out, slowly" in line


@pytest.mark.parametrize(
    ("problem", "overlaps"),
    [
        (rigid([[0, 0, -0.01], [0, 0, 1]], FLOOR), True),
        (rigid([[0, 0, 0.3]], FLOOR), False),
        # Of a body that is known by its points alone cubes of a decimetre touch the floor.
        (rigid([[0, 0, 0.05]], FLOOR), False),
        (rigid([[0, 0, 0.04]], FLOOR), True),
        # A surface that is known may be lower than any of them, by a millimetre as by a centimetre.
        (rigid([[0, 0, 0.2]], FLOOR, hints=box_shape(0.0)), False),
        (rigid([[0, 0, 0.2]], FLOOR, hints=box_shape(-0.001)), True),
        (rigid([[0, 0, 0.2]], FLOOR, hints=box_shape(-0.01)), True),
        (rigid([[0, 0, 0.2], [0, 0, 0.52]], bodies=[0, 1], hints=box_shape(0.0)), True),
        (rigid([[0, 0, 0.2], [0, 0, 0.56]], bodies=[0, 1], hints=box_shape(0.0)), False),
        # Cubes of a decimetre, the first of them two.
        (rigid([[0, 0, 1], [1, 0, 1], [0.5, 0.05, 1]], bodies=[0, 0, 1]), True),
        (rigid([[0, 0, 1], [1, 0, 1], [0.5, 0.11, 1]], bodies=[0, 0, 1]), False),
    ],
)
def test_whether_rigid_bodies_overlap(problem: PointProblem, overlaps: bool) -> None:
    assert rigid_bodies_overlap(problem) is overlaps


SPACING = 0.1
SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)


def cube(corner=(0.0, 0.0, 0.0), jitter=0.0):
    """Four cells wide, two points a cell along each edge, as volume mode has them."""
    places = (np.stack(np.meshgrid(*[np.arange(8) + 0.5] * 3), axis=-1).reshape(-1, 3)) * SPACING / 2
    return places + corner + jitter * SPACING / 2 * np.random.default_rng(0).uniform(-1, 1, places.shape)


def two(first, second, materials=(SOFT, SOFT), contacts=None, spacing=SPACING):
    """What is told of a body of these points, and of another of those."""
    counts = len(first), len(second)
    points = PointCloud(
        reference_positions=np.concatenate([first, second]),
        initial_velocities=np.zeros((sum(counts), 3)),
        reference_volumes=np.full(sum(counts), (SPACING / 2) ** 3),
        material_ids=np.repeat([0, 1], counts),
        body_ids=np.repeat([0, 1], counts),
    )
    problem = PointProblem(points=points, materials=materials, pair_contacts=contacts or {})
    return list(starts_in_another(problem, spacing, ["left", "right"]))


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_two_at_one_place_are_told(jitter):
    ((_, line),) = two(cube(), cube(jitter=jitter))
    count, share = line.replace(",", "").split(" points ")[0], float(line.split(", ")[1].split(" %")[0])
    # All but those a quarter of a cell from a face, or less: the outermost layer at most.
    assert int(count) >= 6**3 and share >= 100 * (6 / 8) ** 3 * 0.99
    assert 'start inside object "' in line and "is not pushed apart" in line and "\n" not in line


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_two_that_touch_are_not_in_each_other(jitter):
    assert two(cube(), cube((0.4, 0.0, 0.0), jitter)) == []
    assert two(cube(), cube((0.4, 0.1, 0.03), jitter)) == []


@pytest.mark.parametrize("spacing", [SPACING / 5, SPACING / 2])
def test_two_that_touch_are_not_in_each_other_where_their_points_are_far_apart(spacing):
    """As those of cores are, in cells."""
    assert two(cube(), cube((0.4, 0.02, 0.0)), spacing=spacing) == []
    assert len(two(cube(), cube((0.2, 0.02, 0.0)), spacing=spacing)) == 1


def test_by_half_a_cell_and_more_one_is_in_the_other():
    ((number, line),) = two(cube(), cube((0.3, 0.05, 0.0)))
    assert number in (0, 1) and "start inside object" in line


def test_the_one_with_more_of_its_mass_in_the_other_is_told_of():
    little = cube()[(np.abs(cube() - 0.2) < 0.1).all(axis=1)]
    ((number, line),) = two(cube(), little)
    assert number == 1 and line.startswith('64 points, 100 % of its mass, start inside object "left"')


def test_two_that_stick_may_be_one():
    assert two(cube(), cube(), contacts={(0, 1): BodyContact(contact=ContactCondition.STICK)}) == []


def test_two_rigid_ones_come_apart():
    material = Rigid(density=500.0)
    ((_, line),) = two(cube(), cube((0.1, 0.0, 0.0)), (material, material))
    assert "they are pushed apart, slowly" in line


def test_a_sheet_in_a_body_is_in_its_way_and_beside_it_is_not():
    sheet = cube()[cube()[:, 2] < SPACING / 2]
    assert len(sheet) == 64
    ((number, _),) = two(cube((0.0, 0.0, -0.2)), sheet)
    assert number == 1
    assert two(cube((0.0, 0.0, 0.05)), sheet) == []
