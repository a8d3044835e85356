from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core import BoxShape, Elastic, Floaters, Gaussians, HalfSpace, SplatObject
from gasp_core.errors import SceneError
from gasp_core.scene.floaters import component_sizes, floating
from gasp_core.scene.selection import place_object

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


def at(means) -> Gaussians:
    means = np.asarray(means, dtype=np.float64)
    count = len(means)
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), 0.01),
        opacities=np.full(count, 0.5),
        harmonics=np.zeros((count, 1, 3)),
    )


def ball(count=3000, seed=0):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def thing(splat, **options):
    return SplatObject(name="thing", splat=splat, material=JELLY, **options)


def brute_components(positions, spacing):
    """Flood fill over occupied voxels, the slow way."""
    voxels = {}
    for row, index in enumerate(np.floor(positions / spacing).astype(int)):
        voxels.setdefault(tuple(index), []).append(row)
    sizes = np.zeros(len(positions), dtype=int)
    left = set(voxels)
    while left:
        stack, component = [left.pop()], []
        while stack:
            i, j, k = stack.pop()
            component += voxels[(i, j, k)]
            near = {(i + a, j + b, k + c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)} & left
            left -= near
            stack += near
        sizes[component] = len(component)
    return sizes


@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(0.05, 0.5))
def test_components_agree_with_flood_fill(seed, count, spacing):
    positions = np.random.default_rng(seed).uniform(-2, 2, size=(count, 3))
    assert np.array_equal(component_sizes(positions, spacing), brute_components(positions, spacing))


def test_a_speck_far_off_floats_and_a_second_body_does_not():
    splat = np.concatenate([ball(), ball(400, 1) / 4 + [3, 0, 0], [[0, 9, 0], [0, 9.01, 0], [1e12, 0, 0]]])
    mask = floating(splat)
    assert not mask[:3400].any()
    assert mask[3400:].all()


def test_a_sparse_cloud_has_no_floaters():
    assert not floating(np.random.default_rng(0).uniform(size=(30, 3)) * 100).any()
    assert not floating(np.zeros((5, 3))).any()
    assert floating(np.zeros((0, 3))).shape == (0,)


def test_what_is_done_with_floaters():
    splat = at(np.concatenate([ball(), [[0, 0, 9]]]))
    drawn = {}
    for rule in Floaters:
        placed = place_object(thing(splat, floaters=rule, height=1.0, position=(0, 0, 0)), splat)
        assert placed.set_aside.floaters == 1
        assert any("1 of 3001" in sentence for sentence in placed.set_aside.sentences("thing"))
        drawn[rule] = (len(placed.gaussians), int(placed.moving.sum()), int(placed.floating.sum()))
        # The ball of radius 1, not the speck above it, is one metre tall.
        np.testing.assert_allclose(placed.gaussians.means[:3000, 2].max(), 1.0, atol=5e-3)
    assert drawn == {Floaters.DROP: (3000, 3000, 0), Floaters.STILL: (3001, 3000, 1), Floaters.KEEP: (3001, 3001, 1)}


def test_every_reason_is_counted_once_and_in_order():
    splat = at(ball(100))
    means, scales, opacities = splat.means.copy(), splat.scales.copy(), splat.opacities.copy()
    means[3] = np.nan
    opacities[3] = 0.0
    scales[4] = 0
    scales[5] = [0.1, 0, 0]
    opacities[6:9] = 0.01
    splat = splat.with_(means=means, scales=scales, opacities=opacities)
    placed = place_object(thing(splat, min_opacity=0.1), splat)
    aside = placed.set_aside
    assert (aside.total, aside.non_finite, aside.invisible, aside.faint) == (100, 1, 1, 3)
    assert aside.first_non_finite == (3,)
    assert np.array_equal(placed.rows, np.setdiff1d(np.arange(100), [3, 4, 6, 7, 8]))
    assert len(aside.sentences("thing")) == 3
    assert "first rows 3" in aside.sentences("thing")[0]


def test_a_region_is_in_world_coordinates_and_the_rest_stays():
    splat = at(ball(500))
    item = thing(splat, metres_per_unit=2.0, region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    placed = place_object(item, splat)
    assert np.array_equal(placed.moving, placed.gaussians.means[:, 2] <= 0)
    assert placed.set_aside.outside_region == int((splat.means[:, 2] > 0).sum())
    nowhere = thing(splat, region=BoxShape(center=(99, 0, 0), half_extents=(1, 1, 1)))
    with pytest.raises(SceneError, match="inside the region"):
        place_object(nowhere, splat)


def test_a_static_object_does_not_move():
    splat = at(ball(50))
    assert not place_object(SplatObject(name="s", splat=splat, static=True), splat).moving.any()


def test_nothing_left():
    splat = at(ball(50))
    with pytest.raises(SceneError, match=r"none of its 50 Gaussians is left .*50 below min_opacity 0.9"):
        place_object(thing(splat, min_opacity=0.9), splat)
    with pytest.raises(SceneError, match="none of its 0"):
        place_object(thing(splat), splat.select(np.zeros(0, dtype=int)))
