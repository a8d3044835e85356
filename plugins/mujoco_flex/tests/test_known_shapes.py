"""Bodies whose surface is known, and colliders without a formula: both are convex pieces of a signed distance field."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gasp_mujoco_flex.engine import MujocoFlex

import gasp_core as gasp
from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Driven,
    Elastic,
    Field,
    HalfSpace,
    Pinned,
    PointCloud,
    PointProblem,
    Rigid,
    Side,
    SignedDistanceField,
    SphereShape,
    Status,
)
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.body_shape import BodyShape, body_shapes

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
RIGID = Rigid(density=1000.0)
PLANE = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
FLOOR = Collider(shape=PLANE, friction=0.4)
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})
H = 0.02
SOFTNESS = 1e-3
"""Of MuJoCo's contacts, in lengths of a body: what they are deep until they bear the most."""


class Torus:
    """Lying, about (0, 0, 0.06)."""

    def signed_distance(self, places):
        across = np.linalg.norm(places[:, :2], axis=1) - 0.2
        return np.hypot(across, places[:, 2] - 0.06) - 0.06


class Bowl:
    """Half a shell, open above."""

    def signed_distance(self, places):
        radius = np.linalg.norm(places - [0, 0, 0.6], axis=1)
        return np.max([radius - 0.6, 0.5 - radius, places[:, 2] - 0.6], axis=0)


BALL = SphereShape(center=(0.0, 0.0, 0.15), radius=0.15)
BODIES = {
    "ball": (BALL, (-0.15, -0.15, 0.0), (0.15, 0.15, 0.3)),
    "box": (BoxShape(center=(0, 0, 0.1), half_extents=(0.1, 0.15, 0.1)), (-0.1, -0.15, 0.0), (0.1, 0.15, 0.2)),
    "torus": (Torus(), (-0.26, -0.26, 0.0), (0.26, 0.26, 0.12)),
}


def solid_problem(shape, lower, upper, *, lift=0.0, distance=0.015, material=RIGID, **scene):
    """Points that fill a shape and the field that says its surface, both lifted."""
    field = SignedDistanceField.sampled(shape, lower, upper, H)
    counts = np.ceil((np.array(upper) - lower) / distance).astype(int)
    middle = (np.array(upper) + lower) / 2
    places = middle + distance * (np.indices(counts).reshape(3, -1).T - (counts - 1) / 2)
    places = places[shape.signed_distance(places) < 0] + [0, 0, lift]
    lifted = replace(field, origin=(field.origin[0], field.origin[1], field.origin[2] + lift))
    count = len(places)
    cloud = PointCloud(
        reference_positions=places,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, distance**3),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    hints = (BodyShape(body=0, shape=lifted),) if isinstance(material, Rigid) else ()
    return PointProblem(points=cloud, materials=(material,), hints=hints, **scene)


@pytest.mark.parametrize("name", BODIES)
def test_a_body_of_known_shape_rests_on_its_surface(opened, name):
    problem = solid_problem(*BODIES[name], lift=0.05, colliders=(FLOOR,))
    with opened(problem) as session:
        assert session.advance_to(1.5).status is Status.OK
        state = session.read(MOVING)
    # It fell straight down, by as much as it was lifted.
    gap = (state.positions - problem.points.reference_positions)[:, 2].mean() + 0.05
    # A third of a voxel is what was asked for. The surface is found on the edges of the grid, and may go lower between
    # them by H^2 / 4 R: a tenth of a voxel for the torus, which has R = 3 H.
    assert abs(gap) <= H / 3
    assert gap == pytest.approx(0.0, abs=H**2 / (4 * 0.06) + SOFTNESS * 0.3)
    assert np.abs(state.velocities).max() < 1e-3


def test_what_is_smaller_than_a_hole_falls_through_it(opened):
    ring, ball = (
        solid_problem(*body)
        for body in (BODIES["torus"], (SphereShape(center=(0, 0, 0.4), radius=0.1), (-0.1, -0.1, 0.3), (0.1, 0.1, 0.5)))
    )
    clouds = (ring.points, ball.points)
    cloud = PointCloud(
        reference_positions=np.concatenate([one.reference_positions for one in clouds]),
        initial_velocities=np.zeros((sum(map(len, clouds)), 3)),
        reference_volumes=np.concatenate([one.reference_volumes for one in clouds]),
        material_ids=np.zeros(sum(map(len, clouds))),
        body_ids=np.repeat([0, 1], [len(one) for one in clouds]),
    )
    shapes = [body_shapes(one)[0] for one in (ring, ball)]
    hints = tuple(BodyShape(body=number, shape=shape) for number, shape in enumerate(shapes))
    with opened(replace(ring, points=cloud, hints=hints, colliders=(FLOOR,))) as session:
        assert session.advance_to(1.0).status is Status.OK
        moved = session.read(MOVING).positions - cloud.reference_positions
    # The ball lies on the floor in the middle, where a hull would have been closed at 0.12.
    assert moved[cloud.body_ids == 1, 2].mean() == pytest.approx(-0.3, abs=H / 3)
    assert np.abs(moved[cloud.body_ids == 0]).max() < H / 3


def test_its_mass_and_its_inertia_are_those_of_its_points(opened):
    problem = solid_problem(*BODIES["torus"], colliders=(FLOOR,))
    with opened(problem) as known, opened(replace(problem, hints=())) as guessed:
        one, other = (session.held()._model for session in (known, guessed))
        for mine, its in zip(one.bodies, other.bodies):
            assert mine.matter.mass == its.matter.mass
            assert np.array_equal(mine.inertia, its.inertia)
            assert np.array_equal(mine.centre, its.centre)
        assert one.mj.body_mass[1] == pytest.approx(other.mj.body_mass[1], rel=1e-14)
        assert not np.array_equal(one.bodies[0].corners, other.bodies[0].corners)


def sampled_plane(low=(-1.0, -1.0, -0.5), high=(2.0, 2.0, 0.5)):
    return SignedDistanceField.sampled(PLANE, low, high, 0.05)


@pytest.mark.parametrize("material", [SOFT, RIGID], ids=["soft", "rigid"])
def test_a_field_of_a_plane_bears_as_the_plane_does(block, opened, material):
    heights: list[float] = []
    for shape in (PLANE, sampled_plane()):
        problem = block(material, corner=(0, 0, 0.05), colliders=(Collider(shape=shape, friction=0.4),))
        with opened(problem, damping=0.02) as session:
            assert session.advance_to(1.5).status is Status.OK
            heights.append(float(session.read(MOVING).positions[:, 2].mean()))
    # Field and plane are one surface; values of the field are single precision, and contacts are soft.
    assert heights[1] == pytest.approx(heights[0], abs=SOFTNESS * 0.4)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_cube_slides_on_a_field_as_coulomb_says(block, opened, friction):
    speed = 1.0
    problem = block(RIGID, velocity=(speed, 0, 0), colliders=(Collider(shape=sampled_plane(), friction=friction),))
    with opened(problem) as session:
        step = session.advance_to(speed / (friction * 9.81) + 0.3).largest_substep
        state = session.read(MOVING)
    way = (state.positions - problem.points.reference_positions)[:, 0].mean()
    # Symplectic Euler goes with the velocity of a step's end: v dt / 2 less in all. It rocks as it is braked, and when
    # it presses is known to a tenth of that.
    assert way == pytest.approx(speed**2 / (2 * friction * 9.81) - speed * step / 2, abs=0.05 * speed * step)
    assert np.abs(state.velocities).max() < 1e-3


def test_a_field_without_friction_takes_no_speed(block, opened):
    problem = block(RIGID, velocity=(1.0, 0, 0), colliders=(Collider(shape=sampled_plane()),))
    with opened(problem) as session:
        session.advance_to(0.3)
        assert session.read(MOVING).velocities[:, 0].mean() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("material", [SOFT, RIGID], ids=["soft", "rigid"])
def test_a_ball_that_falls_into_a_bowl_stays_in_it(opened, material):
    bowl = SignedDistanceField.sampled(Bowl(), (-0.6, -0.6, 0.0), (0.6, 0.6, 0.6), 0.05)
    around = (0.1, 0.05, 0.5)
    ball = SphereShape(center=around, radius=0.15)
    low, high = (tuple(middle + sign * 0.15 for middle in around) for sign in (-1, 1))
    problem = solid_problem(ball, low, high, distance=0.03, material=material, colliders=(Collider(shape=bowl),))
    with opened(problem, 0.06) as session:
        for time in np.linspace(0, 1.0, 26)[1:]:
            assert session.advance_to(float(time)).status is Status.OK
            places = session.read(MOVING).positions
            # Never through the wall, by more than a spacing of its field.
            assert bowl.signed_distance(places).min() > -0.05
    # Down in the hollow, which a hull around the bowl would have closed.
    lowest = places[:, 2].min()
    assert 0.1 - 0.05 < lowest < 0.3


@pytest.mark.parametrize("material", [SOFT, RIGID], ids=["soft", "rigid"])
def test_the_inside_of_a_field_holds_matter_in(block, opened, material):
    room = BoxShape(center=(0.2, 0.2, 0.4), half_extents=(0.4, 0.4, 0.4))
    field = SignedDistanceField.sampled(room, (-0.2, -0.2, 0.0), (0.6, 0.6, 0.8), 0.05)
    collider = Collider(shape=field, side=Side.INSIDE)
    problem = block(material, corner=(0, 0, 0.1), velocity=(3.0, 2.0, -1.0), colliders=(collider,))
    with opened(problem) as session:
        for time in np.linspace(0, 0.8, 21)[1:]:
            assert session.advance_to(float(time)).status is Status.OK
            # A wall is met within a step, at 4 m/s in steps of 4 ms at most; and its field rounds its edges.
            assert field.signed_distance(session.read(MOVING).positions).max() < 0.02


def test_a_body_of_known_shape_sticks_where_its_surface_touches(opened):
    # Its nearest points are half their distance within it.
    plate = Collider(shape=sampled_plane((-0.6, -0.6, -0.2), (0.6, 0.6, 0.2)), contact=ContactCondition.STICK)
    problem = solid_problem(*BODIES["box"], lift=0.05, distance=0.05, colliders=(plate,))
    with opened(problem) as session:
        step = session.advance_to(0.3).largest_substep
        moved = session.read(MOVING).positions - problem.points.reference_positions
        assert not session.read(MOVING).velocities.any()
    # It is found to touch at the end of a step.
    assert 0.0 <= -(moved[:, 2].mean() + 0.05) <= math.sqrt(2 * 9.81 * 0.05) * step + 1e-6


def test_drives_have_fields_for_regions(block, opened):
    lower = BoxShape(center=(0.2, 0.2, 0.0), half_extents=(0.5, 0.5, 0.1))
    region = SignedDistanceField.sampled(lower, (-0.3, -0.3, -0.1), (0.7, 0.7, 0.1), 0.05)
    problem = block(SOFT, drives=(Pinned(region=region),))
    with opened(problem) as session:
        session.advance_to(0.2)
        moved = session.read(MOVING).positions - problem.points.reference_positions
    held = problem.points.reference_positions[:, 2] < 0.1
    assert not moved[held].any()
    assert np.abs(moved[~held]).max() > 1e-4
    lift = Driven(region=region, velocity=(0.0, 0.0, 0.5), center=(0.2, 0.2, 0.0))
    with opened(block(RIGID, drives=(lift,))) as session:
        session.advance_to(0.2)
        moved = session.read(MOVING).positions - problem.points.reference_positions
    # Some dozen exact steps.
    np.testing.assert_allclose(moved, np.broadcast_to([0, 0, 0.1], moved.shape), atol=1e-12)


@pytest.mark.thorough
def test_a_real_statue_rests_on_its_surface():
    folder = Path(os.environ.get("GASP_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real splats at {folder} (set GASP_DATA)")
    data = folder / "splats" / "statue-angel.sog"
    statue = gasp.SplatObject(name="statue", splat=data, height=0.4, position=(0, 0, 0.05), material=RIGID)
    assembly = prepare(gasp.Scene(duration=1.0, frame_rate=25, objects=(statue,), colliders=(FLOOR,))).assembly
    field = body_shapes(assembly.problem)[0]
    rest = assembly.problem.points.reference_positions
    with MujocoFlex().open(assembly.problem, accuracy=assembly.accuracy) as session:
        assert session.advance_to(2.0).status is Status.OK
        state = session.read(MOVING)
    middle, now = rest.mean(axis=0), state.positions.mean(axis=0)
    turn = np.linalg.lstsq(rest - middle, state.positions - now, rcond=None)[0]
    # Where the floor is now, in the statue's own axes: the field says how far its surface is from there, with places
    # half a spacing apart.
    low, high = rest.min(axis=0) - 0.05, rest.max(axis=0) + 0.05
    x, y = (np.arange(start, end, field.spacing / 2) for start, end in zip(low[:2], high[:2]))
    heights = np.linspace(-2, 2, 121) * field.spacing
    places = np.stack(np.meshgrid(x - middle[0], y - middle[1], heights - now[2], indexing="ij"), axis=-1)
    distances = field.signed_distance(places.reshape(-1, 3) @ turn.T + middle)
    inside = distances.reshape(places.shape[:3]) <= 0
    lowest = heights[inside.any(axis=(0, 1))].min()
    assert abs(lowest) <= field.spacing / 3
    assert np.abs(state.velocities).max() < 1e-3
