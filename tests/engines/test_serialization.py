"""Values and arrays arrive as they were sent, and what cannot be sent is refused before it is."""

import dataclasses
import enum
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.contract import Collider, EngineAccuracy, HalfSpace, Precision, Snow
from gasp_core.engines.worker.serialization import from_plain, to_plain
from gasp_core.engines.worker.shared_memory import Block

NUMBERS = st.floats(-1e6, 1e6)
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text()
    | st.sampled_from(Precision)
    | st.builds(Path, st.sampled_from(["a", "/b/c.txt", "."]))
    | st.builds(Snow, density=st.floats(1, 1e4), youngs_modulus=st.floats(1, 1e9), poissons_ratio=st.just(0.3)),
    lambda inner: (
        st.tuples(inner, inner)
        | st.lists(inner)
        | st.frozensets(st.integers())
        | st.dictionaries(st.text() | st.integers(), inner)
    ),
)


def sent(value):
    """Through JSON text and shared memory, to the other side."""
    arrays = {}
    text = json.dumps(to_plain(value, arrays))
    block = Block.make()
    try:
        return from_plain(json.loads(text), block.unpack(json.loads(json.dumps(block.pack(arrays)))))
    finally:
        block.close()


@given(VALUES)
def test_values_arrive_as_they_were(value):
    arrived = sent(value)
    assert arrived == value
    assert type(arrived) is type(value)


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(lambda normal: math.hypot(*normal) > 1e-6))
def test_directions_keep_their_last_bit(normal):
    collider = Collider(shape=HalfSpace(point=(0, 0, 0), normal=normal), friction=0.1)
    assert sent(collider) == collider


def test_every_number_there_is():
    arrived = sent((math.inf, -math.inf, math.nan, -0.0, 5e-324, 10**30, np.float32(0.1), np.int64(7)))
    assert arrived[:2] == (math.inf, -math.inf)
    assert math.isnan(arrived[2])
    assert math.copysign(1, arrived[3]) == -1
    assert arrived[4:] == (5e-324, 10**30, float(np.float32(0.1)), 7)


def test_knobs_arrive():
    accuracy = EngineAccuracy(resolution=7, substep=1e-3, spacing=0.1)
    assert sent(accuracy) == accuracy


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 3)),
        np.array(1.5),
        np.arange(12.0).reshape(3, 4).T,
        np.arange(20.0)[::3],
        np.array([True, False]),
        np.arange(5, dtype=np.int32),
        np.array([1 + 2j]),
        np.array(["a", "bcd"]),
        np.array([np.nan, np.inf]),
    ],
)
def test_arrays_arrive_as_they_were(array):
    arrived = sent({"it": array, "again": array})
    for each in arrived.values():
        assert each.dtype == array.dtype
        assert each.shape == array.shape
        assert each.tobytes() == array.tobytes()
        assert each.flags.owndata
        assert each.flags.c_contiguous


@pytest.mark.parametrize("value", [object(), lambda: None, 1j, b"bytes", {"deep": [object()]}, type("Local", (), {})()])
def test_what_cannot_be_sent_is_refused(value):
    with pytest.raises(TypeError, match="cannot be sent to a worker"):
        to_plain(value, {})


def test_classes_that_the_other_side_cannot_find_are_refused():
    @dataclasses.dataclass
    class Inner:
        x: float = 0.0

    class Kind(enum.Enum):
        ONE = 1

    for value in (Inner(), Kind.ONE):
        with pytest.raises(TypeError, match="define it at the top of a module"):
            to_plain(value, {})


def test_nothing_but_dataclasses_and_enums_is_made_of_a_message():
    for address in ("subprocess:Popen", "os:system", "builtins:dict"):
        with pytest.raises(TypeError, match="neither a dataclass nor an enum"):
            from_plain({"dataclass": address, "fields": {}}, {})


def test_a_block_grows_and_is_used_again():
    block = Block.make()
    for count in (10, 100_000, 3):
        array = np.random.default_rng(count).random((count, 3))
        arrived = block.unpack(block.pack({"x": array, "y": array + 1}))
        assert np.array_equal(arrived["x"], array)
        assert np.array_equal(arrived["y"], array + 1)
    with pytest.raises((TypeError, ValueError)):
        block.unpack({"x": ("<f8", [10**9], 0)})
    with pytest.raises(TypeError, match='array "x" of type object'):
        block.pack({"x": np.array([None])})
    block.close()
    block.close()
