"""Edges of bodies whose surfels lie smooth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, label

from gasp_core.solid.creases import sharpened
from gasp_core.solid.grid import Grid

DETAIL = 0.1
GRID = Grid(origin=np.full(3, -0.5), spacing=0.05, shape=(21, 21, 21))


def edge(noise=0.0):
    """Surfels (N, 3) of the quadrant x < 0, z < 0 about an edge along y, and their outward normals."""
    rng = np.random.default_rng(0)
    places, normals = rng.uniform(-1, 1, (2, 4_000, 3)), np.zeros((2, 4_000, 3))
    for side, axis in enumerate((0, 2)):
        places[side, :, 2 - axis] = -np.abs(places[side, :, 2 - axis])
        places[side, :, axis] = noise * rng.normal(size=4_000)
        normals[side, :, axis] = 1
    return places.reshape(-1, 3), normals.reshape(-1, 3)


def quadrant():
    """Depth of the nodes in it, with an edge, and rounded off as a smoothed field is."""
    x, _, z = np.meshgrid(*(GRID.origin[:, None] + GRID.spacing * np.arange(21)), indexing="ij")
    exact = np.minimum(-x, -z)
    return exact, gaussian_filter(exact, 0.7 * DETAIL / GRID.spacing, mode="nearest")


@pytest.mark.parametrize("sign", [1, -1], ids=["outward", "inward"])
def test_an_edge_of_two_planes_is_sharp(sign):
    means, normals = edge()
    exact, rounded = (sign * field for field in quadrant())
    beside = np.abs(exact) < 0.5 * DETAIL
    beside[:, [0, 1, -2, -1]] = False
    found = sharpened(rounded, GRID, means, sign * normals, DETAIL)
    # Surfels are a hundredth apart: nodes nearer to the edge than that may see one plane only.
    assert np.abs(found - exact)[beside].max() < 0.02 < np.abs(rounded - exact)[beside].max()
    far = np.abs(rounded) >= 1.5 * DETAIL
    assert np.array_equal(found[far], rounded[far])


def test_fuzz_changes_nothing():
    means, normals = edge(noise=0.2 * DETAIL)
    _, rounded = quadrant()
    assert np.mean(sharpened(rounded, GRID, means, normals, DETAIL) != rounded) < 0.01


@pytest.mark.parametrize("scatter", [0.5, 1.0])
def test_fuzz_that_faces_every_way_cuts_off_no_specks(scatter):
    """As on a capture: a surfel that no other faces like lies on its own plane, and that says nothing."""
    means, normals = edge(noise=0.2 * DETAIL)
    scattered = normals + scatter * np.random.default_rng(1).normal(size=normals.shape)
    scattered /= np.linalg.norm(scattered, axis=1, keepdims=True)
    _, rounded = quadrant()
    found = sharpened(rounded, GRID, means, scattered, DETAIL)
    # Matter and air were one part each, and are.
    assert [label(side)[1] for side in (found > 0, found <= 0)] == [1, 1]
    assert np.mean(found != rounded) < 0.01


def test_without_surfels_the_field_is_as_it_was():
    _, rounded = quadrant()
    assert np.array_equal(sharpened(rounded, GRID, np.zeros((0, 3)), np.zeros((0, 3)), DETAIL), rounded)


def test_one_surfel_is_no_plane():
    _, rounded = quadrant()
    found = sharpened(rounded, GRID, np.zeros((1, 3)), np.array([[0.0, 0, 1]]), DETAIL)
    assert np.array_equal(found, rounded)
