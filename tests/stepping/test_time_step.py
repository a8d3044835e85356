"""The stable step, against the spectral radius of the step itself and against energies that must not grow."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    Driven,
    Elastic,
    EngineAccuracy,
    Fluid,
    Foam,
    HalfSpace,
    Impulse,
    Material,
    Metal,
    NeoHookean,
    Plasticine,
    PointCloud,
    PointProblem,
    Rigid,
    RigidMotion,
    Sand,
    Side,
    Snow,
    SphereShape,
    SteadyMotion,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.mpm import GRADIENT_SHARE, averaged_lame
from gasp_core.stepping.stiffening import fluid_stiffening, hencky_stiffening, snow_stiffening, stiffening
from gasp_core.stepping.time_step import (
    Gust,
    MotionLimits,
    driven_speed,
    event_times,
    gust_of,
    hardening_of,
    refuse_unstable_substep,
    rest_bound,
    substep_size,
    substeps_to,
    viscous_share,
    wall_speed,
)

Array = NDArray[Any]

EVERYWHERE = SphereShape(center=(0.0, 0.0, 0.0), radius=1.0)
moduli = st.floats(1e2, 1e9)
ratios = st.floats(0.0, 0.499)
densities = st.floats(1.0, 2e4)
spacings = st.floats(1e-3, 1e2)


def linear_step(cell: Array, mu: float, lame: float, viscosity: float, density: float, spacing: float, dt: float):
    """One MLS-MPM step of a lone point at `cell` (in cells) as a matrix on (C, L, strain), each (3, 3).

    Scatter and gather are written out node by node: nothing here knows what sum w r r^T is, or sum a a^T / w.
    """
    base = np.floor(cell - 0.5)
    fraction = cell - base
    weights = np.stack([0.5 * (1.5 - fraction) ** 2, 0.75 - (fraction - 1) ** 2, 0.5 * (fraction - 0.5) ** 2])
    slopes = np.stack([fraction - 1.5, 2 - 2 * fraction, fraction - 0.5])
    pulls = (1 - GRADIENT_SHARE) * 4 * weights * (np.arange(3)[:, None] - fraction) + GRADIENT_SHARE * slopes
    volume = 1.0
    columns = []
    for unit in np.eye(27):
        c, gradient, strain = unit.reshape(3, 3, 3)
        rate = gradient + gradient.T - 2 / 3 * np.trace(gradient) * np.eye(3)
        stress = mu * (strain + strain.T) + lame * np.trace(strain) * np.eye(3) + viscosity * rate
        new, gradient = np.zeros((3, 3)), np.zeros((3, 3))
        for node in itertools.product(range(3), repeat=3):
            along = [weights[node[axis], axis] for axis in range(3)]
            weight = math.prod(along)
            if weight == 0:
                continue  # a node just out of reach
            pull = np.array([pulls[node[i], i] * along[(i + 1) % 3] * along[(i + 2) % 3] for i in range(3)]) / spacing
            arm = (np.array(node) - fraction) * spacing
            velocity = c @ arm - dt * volume * stress @ pull / (density * volume * weight)
            new += 4 / spacing**2 * weight * np.outer(velocity, arm)
            gradient += np.outer(velocity, pull)
        columns.append(np.stack([new, gradient, strain + dt * gradient]).ravel())
    return np.array(columns).T


def growth(material: Material, spacing: float, dt: float, cell: Array) -> float:
    mu = getattr(material, "shear_modulus", 0.0)
    lame = material.bulk_modulus if isinstance(material, Fluid) else getattr(material, "lame_lambda", 0.0)
    viscosity = getattr(material, "viscosity", 0.0)
    step = linear_step(cell, mu, lame, viscosity, material.density, spacing, dt)
    return float(np.abs(np.linalg.eigvals(step)).max())


@settings(deadline=None)  # a slow machine is not a failure
@given(modulus=moduli, ratio=ratios, density=densities, spacing=spacings, cell=st.tuples(*[st.floats(0, 1)] * 3))
def test_a_lone_point_is_stable_up_to_the_bound_and_not_beyond(
    modulus: float, ratio: float, density: float, spacing: float, cell: tuple[float, float, float]
) -> None:
    material = Elastic(density=density, youngs_modulus=modulus, poissons_ratio=ratio)
    bound = rest_bound(material, spacing)
    # At rest the radius is one twice over (a rotation is neither stressed nor damped), so rounding shows as its root.
    assert growth(material, spacing, 0.99 * bound, np.array(cell)) <= 1 + 1e-6
    # Between nodes the bound is met; there the stiffest mode has the eigenvalue -1 at it, and 1 % beyond -1.16 (-1.33
    # without the splines' own gradient, -1.08 with nothing else).
    between = np.full(3, 0.5 - 1e-9)
    assert growth(material, spacing, 0.99 * bound, between) <= 1 + 1e-6
    assert growth(material, spacing, 1.01 * bound, between) > 1.1


@settings(deadline=None)  # a slow machine is not a failure
@given(ratio=ratios, modulus=moduli, density=densities, spacing=spacings)
def test_the_bound_of_a_solid_is_the_closed_form(ratio: float, modulus: float, density: float, spacing: float) -> None:
    closed = spacing * math.sqrt(density * (1 - 2 * ratio) / (modulus * (1 + GRADIENT_SHARE**2)))
    solid = {"density": density, "youngs_modulus": modulus, "poissons_ratio": ratio}
    flowing = [kind(**solid, yield_stress=1.0) for kind in (Metal, Plasticine, Foam)]
    for material in [*(kind(**solid) for kind in (Elastic, NeoHookean, Sand, Snow)), *flowing]:
        # 1 - 2 nu cancels near 1/2: eps / (1 - 0.998) and the roundings of both forms.
        assert rest_bound(material, spacing) == pytest.approx(closed, rel=1e-12)


@settings(deadline=None)  # a slow machine is not a failure
@given(ratio=st.floats(-0.95, -0.01))
def test_an_auxetic_solid_is_bound_by_its_shear(ratio: float) -> None:
    material = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=ratio)
    bound = rest_bound(material, 0.1)
    between = np.full(3, 0.5 - 1e-9)
    assert growth(material, 0.1, 0.99 * bound, between) <= 1 + 1e-6
    assert growth(material, 0.1, 1.01 * bound, between) > 1.1


@settings(deadline=None)  # a slow machine is not a failure
@given(bulk=moduli, viscosity=st.floats(0, 1e4), density=densities, spacing=spacings)
def test_a_lone_drop_is_stable_at_the_bound(bulk: float, viscosity: float, density: float, spacing: float) -> None:
    material = Fluid(density=density, bulk_modulus=bulk, viscosity=viscosity)
    for cell in ((0.2, 0.5, 0.9), (0.5 - 1e-9,) * 3):
        assert growth(material, spacing, 0.99 * rest_bound(material, spacing), np.array(cell)) <= 1 + 1e-6


def test_viscosity_alone_sets_the_bound_of_honey() -> None:
    honey = Fluid(density=1400.0, bulk_modulus=1e-3, viscosity=100.0)
    bound = rest_bound(honey, 0.01)
    assert bound == pytest.approx(1400 * 0.01**2 / (4 * 100 * (1 + GRADIENT_SHARE**2)), rel=1e-3)
    assert growth(honey, 0.01, 1.05 * bound, np.full(3, 0.5 - 1e-9)) > 1.05


def test_without_stiffness_there_is_no_bound() -> None:
    assert rest_bound(Rigid(density=1.0), 0.1) == math.inf


def metal(*, density: float, youngs_modulus: float, poissons_ratio: float) -> Material:
    return Metal(
        density=density, youngs_modulus=youngs_modulus, poissons_ratio=poissons_ratio, yield_stress=1.0, hardening=9.0
    )


@pytest.mark.parametrize("kind", [Elastic, NeoHookean, metal])
def test_the_dilation_is_averaged_beyond_a_poissons_ratio_of_two_fifths(kind: Any) -> None:
    for ratio in (-0.5, 0.0, 0.3, 0.4 - 1e-9):
        assert averaged_lame(kind(density=1.0, youngs_modulus=1e5, poissons_ratio=ratio)) == 0.0
    rubber = kind(density=1.0, youngs_modulus=1e5, poissons_ratio=0.499)
    kept = kind(density=1.0, youngs_modulus=1.0, poissons_ratio=0.4)
    # What a point keeps to itself is as hard, beside its shear, as matter of that ratio.
    own = (rubber.lame_lambda - averaged_lame(rubber)) / rubber.shear_modulus
    assert own == pytest.approx(kept.lame_lambda / kept.shear_modulus, rel=1e-9)
    assert averaged_lame(Sand(density=1.0, youngs_modulus=1e5, poissons_ratio=0.499)) == 0.0
    assert averaged_lame(Snow(density=1.0, youngs_modulus=1e5, poissons_ratio=0.499)) == 0.0
    assert averaged_lame(Fluid(density=1.0, bulk_modulus=1e5)) == 0.0


def tangent(law: Any, deformation: Array) -> float:
    """Largest eigenvalue of d tau / d(grad v), by central differences: what a lone point feels of its own C."""
    h = 1e-6
    columns = []
    for unit in np.eye(9).reshape(9, 3, 3):
        columns.append(
            ((law((np.eye(3) + h * unit) @ deformation) - law((np.eye(3) - h * unit) @ deformation)) / (2 * h)).ravel()
        )
    return float(np.linalg.eigvals(np.array(columns).T).real.max())


@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.45])
@settings(deadline=None)
@given(stretches=st.tuples(*[st.floats(0.3, 4.0)] * 3))
def test_stiffening_covers_the_tangent_of_the_fixed_corotated_law(
    ratio: float, stretches: tuple[float, float, float]
) -> None:
    material = Elastic(density=1.0, youngs_modulus=1.0, poissons_ratio=ratio)
    mu, lame = material.shear_modulus, material.lame_lambda

    def law(f: Array) -> Array:
        left, _, right = np.linalg.svd(f)
        volume = np.linalg.det(f)
        return 2 * mu * (f - left @ right) @ f.T + lame * (volume - 1) * volume * np.eye(3)

    deformation = np.diag(stretches)
    at_rest = max(2 * mu, 2 * mu + 3 * lame)
    allowed = at_rest * float(stiffening(deformation[None])[0])
    # Central differences with h = 1e-6 are good to 1e-8 of these numbers.
    assert tangent(law, deformation) <= allowed * (1 + 1e-6)


@pytest.mark.parametrize("ratio", [-0.5, 0.0, 0.3, 0.45])
@settings(deadline=None)
@given(stretches=st.tuples(*[st.floats(0.05, 20.0)] * 3))
def test_stiffening_covers_the_tangent_of_hencky_elasticity(
    ratio: float, stretches: tuple[float, float, float]
) -> None:
    material = metal(density=1.0, youngs_modulus=1.0, poissons_ratio=ratio)
    mu, lame = material.shear_modulus, material.lame_lambda

    def law(f: Array) -> Array:
        left, values, _ = np.linalg.svd(f)
        strains = np.log(values)
        return (left * (2 * mu * strains + lame * strains.sum())) @ left.T

    deformation = np.diag(stretches)
    allowed = max(2 * mu, 2 * mu + 3 * lame) * float(hencky_stiffening(deformation[None])[0])
    # Central differences with h = 1e-6 are good to 1e-8 of these numbers.
    assert tangent(law, deformation) <= allowed * (1 + 1e-6)


def test_hencky_elasticity_is_as_stiff_however_far_it_is_pressed() -> None:
    factors = hencky_stiffening(np.stack([np.eye(3), 0.01 * np.eye(3), 50 * np.eye(3), np.diag([1.0, 1.0, 1e-3])]))
    # Pressed alike on all sides s^3 / |J| is one, but for rounding, of which x has the root: x coth x = 1 + x^2 / 3.
    np.testing.assert_allclose(factors[:3], 1, rtol=1e-12)
    # Flat: x is ln 1000, to which the bound on the largest stretch, sqrt(2) but for a thousandth, adds 3 ln sqrt(2).
    assert factors[3] == pytest.approx(math.log(1e3) + 1.5 * math.log(2), rel=1e-3)
    assert np.isfinite(hencky_stiffening(np.zeros((1, 3, 3)))).all()


def test_snow_stiffens_as_its_law_says_and_its_step_can_always_be_counted() -> None:
    ratios = np.array([1.0, 0.9, 0.5, 1.5, 1e300])
    expected = [1.0, math.exp(0.8), math.exp(4.0), 1.0, 1.0]
    np.testing.assert_allclose(snow_stiffening(np.log(ratios), 8.0), expected, rtol=1e-12)
    # exp(1e6) is no number; what is given instead is beyond any limit of substeps, and its root can be divided by.
    factor = float(snow_stiffening(np.array([-9.0]), 1e6)[0])
    assert 1e60 < factor < 1e100
    assert snow_stiffening(np.array([-9.0, 9.0]), 0.0).tolist() == [1.0, 1.0]


@pytest.mark.parametrize("viscosity", [0.0, 0.5, 50.0])
@given(ratio=st.floats(0.6, 10.0))
def test_stiffening_covers_pressure_and_viscosity_of_a_fluid(viscosity: float, ratio: float) -> None:
    """The rates of both, sqrt(J dtau/dJ) of the pressure, and J times the viscosity's at rest."""
    water, spacing = Fluid(density=1000.0, bulk_modulus=1e5, viscosity=viscosity), 0.02
    at_rest = 1 / rest_bound(replace(water, viscosity=0.0), spacing)
    viscous = 1 / rest_bound(water, spacing) - at_rest
    # tau = -J p: with a = K / 7 it is a (J - J^-6) where J < 1, and nothing beyond.
    tangent = (ratio + 6 * ratio**-6) / 7 if ratio < 1 else 0.0
    rate = at_rest * math.sqrt(tangent) + viscous * ratio
    factor = float(fluid_stiffening(np.array([ratio]), viscous_share(water, spacing))[0])
    allowed = math.sqrt(factor) / rest_bound(water, spacing)
    assert rate <= allowed * (1 + 1e-12)
    # And leaves no more room than a cycle wants: a power of J each way, and what is at rest where it is torn.
    assert allowed <= (at_rest * max(1.0, ratio**-4) + viscous * ratio) * (1 + 1e-12)


def test_steps_are_short_where_snow_hardens_fast() -> None:
    limits = MotionLimits(stress=1.0, speed=0.0, velocity_gradient=2.0, hardening=10.0)
    # In 0.5 / (xi |grad v|) the compression is sqrt(3) / 2 / xi at most.
    assert limits.hardening_time == limits.lasting(1.0) == 0.5 / 20
    assert substep_size(limits, 0.1, EngineAccuracy()) == 0.5 / 20
    assert replace(limits, speed=100.0).lasting(1.0) == 0.01
    assert replace(limits, hardening=0.0).lasting(1.0) == math.inf
    elastic = Elastic(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0)
    snows = [Snow(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0, hardening=xi) for xi in (3.0, 7.0)]
    assert hardening_of(problem_of(elastic, *snows)) == 7.0
    assert hardening_of(problem_of(elastic)) == 0.0


def test_stiffening_is_one_at_rest_and_under_pressure_and_knows_no_rotation() -> None:
    angle = 0.7
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    factors = stiffening(np.stack([np.eye(3), turn, 0.5 * np.eye(3), np.diag([2.0, 1.0, 1.0])]))
    # Stretch 2 along one axis: 2 s^2 - s = 6.
    # At rest the bound is a double root, where rounding shows as its square root: a few 1e-8.
    np.testing.assert_allclose(factors, [1, 1, 1, 6], rtol=1e-6)


@pytest.mark.filterwarnings("ignore:invalid value encountered in det")
def test_stiffening_passes_nan_on() -> None:
    assert np.isnan(stiffening(np.full((1, 3, 3), np.nan))).all()


def problem_of(*materials: Material) -> PointProblem:
    count = len(materials)
    return PointProblem(
        points=PointCloud(
            reference_positions=np.zeros((count, 3)),
            initial_velocities=np.zeros((count, 3)),
            reference_volumes=np.ones(count),
            material_ids=np.arange(count),
            body_ids=np.arange(count),
        ),
        materials=materials,
    )


def test_an_override_above_the_bound_names_bound_and_material() -> None:
    soft = Elastic(density=1000.0, youngs_modulus=1e3, poissons_ratio=0.2)
    hard = Sand(density=1000.0, youngs_modulus=1e7, poissons_ratio=0.2)
    bound = rest_bound(hard, 0.1)
    with pytest.raises(SceneError, match=rf"stable bound {bound:.3g} s \(sand, grid spacing 0.1 m\)"):
        refuse_unstable_substep(problem_of(soft, hard), 0.1, EngineAccuracy(substep=1.01 * bound))
    refuse_unstable_substep(problem_of(soft, hard), 0.1, EngineAccuracy(substep=0.99 * bound))
    refuse_unstable_substep(problem_of(soft), 0.1, EngineAccuracy(substep=1.01 * bound))
    refuse_unstable_substep(problem_of(soft, hard), 0.1, EngineAccuracy())


def test_the_smallest_limit_sets_the_step() -> None:
    accuracy = EngineAccuracy(substep_fraction=0.5)

    def step(stress: float = 1.0, speed: float = 0.0, gradient: float = 0.0) -> float:
        return substep_size(MotionLimits(stress=stress, speed=speed, velocity_gradient=gradient), 0.1, accuracy)

    assert step() == 0.5
    assert step(speed=10.0) == pytest.approx(0.005)
    assert step(gradient=100.0) == pytest.approx(0.002)
    assert step(stress=1e-3, speed=10.0, gradient=100.0) == pytest.approx(5e-4)
    fixed = EngineAccuracy(substep=0.3)
    assert substep_size(MotionLimits(stress=1e-9, speed=1e9, velocity_gradient=1e9), 0.1, fixed) == 0.3


def test_a_flight_is_no_longer_than_speed_and_gravity_allow() -> None:
    still = MotionLimits(stress=1.0, speed=0.0, velocity_gradient=0.0)
    assert still.flight(0.05) == math.inf
    assert replace(still, speed=10.0).flight(0.05) == 0.005
    both = replace(still, speed=10.0, acceleration=400.0)
    time = both.flight(0.05)
    assert 10 * time + 400 * time**2 == pytest.approx(0.05, rel=1e-12)
    # What falls from rest in a single step goes g dt^2.
    falling = replace(still, acceleration=9.81)
    step = substep_size(falling, 0.1, EngineAccuracy())
    assert 9.81 * step**2 == pytest.approx(0.05, rel=1e-12)


def test_stiffening_of_what_was_crushed_to_nothing_is_one() -> None:
    scales = np.array([0.0, 1e-300, 1e-160, 1e-107, 1e-60, 1e-3])
    assert stiffening(scales[:, None, None] * np.eye(3)).tolist() == [1.0] * len(scales)


@settings(deadline=None)  # a slow machine is not a failure
@given(remaining=st.floats(1e-9, 1e3), step=st.floats(1e-9, 1e3))
def test_equal_steps_land_on_the_end(remaining: float, step: float) -> None:
    if remaining / step > 1e6:
        return
    count, size = substeps_to(remaining, step)
    assert count * size == pytest.approx(remaining, rel=1e-15)
    assert size <= step * (1 + 2e-9)
    # Not one more than needed.
    assert count == 1 or remaining / (count - 1) > step * (1 - 1e-8)


def test_round_numbers_make_round_counts() -> None:
    assert substeps_to(0.04, 0.0004)[0] == 100
    assert substeps_to(0.3, 0.1)[0] == 3
    assert substeps_to(1.0, math.inf) == (1, 1.0)


def test_events_are_starts_and_finite_ends_once_each_in_order() -> None:
    drives = [
        Driven(region=EVERYWHERE, start=0.5, end=2.0),
        Impulse(region=EVERYWHERE, start=1.0),
        Driven(region=EVERYWHERE, start=0.5),
    ]
    np.testing.assert_array_equal(event_times(drives, [Wind(end=0.25)]), [0.0, 0.25, 0.5, 1.0, 2.0])
    assert event_times([], []).shape == (0,)


def test_what_a_drive_takes_hold_of_has_its_speed() -> None:
    low, high = np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.0])
    half_space = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    turned = Driven(region=half_space, start=1.0, end=2.0, angular_velocity=(0.0, 0.0, 3.0), center=(0.0, 0.0, 0.0))
    # The farthest corner of the matter, sqrt(5) m away.
    assert driven_speed([turned], 1.0, low, high) == pytest.approx(3 * math.sqrt(5))
    # Before and after it there is none, at its end there is none either.
    assert driven_speed([turned], 0.9, low, high) == driven_speed([turned], 2.0, low, high) == 0.0
    # No part of a ball of half a metre is farther away than that, however large the matter.
    ball = replace(turned, region=SphereShape(center=(0.0, 0.0, 0.0), radius=0.5), velocity=(4.0, 0.0, 0.0))
    assert driven_speed([ball], 1.0, low, high) == pytest.approx(4 + 3 * 0.5)
    # The same one second on: its centre is 4 m away, and nothing in reach of it.
    later = replace(ball, end=3.0)
    assert driven_speed([later], 2.0, low, high) == 0.0
    box = replace(turned, region=BoxShape(center=(0.1, 0.0, 0.0), half_extents=(0.1, 0.1, 0.1)))
    assert driven_speed([box], 1.5, low, high) == pytest.approx(3 * math.sqrt(0.2**2 + 2 * 0.1**2))
    assert driven_speed([box, turned], 1.5, low, high) == pytest.approx(3 * math.sqrt(5))
    assert driven_speed([Impulse(region=half_space, start=1.0)], 1.0, low, high) == 0.0


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_nothing_a_drive_holds_is_faster_than_the_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    center, velocity, spin = rng.uniform(-1, 1, (3, 3))
    region = BoxShape(center=tuple(rng.uniform(-1, 1, 3)), half_extents=tuple(rng.uniform(0.1, 1, 3)))
    drive = Driven(
        region=region, velocity=tuple(velocity), angular_velocity=tuple(spin), center=tuple(center), start=0.0, end=9.0
    )
    # At its start the region is where it is said to be: what is in it and within the box of the matter.
    points = rng.uniform(-2, 2, (200, 3))
    held = points[region.signed_distance(points) <= 0]
    prescribed = np.linalg.norm(velocity + np.cross(spin, held - center), axis=1)
    bound = driven_speed([drive], 0.0, points.min(axis=0), points.max(axis=0))
    assert prescribed.max(initial=0.0) <= bound * (1 + 1e-12)


def test_a_wind_pulls_by_its_drag_and_makes_nothing_faster_than_the_air() -> None:
    winds = [Wind(velocity=(3.0, 0.0, 4.0), drag=2.0, end=1.0), Wind(velocity=(1.0, 0.0, 0.0), drag=1.0, start=0.5)]
    assert (gust_of(winds, 0.75).drag, gust_of(winds, 0.75).speed) == (3.0, 5.0)
    assert (gust_of(winds, 0.25).drag, gust_of(winds, 2.0).speed) == (2.0, 1.0)
    assert gust_of([Wind(velocity=(9.0, 0.0, 0.0), drag=0.0)], 0.0).speed == 0.0
    still = MotionLimits(stress=1.0, speed=0.0, velocity_gradient=0.0)
    # A breeze: what it pulls. A blast: the air is as fast as anything gets, for against its own drag nothing is slow.
    breeze, blast = (replace(still, gust=Gust(drag=drag, speed=30.0)) for drag in (1.0, 1e6))
    assert breeze.flight(0.025) == pytest.approx(math.sqrt(0.025 / 30.0), rel=1e-12)
    assert blast.flight(0.025) == pytest.approx(0.025 / 30.0, rel=1e-12)


@settings(deadline=None)
@given(drag=st.floats(0.01, 1e5), air=st.floats(0.01, 100.0), speed=st.floats(-100.0, 100.0))
def test_nothing_is_blown_farther_than_a_flight(drag: float, air: float, speed: float) -> None:
    limits = MotionLimits(stress=1.0, speed=abs(speed), velocity_gradient=0.0, gust=Gust(drag=drag, speed=air))
    step = limits.flight(0.05)
    # As engines do it, implicitly.
    blown = (speed + step * drag * air) / (1 + step * drag)
    assert abs(blown) * step <= 0.05 * (1 + 1e-9)


def test_a_collider_is_as_fast_as_it_is_where_it_may_meet_matter() -> None:
    low, high = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, 1.0])

    def bound(motion: RigidMotion, **shape: Any) -> float:
        ball = SphereShape(**({"center": (-30.0, 0.5, 0.5), "radius": 0.1} | shape))
        return wall_speed([Collider(shape=ball, motion=motion)], 0.0, low, high, 0.05)

    spin = SteadyMotion(angular_velocity=(0.0, 0.0, 20.0), center=(-30.0, 0.5, 0.5))
    # No part of it goes faster than 2 m/s, and it is 29.9 m off: half a cell in as long as it would take to come.
    assert bound(spin) == pytest.approx(2.0 * 0.025 / 29.9, rel=1e-9)
    assert bound(replace(spin, center=(0.0, 0.5, 0.5)), center=(0.0, 0.5, 0.5)) == pytest.approx(2.0, rel=1e-9)
    comes = SteadyMotion(velocity=(100.0, 0.0, 0.0), center=(-2.1, 0.5, 0.5))
    assert bound(comes, center=(-2.1, 0.5, 0.5)) == pytest.approx(100.0 * 0.025 / 2.0, rel=1e-9)
    # What has no end, and what matter is inside of, are everywhere.
    everywhere = replace(spin, center=(0.0, 0.0, 0.0))
    wide = [
        Collider(shape=HalfSpace(point=(0.0, 0.0, -9.0), normal=(0.0, 0.0, 1.0)), motion=everywhere),
        Collider(shape=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(9.0, 9.0, 9.0)), side=Side.INSIDE, motion=spin),
    ]
    assert wall_speed(wide[:1], 0.0, low, high, 0.05) == pytest.approx(20.0 * math.sqrt(2), rel=1e-9)
    assert wall_speed(wide[1:], 0.0, low, high, 0.05) > 20.0 * 30.0
    assert wall_speed([Collider(shape=EVERYWHERE)], 0.0, low, high, 0.05) == 0.0
