"""What is compiled is what the shapes say themselves."""

from dataclasses import dataclass
from typing import ClassVar

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.contract import SHAPES, BoxShape, HalfSpace, SphereShape
from gasp_core.stepping.signed_distances import distance_at, shape_rows, signed_distances

KINDS = {
    "plane": HalfSpace(point=(0.1, 0.2, -0.3), normal=(0.6, 0.0, 0.8)),
    "box": BoxShape(center=(0.1, -0.2, 0.3), half_extents=(0.5, 0.3, 0.2)),
    "sphere": SphereShape(center=(0.3, 0.0, -0.1), radius=0.4),
}
# Sums of three products of numbers up to a thousand, and a root: a few roundings of the largest, 1e3 * 2^-52 each.
TOLERANCE = {"rtol": 0.0, "atol": 16 * 1e3 * 2.0**-52}


def test_every_kind_of_shape_is_compiled():
    assert KINDS.keys() == SHAPES.keys()


@given(st.integers(0, 2**32 - 1), st.floats(1e-6, 1e3))
def test_distances_are_those_of_the_shapes(seed, reach):
    positions = np.random.default_rng(seed).uniform(-reach, reach, (50, 3))
    found = signed_distances(list(KINDS.values()), positions)
    expected = [shape.signed_distance(positions) for shape in KINDS.values()]
    np.testing.assert_allclose(found, expected, **TOLERANCE)


def test_a_kernel_asks_for_the_distance_at_one_place():
    @numba.njit
    def nearest(rows, place):
        return min([distance_at(rows, row, place[0], place[1], place[2]) for row in range(len(rows))])

    place = np.array([0.9, -0.4, 0.2])
    expected = min(shape.signed_distance(place[None])[0] for shape in KINDS.values())
    assert nearest(shape_rows(list(KINDS.values())), place) == pytest.approx(expected, abs=TOLERANCE["atol"])


def test_no_shapes_and_no_positions_are_none():
    assert signed_distances([], np.zeros((3, 3))).shape == (0, 3)
    assert signed_distances(list(KINDS.values()), np.zeros((0, 3))).shape == (3, 0)


def test_single_precision_is_taken_as_it_is():
    positions = np.random.default_rng(0).random((20, 3)).astype(np.float32)
    found = signed_distances([KINDS["sphere"]], positions)
    np.testing.assert_array_equal(found, signed_distances([KINDS["sphere"]], positions.astype(np.float64)))


def test_an_unknown_kind_is_refused_by_its_name():
    @dataclass(frozen=True)
    class Torus:
        kind: ClassVar[str] = "torus"

    with pytest.raises(TypeError, match='no compiled signed distance is known for a shape of kind "torus"'):
        signed_distances([Torus()], np.zeros((1, 3)))
