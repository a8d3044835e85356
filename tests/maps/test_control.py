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


@pytest.mark.parametrize("alpha", [0.0, -1.0, np.nan])
def test_impossible_alpha(alpha):
    gaussians = some_gaussians(2)
    with pytest.raises(SceneError, match="alpha"):
        control(games.to_simplices(gaussians, 4), gaussians, alpha, "exact")


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
