"""The laws as Genesis evaluates them, against their closed forms.

A point that nothing is near makes one oscillator with itself: a substep takes its affine velocity C to
C - 4 dt V tau / (m dx^2). So C tells tau, for any F that a checkpoint hands over.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_core.contract import (
    Elastic,
    EngineAccuracy,
    Fluid,
    Material,
    Metal,
    NeoHookean,
    PointCloud,
    PointProblem,
    Precision,
    Sand,
    Snow,
)

Array = NDArray[Any]

SPACING = 0.1
APART = 4
"""In cells: splines of two points do not meet within three."""
COUNT = 9
SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}
STEP = 1e-5
EPS = float(np.finfo(np.float32).eps)


def eigen(deformations: Array) -> tuple[Array, Array]:
    """Squares of the principal stretches (N, 3) and axes (N, 3, 3) of F F^T."""
    return np.linalg.eigh(deformations @ deformations.transpose(0, 2, 1))


def spectral(axes: Array, values: Array) -> Array:
    return np.einsum("nij,nj,nkj->nik", axes, values, axes)


def corotated(deformations: Array, material: Any) -> Array:
    squares, axes = eigen(deformations)
    stretches = np.sqrt(squares)
    ratio = stretches.prod(axis=1, keepdims=True)
    pressure = material.lame_lambda * ratio * (ratio - 1)
    return spectral(axes, 2 * material.shear_modulus * (squares - stretches) + pressure)


def hencky(strains: Array, axes: Array, material: Any) -> Array:
    trace = strains.sum(axis=1, keepdims=True)
    return spectral(axes, 2 * material.shear_modulus * strains + material.lame_lambda * trace)


def neo_hookean(deformations: Array, _: Array, material: Any) -> Array:
    squares, axes = eigen(deformations)
    volume = material.lame_lambda * np.log(squares).sum(axis=1, keepdims=True) / 2
    return spectral(axes, material.shear_modulus * (squares - 1) + volume)


def snow(deformations: Array, ratios: Array, material: Any) -> Array:
    """The stretches kept in their box, the stiffness that of the J_P there was."""
    left, stretches, right = np.linalg.svd(deformations)
    kept = np.clip(stretches, 1 - material.critical_compression, 1 + material.critical_stretch)
    stiffer = np.exp(material.hardening * (1 - ratios))
    return stiffer[:, None, None] * corotated((left * kept[:, None, :]) @ right, material)


def slip_of(deformations: Array, plastic: Array, material: Any) -> Array:
    """By how much (N,) the deviator of the logarithmic strain has to be shorter."""
    strains = np.log(eigen(deformations)[0]) / 2
    length = np.linalg.norm(strains - strains.mean(axis=1, keepdims=True), axis=1)
    mu, hardening = material.shear_modulus, material.hardening
    over = 2 * mu * length - math.sqrt(2 / 3) * (material.yield_stress + hardening * plastic)
    return np.maximum(over, 0) / (2 * mu + 2 / 3 * hardening)


def metal(deformations: Array, plastic: Array, material: Any) -> Array:
    """Radial return along the deviator, to sqrt(3/2) |dev tau| = Y + H p after it."""
    squares, axes = eigen(deformations)
    strains = np.log(squares) / 2
    mean = strains.mean(axis=1, keepdims=True)
    length = np.linalg.norm(strains - mean, axis=1)
    slip = slip_of(deformations, plastic, material)
    return hencky(mean + (strains - mean) * (1 - slip / length)[:, None], axes, material)


def sand(deformations: Array, _: Array, material: Any) -> Array:
    """Pressed evenly alone, it is within its cone."""
    squares, axes = eigen(deformations)
    return hencky(np.log(squares) / 2, axes, material)


def fluid(deformations: Array, _: Array, material: Any) -> Array:
    ratio = np.linalg.det(deformations)
    pressure = np.maximum(0.0, material.bulk_modulus / 7 * (ratio**-7 - 1))
    return -(ratio * pressure)[:, None, None] * np.eye(3)


def any_deformation(draw: np.random.Generator) -> Array:
    return np.eye(3) + 0.1 * draw.uniform(-1, 1, (COUNT, 3, 3))


def even_deformation(draw: np.random.Generator) -> Array:
    return np.linspace(0.9, 1.1, COUNT)[:, None, None] * np.eye(3)


def pressed_evenly(draw: np.random.Generator) -> Array:
    return np.linspace(0.9, 0.99, COUNT)[:, None, None] * np.eye(3)


def after_a_substep(
    engine: Any, material: Material, deformations: Array, history: Array | None, affine: Array
) -> Mapping[str, Array]:
    """Checkpoint of points that had F, Genesis' Jp and C (N, 3, 3) [1/s] a substep ago."""
    places = APART * SPACING * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:COUNT]
    volume = (SPACING / 2) ** 3
    points = PointCloud(
        reference_positions=places + [0.012, -0.031, 0.02],
        initial_velocities=np.zeros((COUNT, 3)),
        reference_volumes=np.full(COUNT, volume),
        material_ids=np.zeros(COUNT),
        body_ids=np.arange(COUNT),
    )
    problem = PointProblem(points=points, materials=(material,), gravity=(0.0, 0.0, 0.0))

    def opened(restart: Any) -> Any:
        return engine.open(
            problem,
            device="cpu",
            precision=Precision.FLOAT32,
            seed=0,
            accuracy=EngineAccuracy(spacing=SPACING, substep=STEP),
            restart=restart,
        )

    with opened(None) as session:
        state = dict(session.checkpoint())
    state |= {"deformations": deformations, "affine_velocities": affine}
    if history is not None:
        state["history"] = history
    with opened(state) as session:
        assert session.advance_to(STEP).substep_count == 1
        return session.checkpoint()


def found_stress(
    engine: Any, material: Material, deformations: Array, history: Array | None, affine: Array
) -> tuple[Array, float]:
    """tau (N, 3, 3) [Pa], and what rounding may do to it; parameters as above."""
    after = after_a_substep(engine, material, deformations, history, affine)["affine_velocities"]
    scale = material.density * SPACING**2 / (4 * STEP)
    # C is the sum of 27 products of weights and velocities, of which each is one of momenta over masses.
    return -scale * (after - affine), 30 * EPS * scale * float(np.abs(after).max())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("material", "deformation", "history", "law"),
    [
        (Elastic(**SOLID), any_deformation, None, lambda F, _, own: corotated(F, own)),
        (NeoHookean(**SOLID), any_deformation, None, neo_hookean),
        (Sand(**SOLID), pressed_evenly, 0.0, sand),
        (Fluid(density=1000.0, bulk_modulus=1e5), even_deformation, None, fluid),
        (Snow(**SOLID, critical_compression=0.05, critical_stretch=0.04), any_deformation, 0.95, snow),
        (Snow(**SOLID, critical_compression=0.05, critical_stretch=0.04, hardening=3.0), any_deformation, 1.05, snow),
        (Metal(**SOLID, yield_stress=5e3), any_deformation, 0.3, metal),
        (Metal(**SOLID, yield_stress=5e3, hardening=4e4), any_deformation, 0.02, metal),
        (Metal(**SOLID, yield_stress=1e6, hardening=4e4), any_deformation, 0.0, metal),
    ],
)
def test_stress_is_that_of_the_law(
    engine: Any,
    material: Material,
    deformation: Callable[[np.random.Generator], Array],
    history: float | None,
    law: Callable[[Array, Array, Any], Array],
) -> None:
    deformations = deformation(np.random.default_rng(7))
    remembered = np.full(COUNT, 1.0 if history is None else history)
    found, rounding = found_stress(
        engine, material, deformations, None if history is None else remembered, np.zeros((COUNT, 3, 3))
    )
    exact = law(deformations, remembered, material)
    # Stretches are known to a few roundings each, and moduli turn them into stress; snow's by as much more as it
    # hardened.
    modulus = getattr(material, "bulk_modulus", None) or 2 * SOLID["youngs_modulus"]
    assert np.abs(found - exact).max() <= rounding + 30 * EPS * modulus
    # That there was something to find.
    assert np.abs(exact).max() > 1e3 * (rounding + 30 * EPS * modulus)


def test_a_fluid_resists_the_rate_of_shear_alone(engine: Any) -> None:
    """tau = eta J (L + L^T - 2/3 tr L I), where it bears no pressure, in a flow that turns, shears and spreads."""
    honey = Fluid(density=1000.0, bulk_modulus=1e4, viscosity=2000.0)
    ratio = 1.2
    rates = 300.0 * np.random.default_rng(8).uniform(-1, 1, (COUNT, 3, 3))
    deformations = np.cbrt(ratio) * np.tile(np.eye(3), (COUNT, 1, 1))
    found, rounding = found_stress(engine, honey, deformations, None, rates)
    spread = np.trace(rates, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    exact = ratio * honey.viscosity * (rates + rates.transpose(0, 2, 1) - 2 / 3 * spread)
    # The strain of a substep is a difference of numbers near 1, and eta / dt turns it into stress.
    assert np.abs(found - exact).max() <= rounding + 4 * EPS * honey.viscosity / STEP
    assert np.abs(exact).max() > 1e3 * (rounding + 4 * EPS * honey.viscosity / STEP)


@pytest.mark.thorough
def test_metal_remembers_what_it_flowed(engine: Any) -> None:
    """The equivalent plastic strain that brings it back to its yield stress, and none where it is below."""
    plastic = np.full(COUNT, 0.02)
    deformations = any_deformation(np.random.default_rng(7))
    deformations[0] = np.eye(3)
    hard = Metal(**SOLID, yield_stress=5e3, hardening=4e4)
    remembered = after_a_substep(engine, hard, deformations, plastic, np.zeros((COUNT, 3, 3)))["history"]
    exact = plastic + math.sqrt(2 / 3) * slip_of(deformations, plastic, hard)
    np.testing.assert_allclose(remembered, exact, rtol=0, atol=30 * EPS)
    assert exact[0] == plastic[0] and np.all(exact[1:] > plastic[1:])
