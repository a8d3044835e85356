"""How far bodies give way, against integrals of the beam and the bar and against a stepped bar."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

from gasp_core.contract import (
    BoxShape,
    Collider,
    Driven,
    Elastic,
    Fluid,
    HalfSpace,
    Impulse,
    Metal,
    PointCloud,
    PointProblem,
    Rigid,
    Sand,
    Side,
    Snow,
    SphereShape,
    Wind,
)
from gasp_core.simulation.deflection import UNSEEN, Load, drop_height, load_of, meeting_speed, softened

DENSITY, GRAVITY, LENGTH = 7850.0, 9.81, 0.4
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
SOLID = {"density": DENSITY, "youngs_modulus": 2e11, "poissons_ratio": 0.3}


def load(thickness=LENGTH, speed=0.0):
    return Load(length=LENGTH, thickness=thickness, gravity=GRAVITY, speed=speed)


def block(*, low=(0.0, 0.0, 0.0), sides=(0.4, 0.4, 0.4), cells=4, body=0, velocity=(0.0, 0.0, 0.0)):
    """Columns of points that fill a box, each in the middle of its part."""
    axes = [start + (np.arange(cells) + 0.5) * side / cells for start, side in zip(low, sides)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(places)
    return {
        "reference_positions": places,
        "initial_velocities": np.tile(velocity, (count, 1)),
        "reference_volumes": np.full(count, math.prod(sides) / count),
        "material_ids": np.zeros(count),
        "body_ids": np.full(count, body),
    }


def problem(*blocks, **rest):
    joined = {name: np.concatenate([each[name] for each in blocks]) for name in blocks[0]}
    return PointProblem(points=PointCloud(**joined), materials=(Elastic(**SOLID),), **rest)


# --- closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [0.4, 0.1, 0.02])
def test_a_beam_sags_as_its_curvature_integrates(thickness):
    modulus, width, steps = 1e9, 0.07, 20_000
    # E I w'' = M, M = q (L - x)^2 / 2, twice by the midpoint rule, whose error is of the order of 1 / steps^2.
    step = LENGTH / steps
    middles = (np.arange(steps) + 0.5) * step
    line_load = DENSITY * GRAVITY * thickness * width
    curvature = line_load * (LENGTH - middles) ** 2 / 2 / (modulus * width * thickness**3 / 12)
    tip = float(np.sum(curvature * (LENGTH - middles)) * step)
    assert load(thickness).sag(DENSITY, modulus) == pytest.approx(tip / LENGTH, rel=1e-6)


def test_a_column_that_is_as_stiff_as_is_asked_sags_by_less_than_a_thousandth():
    modulus = load().least_modulus(DENSITY)
    # rho g L^2 / (2 E): the strain at each height integrated.
    steps = 10_000
    heights = (np.arange(steps) + 0.5) * LENGTH / steps
    shortened = float(np.sum(DENSITY * GRAVITY * (LENGTH - heights) / modulus) * LENGTH / steps)
    assert shortened == pytest.approx(DENSITY * GRAVITY * LENGTH**2 / (2 * modulus), rel=1e-9)
    foot = DENSITY * GRAVITY * LENGTH / modulus
    assert shortened / LENGTH < foot < UNSEEN
    # A cube held at one side is what it was asked for, and sags three times as far as the column.
    assert load().sag(DENSITY, modulus) == pytest.approx(UNSEEN) == pytest.approx(3 * shortened / LENGTH)


def test_a_bar_that_is_stopped_is_shortened_by_the_ratio_of_speed_and_sound():
    """A row of masses and springs flies against a wall with its first mass; v / c of its length is the closed form."""
    modulus, speed, count = 1e8, 3.0, 400
    sound = math.sqrt(modulus / DENSITY)
    spacing = LENGTH / count
    step = 0.2 * spacing / sound
    places, velocities = np.zeros(count), np.full(count, -speed)
    velocities[0] = 0.0
    shortest = 0.0
    for _ in range(round(1.2 * LENGTH / sound / step)):
        pull = modulus * np.diff(places) / spacing
        forces = np.append(pull, 0.0) - np.append(0.0, pull)
        velocities[1:] += step * forces[1:] / (DENSITY * spacing)
        places += step * velocities
        shortest = min(shortest, float(places[-1]))
    # The front of the wave is a few springs wide, and rings by some of them in 400.
    assert -shortest / LENGTH == pytest.approx(speed / sound, rel=0.02)
    assert -shortest / LENGTH < load(speed=speed).recoil(DENSITY, modulus)


@pytest.mark.parametrize("thickness", [0.2, 0.05])
def test_a_beam_whose_root_is_stopped_goes_no_farther_than_said_and_nearly_so(thickness):
    modulus, speed, cells = 1e9, 2.0, 60
    h = LENGTH / cells
    inertia = thickness**3 / 12  # of a width of 1 m
    # Hermite elements of Euler and Bernoulli.
    stiffness, mass = np.zeros((2 * cells + 2,) * 2), np.zeros((2 * cells + 2,) * 2)
    bend = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]]
    bend += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    move = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]]
    move += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    for cell in range(cells):
        rows = np.s_[2 * cell : 2 * cell + 4]
        stiffness[rows, rows] += modulus * inertia / h**3 * np.array(bend)
        mass[rows, rows] += DENSITY * thickness * h / 420 * np.array(move)
    squares, shapes = eigh(stiffness[2:, 2:], mass[2:, 2:])
    start = np.zeros(2 * cells)
    start[::2] = speed
    rates = np.sqrt(squares)
    amplitudes = shapes[-2] * (shapes.T @ mass[2:, 2:] @ start) / rates
    times = np.linspace(0, 3 * 2 * math.pi / rates[0], 6000)
    farthest = float(np.abs(np.sin(np.outer(times, rates)) @ amplitudes).max()) / LENGTH
    said = load(thickness, speed).recoil(DENSITY, modulus)
    # The first mode alone has 1.54 of sqrt(3) = 1.73, and is at its end some time.
    assert 1.54 / math.sqrt(3) * said < farthest < said


def test_the_least_modulus_is_that_of_the_worse_load():
    standing, flying = load(0.1), load(0.1, speed=2.0)
    weight = 1.5 * 16 * DENSITY * GRAVITY * LENGTH / UNSEEN
    blow = 3 * 16 * DENSITY * 4.0 / UNSEEN**2
    assert standing.least_modulus(DENSITY) == pytest.approx(weight)
    assert flying.least_modulus(DENSITY) == pytest.approx(max(weight, blow)) == pytest.approx(blow)
    assert flying.recoil(DENSITY, blow) == pytest.approx(UNSEEN)
    assert load(0.1, speed=1e-3).least_modulus(DENSITY) == pytest.approx(weight)


# --- softer ---------------------------------------------------------------------------------------------------------


def test_softer_matter_has_two_digits_and_is_stiff_enough():
    softer = softened(Elastic(**SOLID, name="steel"), load())
    assert softer.name == "steel"
    least = load().least_modulus(DENSITY)
    assert least <= softer.youngs_modulus <= 1.1 * least
    assert softer.youngs_modulus == float(f"{softer.youngs_modulus:.1e}")
    # What has two digits already stays.
    exact = Load(length=1.0, thickness=1.0, gravity=2.0)
    assert softened(Elastic(density=1000, youngs_modulus=1e9, poissons_ratio=0), exact).youngs_modulus == 3e6


def test_what_is_no_stiffer_than_it_has_to_be_has_nothing_softer():
    least = load(speed=2.0).least_modulus(DENSITY)
    assert softened(Elastic(density=DENSITY, youngs_modulus=0.9 * least, poissons_ratio=0.3), load(speed=2.0)) is None
    assert softened(Rigid(density=DENSITY), load()) is None
    # Its strength would fall with its stiffness.
    assert softened(Snow(**SOLID), load()) is None
    # Nothing pulls at it, and nothing stops it: there is no least.
    assert softened(Elastic(**SOLID), Load(length=1.0, thickness=1.0, gravity=0.0)) is None


def test_what_yields_springs_back_by_no_more_than_a_thousandth():
    metal = Metal(**SOLID, yield_stress=2.5e8)
    # sqrt(3) rho c v is below the yield stress at 1 m/s and above it at 10 m/s.
    assert softened(metal, load(speed=0.1)).youngs_modulus == softened(Elastic(**SOLID), load(speed=0.1)).youngs_modulus
    assert softened(metal, load(speed=10)) is None
    lead = Metal(**SOLID, yield_stress=1e7)
    assert load().stress(DENSITY, 2e11) < 1e7 < load(speed=1).stress(DENSITY, 2e11)
    assert softened(lead, load(0.4, speed=0.3)).youngs_modulus == max(1e10, 2.2e9)


def test_heaps_do_not_bend():
    sand = Sand(**SOLID)
    assert softened(sand, load(0.01)) == softened(sand, load())


def test_a_fluid_is_so_stiff_that_its_density_changes_by_a_hundredth():
    water = Fluid(density=1000, bulk_modulus=2.2e9)
    # v^2 / c^2, and 2 rho g L / K, are a hundredth.
    assert softened(water, Load(length=0.5, thickness=0.5, gravity=10)).bulk_modulus == 1e6
    assert softened(water, Load(length=0.5, thickness=0.5, gravity=0, speed=3)).bulk_modulus == 9e5


# --- loads of a scene -----------------------------------------------------------------------------------------------


def test_a_body_is_as_thick_as_its_matter_over_its_two_longest_sides():
    beam = problem(block(sides=(0.4, 0.1, 0.02), cells=8))
    found = load_of(beam, 0, 0.5)
    # Points are in the middle of their parts: the box around them is an eighth shorter.
    assert found.length == pytest.approx(0.35)
    assert found.thickness == pytest.approx(0.4 * 0.1 * 0.02 / (0.35 * 0.0875))
    assert (found.gravity, found.speed) == (9.81, 0.5)
    one = problem(block(cells=1))
    assert load_of(one, 0, 0.0).slenderness == 1.0


@pytest.mark.parametrize(
    ("collider", "height"),
    [
        (FLOOR, 0.45),
        (Collider(shape=HalfSpace(point=(0, 0, 0.1), normal=(0, 1, 2))), None),
        (Collider(shape=BoxShape(center=(0.15, 0.15, -1), half_extents=(0.01, 0.01, 1.2))), 0.25),
        (Collider(shape=SphereShape(center=(0.15, 0.15, 0), radius=0.2)), 0.25),
        (Collider(shape=BoxShape(center=(0, 0, 0), half_extents=(9, 9, 9)), side=Side.INSIDE), 9.45),
        (Collider(shape=BoxShape(center=(5, 0, 0), half_extents=(1, 1, 9))), math.inf),
        (Collider(shape=HalfSpace(point=(0, 0, 3), normal=(0, 0, 1))), 0.0),
    ],
)
def test_a_body_falls_to_the_first_collider_below_it(collider, height):
    falling = problem(block(low=(0, 0, 0.45)), colliders=(collider,))
    if height is None:
        # The slope is at z = 0.1 - y / 2, and met first by the lowest points that are farthest up it, at z = 0.5,
        # y = 0.05. Along gravity a ball of radius 0.05 meets it sooner, by its radius over the cosine of the slope.
        height = 0.5 - (0.1 - 0.05 / 2) - 0.05 * math.sqrt(5) / 2
    # It has touched within a thousandth of its size.
    assert drop_height(falling, 0) == pytest.approx(height, abs=2e-3)


def test_matter_meets_a_floor_at_the_speed_of_its_fall():
    fall = block(low=(0, 0, 0.45), velocity=(0, 3.0, 0))
    v = math.hypot(3.0, math.sqrt(2 * 9.81 * 0.45))
    assert meeting_speed(problem(fall, colliders=(FLOOR,)), 5.0) == pytest.approx(v, rel=1e-3)
    # The scene is over before it is there.
    assert meeting_speed(problem(fall, colliders=(FLOOR,)), 0.01) == pytest.approx(3.0 + 9.81 * 0.01)
    # Nothing is there to be met.
    assert meeting_speed(problem(fall), 5.0) == 0.0
    # Another body may be.
    two = problem(fall, block(low=(2, 0, 0.45), body=1))
    assert meeting_speed(two, 0.5) == pytest.approx(3.0 + 9.81 * 0.5)
    weightless = problem(fall, colliders=(FLOOR,), gravity=(0, 0, 0))
    assert meeting_speed(weightless, 5.0) == pytest.approx(3.0)


def test_what_drives_and_winds_give_counts():
    everywhere = BoxShape(center=(0, 0, 0), half_extents=(9, 9, 9))
    still = block()
    mass = DENSITY * 0.4**3

    def speed(**acting):
        return meeting_speed(problem(still, gravity=(0, 0, 0), **acting), 1.0)

    assert speed(drives=(Driven(region=everywhere, velocity=(0, 3, 4)),)) == pytest.approx(5.0)
    assert speed(drives=(Driven(region=everywhere, angular_velocity=(0, 0, 2)),)) == pytest.approx(2 * 0.3)
    assert speed(drives=(Impulse(region=everywhere, impulse=(0, 0, 7 * mass)),)) == pytest.approx(7.0)
    nowhere = SphereShape(center=(50, 0, 0), radius=1)
    assert speed(drives=(Impulse(region=nowhere, impulse=(0, 0, 7 * mass)),)) == 0.0
    assert speed(force_fields=(Wind(velocity=(6, 0, 8)),), colliders=(FLOOR,)) == pytest.approx(10.0)
