"""The maps on every Gaussian of every real file: T^-1(T(G)) as it is, and with the engine's points in float32."""

import os
from pathlib import Path

import numpy as np
import pytest

from gasp_core import games
from gasp_core.io import read_splat

DATA = Path(os.environ.get("GASP_DATA", Path(__file__).parents[3] / "shared" / "data"))
LARGE = [
    "skull.sog",
    "skull_inria_sh3.ply",
    "statue-angel.sog",
    "statue-st-peter.sog",
    *(f"playbot/{level}_0" for level in range(3)),
]
FILES = [
    "splats/fruit_drops_minimal.ply",
    "splats/guitar.compressed.ply",
    "splats/plant.splat",
    "splats/playbot_lod3_inria_sh2.ply",
    "splats/statue-angel.compressed.ply",
    "splats/statue-massa.sog",
    "splats/train-1000.ply",
    *(f"splats/playbot/{level}_0" for level in range(3, 7)),
    "meshlike/spot_10k.splat",
    # As large again, each of the same kind as one above.
    *(pytest.param(f"splats/{name}", marks=pytest.mark.thorough) for name in LARGE),
    pytest.param("meshlike/spot_100k.splat", marks=pytest.mark.thorough),
]


def relative_errors(found, wanted):
    return np.linalg.norm(found - wanted, axis=(1, 2)) / np.linalg.norm(wanted, axis=(1, 2))


def thin_errors(found, wanted):
    """Relative error of each Gaussian's smallest scale: what a norm of the whole covariance does not see."""
    smallest = np.sort(wanted.scales.astype(np.float64), axis=1)[:, 0]
    return np.abs(np.sort(found.scales, axis=1)[:, 0] - smallest) / np.maximum(smallest, 1e-300)


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real splats at {DATA}; set GASP_DATA")
@pytest.mark.parametrize("name", FILES)
def test_nothing_is_lost_on_the_way_through_points(name, record_property):
    gaussians = read_splat(DATA / name)
    vertices = games.choose_vertices(gaussians)
    simplices = games.to_simplices(gaussians, vertices)
    covariances = gaussians.covariances()

    back = games.from_simplices(simplices, reference=gaussians)
    assert relative_errors(back.covariances(), covariances).max() <= 1e-6
    np.testing.assert_array_equal(back.harmonics, gaussians.harmonics)

    # What a float32 engine sees: the object about its own centre, edges no shorter than a quarter of its spacing.
    centred = simplices - simplices[:, :1].mean(axis=0)
    size = np.ptp(centred.reshape(-1, 3), axis=0).max()
    magnified, factors = games.magnify(centred, 0.25 * size / 64)
    carried = games.demagnify(magnified.astype(np.float32).astype(np.float64), factors)
    carried = games.from_simplices(carried, reference=gaussians)
    # A coordinate below size/2 is known to 3e-8 size: an edge of size/256 to 8e-6 in each component.
    assert relative_errors(carried.covariances(), covariances).max() <= 1e-3
    assert thin_errors(carried, gaussians).max() <= 1e-3

    bare = games.from_simplices(centred.astype(np.float32).astype(np.float64), reference=gaussians)
    record_property("bare_share", float((relative_errors(bare.covariances(), covariances) > 1e-3).mean()))
    record_property("bare_thin_share", float((thin_errors(bare, gaussians) > 1e-3).mean()))
