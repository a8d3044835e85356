"""How many threads an engine takes when it is not told."""

import pytest

from gasp_core.stepping import threads
from gasp_core.stepping.threads import ThreadOptions


@pytest.mark.parametrize(("points", "expected"), [(1, 1), (2_499, 1), (5_000, 2), (12_500, 5), (10**6, 8)])
def test_as_many_as_there_are_points_for_and_no_more_than_processors(monkeypatch, points, expected):
    monkeypatch.setattr(threads, "processors", lambda: 8)
    assert ThreadOptions().threads_for(points) == expected


def test_what_is_asked_for_counts_but_for_processors(monkeypatch):
    monkeypatch.setattr(threads, "processors", lambda: 4)
    assert ThreadOptions(threads=3).threads_for(1) == 3
    assert ThreadOptions(threads=9).threads_for(1) == 4
