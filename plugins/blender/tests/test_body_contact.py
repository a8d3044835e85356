"""Elastic bodies that touch each other, or pass through."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core.contract import (
    Collider,
    Elastic,
    Field,
    HalfSpace,
    PointCloud,
    PointProblem,
    Rigid,
)

FLOOR = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))

EVERYTHING = frozenset({Field.POSITIONS, Field.VELOCITIES})

G = 9.81


def fallen(kit, problem, times, **options):
    """Mean fall [m] at each time, and how many substeps it took."""
    start = problem.points.reference_positions
    falls, count = [], 0
    with kit.open(problem, **options) as session:
        for time in times:
            count += session.advance_to(time).substep_count
            falls.append(float((start - session.read(EVERYTHING).positions)[:, 2].mean()))
    return np.array(falls), count


def two_blocks(kit, apart, velocity, materials, density=1.0):
    """Blocks of 3 cells of 0.1 m, the second one `apart` (3,) [m] from the first, flying at `velocity` (3,) [m/s]."""
    points = kit.block((3, 3, 3), 0.1)
    count = len(points)
    cloud = PointCloud(
        reference_positions=np.concatenate([points, points + apart]),
        initial_velocities=np.repeat([[0.0, 0, 0], velocity], count, axis=0),
        reference_volumes=np.full(2 * count, 1.25e-4),
        material_ids=np.repeat([0, len(materials) - 1], count),
        body_ids=np.repeat([0, 1], count),
    )
    return PointProblem(points=cloud, materials=materials, gravity=(0, 0, 0))


def test_bodies_that_pass_through_each_other_are_told(kit):
    rigid = Rigid(density=700.0)
    for materials, options, told in (
        ((kit.rubber,), {}, 0),
        ((rigid,), {}, 0),
        ((kit.rubber, rigid), {}, 1),
    ):
        with kit.open(two_blocks(kit, (1.0, 0, 0), (0, 0, 0), materials), **options) as session:
            assert len(session.advance_to(0.001).warnings) == told
            assert session.advance_to(0.002).warnings == ()


@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.13, 0.07)])
@pytest.mark.parametrize("mach", [0.1, 0.5])
def test_elastic_bodies_collide(kit, aside, mach):
    """Blender's soft bodies leave a gap to each other, or pass through."""
    light = Elastic(density=300.0, youngs_modulus=1e5, poissons_ratio=0.25)
    heavy = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.25)
    speed = mach * 10.0
    problem = two_blocks(kit, (0.35, *aside), (-speed, 0, 0), (light, heavy))
    masses = problem.masses
    start = masses @ problem.points.initial_velocities
    energy = (masses[:, None] * problem.points.initial_velocities**2).sum()
    one, other = np.arange(len(masses)) < len(masses) // 2, np.arange(len(masses)) >= len(masses) // 2
    with kit.open(problem) as session:
        # They meet after 0.05 m, and a wave goes through both and back in 0.06 s.
        for time in np.linspace(0, 0.05 / speed + 0.15, 31)[1:]:
            session.advance_to(float(time))
            state = session.read(EVERYTHING)
            apart = state.positions[other, 0].mean() - state.positions[one, 0].mean()
            # They are 0.3 m long, and lose at most v / c of that each.
            assert apart > 0.3 * (1 - mach)
            # Impulses are equal and opposite; places in float32 of a voxel lose 1e-7 in each of some hundred steps.
            np.testing.assert_allclose(masses @ state.velocities, start, atol=1e-5 * np.abs(start).max())
            assert (masses[:, None] * state.velocities**2).sum() <= 1.001 * energy
    # The light one was struck: it parts from what struck it, with at least a fifth of the speed they met with.
    assert (state.velocities[other] - state.velocities[one])[:, 0].mean() > 0.2 * speed


def test_what_starts_on_another_body_rests_on_it_and_what_starts_inside_is_told(kit):
    for lift, told in ((0.3, 0), (0.15, 1)):
        problem = two_blocks(
            kit, (0, 0, lift), (0, 0, 0), (Elastic(density=1000.0, youngs_modulus=1e6, poissons_ratio=0),)
        )
        points = problem.points
        floored = PointProblem(points=points, materials=problem.materials, colliders=(Collider(shape=FLOOR),))
        with kit.open(floored) as session:
            report = session.advance_to(0.3)
            fallen = (points.reference_positions - session.read(EVERYTHING).positions)[:, 2]
        assert len(report.warnings) == told
        if not told:
            # Of a column of 0.6 m on a floor, rho g H^2 / 2E = 1.8 mm at rest and twice that as it swings.
            assert fallen.max() < 2.5 * 1000 * G * 0.6**2 / 2e6
