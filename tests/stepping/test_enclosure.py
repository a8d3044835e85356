"""What is inside by six rays: against rays followed cell by cell, and bodies whose inside is known."""

import subprocess
import sys

import numpy as np
import pytest

from gasp_core.stepping.enclosure import enclosed


def followed(occupied):
    """The same, every ray on its own."""
    inside = np.zeros_like(occupied)
    for i, j, k in np.argwhere(~occupied):
        rays = (
            *(occupied[:i, j, k], occupied[i + 1 :, j, k]),
            *(occupied[i, :j, k], occupied[i, j + 1 :, k]),
            *(occupied[i, j, :k], occupied[i, j, k + 1 :]),
        )
        inside[i, j, k] = sum(ray.any() for ray in rays) >= 5
    return inside


def box(*open_sides):
    """A hollow box of 6^3 cells with walls of one, without the walls at `open_sides`, pairs of an axis and its end."""
    walls = np.ones((6, 6, 6), dtype=bool)
    walls[1:5, 1:5, 1:5] = False
    for axis, end in open_sides:
        middle = [slice(1, 5)] * 3
        middle[axis] = end
        walls[tuple(middle)] = False
    return walls


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_it_is_what_rays_that_are_followed_say(share):
    occupied = np.random.default_rng(0).random((9, 5, 12)) < share
    kept = occupied.copy()
    found = enclosed(occupied)
    assert 0 < found.sum() < found.size
    assert np.array_equal(found, followed(occupied))
    assert np.array_equal(occupied, kept)


def test_a_closed_box_is_full_and_its_walls_are_not_counted():
    walls = box()
    assert np.array_equal(enclosed(walls), ~walls)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("end", [0, -1])
def test_a_box_with_one_side_open_is_full_whichever_it_is(axis, end):
    inside = enclosed(box((axis, end)))
    assert inside[1:5, 1:5, 1:5].all()
    # And the place of the wall that it has not: rays along it run into the other walls, and one into the one opposite.
    assert inside.sum() == 4 * 4 * 5


def test_a_bowl_that_stood_on_a_table_is_filled_and_a_tube_is_not():
    bowl, tube = box((2, -1)), box((2, 0), (2, -1))
    assert enclosed(bowl).any()
    assert not enclosed(tube).any()


@pytest.mark.parametrize("shape", [(0, 3, 3), (1, 1, 1), (4, 4, 4)])
def test_where_nothing_is_nothing_is_inside(shape):
    assert not enclosed(np.zeros(shape, dtype=bool)).any()


def test_it_needs_numpy_alone():
    """A worker in an environment of its own, with a Python of its own, imports it."""
    code = (
        "import sys, numpy; before = set(sys.modules); import gasp_core.stepping.enclosure;"
        " found = {name.split('.')[0] for name in set(sys.modules) - before};"
        " sys.exit(str(found) if found - set(sys.stdlib_module_names) - {'gasp_core', 'numpy'} else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
