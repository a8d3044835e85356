"""What a run reports of the shapes of a frame, against the shapes themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core import Gaussians, MapChoice
from gasp_core.reduction.all_vertices import block_of, sample_all
from gasp_core.reduction.bodies import Body, moved_gaussians
from gasp_core.reduction.shape_flags import shape_flags


def body_of(rng, vertices, count=60):
    scales = np.exp(rng.normal(-4, 1, (count, 3)))
    scales[rng.uniform(size=(count, 3)) < 0.1] = 0.0
    gaussians = Gaussians(
        means=rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )
    block = block_of(gaussians, vertices)
    sample = sample_all(block, 0.01, 0.04)
    points = slice(0, len(sample.positions))
    return Body(
        name="body", rows=np.arange(count), points=points, block=block, carrier=sample.carrier
    ), sample.positions


@pytest.mark.parametrize("covariance", ["exact", "gram_schmidt"])
@pytest.mark.parametrize("vertices", [3, pytest.param(4, marks=pytest.mark.thorough)])
@settings(deadline=None)
@given(
    seed=st.integers(0, 10_000),
    stretch=st.floats(0.0, 3.0),
    alpha=st.sampled_from([1.0, 1.1, 1.5, 2.0, float("inf")]),
    size=st.sampled_from([1.0, 1e-200, 1e150]),
)
def test_the_flags_are_those_of_the_gaussians(vertices, covariance, seed, stretch, alpha, size):
    """Row for row, whatever was stretched, collapsed or beyond all numbers: a cheap bound passes only what is sure."""
    rng = np.random.default_rng(seed)
    body, positions = body_of(rng, vertices)
    gradient = np.eye(3) + stretch * rng.normal(0, 0.3, (3, 3))
    moves = positions @ (gradient - np.eye(3)).T * size + rng.normal(0, 1e-3, positions.shape)
    simplices = moves.reshape(-1, vertices, 3)
    lost = rng.uniform(size=len(simplices)) < 0.2
    # All corners of these end where the first one does.
    home = positions.reshape(simplices.shape)
    simplices[lost] += (home[:, :1] + simplices[:, :1] - home - simplices)[lost]
    maps = MapChoice(alpha=alpha, covariance=covariance)
    whole = moved_gaussians(body, moves, maps)
    degenerate, clipped = shape_flags(body, moves, maps)
    np.testing.assert_array_equal(degenerate, whole.degenerate)
    np.testing.assert_array_equal(clipped, whole.clipped)


def test_at_rest_nothing_is_flagged():
    body, positions = body_of(np.random.default_rng(1), 4)
    flags = shape_flags(body, np.zeros_like(positions), MapChoice())
    shapeless = (body.block.local.scales == 0).all(axis=1)
    np.testing.assert_array_equal(flags[0], shapeless)
    assert not flags[1].any()
