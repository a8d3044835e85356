from __future__ import annotations

import numpy as np
import pytest
from gasp_genesis_mpm.grid_window import TooWideError, Window


def cloud(span: float, count: int = 50) -> np.ndarray:
    return np.random.default_rng(0).uniform(-span, span, (count, 3))


@pytest.mark.parametrize("span", [0.0, 3.0, 30.0])
def test_a_window_holds_its_points_with_room(span: float) -> None:
    cells = cloud(span) + [100.3, -7.7, 0.0]
    window = Window.around(cells)
    assert window.holds(cells, 5.0)
    assert window.recentred(cells) is window


def test_points_that_flew_take_the_window_with_them() -> None:
    cells = cloud(4.0)
    window = Window.around(cells)
    flown = cells + [50.0, 0.0, -8.0]
    moved = window.recentred(flown)
    assert moved.holds(flown, 3.0)
    # The same grid elsewhere: nothing has to be built.
    assert moved.half == window.half and moved.shift != window.shift


def test_points_that_spread_are_given_a_larger_one() -> None:
    cells = cloud(4.0)
    window = Window.around(cells).recentred(5 * cells)
    assert window.holds(5 * cells, 3.0)
    assert min(window.half) > max(Window.around(cells).half)


def test_what_no_grid_holds_is_told_by_its_nodes() -> None:
    with pytest.raises(TooWideError, match="grid nodes"):
        Window.around(cloud(2000.0))
