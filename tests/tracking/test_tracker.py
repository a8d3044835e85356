"""Frames whose Gaussians are other samples of what moves: where the first frame's are is known all the same."""

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat
from gasp_core.tracking import Tracked, Tracker
from gasp_core.tracking.clouds import Affine, Cloud, laid_onto
from gasp_core.tracking.deformation_graph import DeformationGraph, Pose


def lump(directions):
    """A surface (N, 3) that has no symmetry: a sphere with three bumps, by directions (N, 3)."""
    bumps = np.array([[1.0, 0.2, 0.1], [-0.3, 1.0, 0.4], [0.1, -0.5, 1.0]])
    bumps /= np.linalg.norm(bumps, axis=1, keepdims=True)
    heights = np.array([0.5, 0.35, 0.7])
    return directions * (0.5 + np.exp(-12 * (1 - directions @ bumps.T)) @ heights)[:, None]


def directions(count, random):
    found = random.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def splat(means):
    count = len(means)
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.tile([0.004, 0.01, 0.012], (count, 1)),
        opacities=np.full(count, 0.9),
        harmonics=np.zeros((count, 1, 3)),
    )


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0, 0, 1.0]]).T


def bent(points, angle):
    """About y, by an angle that grows with the height."""
    own = angle * (points[:, 2] + 0.6)
    c, s, low = np.cos(own), np.sin(own), points[:, 2] + 0.6
    return np.stack([c * points[:, 0] + s * low, points[:, 1], c * low - s * points[:, 0] - 0.6], axis=1)


@pytest.mark.parametrize(("motion", "most"), [(turned, 0.002), pytest.param(bent, 0.03, marks=pytest.mark.thorough)])
def test_where_the_first_frame_is_in_later_ones(motion, most):
    """Of 4,000 Gaussians, each frame other ones, and as many as it likes, .8 % of the diagonal apart.

    What turns is known by its bumps. What bends slides along itself between them, which no frame shows: a third of
    the way that it goes is what may be missed.
    """
    random = np.random.default_rng(0)
    first = lump(directions(4000, random))
    tracker = Tracker(splat(first), nodes=100)
    diagonal = np.linalg.norm(np.ptp(first, axis=0))
    for k in range(1, 6):
        tracked = tracker.follow(splat(motion(lump(directions(3500 + 200 * k, random)), 0.08 * k)))
        off = np.linalg.norm(tracked.gaussians.means - motion(first, 0.08 * k), axis=1)
        assert np.sqrt((off**2).mean()) < most * diagonal
        # As near as samples are, and nothing is unseen.
        assert tracked.distance < 1.1 * tracked.spacing and tracked.unseen < 0.005
    # It had somewhere to go.
    assert np.linalg.norm(motion(first, 0.4) - first, axis=1).mean() > 0.06 * diagonal


def test_gaussians_turn_and_stretch_with_what_they_are_of():
    random = np.random.default_rng(1)
    first, second = lump(directions(4000, random)), lump(directions(4000, random))
    still = splat(first)
    found = Tracker(still, nodes=60).follow(splat(1.2 * turned(second, 0.2))).gaussians
    turn = turned(np.eye(3), 0.2).T
    expected = 1.44 * turn @ still.covariances() @ turn.T
    assert np.abs(found.covariances() - expected).max() < 0.05 * np.abs(expected).max()
    # Each axis is still the axis that it was.
    np.testing.assert_allclose(found.scales / still.scales, 1.2, rtol=0.03)
    assert found.opacities is still.opacities or np.array_equal(found.opacities, still.opacities)


def test_nothing_happens():
    random = np.random.default_rng(2)
    first = lump(directions(3000, random))
    tracked = Tracker(splat(first), nodes=60).follow(splat(first[::-1].copy()))
    assert np.abs(tracked.gaussians.means - first).max() < 1e-3
    assert tracked.distance < 1e-3 and tracked.unseen == 0


def test_what_is_lost_is_said():
    """Half of the frame is somewhere where nothing was."""
    random = np.random.default_rng(3)
    first, second = lump(directions(2000, random)), lump(directions(2000, random))
    tracked = Tracker(splat(first), nodes=60).follow(splat(np.concatenate([second, second[:1500] + [9.0, 0, 0]])))
    assert tracked.unseen > 0.1


def test_the_same_twice():
    random = np.random.default_rng(4)
    first, second = splat(lump(directions(1500, random))), splat(turned(lump(directions(1500, random)), 0.1))
    one, other = (Tracker(first, nodes=40).follow(second).gaussians.means for _ in range(2))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("means", [np.zeros((5, 3)), np.full((400, 3), 1.0)])
def test_too_little_to_be_tracked(means):
    random = np.random.default_rng(5)
    with pytest.raises(SplatFormatError, match="tracking wants 100"):
        Tracker(splat(means))
    tracker = Tracker(splat(lump(directions(500, random))), nodes=20)
    with pytest.raises(SplatFormatError, match=r"f2: has Gaussians.*tracking wants 100"):
        tracker.follow(splat(means), "f2")


def test_gaussians_on_top_of_each_other():
    """Fewer places than nodes, and every Gaussian twice."""
    random = np.random.default_rng(8)
    first, second = (np.repeat(lump(directions(150, random)), 2, axis=0) for _ in range(2))
    tracked = Tracker(splat(first), nodes=200).follow(splat(second))
    assert np.isfinite(tracked.gaussians.means).all() and tracked.spacing > 0


def test_a_first_frame_that_is_partly_nowhere():
    means = lump(directions(500, np.random.default_rng(9)))
    means[3] = np.nan
    with pytest.raises(SplatFormatError, match="not finite"):
        Tracker(splat(means))


def test_a_step_solves_what_it_says():
    """Nodes that do an affine motion already: nothing is left to be done, whatever the weights."""
    random = np.random.default_rng(6)
    points = lump(directions(800, random))
    graph = DeformationGraph.over(points, 40)
    affine = Affine(matrix=np.eye(3) + 0.2 * random.normal(size=(3, 3)), shift=random.normal(size=3))
    there = graph.rest.then(affine)
    np.testing.assert_allclose(graph.carried(there), affine(points), atol=1e-12)
    again = graph.fitted(there, Cloud.of(affine(points)), 1.0)
    np.testing.assert_allclose(again.places, there.places, atol=1e-9)
    np.testing.assert_allclose(graph.gradients(again), np.tile(affine.matrix, (800, 1, 1)), atol=1e-9)
    # Points that are off the surface come nearer to it.
    off = Pose(places=there.places + 0.03 * random.normal(size=there.places.shape), transforms=there.transforms)
    cloud = Cloud.of(affine(points))

    def across(pose):
        apart = np.einsum("nij,nj->ni", cloud.metric, graph.carried(pose) - cloud.points)
        return np.sqrt((apart[:, 0] ** 2).mean())

    assert across(graph.fitted(off, cloud, 0.01)) < 0.5 * across(off)


def test_affine_maps_are_found():
    random = np.random.default_rng(7)
    one, other = lump(directions(3000, random)), lump(directions(3000, random))
    affine = Affine(matrix=turned(np.eye(3), 0.25).T @ np.diag([1.1, 0.95, 1.0]), shift=np.array([0.2, -0.1, 0.05]))
    found = laid_onto(one, Cloud.of(affine(other)), [Affine.nothing()])
    np.testing.assert_allclose(found.matrix, affine.matrix, atol=0.02)
    np.testing.assert_allclose(found.shift, affine.shift, atol=0.01)


@pytest.mark.slow
def test_a_flipbook_comes_back_as_it_began_but_larger(data):
    """The monkey turns around once and grows: its last frame is its first, 2.257 times as large, in another order."""
    files = sorted((data / "dynamic" / "monkey_flipbook").glob("*.sog"))
    first = read_splat(files[0])
    tracker = Tracker(first)
    found: Tracked | None = None
    for file in files[1:]:
        found = tracker.follow(read_splat(file))
        assert found.unseen < 0.01
    assert found is not None
    means = first.means.astype(np.float64)
    growth = np.ptp(read_splat(files[-1]).means, axis=0) / np.ptp(means, axis=0)
    off = np.linalg.norm(found.gaussians.means - growth * means, axis=1)
    assert np.sqrt((off**2).mean()) < 0.005 * np.linalg.norm(np.ptp(growth * means, axis=0))
