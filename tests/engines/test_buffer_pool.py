"""Memory is used again once nobody can see it any more, and not a moment before."""

import gc

import numpy as np

from gasp_core.engines.worker.buffer_pool import Recycling

DOUBLE = np.dtype(np.float64)


def place(array):
    return array.__array_interface__["data"][0]


def test_memory_that_somebody_sees_is_not_given_away():
    memory = Recycling()
    first = memory.empty((50, 3), DOUBLE)
    first[...] = 1.0
    seen = [first[10:20].T, first.reshape(-1)[::2], memoryview(first)]
    where = place(first)
    del first
    while seen:
        gc.collect()
        other = memory.empty((50, 3), DOUBLE)
        assert place(other) != where
        other[...] = 2.0
        assert (np.asarray(seen[-1]) == 1.0).all()
        seen.pop()
    del other
    gc.collect()
    taken = [memory.empty((50, 3), DOUBLE) for _ in range(4)]
    assert where in map(place, taken)
    for one in taken:
        for another in taken:
            assert one is another or not np.shares_memory(one, another)


def test_any_shape_and_type_of_the_same_size():
    memory = Recycling()
    array = memory.empty((6, 2), DOUBLE)
    where = place(array)
    del array
    again = memory.empty((12, 2), np.dtype(np.float32))
    assert place(again) == where
    assert again.shape == (12, 2)
    assert again.dtype == np.float32
    assert again.flags.c_contiguous
    assert memory.empty((0, 3), DOUBLE).shape == (0, 3)
    assert memory.empty((), DOUBLE).shape == ()


def test_what_waits_is_bounded():
    memory = Recycling()
    many = [memory.empty((1000,), DOUBLE) for _ in range(50)]
    places = set(map(place, many))
    many.clear()
    (spare,) = memory._spare.values()
    assert len(spare) == 4
    assert {place(piece) for piece in spare} <= places
