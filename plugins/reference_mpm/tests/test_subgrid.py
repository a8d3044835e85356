"""What the grid does not see: it carries no momentum and no spin, and fades by time and not by steps."""

from dataclasses import replace

import numpy as np
import pytest
from gasp_reference_mpm.material_points import Motion, matter_of
from gasp_reference_mpm.subgrid import subgrid_velocities, with_room
from gasp_reference_mpm.transfer import scatter, stencil_around

from gasp_core.contract import Elastic, Fluid, PointCloud, PointProblem, Sand
from gasp_core.stepping.flow import CROWDED_VOLUME_RATIO
from gasp_core.stepping.time_step import rest_bound

SPACING = 0.1
SAND = Sand(density=1600, youngs_modulus=1e6, poissons_ratio=0.2)
WATER = Fluid(density=1000, bulk_modulus=1e5)
JELLY = Elastic(density=1000, youngs_modulus=1e4, poissons_ratio=0.3)


def scene(material, count=200, crowd=1.0):
    """A cloud of matter in disorder, and all that a step knows of it."""
    rng = np.random.default_rng(3)
    positions = 0.5 + 0.3 * rng.random((count, 3)) / crowd
    cloud = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, 0.3**3 / count),
        material_ids=np.zeros(count, int),
        body_ids=np.zeros(count, int),
    )
    matter = matter_of(PointProblem(points=cloud, materials=(material,)), SPACING)
    affine = rng.normal(size=(count, 3, 3))
    motion = Motion(
        positions=positions,
        velocities=rng.normal(size=(count, 3)),
        affine_velocities=affine,
        velocity_gradients=affine,
        deformations=np.tile(np.eye(3), (count, 1, 1)),
        history=np.zeros(count),
        shock_pressures=np.zeros(count),
        tracers=np.zeros((0, 3)),
    )
    stencil = stencil_around(positions, SPACING, cloud.body_ids)
    nothing = np.zeros((count, 3, 3))
    grid = scatter(stencil, SPACING, matter.masses, motion.velocities, motion.affine_velocities, nothing)
    return matter, motion, stencil, grid


def unseen(material, step):
    matter, motion, stencil, grid = scene(material)
    still = np.zeros_like(motion.affine_velocities)
    # Without a velocity gradient nothing falls as it is carried along.
    return matter, motion, *subgrid_velocities(matter, motion, stencil, grid, still, still, SPACING, step)


def test_it_has_no_momentum_and_no_spin():
    matter, motion, velocities, affine = unseen(SAND, 1e-9)
    masses = matter.masses[:, None]
    scale = np.abs(masses * motion.velocities).sum()
    assert np.abs((masses * velocities).sum(axis=0)).max() <= 1e-14 * scale
    # The inertia of a quadratic spline is dx^2/4 along each axis: C = 4/dx^2 B.
    spin = np.cross(motion.positions, masses * velocities).sum(axis=0)
    skew = SPACING**2 / 4 * (matter.masses[:, None, None] * (affine - affine.transpose(0, 2, 1))).sum(axis=0)
    spin += [skew[2, 1], skew[0, 2], skew[1, 0]]
    assert np.abs(spin).max() <= 1e-14 * scale
    assert np.abs(velocities).max() > 0.1  # of points in disorder the grid does see little


@pytest.mark.parametrize("material", [SAND, WATER])
def test_it_fades_by_time(material):
    bound = rest_bound(material, SPACING)
    *_, whole, _ = unseen(material, 1e-12 * bound)
    *_, half, half_affine = unseen(material, 0.5 * bound)
    *_, tenth, _ = unseen(material, 0.1 * bound)
    np.testing.assert_allclose(5 * (whole - tenth), whole - half, atol=1e-9)
    *_, none, none_affine = unseen(material, 100 * bound)
    assert not none.any() and not none_affine.any()
    assert half.any() and half_affine.any()


def test_water_in_one_step_of_its_bound_keeps_what_the_grid_sees():
    *_, velocities, affine = unseen(WATER, rest_bound(WATER, SPACING) * (1 + 1e-12))
    assert not velocities.any() and not affine.any()


def test_elastic_solids_keep_nothing():
    *_, velocities, affine = unseen(JELLY, 1e-9)
    assert velocities.shape == (0, 3) and affine.shape == (0, 3, 3)


@pytest.mark.parametrize(("crowd", "falls"), [(1.0, False), (2.0, True)])
def test_volumes_fall_where_there_is_more_water_than_room(crowd, falls):
    matter, motion, stencil, grid = scene(WATER, crowd=crowd)
    step = 0.5 * rest_bound(WATER, SPACING)
    roomy = with_room(matter, motion, stencil, grid, (), np.zeros(3), SPACING, 0.0, step)
    volumes = np.linalg.det(roomy.deformations)
    assert volumes.max() <= 1 + 1e-12
    assert (volumes.mean() < 0.99) == falls


@pytest.mark.parametrize("start", [1.0, 0.9], ids=["as at rest", "pressed by something else"])
def test_what_is_crowded_at_the_start_is_not_pressed_for_that_beyond_a_twentieth(start):
    """Volume that there is no room for has no energy of its own: no more of it than this much pressure has appears."""
    matter, motion, stencil, grid = scene(WATER, crowd=30.0)
    motion = replace(motion, deformations=np.cbrt(start) * motion.deformations)
    for _ in range(200):
        motion = with_room(
            matter, motion, stencil, grid, (), np.zeros(3), SPACING, 0.0, 0.5 * rest_bound(WATER, SPACING)
        )
    np.testing.assert_allclose(np.linalg.det(motion.deformations), min(start, CROWDED_VOLUME_RATIO), rtol=1e-9)
