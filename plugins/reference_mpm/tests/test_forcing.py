"""What acts on matter: impulses, wind, drives, colliders and the edge of the domain."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from reference_problems import ALL, EVERYWHERE, FLOOR, box, opened, problem, run

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Driven,
    Elastic,
    HalfSpace,
    Impulse,
    Pinned,
    PointProblem,
    Side,
    SphereShape,
    Status,
    Wind,
)
from gasp_core.stepping.grid import GridAnchor


def test_impulse_gives_its_momentum_once_at_its_time() -> None:
    spacing = 0.25
    positions = box((2, 2, 2), spacing)
    left = HalfSpace(point=(0.25, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    blow = Impulse(region=left, start=0.05, impulse=(3.0, -2.0, 1.0))
    scene = problem(positions, spacing, drives=(blow,), gravity=(0.0, 0.0, 0.0))
    with opened(scene, spacing) as session:
        session.advance_to(0.05)
        assert not session.read(ALL).velocities.any()
        saved = session.checkpoint()
        session.advance_to(0.1)
        whole = session.read(ALL)
    np.testing.assert_allclose(scene.masses @ whole.velocities, [3.0, -2.0, 1.0], rtol=1e-12)
    with opened(scene, spacing, restart=saved) as session:
        session.advance_to(0.1)
        np.testing.assert_array_equal(session.read(ALL).positions, whole.positions)


def test_wind_takes_matter_along_at_its_rate() -> None:
    spacing, drag, air = 0.25, 3.0, np.array([2.0, -1.0, 0.5])
    wind = Wind(velocity=tuple(air), drag=drag, start=0.1, end=0.4)
    scene = problem(box((1, 1, 1), spacing), spacing, force_fields=(wind,), gravity=(0.0, 0.0, 0.0))
    step = 1e-3
    with opened(scene, spacing, substep=step) as session:
        session.advance_to(0.1)
        assert not session.read(ALL).velocities.any()
        session.advance_to(0.7)
        state = session.read(ALL)
    # Implicit Euler of dv/dt = k (u - v): each step divides what is missing by 1 + k dt. 300 steps, exactly.
    expected = air * (1 - (1 + drag * step) ** -300)
    np.testing.assert_allclose(state.velocities, np.tile(expected, (8, 1)), rtol=1e-11)
    # And that is the closed form up to k dt / 2 of k t exp(-k t).
    closed = air * (1 - math.exp(-drag * 0.3))
    np.testing.assert_allclose(state.velocities, np.tile(closed, (8, 1)), rtol=drag * step)


def test_wind_blows_in_its_region_alone() -> None:
    spacing = 0.25
    far = box((1, 1, 1), spacing, (5.0, 0.0, 0.0))
    here = SphereShape(center=(0.0, 0.0, 0.0), radius=2.0)
    wind = Wind(velocity=(0.0, 1.0, 0.0), drag=1.0, region=here)
    scene = problem(
        np.concatenate([box((1, 1, 1), spacing), far]), spacing, force_fields=(wind,), gravity=(0.0, 0.0, 0.0)
    )
    velocities = run(scene, spacing, [0.1]).velocities
    assert (velocities[:8, 1] > 0.05).all()
    assert not velocities[8:].any()


def test_pinned_matter_stands_still_until_its_window_ends() -> None:
    spacing = 0.25
    pin = Pinned(region=EVERYWHERE, end=0.1)
    scene = problem(box((1, 1, 1), spacing), spacing, drives=(pin,))
    with opened(scene, spacing, substep=1e-3) as session:
        session.advance_to(0.1)
        np.testing.assert_array_equal(session.read(ALL).velocities, 0)
        session.advance_to(0.2)
        np.testing.assert_allclose(session.read(ALL).velocities[:, 2], -0.981, rtol=1e-12)


@pytest.mark.parametrize("beyond", [0.0, 0.25, 0.5, 0.75])
def test_a_clamp_is_felt_on_its_plane_wherever_the_grid_lies(beyond: float) -> None:
    spacing, free, density, modulus, gravity = 0.1, 6, 1000.0, 1e6, 1.0
    length = free * spacing
    bar = box((free + 3, 1, 1), spacing, (-3 * spacing, 0.0, 0.0))
    # The plane of the clamp is `beyond` cells behind a node; a bar that is one cell wide hangs along its axis.
    anchor = GridAnchor(place=(-beyond * spacing, 0.0, 0.0))
    rate = math.pi / 2 * math.sqrt(modulus / density) / length
    scene = problem(
        bar,
        spacing,
        Elastic(density=density, youngs_modulus=modulus, poissons_ratio=0.0),
        gravity=(gravity, 0.0, 0.0),
        drives=(Pinned(region=HalfSpace(point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))),),
        force_fields=(Wind(velocity=(0.0, 0.0, 0.0), drag=2 * rate),),
        hints=(anchor,),
    )
    hung = run(scene, spacing, [12 / rate]).positions - bar
    place = bar[:, 0]
    exact = density * gravity / modulus * (length * place - place**2 / 2)
    error = hung[place > 0, 0].mean() / exact[place > 0].mean() - 1
    # The drop goes with the length squared: a fifth of a cell in six.
    assert abs(error) < 2 * 0.2 / free


def test_driven_matter_moves_as_a_rigid_body_with_its_region() -> None:
    spacing, rate = 0.125, 2.0
    # A plate in a box-shaped grip that turns by a radian and travels on; box and plate stay together all the way.
    plate = box((4, 2, 1), spacing, (-0.25, -0.125, -0.0625))
    grip = Driven(
        region=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(0.5, 0.375, 0.3125)),
        velocity=(0.5, 0.0, 0.2),
        angular_velocity=(0.0, 0.0, rate),
    )
    time = 0.5
    state = run(problem(plate, spacing, drives=(grip,)), spacing, [time])
    angle = rate * time
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    expected = plate @ turn.T + np.array([0.5, 0.0, 0.2]) * time
    # Euler on a circle of radius r ends r w^2 t dt / 2 away; substeps here stay below 0.0072 s.
    assert np.abs(state.positions - expected).max() < 0.28 * rate**2 * time * 0.0072 / 2
    with opened(problem(plate, spacing, drives=(grip,)), spacing) as session:
        assert session.advance_to(0.1).largest_substep < 0.0072


def test_a_drive_that_grips_late_starts_from_its_own_centre() -> None:
    spacing = 0.25
    grip = Driven(
        region=BoxShape(center=(0.25, 0.25, 0.25), half_extents=(1.0, 1.0, 1.0)), velocity=(1.0, 0, 0), start=0.1
    )
    state = run(problem(box((2, 2, 2), spacing), spacing, drives=(grip,), gravity=(0.0, 0.0, 0.0)), spacing, [0.3, 0.6])
    np.testing.assert_allclose(state.positions[:, 0] - box((2, 2, 2), spacing)[:, 0], 0.5, rtol=1e-10)


@pytest.mark.parametrize("contact", list(ContactCondition))
def test_contact_conditions_on_a_box_floor(contact: ContactCondition) -> None:
    spacing = 0.25
    slab = BoxShape(center=(0.0, 0.0, -1.0), half_extents=(5.0, 5.0, 1.0))
    stiff = Elastic(density=1000.0, youngs_modulus=1e6, poissons_ratio=0.0)
    scene = problem(
        box((2, 2, 2), spacing),
        spacing,
        stiff,
        (1.0, 0.0, 0.0),
        colliders=(Collider(shape=slab, contact=contact),),
    )
    state = run(scene, spacing, [0.3])
    moved = (state.positions - scene.points.reference_positions).mean(axis=0)
    if contact is ContactCondition.STICK:
        # The foot stands; the rest sways about it.
        assert abs(moved[0]) < 0.1
    else:
        np.testing.assert_allclose(moved[0], 0.3, rtol=1e-9)
    assert abs(moved[2]) < 0.01


@pytest.mark.parametrize("contact", [ContactCondition.SLIP, ContactCondition.SEPARATE])
def test_only_separate_lets_go(contact: ContactCondition) -> None:
    spacing = 0.25
    scene = problem(
        box((2, 2, 2), spacing),
        spacing,
        colliders=(Collider(shape=FLOOR, contact=contact),),
        gravity=(0.0, 0.0, 9.81),
    )
    risen = float((run(scene, spacing, [0.4]).positions - scene.points.reference_positions)[:, 2].mean())
    if contact is ContactCondition.SLIP:
        assert risen < 0.1
    else:
        # Free fall upwards, and Euler's own g t dt / 2 of at most 2 %.
        assert risen == pytest.approx(9.81 * 0.4**2 / 2, rel=0.03)


def test_a_ball_inside_a_hollow_sphere_stays_there() -> None:
    spacing = 0.125
    shell = Collider(shape=SphereShape(center=(0.25, 0.25, 0.25), radius=0.6), side=Side.INSIDE)
    scene = problem(box((4, 4, 4), spacing), spacing, colliders=(shell,), velocity=(1.0, 0.3, 0.2))
    state = run(scene, spacing, [0.2, 0.4, 0.6])
    # Contact acts on nodes; matter between them may come a cell beyond.
    assert np.linalg.norm(state.positions - 0.25, axis=1).max() < 0.6 + spacing


def test_domain_policies() -> None:
    spacing = 0.25

    def scene(policy: DomainPolicy) -> PointProblem:
        domain = Domain(lower=(-1.0, -1.0, -0.5), upper=(2.0, 2.0, 2.0), policy=policy)
        return problem(box((2, 2, 2), spacing), spacing, domain=domain)

    expanding = run(scene(DomainPolicy.EXPAND), spacing, [0.6])
    assert expanding.positions[:, 2].max() < -0.5

    with opened(scene(DomainPolicy.STOP), spacing) as session:
        report = session.advance_to(0.6)
        assert report.status is Status.OUT_OF_DOMAIN
        assert re.search(r"16 point\(s\) left the domain, farthest point \d+ at", report.warnings[0])
        # 0.06 m to fall and 0.5 m more: sqrt(2 * 0.5625 / g), and up to twenty substeps until it is seen.
        assert math.sqrt(2 * 0.5625 / 9.81) * 0.9 < session.time < 0.5

    with opened(scene(DomainPolicy.CLAMP), spacing) as session:
        for time in (0.3, 0.6, 0.9):
            assert session.advance_to(time).status is Status.OK
        lowest = session.read(ALL).positions[:, 2].min()
    assert -0.5 <= lowest < -0.25


def test_points_held_at_the_edge_are_reported() -> None:
    spacing = 0.25
    domain = Domain(lower=(-9.0, -9.0, -0.0), upper=(9.0, 9.0, 9.0), policy=DomainPolicy.CLAMP)
    start = np.array([[0.0, 0.0, -0.3], [3.0, 0.0, 3.0]])
    with opened(problem(start, spacing, domain=domain), spacing) as session:
        report = session.advance_to(0.01)
    assert report.warnings == ("1 point(s) were held back at the domain's edge",)


def test_a_point_stopped_short_of_the_edge_is_reported_and_one_that_glides_along_it_is_not() -> None:
    spacing = 0.25
    domain = Domain(lower=(-9.0, -9.0, 0.0), upper=(9.0, 9.0, 9.0), policy=DomainPolicy.CLAMP)
    start = np.array([[0.0, 0.0, 0.5], [3.0, 0.0, 0.1]])
    scene = problem(
        start, spacing, velocity=[[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], gravity=(0.0, 0.0, 0.0), domain=domain
    )
    with opened(scene, spacing) as session:
        report = session.advance_to(1.0)
        lowest = session.read(ALL).positions[0, 2]
    # The wall's nodes reach a cell and a half, and stop it before it gets there.
    assert lowest > 0.0
    assert report.warnings == ("1 point(s) were held back at the domain's edge",)


def test_a_point_brought_back_to_the_edge_goes_no_further_and_glides_on() -> None:
    # The wall's nodes take an eighth of its speed in this one substep, which is four times as long as the way is.
    spacing, lower = 0.25, -1e-3
    domain = Domain(lower=(-9.0, -9.0, lower), upper=(9.0, 9.0, 9.0), policy=DomainPolicy.CLAMP)
    scene = problem(
        np.array([[0.0, 0.0, 0.0]]), spacing, velocity=(1.0, 0.0, -5.0), gravity=(0.0, 0.0, 0.0), domain=domain
    )
    with opened(scene, spacing) as session:
        session.advance_to(1e-3)
        state = session.read(ALL)
    np.testing.assert_allclose(state.positions[0, 2], lower, atol=1e-15)
    assert state.velocities[0, 2] == 0.0
    assert state.velocities[0, 0] == pytest.approx(1.0, rel=1e-12)
