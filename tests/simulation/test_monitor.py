from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gasp_core import Driven, Elastic, Fluid, Impulse, Pinned, SphereShape, Wind
from gasp_core.contract import PointCloud, PointProblem, PointState, Rigid, Sand, Status
from gasp_core.simulation.driving import drive_speed, work_starts
from gasp_core.simulation.monitor import (
    FASTER_THAN_SOUND,
    excess_displacement,
    flattened,
    inspect,
    kinetic_energy,
    non_finite_rows,
    outrun_sound,
    released_potential,
    sound_speed,
    stretched_out,
    watch_over,
)
from gasp_core.stepping.body_faces import BodyFaces

JELLY = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
WATER = Fluid(density=1000.0, bulk_modulus=1e5)
STEP = 0.04
EVERYWHERE = SphereShape(center=(0, 0, 0), radius=100)


def cloud(positions, velocity=(0.0, 0.0, 0.0)):
    count = len(positions)
    return PointCloud(
        reference_positions=positions,
        initial_velocities=np.tile(velocity, (count, 1)),
        reference_volumes=np.full(count, 1 / count),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )


def problem(material=JELLY, velocity=(0.0, 0.0, 0.0), drives=(), fields=(), gravity=(0.0, 0.0, -9.81)):
    rng = np.random.default_rng(0)
    points = cloud(rng.uniform(size=(500, 3)), velocity)
    return PointProblem(points=points, materials=(material,), drives=drives, force_fields=fields, gravity=gravity)


def flown(problem, time):
    """The state of free flight, exactly."""
    gravity = np.asarray(problem.gravity)
    start, velocity = problem.points.reference_positions, problem.points.initial_velocities
    return PointState(
        time=time,
        positions=start + velocity * time + gravity * time**2 / 2,
        velocities=velocity + gravity * time,
        deformation_gradients=np.tile(np.eye(3), (len(start), 1, 1)),
    )


def changed(state, **arrays):
    return dataclasses.replace(state, **arrays)


def verdict(problem, before, now):
    return inspect(watch_over(problem, STEP), before, now)


@pytest.mark.parametrize("velocity", [(0, 0, 0), (0, 0, 10), (300, 0, 50)])
@pytest.mark.parametrize("gravity", [(0, 0, 0), (0, 0, -9.81), (0, 0, -1e4)])
def test_free_flight_is_fine_however_fast(velocity, gravity):
    case = problem(velocity=velocity, gravity=gravity)
    for frame in range(1, 20):
        found = verdict(case, flown(case, (frame - 1) * STEP), flown(case, frame * STEP))
        assert found.status is Status.OK, found.reason


def test_a_bounce_is_fine():
    case = problem(velocity=(0, 0, -5))
    before, now = flown(case, STEP), flown(case, 2 * STEP)
    now = changed(now, velocities=now.velocities * [1, 1, -0.95])
    assert verdict(case, before, now).status is Status.OK


def test_one_bad_number_is_enough():
    case = problem()
    before, now = flown(case, 0.0), flown(case, STEP)
    for name in ("positions", "velocities"):
        for bad in (np.nan, np.inf):
            array = np.array(getattr(now, name))
            array[7, 1] = bad
            found = verdict(case, before, changed(now, **{name: array}))
            assert found.status is Status.NON_FINITE
            assert "1 of 500 points" in found.reason and "first 7" in found.reason


def test_energy_from_nowhere():
    """KE may be 1.05 of what there was and what gravity released: 1.02 in speed passes, 1.03 does not."""
    case = problem(velocity=(20, 0, 0))
    before, now = flown(case, STEP), flown(case, 2 * STEP)
    assert verdict(case, before, changed(now, velocities=now.velocities * 1.02)).status is Status.OK
    found = verdict(case, before, changed(now, velocities=now.velocities * 1.03))
    assert found.status is Status.ENERGY_GREW
    assert "J" in found.reason


def test_rounding_of_matter_at_rest_is_no_energy():
    case = problem(gravity=(0, 0, 0))
    before, now = flown(case, 0.0), flown(case, STEP)
    noise = np.random.default_rng(0).normal(size=now.velocities.shape) * 1e-6
    assert verdict(case, before, changed(now, velocities=noise)).status is Status.OK
    assert verdict(case, before, changed(now, velocities=noise * 1e5)).status is Status.ENERGY_GREW


@pytest.mark.parametrize(
    ("drives", "fields", "start"),
    [
        ((Pinned(region=EVERYWHERE),), (), math.inf),
        ((Driven(region=EVERYWHERE, start=0.5, velocity=(1, 0, 0)),), (), 0.5),
        ((Impulse(region=EVERYWHERE, start=0.25),), (Wind(start=0.75),), 0.25),
        ((), (Wind(),), 0.0),
        ((), (), math.inf),
    ],
)
def test_energy_is_not_minded_once_something_does_work(drives, fields, start):
    case = problem(velocity=(1, 0, 0), drives=drives, fields=fields)
    assert work_starts(case) == start
    for time in (0.2, 1.0):
        before, now = flown(case, time - STEP), flown(case, time)
        found = verdict(case, before, changed(now, velocities=now.velocities * 2))
        assert (found.status is Status.ENERGY_GREW) == (time <= start)


def test_a_jump_that_no_speed_explains():
    case = problem(velocity=(50, 0, 0))
    before, now = flown(case, STEP), flown(case, 2 * STEP)
    for distance, status in ((0.5, Status.OK), (3.0, Status.NOT_CONVERGED)):  # the diagonal is sqrt(3)
        positions = np.array(now.positions)
        positions[11] -= [0, distance, 0]
        found = verdict(case, before, changed(now, positions=positions))
        # Along y, so that the flight of 2 m along x does not hide it: hypot(2, 3) - 2 = 1.6.
        assert found.status is status, found.reason


def test_a_driven_part_may_go_as_far_as_it_is_driven():
    drive = Driven(region=EVERYWHERE, velocity=(100, 0, 0), end=0.03)
    case = problem(drives=(drive,))
    before = flown(case, 0.0)
    now = changed(before, time=STEP, positions=before.positions + [3.0, 0, 0])
    assert verdict(case, before, now).status is Status.OK
    assert drive_speed(case, STEP, STEP, 1.0) == 100
    assert drive_speed(case, 10 * STEP, STEP, 1.0) == 0
    assert verdict(problem(), before, now).status is Status.NOT_CONVERGED
    struck = problem(drives=(Impulse(region=EVERYWHERE, start=0.02),))
    assert drive_speed(struck, STEP, STEP, 1.0) == math.inf
    assert drive_speed(struck, 3 * STEP, STEP, 1.0) == 0


def test_excess_is_what_speed_and_gravity_leave_over():
    case = problem(velocity=(3, 0, 0))
    before, now = flown(case, 0.0), flown(case, STEP)
    assert (excess_displacement(before, now, case.gravity, 0.0) <= 0).all()
    away = changed(now, positions=now.positions + [5, 0, 0])
    allowance = np.linalg.norm(now.velocities[0]) * STEP + 9.81 * STEP**2
    expected = np.linalg.norm(away.positions[0] - before.positions[0]) - allowance
    np.testing.assert_allclose(excess_displacement(before, away, case.gravity, 0.0), expected, rtol=1e-12)


def test_volume_ratios_of_elastic_points():
    case = problem()
    before, now = flown(case, 0.0), flown(case, STEP)
    for count, status in ((4, Status.OK), (6, Status.NOT_CONVERGED)):  # a hundredth of 500 is 5
        gradients = np.array(now.deformation_gradients)
        gradients[:count] *= 3.0
        gradients[-1, 0, 0] = -1.0
        found = verdict(case, before, changed(now, deformation_gradients=gradients))
        assert (found.stretched, found.inverted) == (count + 1, 1)
        assert found.status is (status if count + 1 <= 5 else Status.NOT_CONVERGED)
    gradients = np.array(now.deformation_gradients)
    gradients[:4] *= 3.0
    gradients[4:10] *= 0.1
    assert verdict(case, before, changed(now, deformation_gradients=gradients)).status is Status.CRUSHED
    water = problem(material=WATER)
    found = verdict(water, before, changed(now, deformation_gradients=gradients))
    assert (found.status, found.stretched) == (Status.OK, 0)


def test_a_body_that_stays_flat_is_crushed_whatever_its_gradients_say():
    case = problem()
    before, now = flown(case, 0.0), flown(case, STEP)
    pressed = changed(now, positions=now.positions * [1, 1, 0.015], velocities=None, deformation_gradients=None)
    assert verdict(case, before, pressed).status is Status.OK
    later = changed(pressed, time=2 * STEP)
    found = verdict(case, pressed, later)
    assert found.status is Status.CRUSHED
    assert "body 0 is pressed flat: it is 0.01" in found.reason
    thicker = changed(later, positions=now.positions * [1, 1, 0.03])
    assert verdict(case, pressed, thicker).status is Status.OK
    # A rod that coils up has its thickness still; water has none to lose.
    assert not flattened(watch_over(problem(material=WATER), STEP), pressed.positions)


def test_a_sheet_that_falls_down_flat_is_whole():
    """It was bent at first: a cape."""
    rng = np.random.default_rng(2)
    case = dataclasses.replace(problem(), points=cloud(rng.uniform(size=(500, 3))))
    sheet = dataclasses.replace(case, hints=(BodyFaces(body=0, faces=(np.arange(500)[:, None] + np.arange(3)) % 500),))
    flat = case.points.reference_positions * [1, 1, 0]
    assert flattened(watch_over(case, STEP), flat)
    assert not flattened(watch_over(sheet, STEP), flat)


def test_a_rod_that_coils_up_is_not_flat():
    along = np.linspace(0, 2 * np.pi, 400)
    rng = np.random.default_rng(1)
    across = rng.uniform(-0.05, 0.05, (400, 2))
    rod = np.column_stack([along, across])
    ring = np.column_stack([(1 + across[:, 0]) * np.cos(along), (1 + across[:, 0]) * np.sin(along), across[:, 1]])
    case = problem()
    watch = watch_over(dataclasses.replace(case, points=cloud(rod)), STEP)
    assert watch.thicknesses[0] == pytest.approx(0.1, rel=0.1)
    assert not flattened(watch, ring)


def test_how_far_away_a_body_is_does_not_decide_whether_it_is_a_plane():
    case = problem()
    away = np.array(case.points.reference_positions) + [5000.0, 0.0, 0.0]
    here, there = (watch_over(each, STEP) for each in (case, dataclasses.replace(case, points=cloud(away))))
    np.testing.assert_allclose(there.thicknesses, here.thicknesses, rtol=1e-9)


def test_what_is_a_plane_at_the_start_has_no_thickness_to_lose():
    case = problem()
    plane = np.array(case.points.reference_positions)
    plane[:, 2] = 0.3
    assert np.isinf(watch_over(dataclasses.replace(case, points=cloud(plane)), STEP).thicknesses).all()


def test_stretch_counts_what_is_not_a_number():
    determinants = np.array([1.0, 0.05, 20.0, 0.04, 21.0, np.nan, -1.0])
    assert np.array_equal(stretched_out(determinants, np.ones(7, dtype=bool)), [0, 0, 0, 1, 1, 1, 1])
    assert not stretched_out(determinants, np.zeros(7, dtype=bool)).any()


def test_without_velocities_only_positions_are_judged():
    case = problem()
    before, now = (changed(flown(case, time), velocities=None, deformation_gradients=None) for time in (0.0, STEP))
    found = verdict(case, before, changed(now, positions=now.positions + 50))
    assert (found.status, found.kinetic_energy, found.inverted) == (Status.OK, None, None)


def test_energies():
    case = problem(velocity=(3, 4, 0))
    # 1000 kg in all; sums of 500 doubles.
    np.testing.assert_allclose(kinetic_energy(case.masses, case.points.initial_velocities), 12500, rtol=1e-12)
    dropped = np.tile([0, 0, -2.0], (500, 1))
    np.testing.assert_allclose(released_potential(case.masses, case.gravity, dropped), 19620, rtol=1e-12)
    assert kinetic_energy(case.masses, np.full((500, 3), 1e200)) == math.inf


def test_rows():
    a, b = np.zeros((4, 3)), np.zeros((4, 3, 3))
    a[2, 1], b[0, 2, 2] = np.nan, -np.inf
    assert np.array_equal(non_finite_rows(a, None, b), [0, 2])
    assert len(non_finite_rows(None)) == 0


def test_sound_goes_by_the_modulus_and_the_density():
    assert sound_speed(JELLY) == 10.0
    assert sound_speed(Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2)) == 25.0
    assert sound_speed(Fluid(density=1000.0, bulk_modulus=2.25e9)) == 1500.0
    assert sound_speed(Rigid(density=1.0)) == math.inf


def outran(problem, before, now):
    return outrun_sound(watch_over(problem, STEP), before, now, ["thing"])


def test_matter_that_outruns_its_sound_is_told_with_what_helps():
    case = problem(velocity=(12.0, 16.0, 0.0), gravity=(0, 0, 0))
    said = outran(case, flown(case, 0.0), flown(case, STEP))
    assert FASTER_THAN_SOUND in said and "\n" not in said
    assert 'object "thing" goes at 20 m/s' in said
    assert "elastic: sqrt(E/rho) = 10 m/s" in said
    assert "youngs_modulus above rho v^2 = 4e+05 Pa" in said
    water = problem(material=WATER, velocity=(0.0, 0.0, -20.0), gravity=(0, 0, 0))
    said = outran(water, flown(water, 0.0), flown(water, STEP))
    assert "fluid: sqrt(K/rho) = 10 m/s" in said and "bulk_modulus above rho v^2 = 4e+05 Pa" in said


def test_matter_at_its_speed_of_sound_and_what_has_none_are_not_told():
    slow = problem(velocity=(9.999, 0.0, 0.0), gravity=(0, 0, 0))
    assert outran(slow, flown(slow, 0.0), flown(slow, STEP)) == ""
    rigid = problem(material=Rigid(density=1000.0), velocity=(1e4, 0.0, 0.0))
    assert outran(rigid, flown(rigid, 0.0), flown(rigid, STEP)) == ""


def test_one_point_within_a_frame_is_enough_whatever_shows_it():
    case = problem(gravity=(0, 0, 0))
    before, now = flown(case, 0.0), flown(case, STEP)
    struck = np.array(now.velocities)
    struck[17] = [0.0, -11.0, 0.0]
    # At either end of a frame: what is stopped within it was fast before.
    assert "11 m/s" in outran(case, before, changed(now, velocities=struck))
    assert "11 m/s" in outran(case, changed(before, velocities=struck), now)
    # An engine that shows no velocities: by the way gone.
    moved = np.array(now.positions)
    moved[17, 1] -= 11.0 * STEP
    silent = [changed(state, velocities=None) for state in (before, changed(now, positions=moved))]
    assert "11 m/s" in outran(case, *silent)
    # Two looks at one time have no way between them.
    assert outran(case, silent[0], changed(silent[0])) == ""


def test_of_two_materials_the_one_that_outruns_its_own_sound_is_named():
    case = problem(velocity=(12.0, 0.0, 0.0), gravity=(0, 0, 0))
    ids = np.arange(500) % 2
    points = dataclasses.replace(case.points, material_ids=ids, body_ids=ids)
    stiff = dataclasses.replace(JELLY, youngs_modulus=1e9)
    case = dataclasses.replace(case, points=points, materials=(stiff, JELLY))
    said = outrun_sound(watch_over(case, STEP), flown(case, 0.0), flown(case, STEP), ["plate", "cake"])
    assert 'object "cake" goes at 12 m/s' in said
