"""Whole numbers and frames of them, there and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gasp_core.moving.bodies import Corrections
from gasp_core.moving.frames import CorrectionReader, CorrectionWriter, FrameReader, FrameWriter
from gasp_core.moving.integers import LARGEST, decoded, encoded
from gasp_core.moving.settling import near_enough

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
    writer, reader = FrameWriter(frames.shape[1:]), FrameReader(frames.shape[1:])
    data = memoryview(b"".join(writer.write(lambda _, frame=frame: frame)[0] for frame in frames))
    for frame in frames:
        found, data = reader.read(data)
        np.testing.assert_array_equal(found, frame)
    assert not len(data)


def test_what_goes_on_as_it_did_costs_nothing():
    """A fall: the second differences of a parabola are one number."""
    rows = np.random.default_rng(0).integers(-500, 500, (400, 3))
    writer = FrameWriter(rows.shape)
    data = [writer.write(lambda _, time=time: rows * time + 7 * time**2)[0] for time in range(6)]
    assert [piece[0] for piece in data[2:]] == [2] * 4
    assert max(len(set(piece[2:])) for piece in data[2:]) <= 2


def test_a_frame_of_frames_that_there_are_not():
    reader = FrameReader((1, 1))
    with pytest.raises(ValueError, match="foretold by frames that there are not"):
        reader.read(memoryview(b"\x01\x01\x00"))


ROWS = st.integers(1, 9).flatmap(
    lambda rows: st.tuples(
        arrays(np.int64, (rows, 3), elements=st.integers(-50, 50)),
        arrays(np.float64, (rows, 3), elements=st.floats(-50, 50)),
        arrays(np.float64, rows, elements=st.sampled_from([0.0, 1.0, 3.0, np.inf])),
    )
)


@given(ROWS)
def test_numbers_near_enough_are_off_by_no_more_than_they_may(rows):
    foretold, wanted, slack = rows
    numbers = near_enough(foretold, wanted, slack)
    off = np.linalg.norm(numbers - wanted, axis=1)
    assert (off <= np.maximum(slack, np.sqrt(3) / 2) * (1 + 1e-12)).all()


def test_what_hardly_moves_stays_as_foretold():
    rng = np.random.default_rng(0)
    foretold = rng.integers(-500, 500, (300, 3))
    wanted = foretold + rng.uniform(-0.49, 0.49, (300, 3))
    wanted[100] += 70
    numbers = near_enough(foretold, wanted, np.full(300, 0.86))
    assert (numbers != foretold).any(axis=1).nonzero()[0].tolist() == [100]


def test_what_moves_as_the_row_above_takes_nothing():
    """A fall: all rows change by as much, whatever their own rounding would be."""
    rng = np.random.default_rng(1)
    foretold = rng.integers(-500, 500, (300, 3))
    numbers = near_enough(foretold, foretold + [0.0, 0.0, -7.2] + rng.uniform(-0.2, 0.2, (300, 3)), np.full(300, 0.86))
    assert len(np.unique(numbers - foretold, axis=0)) == 1


def test_where_any_number_will_do_none_goes_far():
    far = np.array([[2**15 + 5, 0, 0]])
    np.testing.assert_array_equal(near_enough(far, np.array([[2.2, 0.0, 0.0]]), np.array([np.inf])), [[2, 0, 0]])


def corrections(rows, numbers=None):
    given = np.zeros((len(rows), 12), dtype=np.int64) if numbers is None else numbers
    return Corrections(rows=np.array(rows, dtype=np.int64), numbers=given)


def test_corrections_come_back():
    rng = np.random.default_rng(2)
    frames = [
        corrections(np.sort(rng.choice(40, count, False)), rng.integers(-99, 99, (count, 12)))
        for count in (0, 1, 5, 9, 0, 3)
    ]
    writer, reader = CorrectionWriter(40), CorrectionReader(40, 2)
    data = memoryview(b"".join(map(writer.write, frames)) + b"!")
    for wanted in frames:
        found, data = reader.read(data)
        np.testing.assert_array_equal(found.rows, wanted.rows)
        np.testing.assert_array_equal(found.numbers, wanted.numbers)
    assert bytes(data) == b"!"


def test_corrections_that_stay_take_nothing():
    given_once = corrections([3, 4, 30], np.random.default_rng(0).integers(-99, 99, (3, 12)))
    writer = CorrectionWriter(40)
    writer.write(given_once)
    # How many, none of them new, and no difference.
    assert writer.write(given_once) == bytes([3, 0, 0, 0, 0, 0, 0, 0, 1, 1]) + bytes(36)


def in_version_1(given):
    return len(given.rows).to_bytes(4, "little") + encoded(given.rows[:, None]) + encoded(given.numbers)


def test_corrections_of_version_1():
    given = corrections([3, 7], np.arange(24).reshape(2, 12))
    reader = CorrectionReader(40, 1)
    data = memoryview(in_version_1(given) * 2)
    for _ in range(2):
        found, data = reader.read(data)
        np.testing.assert_array_equal(found.rows, given.rows)
        np.testing.assert_array_equal(found.numbers, given.numbers)
    with pytest.raises(ValueError, match="that there is not"):
        CorrectionReader(7, 1).read(memoryview(in_version_1(given)))


@pytest.mark.parametrize("version", [1, 2])
def test_corrections_of_what_is_not_there(version):
    given = corrections([3, 7])
    data = in_version_1(given) if version == 1 else CorrectionWriter(8).write(given)
    with pytest.raises(ValueError, match="more corrections than"):
        CorrectionReader(1, version).read(memoryview(data))
    for length in range(len(data)):
        with pytest.raises(ValueError, match="cut off"):
            CorrectionReader(8, version).read(memoryview(data[:length]))


def test_corrections_of_other_rows_than_there_are():
    data = bytearray(CorrectionWriter(8).write(corrections([3, 7])))
    data[0] = 3
    with pytest.raises(ValueError, match="of other Gaussians"):
        CorrectionReader(8, 2).read(memoryview(bytes(data)))
