"""What an engine takes from a checkpoint, which comes out of a file."""

import numpy as np
import pytest

from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays

SHAPES = {"time": (), "places": (2, 3)}


def test_arrays_are_copies_of_the_type_that_they_were_kept_in():
    places = np.ones((2, 3), dtype=np.float32)
    found = checkpoint_arrays({"time": 0.5, "places": places, "more": np.array("x")}, SHAPES, "mine")
    assert set(found) == set(SHAPES) and found["places"].dtype == np.float32
    places[:] = 2
    assert (found["places"] == 1).all() and found["time"] == 0.5


@pytest.mark.parametrize(
    ("places", "reason"),
    [
        (None, "nothing for places"),
        (np.ones((3, 3)), r"\(3, 3\) for places, expected \(2, 3\)"),
        (np.full((2, 3), "1.0"), "no numbers for places"),
        (np.ones((2, 3), dtype=object), "no numbers for places"),
        (np.full((2, 3), np.nan), "not finite for places"),
        (np.full((2, 3), np.inf), "not finite for places"),
    ],
)
def test_what_is_not_the_engines_own_is_refused(places, reason):
    kept = {"time": 0.0} if places is None else {"time": 0.0, "places": places}
    with pytest.raises(SceneError, match=reason) as caught:
        checkpoint_arrays(kept, SHAPES, "mine")
    assert str(caught.value).startswith("mine: ") and "start the run anew" in str(caught.value)


def test_nan_is_taken_where_it_says_something_and_infinite_never():
    grips = np.array([[np.nan, 0.0, 1.0], [2.0, np.nan, 3.0]])
    found = checkpoint_arrays({"time": 0.0, "places": grips}, SHAPES, "mine", may_be_nan=("places",))
    assert np.array_equal(found["places"], grips, equal_nan=True)
    with pytest.raises(SceneError, match="not finite for places"):
        checkpoint_arrays({"time": 0.0, "places": grips * np.inf}, SHAPES, "mine", may_be_nan=("places",))
    with pytest.raises(SceneError, match="not finite for time"):
        checkpoint_arrays({"time": np.nan, "places": grips}, SHAPES, "mine", may_be_nan=("places",))
