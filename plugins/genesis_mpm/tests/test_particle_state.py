from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gasp_genesis_mpm.affine_velocities import seeded_affine_velocities
from gasp_genesis_mpm.particle_state import PARTICLE_VOLUME, TICK, Motion, Units
from gasp_genesis_mpm.stiffness_groups import portions_of

from gasp_core.contract import Elastic, Fluid, PointCloud, PointProblem, Sand

COUNT = 40
MATERIALS = (
    Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
    Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2),
)
HONEY = Fluid(density=1300.0, bulk_modulus=1e5, viscosity=10.0)


@pytest.fixture
def problem() -> PointProblem:
    generator = np.random.default_rng(3)
    points = PointCloud(
        reference_positions=generator.random((COUNT, 3)),
        initial_velocities=generator.normal(size=(COUNT, 3)),
        reference_volumes=generator.choice([1e-6, 3e-6], COUNT),
        material_ids=generator.integers(0, 2, COUNT),
        body_ids=np.zeros(COUNT),
    )
    return PointProblem(points=points, materials=MATERIALS)


@pytest.fixture
def units(problem: PointProblem) -> Units:
    return Units(spacing=0.05, portions=portions_of(problem), masses=problem.masses)


def some_motion() -> Motion:
    generator = np.random.default_rng(4)
    return Motion(
        cells=generator.normal(size=(COUNT, 3)),
        velocities=generator.normal(size=(COUNT, 3)),
        affine_velocities=generator.normal(size=(COUNT, 3, 3)),
        deformations=np.eye(3) + 0.1 * generator.normal(size=(COUNT, 3, 3)),
        history=generator.random(COUNT),
    )


def test_numbers_say_what_the_motion_says(units: Units) -> None:
    motion, shift, step = some_motion(), np.array([3.0, -2.0, 1.0]), 1e-4
    back = units.motion(units.numbers(motion, shift, step), shift, step)
    for name in ("cells", "velocities", "affine_velocities", "deformations", "history"):
        # A handful of roundings each.
        np.testing.assert_allclose(getattr(back, name), getattr(motion, name), rtol=0, atol=1e-14)


def test_a_substep_of_genesis_is_a_substep_of_ours(units: Units, problem: PointProblem) -> None:
    """Velocity, gravity and stress of its numbers, in cells a substep, are those of SI."""
    step, spacing = 2e-4, 0.05
    numbers = units.numbers(some_motion(), np.zeros(3), step)
    moved = TICK * numbers.positions * 0 + TICK * numbers.velocities
    np.testing.assert_allclose(moved, some_motion().velocities[units.order] * step / spacing, rtol=1e-14)
    fall = TICK**2 * np.array(units.scaled_gravity((1.0, -2.0, -9.81), step))
    np.testing.assert_allclose(fall, np.array([1.0, -2.0, -9.81]) * step**2 / spacing, rtol=1e-14)
    # What a stress of a thousandth of the modulus does to the point itself, in cells a substep.
    masses = units.scaled_masses(step)
    first = 0
    for portion, law in zip(units.portions, units.laws()):
        rows = slice(first, first + len(portion.rows))
        modulus = dict(law.parameters)["E"]
        found = TICK * TICK * PARTICLE_VOLUME * 4e-3 * modulus / masses[rows]
        tension = 1e-3 * portion.material.youngs_modulus
        exact = step**2 * portion.volume * 4 * tension / (problem.masses[portion.rows] * spacing**2)
        np.testing.assert_allclose(found, exact, rtol=1e-13)
        first += len(portion.rows)


def test_the_first_strain_of_genesis_lands_on_the_deformation_given(units: Units) -> None:
    motion, step = some_motion(), 0.05
    numbers = units.numbers(motion, np.zeros(3), step)
    strained = (np.eye(3) + TICK * numbers.affine_velocities) @ numbers.deformations
    np.testing.assert_allclose(strained, motion.deformations[units.order], rtol=0, atol=1e-13)


def test_a_fluid_keeps_its_volume_from_one_substep_to_another_of_another_size(problem: PointProblem) -> None:
    """And nothing of its shape; its viscosity goes with the substep, so that none is compiled."""
    fluid = replace(problem, materials=(HONEY, MATERIALS[1]))
    units = Units(spacing=0.05, portions=portions_of(fluid), masses=fluid.masses)
    flows = np.isin(np.arange(COUNT), np.flatnonzero(problem.points.material_ids == 0))
    motion = some_motion()
    ratios = np.linalg.det(motion.deformations[flows])
    for step in (1e-4, 3e-3):
        numbers = units.numbers(motion, np.zeros(3), step)
        rows = flows[units.order]
        assert np.array_equal(numbers.deformations[rows], np.tile(np.eye(3), (rows.sum(), 1, 1)))
        motion = units.motion(numbers, np.zeros(3), step)
        np.testing.assert_allclose(
            motion.deformations[flows], np.cbrt(ratios)[:, None, None] * np.eye(3), rtol=0, atol=1e-14
        )
        assert np.array_equal(units.actuations(step)[~rows], np.zeros((~rows).sum()))
        np.testing.assert_allclose(units.actuations(step)[rows] * step, 1e-4, rtol=1e-14)


def test_an_affine_field_is_seeded_with_its_gradient() -> None:
    generator = np.random.default_rng(5)
    axis = (np.arange(12) + 0.5) / 2
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = cells + generator.uniform(-0.1, 0.1, cells.shape)
    gradient = generator.normal(size=(3, 3))
    found = seeded_affine_velocities(cells, np.ones(len(cells)), cells @ gradient.T + [1.0, 2.0, 3.0])
    # 0.6 a pass, 16 passes, of what is missing near the surface: no more than the gradient itself.
    assert np.abs(found - gradient).max() <= 0.6**16 * np.linalg.norm(gradient) + 1e-12
    assert not seeded_affine_velocities(cells, np.ones(len(cells)), np.ones_like(cells)).any()
