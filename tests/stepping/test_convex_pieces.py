from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from gasp_core.contract import BoxShape, SignedDistanceField, SphereShape
from gasp_core.stepping.convex_pieces import convex_pieces, convex_walls

H = 0.05
BALL = SphereShape(center=(0.1, 0.2, 0.3), radius=0.5)


class Union:
    def __init__(self, *shapes):
        self.shapes = shapes

    def signed_distance(self, places):
        return np.min([shape.signed_distance(places) for shape in self.shapes], axis=0)


CORNER = Union(
    BoxShape(center=(0.0, 0.0, 0.5), half_extents=(0.12, 0.12, 0.62)),
    BoxShape(center=(0.5, 0.0, 0.0), half_extents=(0.62, 0.12, 0.12)),
)


def sampled(shape, low=(-1.0, -1.0, -1.0), high=(1.3, 1.3, 1.3)):
    return SignedDistanceField.sampled(shape, low, high, H)


def held(pieces, places):
    """Which places are in one of the pieces, by Qhull."""
    found = np.zeros(len(places), dtype=bool)
    for piece in pieces:
        equations = ConvexHull(piece).equations
        found |= (places @ equations[:, :3].T + equations[:, 3] <= 1e-9).all(axis=1)
    return found


def places(count=20_000):
    return np.random.default_rng(0).uniform(-1, 1.3, size=(count, 3))


def test_a_convex_body_is_one_piece_with_the_surface_for_its_corners():
    (piece,) = convex_pieces(sampled(BALL), 64)
    # Distances are interpolated along an edge of the grid: off by H^2 / 8 R where they curve the most.
    assert np.abs(BALL.signed_distance(piece)).max() <= H**2 / (8 * 0.5) + 1e-6


def test_pieces_hold_the_body_and_go_beyond_it_by_a_spacing():
    field = sampled(CORNER)
    pieces = convex_pieces(field, 64)
    assert 2 <= len(pieces) < 64
    inside = held(pieces, places())
    distances = field.signed_distance(places())
    # Between the nodes of a cell that the surface crosses, trilinear interpolation may round a corner off.
    assert inside[distances < -H / 2].all()
    # Nodes are asked, no place between them: half a cell's diagonal farther.
    assert distances[inside].max() <= H + np.sqrt(3) / 2 * H


def test_what_stands_apart_stays_apart():
    balls = [SphereShape(center=(x, 0.0, 0.0), radius=0.3) for x in (-0.5, 0.5)]
    pieces = convex_pieces(sampled(Union(*balls)), 64)
    assert len(pieces) == 2
    assert not held(pieces, np.zeros((1, 3)))


@pytest.mark.parametrize("most", [1, 2, 5])
def test_there_are_no_more_pieces_than_asked_for_and_the_body_lies_in_them(most):
    field = sampled(CORNER)
    pieces = convex_pieces(field, most)
    assert len(pieces) <= most
    assert held(pieces, places())[field.signed_distance(places()) < -H / 2].all()


def test_walls_leave_the_body_free_and_reach_out():
    field = sampled(BALL, (-0.4, -0.3, -0.2), (0.6, 0.7, 0.8))
    pieces = convex_walls(field, 0.7, 256)
    assert len(pieces) < 256
    asked = places()
    inside, distances = held(pieces, asked), BALL.signed_distance(asked)
    assert not inside[distances < -(1 + np.sqrt(3) / 2) * H].any()
    assert inside[distances > H / 2].all()


def test_the_same_pieces_come_out_of_a_body_elsewhere_and_in_another_unit():
    one = sampled(CORNER)
    moved = SignedDistanceField(
        origin=tuple(4 * np.array(one.origin) + 8.0), spacing=4 * one.spacing, values=4 * one.values
    )
    first, second = convex_pieces(one, 64), convex_pieces(moved, 64)
    assert len(first) == len(second)
    # Places are rounded once.
    assert max(np.abs(4 * a + 8 - b).max() for a, b in zip(first, second)) < 1e-14 * 16
