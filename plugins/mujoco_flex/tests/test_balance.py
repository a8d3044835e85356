from __future__ import annotations

import numpy as np
from gasp_mujoco_flex.balance import rigid_share


def test_a_step_leaves_the_momenta_that_it_should():
    rng = np.random.default_rng(0)
    masses, places, before, after, outer = rng.random(20) + 0.1, *rng.normal(size=(4, 20, 3))
    step = 0.3
    velocities = after + rigid_share(masses, places, masses[:, None] * (before - after) + step * outer)
    ends = places + step * velocities
    momenta = masses[:, None] * velocities
    # To the rounding of some hundred terms of about 1.
    np.testing.assert_allclose(momenta.sum(axis=0), (masses[:, None] * before + step * outer).sum(axis=0), atol=1e-12)
    # About the centre of mass of either time.
    turning = np.cross(ends - masses @ ends / masses.sum(), momenta).sum(axis=0)
    arms = places - masses @ places / masses.sum()
    expected = np.cross(arms, masses[:, None] * before + step * outer).sum(axis=0)
    np.testing.assert_allclose(turning, expected, atol=1e-12)
    # It moves them as a rigid body.
    share = rigid_share(masses, places, masses[:, None] * (before - after) + step * outer)
    apart = places[:, None] - places
    assert np.abs(np.einsum("ijk,ijk->ij", apart, share[:, None] - share)).max() <= 1e-12


def test_what_a_step_gives_back_is_damped_as_well():
    rng = np.random.default_rng(1)
    masses, damping, places, before, after = rng.random(20) + 0.1, rng.random(20), *rng.normal(size=(3, 20, 3))
    step = 0.3
    missing = masses[:, None] * (before - after) - step * damping[:, None] * after
    velocities = after + rigid_share(masses + step * damping, places, missing)
    # Nodes damped each at its own rate: what they lost is what their dampers took, of momentum and of spin.
    forces = masses[:, None] * (before - velocities) - step * damping[:, None] * velocities
    # To the rounding of some hundred terms of about 1.
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(places, forces).sum(axis=0), 0.0, atol=1e-12)
