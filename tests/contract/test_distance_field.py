"""Distances on a grid against the formulas they were sampled from."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side, SignedDistanceField, SphereShape
from gasp_core.errors import SceneError

BALL = SphereShape(center=(0.1, -0.2, 0.3), radius=0.5)
CORNERS = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def field_of(shape, spacing=0.05):
    return SignedDistanceField.sampled(shape, *CORNERS, spacing)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_plane_is_interpolated_exactly(seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    plane = HalfSpace(point=tuple(rng.uniform(-0.2, 0.2, 3)), normal=tuple(normal))
    field = field_of(plane)
    # Away from the box that bounds it, where the larger of two distances has a kink.
    places = rng.uniform(-0.4, 0.4, (100, 3))
    places = places[plane.signed_distance(places) > -0.3]
    # Linear functions are what trilinear interpolation keeps; values have 24 bits, and are up to 3 m.
    np.testing.assert_allclose(field.signed_distance(places), plane.signed_distance(places), rtol=0, atol=3 * 2.0**-23)
    rounding = 3 * 2.0**-23 / field.spacing * 2
    np.testing.assert_allclose(field.outward_normal(places), plane.outward_normal(places), rtol=0, atol=rounding)


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.025])
def test_a_ball_is_as_far_as_its_curvature_says(spacing):
    """Linear interpolation of a function of second derivative 1/r is off by h^2 / 8r along each of two directions."""
    places = np.random.default_rng(0).normal(size=(4000, 3))
    places = np.asarray(BALL.center) + places / np.linalg.norm(places, axis=1, keepdims=True) * 0.5
    field = field_of(BALL, spacing)
    nearest = 0.5 - np.sqrt(3) * spacing
    assert np.abs(field.signed_distance(places)).max() <= 2 * spacing**2 / (8 * nearest)
    turn = np.arccos(np.clip(np.sum(field.outward_normal(places) * BALL.outward_normal(places), axis=1), -1, 1))
    # Central differences over h of a function whose third derivative is 1/r^2, and the interpolation's own error.
    assert turn.max() <= spacing**2 / (24 * nearest**2) + 2 * 2 * spacing / (8 * nearest)


def test_beyond_the_grid_the_way_there_is_added():
    field = field_of(BALL)
    far = np.array([[9.0, 0.0, 0.0], [0.0, -7.0, 8.0]])
    found = field.signed_distance(far)
    assert (found >= BALL.signed_distance(far) - 1e-6).all()
    assert (found <= 2 * BALL.signed_distance(far)).all()
    assert field.outward_normal(far)[0] @ [1.0, 0.0, 0.0] > 0.9


def test_where_nothing_slopes_the_normal_points_up():
    values = np.full((5, 5, 5), 1.0)
    values[2, 2, 2] = -1.0
    field = SignedDistanceField(origin=(0, 0, 0), spacing=1.0, values=values)
    np.testing.assert_array_equal(field.outward_normal(np.array([[2.0, 2.0, 2.0]])), [[0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("values", "says"),
    [
        (np.ones((5, 5, 5)), "nothing is inside"),
        (-np.ones((5, 5, 5)), "outermost nodes"),
        (np.ones((5, 1, 5)), "2 nodes along each axis"),
        (np.ones((5, 5)), "has shape"),
        (np.full((5, 5, 5), np.nan), "not finite"),
    ],
)
def test_what_is_no_closed_region_is_refused(values, says):
    with pytest.raises(SceneError, match=says):
        SignedDistanceField(origin=(0, 0, 0), spacing=0.1, values=values)


def test_fields_are_compared_by_their_values():
    one, other = field_of(BALL), field_of(BALL)
    assert one == other and hash(one) == hash(other) and repr(one) == repr(other)
    changed = one.values.copy()
    changed[3, 3, 3] += 1e-3
    different = dataclasses.replace(one, values=changed)
    assert one != different and repr(one) != repr(different)
    assert len(repr(one)) < 200
    assert Collider(shape=one) == Collider(shape=other)


def test_a_region_that_has_no_end_is_cut_off_by_the_box():
    floor = field_of(HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    assert floor.signed_distance(np.array([[0.0, 0.0, -0.5]]))[0] < 0
    assert floor.signed_distance(np.array([[0.0, 0.0, -1.5]]))[0] > 0
    box = field_of(BoxShape(center=(0, 0, 0), half_extents=(0.3, 0.3, 0.3)))
    assert Collider(shape=box, side=Side.INSIDE).shape.signed_distance(np.zeros((1, 3)))[0] == pytest.approx(-0.3)
