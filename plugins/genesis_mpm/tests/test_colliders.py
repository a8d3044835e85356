from __future__ import annotations

import numpy as np
import pytest
from gasp_genesis_mpm.colliders import walls_of

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side

BOX = BoxShape(center=(1.0, 2.0, 3.0), half_extents=(0.5, 1.0, 1.5))


@pytest.mark.parametrize("shape", [BOX, HalfSpace(point=(0.1, 0.2, 0.3), normal=(1.0, 2.0, 2.0))])
def test_planes_of_a_collider_hold_matter_where_the_collider_does(shape) -> None:
    walls = walls_of([Collider(shape=shape, side=Side.INSIDE, friction=0.3)], 0.1)
    places = np.random.default_rng(0).uniform(-2, 5, (500, 3))
    held = np.max([-(places - wall.place) @ np.array(wall.kind.normal) for wall in walls], axis=0)
    assert np.array_equal(held > 0, shape.signed_distance(places) > 0)
    assert {wall.kind.friction for wall in walls} == {0.3}


def test_an_obstacle_is_a_box_in_cells() -> None:
    (wall,) = walls_of([Collider(shape=BOX)], 0.1)
    assert wall.kind.normal is None
    np.testing.assert_allclose(wall.kind.size, (10.0, 20.0, 30.0), rtol=1e-12)
    assert wall.place.tolist() == [1.0, 2.0, 3.0]
