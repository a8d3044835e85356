"""What `inspect` tells of a splat."""

import json

import numpy as np
import pytest

from gasp_core.io import write_splat
from gasp_core.io.inspect import PERCENTILES, inspect_splat, summarise


def oddities(gaussians):
    return "\n".join(summarise(gaussians, path="a", kind="ply").oddities)


def plain(some, count=400):
    """Nothing odd: unit quaternions, no needles, distinct."""
    g = some(count, 1)
    q = g.quaternions / np.linalg.norm(g.quaternions, axis=1, keepdims=True)
    rng = np.random.default_rng(5)
    return g.with_(quaternions=q, scales=rng.uniform(0.01, 0.05, (count, 3)).astype(np.float32))


def test_figures(some, tmp_path):
    g = plain(some)
    write_splat(tmp_path / "a.ply", g)
    summary = inspect_splat(tmp_path / "a.ply")
    assert (summary.count, summary.sh_degree, summary.format, summary.oddities) == (400, 1, "ply", ())
    np.testing.assert_array_equal(summary.minimum, g.means.min(axis=0))
    np.testing.assert_array_equal(summary.maximum, g.means.max(axis=0))
    np.testing.assert_allclose(summary.upper, np.percentile(g.means.astype(float), 99, axis=0))
    ordered = np.sort(g.scales.astype(float), axis=1)
    np.testing.assert_allclose(summary.scale, np.percentile(ordered[:, 2], PERCENTILES), rtol=1e-6)
    np.testing.assert_allclose(summary.opacity, np.percentile(g.opacities.astype(float), PERCENTILES), rtol=1e-6)
    seen = g.opacities > 0.05
    np.testing.assert_allclose(
        summary.flatness, np.percentile((ordered[:, 0] / ordered[:, 1])[seen], PERCENTILES), rtol=1e-5
    )
    told = json.loads(json.dumps(summary.to_json(), allow_nan=False))
    assert (told["count"], told["sh_degree"], told["oddities"]) == (400, 1, [])
    assert told["opacity"]["p50"] == summary.opacity[2]
    text = summary.to_text()
    assert "400 Gaussians, spherical harmonics of degree 1" in text
    assert "nothing odd" in text


def changed(g, field, rows, value):
    array = getattr(g, field).copy()
    array[rows] = value
    return g.with_(**{field: array})


@pytest.mark.parametrize(
    ("field", "rows", "value", "says"),
    [
        ("means", [3, 5], np.nan, "2 Gaussians (0.5 %) have means that are not finite"),
        ("scales", 3, np.inf, "1 Gaussians (0.25 %) have scales that are not finite"),
        ("harmonics", 3, np.nan, "have harmonics that are not finite"),
        ("opacities", 3, np.nan, "have opacities that are not finite"),
        ("quaternions", 3, np.nan, "have quaternions that are not finite"),
        ("quaternions", 3, 0, "1 Gaussians (0.25 %) have a quaternion of zero"),
        ("quaternions", slice(0, 40), 3, "40 Gaussians (10 %) have quaternions that are not normalised"),
        ("scales", (slice(0, 4), 0), 0, "4 Gaussians (1 %) have a scale of zero"),
        ("scales", (slice(None), 2), 0, "every Gaussian is flat"),
        ("scales", (7, slice(0, 2)), 0, "1 Gaussians (0.25 %) have two scales of zero"),
        ("scales", (slice(0, 40), 2), 0.6, "are needles"),
        ("scales", 3, 50.0, "are larger than a quarter"),
        ("opacities", slice(None), 1, "every Gaussian is opaque"),
        ("opacities", slice(0, 100), 0, "25 % of the Gaussians are invisible"),
        ("means", [1, 2], 300, "2 Gaussians (0.5 %) lie far outside"),
        ("means", slice(0, 10), 0.5, "9 Gaussians (2.2 %) share their centre"),
        ("means", slice(None), 0.5, "nearly all centres are at one point"),
        ("harmonics", (slice(None), slice(1, None)), 0, "harmonics of degree 1 to 1 are all zero"),
    ],
)
def test_oddities(some, field, rows, value, says):
    g = plain(some)
    if field == "opacities" and rows == slice(0, 100):
        g = g.with_(opacities=np.full(400, 0.5, np.float32))
    assert says in oddities(changed(g, field, rows, value))


def test_far_from_the_origin(some):
    g = plain(some)
    far = g.with_(means=(g.means + 1e4).astype(np.float32))
    assert "so far from the origin" in oddities(far)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_hardly_any(some, count):
    g = plain(some).select(np.arange(count))
    summary = summarise(g, path="a", kind="ply")
    assert summary.count == count
    json.dumps(summary.to_json(), allow_nan=False)


def test_none_finite(some):
    g = changed(plain(some, 3), "means", slice(None), np.nan)
    summary = summarise(g, path="a", kind="ply")
    assert summary.oddities[0].startswith("3 Gaussians (100 %) have means that are not finite")
    assert summary.to_json()["extents"]["min"] == [None, None, None]
    assert "nan" in summary.to_text()
