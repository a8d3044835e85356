"""The alpha rule: bounds what it says it bounds, and nothing else."""

import numpy as np
import pytest

from gasp_core import MapChoice, games
from gasp_core.control import control, limit_edges, limit_stretches
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians


def some_gaussians(count=200, *, flat=False, seed=0):
    rng = np.random.default_rng(seed)
    scales = 10 ** rng.uniform(-2, 0, (count, 3))
    if flat:
        scales[:, 0] = 0
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=rng.random(count),
        harmonics=rng.normal(size=(count, 1, 3)),
    )


@pytest.mark.parametrize("alpha", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("vertices", [3, 4])
def test_no_principal_stretch_above_alpha(alpha, vertices):
    gaussians = some_gaussians(flat=vertices == 3)
    affine = np.array([[4, 1, 0], [0, 0.5, 0], [0, 0, 1.2]])
    moved = games.to_simplices(gaussians, vertices) @ affine.T
    limited, clipped = limit_stretches(moved, gaussians, alpha)
    stretches = np.linalg.svd(games.deformation_gradients(limited, gaussians), compute_uv=False)
    assert stretches.max() <= alpha * (1 + 1e-6)
    before = np.linalg.svd(games.deformation_gradients(moved, gaussians), compute_uv=False)
    np.testing.assert_array_equal(clipped, before.max(axis=1) > alpha * (1 + 1e-9))
    np.testing.assert_array_equal(limited[~clipped], moved[~clipped])
    np.testing.assert_allclose(stretches, np.minimum(before, alpha), rtol=1e-6)


@pytest.mark.parametrize("vertices", [3, 4])
def test_the_paper_s_rule_with_the_minimum(vertices):
    """s_i = min(s_i, alpha s_i(0)), so that a sheared triangle is never inflated."""
    gaussians = some_gaussians(flat=vertices == 3)
    affine = np.array([[1, 1, 0], [0, 0.6, 0.3], [0.5, 0, 1.4]])
    moved = games.to_simplices(gaussians, vertices) @ affine.T
    free = games.from_simplices(moved, reference=gaussians, covariance="gram_schmidt")
    limited, clipped = limit_edges(moved, gaussians, 1.5)
    held = games.from_simplices(limited, reference=gaussians, covariance="gram_schmidt")
    np.testing.assert_allclose(held.scales, np.minimum(free.scales, 1.5 * gaussians.scales), rtol=1e-9, atol=1e-12)
    assert 0 < clipped.mean() < 1


def test_rest_is_not_clipped_and_infinity_switches_off():
    for flat, vertices in ((True, 3), (False, 4)):
        gaussians = some_gaussians(flat=flat)
        simplices = games.to_simplices(gaussians, vertices)
        for covariance in ("exact", "gram_schmidt"):
            limited, clipped = control(simplices, gaussians, 1.0, covariance)
            assert not clipped.any()
            np.testing.assert_array_equal(limited, simplices)
        limited, clipped = control(simplices * 100, gaussians, np.inf, "exact")
        np.testing.assert_array_equal(limited, simplices * 100)


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_the_paper_s_rules_bound_what_has_no_extent_along_any_one_axis(missing):
    gaussians = some_gaussians()
    scales = np.array(gaussians.scales)
    scales[:, missing] = 0
    gaussians = gaussians.with_(scales=scales)
    rest = games.to_simplices(gaussians, 4)
    moved = rest @ np.array([[4, 1, 0], [0, 3, 0.3], [0.5, 0, 5]]).T
    free = games.from_simplices(moved, reference=gaussians, covariance="gram_schmidt").scales
    held = games.from_simplices(limit_edges(moved, gaussians, 1.5)[0], reference=gaussians, covariance="gram_schmidt")
    np.testing.assert_allclose(held.scales, np.minimum(free, 1.5 * scales), rtol=1e-9, atol=1e-12)
    printed, _ = control(moved, gaussians, 1.5, "gram_schmidt", rule="as_printed")
    held = games.from_simplices(printed, reference=gaussians, covariance="gram_schmidt")
    long = np.linalg.norm(moved[:, 1:] - moved[:, :1], axis=2) > 1.5 * scales
    np.testing.assert_allclose(held.scales, np.where(long, 1.5 * scales, free), rtol=1e-9, atol=1e-12)
    for rule in ("bounded", "as_printed"):
        limited, clipped = control(rest, gaussians, 1.0, "gram_schmidt", rule=rule)
        assert not clipped.any()
        np.testing.assert_array_equal(limited, rest)


@pytest.mark.parametrize("vertices", [3, 4])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_needles_are_bounded_as_well(axis, vertices):
    """With two scales of exactly zero; what they did by themselves before that is let pass."""
    gaussians = some_gaussians()
    scales = np.zeros_like(gaussians.scales)
    scales[:, axis] = gaussians.scales[:, axis]
    gaussians = gaussians.with_(scales=scales)
    rest = games.to_simplices(gaussians, vertices)
    affine = np.array([[4, 1, 0], [0, 0.5, 0], [0.3, 0, 1.2]])
    moved, own = rest @ affine.T, rest @ (3 * np.eye(3)).T
    lengths, lengths_before = (np.linalg.norm(s[:, 1:] - s[:, :1], axis=2).max(axis=1) for s in (moved, rest))
    limited, clipped = limit_stretches(moved, gaussians, 2.0)
    held = np.linalg.norm(limited[:, 1:] - limited[:, :1], axis=2).max(axis=1)
    np.testing.assert_allclose(held, np.minimum(lengths, 2 * lengths_before), rtol=1e-12)
    np.testing.assert_array_equal(clipped, lengths > 2 * lengths_before)
    assert 0 < clipped.mean() < 1
    limited, clipped = limit_stretches(own @ (1.9 * np.eye(3)).T, gaussians, 2.0, own)
    assert not clipped.any()
    limited, clipped = limit_stretches(own @ (5 * np.eye(3)).T, gaussians, 2.0, own)
    assert clipped.all()
    # Edges of 1e-2 at places of 10 are known to 1e-13.
    np.testing.assert_allclose(limited[:, 1:] - limited[:, :1], 2 * (own[:, 1:] - own[:, :1]), atol=1e-13)


@pytest.mark.parametrize("alpha", [0.0, -1.0, np.nan])
def test_impossible_alpha(alpha):
    gaussians = some_gaussians(2)
    with pytest.raises(SceneError, match="alpha"):
        control(games.to_simplices(gaussians, 4), gaussians, alpha, "exact")


def test_an_alpha_that_shrinks_what_is_at_rest_is_refused():
    for alpha in (0.5, 0.999):
        with pytest.raises(SceneError, match=r"MapChoice\.alpha must be >= 1"):
            MapChoice(alpha=alpha)
    assert MapChoice(alpha=1.0).alpha == 1


def heights(simplices):
    first, second = simplices[:, -2] - simplices[:, 0], simplices[:, -1] - simplices[:, 0]
    return np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1)


@pytest.mark.parametrize("vertices", [3, 4])
def test_the_paper_s_rule_as_printed(vertices):
    """s_i := alpha s_i(0) where |e_i| > alpha |e_i(0)|, whatever s_i is: sheared triangles grow by it."""
    gaussians = some_gaussians(flat=vertices == 3)
    affine = np.array([[1, 1, 0], [0, 0.6, 0.3], [0.5, 0, 1.4]])
    rest = games.to_simplices(gaussians, vertices)
    moved = rest @ affine.T
    free = games.from_simplices(moved, reference=gaussians, covariance="gram_schmidt").scales
    limited, clipped = control(moved, gaussians, 1.2, "gram_schmidt", rule="as_printed")
    held = games.from_simplices(limited, reference=gaussians, covariance="gram_schmidt").scales
    lengths, lengths_at_rest = (np.linalg.norm(s[:, 1:] - s[:, :1], axis=2) for s in (moved, rest))
    long = lengths > 1.2 * lengths_at_rest
    axes = games.edge_axes(gaussians.scales, vertices)
    np.testing.assert_array_equal(clipped, long.any(axis=1))
    expected = np.where(
        long, 1.2 * np.take_along_axis(gaussians.scales, axes, axis=1), np.take_along_axis(free, axes, axis=1)
    )
    np.testing.assert_allclose(np.take_along_axis(held, axes, axis=1), expected, rtol=1e-9, atol=1e-12)
    grown = heights(limited)[long[:, -1]] > heights(moved)[long[:, -1]] * (1 + 1e-9)
    assert 0.1 < grown.mean() < 0.9
    np.testing.assert_array_equal(control(rest, gaussians, 1.0, "gram_schmidt", rule="as_printed")[0], rest)


def test_a_rule_belongs_to_an_inverse():
    gaussians = some_gaussians(2)
    with pytest.raises(SceneError, match=r"as_printed.*belongs to covariance"):
        control(games.to_simplices(gaussians, 4), gaussians, 2.0, "exact", rule="as_printed")
    with pytest.raises(SceneError, match="say both"):
        MapChoice(control="as_printed")
