"""Whole numbers and frames of them, there and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gasp_core.moving.bodies import Corrections
from gasp_core.moving.frames import FrameReader, FrameWriter, decoded_corrections, encoded_corrections
from gasp_core.moving.integers import LARGEST, decoded, encoded

HALF = LARGEST // 2 - 1


@given(arrays(np.int64, st.tuples(st.integers(0, 30), st.integers(1, 5)), elements=st.integers(-HALF, HALF)))
def test_numbers_come_back(numbers):
    data = encoded(numbers)
    found, rest = decoded(memoryview(data + b"behind"), *numbers.shape)
    np.testing.assert_array_equal(found, numbers)
    assert bytes(rest) == b"behind"


def test_small_differences_take_one_byte_a_number():
    ramp = np.arange(300)[:, None] * 100 + np.array([[1, 5, 9]])
    assert len(encoded(ramp)) == 1 + 900
    assert len(encoded(ramp * 10)) == 1 + 1800


@pytest.mark.parametrize("numbers", [[[LARGEST]], [[-LARGEST]], [[HALF], [-HALF - 2]]])
def test_numbers_that_are_too_large(numbers):
    with pytest.raises(ValueError, match="too large"):
        encoded(np.array(numbers))


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x05" + bytes(30), b"\x01" + bytes(5), b"\x04" + bytes(23)])
def test_numbers_that_are_cut_off(data):
    with pytest.raises(ValueError, match="cut off"):
        decoded(memoryview(data), 2, 3)


@given(arrays(np.int64, st.tuples(st.integers(1, 6), st.integers(1, 8), st.just(3)), elements=st.integers(-1000, 1000)))
def test_frames_come_back_in_their_order(frames):
    writer, reader = FrameWriter(), FrameReader(frames.shape[1:])
    data = memoryview(b"".join(writer.write(frame) for frame in frames))
    for frame in frames:
        found, data = reader.read(data)
        np.testing.assert_array_equal(found, frame)
    assert not len(data)


def test_what_goes_on_as_it_did_costs_nothing():
    """A fall: the second differences of a parabola are one number."""
    rows = np.random.default_rng(0).integers(-500, 500, (400, 3))
    writer = FrameWriter()
    data = [writer.write(rows * time + 7 * time**2) for time in range(6)]
    assert [piece[0] for piece in data[2:]] == [2] * 4
    assert max(len(set(piece[2:])) for piece in data[2:]) <= 2


def test_a_frame_of_frames_that_there_are_not():
    reader = FrameReader((1, 1))
    with pytest.raises(ValueError, match="foretold by frames that there are not"):
        reader.read(memoryview(b"\x01\x01\x00"))


def test_corrections_come_back():
    rng = np.random.default_rng(2)
    for count in (0, 1, 5):
        given = Corrections(rows=np.sort(rng.choice(40, count, False)), numbers=rng.integers(-99, 99, (count, 12)))
        found, rest = decoded_corrections(memoryview(encoded_corrections(given) + b"!"), 40)
        np.testing.assert_array_equal(found.rows, given.rows)
        np.testing.assert_array_equal(found.numbers, given.numbers)
        assert bytes(rest) == b"!"


def test_corrections_of_what_is_not_there():
    data = encoded_corrections(Corrections(rows=np.array([3, 7]), numbers=np.zeros((2, 12), dtype=np.int64)))
    with pytest.raises(ValueError, match="that there is not"):
        decoded_corrections(memoryview(data), 7)
    with pytest.raises(ValueError, match="more corrections than"):
        decoded_corrections(memoryview(data), 1)
    for length in range(len(data)):
        with pytest.raises(ValueError, match="cut off"):
            decoded_corrections(memoryview(data[:length]), 8)
