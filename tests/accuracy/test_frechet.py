"""The Frechet distance against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.accuracy.images import alexnet_features, frechet_distance
from gasp_core.errors import RenderingError

UNIT_ROUNDOFF = 2.0**-53


def tolerance(*sets):
    """What rounding makes of the distance.

    Means and QR factors are off by at most about (N + D) roundings of the features' size, and the turn that brings the
    factors together by as much; the distance, a square of at most twice that size, by twice as much of its square.
    """
    count = max(sum(features.shape) for features in sets)
    size = sum(np.mean(np.sum(features**2, axis=1)) for features in sets)
    return 16 * count * UNIT_ROUNDOFF * size


def cross(deviations, mean):
    """Features whose sample covariance is diagonal: two points along every axis, as far as the deviation asks for."""
    deviations = np.asarray(deviations, dtype=float)
    half = np.diag(deviations) * np.sqrt((2 * len(deviations) - 1) / 2)
    return np.concatenate([half, -half]) + mean


def turn(dimension, seed):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(dimension, dimension)))[0]


deviations = st.lists(st.floats(0, 10), min_size=4, max_size=4)
means = st.lists(st.floats(-10, 10), min_size=4, max_size=4)


@given(deviations, deviations, means, means, st.integers(0, 99))
def test_covariances_with_common_axes(deviations_a, deviations_b, mean_a, mean_b, seed):
    axes = turn(4, seed)
    first, second = cross(deviations_a, mean_a) @ axes, cross(deviations_b, mean_b) @ axes
    expected = np.sum(np.subtract(mean_a, mean_b) ** 2) + np.sum(np.subtract(deviations_a, deviations_b) ** 2)
    assert frechet_distance(first, second) == pytest.approx(expected, rel=0, abs=tolerance(first, second))


@given(st.floats(0.1, 10), st.floats(0.1, 10), st.floats(0, np.pi), st.integers(2, 12))
def test_two_lines(length_a, length_b, angle, dimension):
    """Both covariances of rank one: s^2 u u^T and t^2 v v^T have s^2 + t^2 - 2 s t |u . v|."""
    u, v = np.zeros((2, dimension))
    u[0], v[0], v[1] = 1, np.cos(angle), np.sin(angle)
    steps = np.array([-1.0, 0.0, 1.0])[:, None]
    first, second = length_a * steps * u, length_b * steps * v
    expected = length_a**2 + length_b**2 - 2 * length_a * length_b * abs(np.cos(angle))
    assert frechet_distance(first, second) == pytest.approx(expected, rel=0, abs=tolerance(first, second))


@pytest.mark.parametrize(("count_a", "count_b"), [(200, 300), (40, 40)])
def test_full_rank_against_the_symmetric_form(count_a, count_b):
    """tr (C_a C_b)^(1/2) is the sum of the roots of the eigenvalues of A C_b A, where A A = C_a."""
    rng = np.random.default_rng(0)
    first = rng.normal(size=(count_a, 6)) @ rng.normal(size=(6, 6)) + 1
    second = rng.normal(size=(count_b, 6)) @ rng.normal(size=(6, 6))
    covariance_a, covariance_b = np.cov(first, rowvar=False), np.cov(second, rowvar=False)
    values, vectors = np.linalg.eigh(covariance_a)
    root = vectors * np.sqrt(values) @ vectors.T
    eigenvalues = np.linalg.eigvalsh(root @ covariance_b @ root)
    trace = np.trace(covariance_a) + np.trace(covariance_b)
    expected = np.sum((first.mean(0) - second.mean(0)) ** 2) + trace - 2 * np.sqrt(eigenvalues).sum()
    # The roots of small eigenvalues are what this form knows worst: each off by a rounding of the largest, over 2 root.
    rounding = 100 * UNIT_ROUNDOFF * eigenvalues[-1] / np.sqrt(eigenvalues[0])
    found = frechet_distance(first, second)
    assert found == pytest.approx(expected, rel=0, abs=tolerance(first, second) + 6 * rounding)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 30), st.integers(2, 30), st.integers(1, 20), st.integers(0, 999))
def test_properties_of_a_distance(count_a, count_b, dimension, seed):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(count_a, dimension)), rng.normal(size=(count_b, dimension)) + 0.5
    distance, allowed = frechet_distance(first, second), tolerance(first, second)
    assert distance >= 0
    assert frechet_distance(second, first) == pytest.approx(distance, rel=0, abs=2 * allowed)
    assert frechet_distance(first[::-1], first) <= tolerance(first)
    axes, shift = turn(dimension, seed), rng.normal(size=dimension)
    moved = first @ axes + shift, second @ axes + shift
    assert frechet_distance(*moved) == pytest.approx(distance, rel=0, abs=allowed + tolerance(*moved))
    third = rng.uniform(size=(count_a, dimension))
    detour = np.sqrt(frechet_distance(first, third)) + np.sqrt(frechet_distance(third, second))
    # A root is off by the root of the tolerance at most.
    assert np.sqrt(distance) <= detour + 3 * np.sqrt(tolerance(first, second, third))


def test_a_shift_is_seen_however_few_pictures():
    """Three pictures, 500 features: the covariances cancel and leave the shift."""
    features = np.random.default_rng(0).normal(size=(3, 500))
    shifted = features + 0.25
    found = frechet_distance(features, shifted)
    assert found == pytest.approx(500 / 16, rel=0, abs=tolerance(features, shifted))


def test_more_pictures_than_features_on_one_side_only():
    """A set without spread against one with: nothing cancels, tr C_b is left."""
    second = np.random.default_rng(0).normal(size=(50, 8))
    second -= second.mean(axis=0)
    found = frechet_distance(np.zeros((2, 8)), second)
    assert found == pytest.approx(np.trace(np.cov(second, rowvar=False)), rel=0, abs=tolerance(second))


@pytest.mark.parametrize("scale", [2.0**-400, 2.0**-100, 2.0**100, 2.0**300])
def test_features_of_any_unit(scale):
    """A power of two changes no rounding but those inside the decompositions."""
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(9, 4)), rng.normal(size=(7, 4))
    found = frechet_distance(first * scale, second * scale) / scale**2
    assert found == pytest.approx(frechet_distance(first, second), rel=0, abs=2 * tolerance(first, second))


def test_equal_constant_features():
    assert frechet_distance(np.zeros((4, 3)), np.zeros((2, 3))) == 0


def test_features_of_pictures(untrained, random_picture):
    bright = alexnet_features([random_picture(40, 40, seed) for seed in range(4)], untrained)
    dark = alexnet_features([random_picture(40, 40, seed) / 8 for seed in range(4, 8)], untrained)
    alike = alexnet_features([random_picture(40, 40, seed) for seed in range(8, 12)], untrained)
    assert frechet_distance(bright, alike) < frechet_distance(bright, dark)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (np.zeros(5), np.zeros((2, 5)), r"the first set of features has shape \(5,\)"),
        (np.zeros((2, 5)), np.zeros((1, 5)), r"the second set of features has shape \(1, 5\).*2 pictures or more"),
        (np.zeros((2, 0)), np.zeros((2, 0)), r"the first set of features has shape \(2, 0\)"),
        (np.zeros((3, 5)), np.zeros((3, 6)), "the first set has 5 features a picture, the second 6"),
        (np.full((3, 5), np.nan), np.zeros((3, 5)), "the first set of features holds a NaN"),
        (np.zeros((3, 5)), np.full((3, 5), 1e200), "the second set of features holds 1e\\+200, whose square"),
        (np.zeros((3, 5)), np.zeros((3, 5), dtype=int), "the second set of features holds int64 values"),
    ],
)
def test_bad_features_are_refused(first, second, message):
    with pytest.raises(RenderingError, match=message):
        frechet_distance(first, second)
