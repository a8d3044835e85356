from __future__ import annotations

import numpy as np
from gasp_mujoco_flex.body_mass import Matter
from gasp_mujoco_flex.cage import cage_of

from gasp_core.stepping.voxel_cage import voxel_grid_around


def test_points_are_carried_by_trilinear_weights():
    rng = np.random.default_rng(0)
    places = rng.random((500, 3))
    count = len(places)
    matter = Matter(
        rows=np.arange(count),
        positions=places,
        velocities=np.zeros((count, 3)),
        masses=np.ones(count),
        volumes=np.full(count, 1 / count),
        materials=np.zeros(count, dtype=int),
    )
    cage = cage_of(matter, voxel_grid_around(places, 0.01, 0.3))
    values = rng.normal(size=(len(cage.masses), 3))
    rows = rng.permutation(count).astype(np.int32)
    found, shifted = np.empty((count, 3)), np.empty((count, 3))
    cage.embedding.spread(values, rows, found)
    cage.embedding.carry(values, places, rows, shifted)
    expected = np.empty((count, 3))
    expected[rows] = cage.embedding.weights() @ values
    # A polynomial's coefficients are differences of eight values of about 1.
    np.testing.assert_allclose(found, expected, atol=1e-14)
    np.testing.assert_allclose(shifted, places + expected, atol=1e-14)
