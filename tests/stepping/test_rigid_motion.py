"""Prescribed rigid motions against the obvious, and against their own derivatives."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.contract import KeyframedMotion, SteadyMotion
from gasp_core.errors import SceneError
from gasp_core.stepping.rigid_motion import abrupt_times, pose_of, starts_of

NUMBERS = st.floats(-3, 3)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
QUATERNIONS = st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS).filter(lambda q: math.hypot(*q) > 0.1)
PLACES = np.array([[0.3, -0.2, 0.5], [1.0, 2.0, -1.0], [0.0, 0.0, 0.0]])
QUARTER = math.sqrt(0.5)


def placed(pose, places):
    return (places - pose.center) @ pose.rotation.T + pose.place


def keyframed(first, second, turn, other):
    return KeyframedMotion(times=(0.5, 1.5), places=(first, second), quaternions=(turn, other), center=(0.1, 0.2, 0.3))


STEADY = st.builds(SteadyMotion, velocity=VECTORS, angular_velocity=VECTORS, center=VECTORS, start=st.just(0.5))
MOTIONS = st.one_of(STEADY, st.builds(keyframed, VECTORS, VECTORS, QUATERNIONS, QUATERNIONS))


@given(MOTIONS, st.floats(0.6, 1.4))
def test_velocities_are_what_places_change_by(motion, time):
    """Central differences: their error is h^2/6 times the third derivative, at most |w|^3 |r| with |w| < 6, |r| < 8."""
    step = 1e-4
    now, before, after = (pose_of(motion, time + shift) for shift in (0.0, -step, step))
    slope = (placed(after, PLACES) - placed(before, PLACES)) / (2 * step)
    assert np.abs(now.velocities(placed(now, PLACES)) - slope).max() < 1e-5


@given(MOTIONS, st.floats(0, 3))
def test_what_moves_is_where_it_came_from(motion, time):
    pose = pose_of(motion, time)
    assert np.allclose(pose.before(placed(pose, PLACES)), PLACES, atol=1e-12)
    assert np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-13)
    assert np.linalg.det(pose.rotation) > 0


@given(MOTIONS)
def test_before_and_after_it_rests(motion):
    for time in (0.0, 0.4999):
        pose = pose_of(motion, time)
        assert not pose.velocities(PLACES).any()
    assert starts_of(motion) == 0.5
    if isinstance(motion, KeyframedMotion):
        end = pose_of(motion, 1.5)
        assert not end.velocities(PLACES).any()
        assert np.array_equal(end.place, motion.places[1])


def test_a_quarter_turn_about_the_upright_axis():
    motion = KeyframedMotion(
        times=(0.0, 2.0),
        places=((1, 0, 0),) * 2,
        quaternions=((1, 0, 0, 0), (QUARTER, 0, 0, QUARTER)),
        center=(1, 0, 0),
    )
    half = pose_of(motion, 1.0)
    assert np.allclose(half.angular_velocity, [0, 0, math.pi / 4])
    assert np.allclose(placed(half, np.array([2.0, 0, 0])), [1 + QUARTER, QUARTER, 0])
    # From the other side of the four-dimensional sphere it is the same turn.
    other = KeyframedMotion(
        times=(0.0, 2.0), places=((1, 0, 0),) * 2, quaternions=((1, 0, 0, 0), (-2, 0, 0, -2)), center=(1, 0, 0)
    )
    assert np.allclose(pose_of(other, 1.0).rotation, half.rotation)


def test_a_steady_motion_ends():
    motion = SteadyMotion(velocity=(2, 0, 0), start=1.0, end=1.5)
    assert np.allclose(pose_of(motion, 1.25).place, [0.5, 0, 0])
    assert np.allclose(pose_of(motion, 7.0).place, [1, 0, 0])
    assert not pose_of(motion, 1.5).velocity.any()


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        ({"times": ()}, "at least one"),
        ({"times": (0.0, "soon")}, "times: moment 1 must have a number"),
        ({"places": ((0, 0, 0),)}, "as many places"),
        ({"times": (1.0, 1.0)}, "must rise"),
        ({"times": (0.0, math.nan)}, "finite"),
        ({"quaternions": ((1, 0, 0, 0), (0, 0, 0, 0))}, "no rotation"),
        ({"places": ((0, 0), (0, 0, 0))}, "places: moment 0 must have 3 numbers"),
        ({"center": (0, 0, math.inf)}, "center"),
    ],
)
def test_moments_that_are_none_are_refused(change, wanted):
    right = {"times": (0.0, 1.0), "places": ((0, 0, 0),) * 2, "quaternions": ((1, 0, 0, 0),) * 2}
    with pytest.raises(SceneError, match=wanted):
        KeyframedMotion(**{**right, **change})


def test_arrays_are_moments_and_what_is_left_out_stays():
    times = np.linspace(0, 1, 3)
    motion = KeyframedMotion(times=times, center=(0, 0, 1))
    assert motion == KeyframedMotion(
        times=(0.0, 0.5, 1.0), places=((0, 0, 1),) * 3, quaternions=((1, 0, 0, 0),) * 3, center=(0, 0, 1)
    )
    turned = KeyframedMotion(times=times, places=np.ones((3, 3)), quaternions=np.tile([0.0, 1, 0, 0], (3, 1)))
    assert turned.places == ((1.0, 1.0, 1.0),) * 3
    assert turned.quaternions == ((0.0, 1.0, 0.0, 0.0),) * 3
    assert type(turned.times[0]) is float


def test_steps_end_where_something_goes_far_or_turns_far_at_once():
    """A way of more than a given one between two moments: with a tenth of a metre in a tenth of a millisecond no step
    that begins before it may end after it."""
    jump = KeyframedMotion(times=(0.0, 0.1, 0.1001, 0.2), places=((0, 0, 0), (0, 0, 0), (0.1, 0, 0), (0.1, 0, 0)))
    assert abrupt_times(jump, 0.01, 1.0) == [0.1, 0.1001]
    assert abrupt_times(jump, 0.11, 1.0) == []
    turn = KeyframedMotion(times=(0.0, 0.5, 1.0), quaternions=((1, 0, 0, 0), (1, 0, 0, 0.01), (1, 0, 0, 1)))
    assert abrupt_times(turn, 0.1, 1.0) == [0.5, 1.0]
    assert abrupt_times(SteadyMotion(start=0.2, end=0.3), 1.0, 1.0) == [0.2, 0.3]
    assert abrupt_times(SteadyMotion(start=0.2), 1.0, 1.0) == [0.2]


@pytest.mark.parametrize("change", [{"start": -1.0}, {"start": 1.0, "end": 1.0}, {"velocity": (0, 0, math.nan)}])
def test_a_steady_motion_that_is_none_is_refused(change):
    with pytest.raises(SceneError):
        SteadyMotion(**change)
