from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gasp_renderer.rasteriser import NumbaRenderer
from gasp_renderer.reference import ReferenceRenderer
from hypothesis import settings

from gasp_core.io import read_splat
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.contract import ALPHA_FLOOR

# A slow machine is not a failure.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session")
def data() -> Path:
    folder = Path(os.environ.get("GASP_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real splats at {folder} (set GASP_DATA)")
    return folder


@pytest.fixture(scope="session")
def real(data):
    """Real splats by name, each read once."""
    return cache(lambda name: RenderInput.of(read_splat(data / "splats" / name)))


@pytest.fixture(scope="session")
def three_views():
    """Three cameras around real splats, which are y-down, framed so that they fill the picture."""

    def make(splats, size=256):
        low, high = np.percentile(splats.means, [2, 98], axis=0)
        center, distance = (low + high) / 2, 0.4 * np.linalg.norm(high - low) / np.sin(np.radians(20))
        cameras = []
        for turn, rise in ((18, 20), (138, 9), (258, 34)):
            turn, rise = np.radians(turn), np.radians(rise)
            side = np.array([np.cos(turn) * np.cos(rise), -np.sin(rise), np.sin(turn) * np.cos(rise)])
            cameras.append(look_at(center + distance * side, center, width=size, height=size, up=(0, -1, 0)))
        return cameras

    return make


@pytest.fixture(scope="session")
def cloud():
    """Random splats about the origin, a different set for every seed."""

    def make(count=40, seed=0, *, degree=0, size=(-2.5, -0.5), dtype=np.float32) -> RenderInput:
        rng = np.random.default_rng(seed)
        return RenderInput(
            means=rng.normal(size=(count, 3)).astype(dtype),
            quaternions=rng.normal(size=(count, 4)).astype(dtype),
            scales=(10 ** rng.uniform(*size, size=(count, 3))).astype(dtype),
            opacities=rng.uniform(0.05, 1, size=count).astype(dtype),
            harmonics=rng.normal(scale=0.4, size=(count, (degree + 1) ** 2, 3)).astype(dtype),
        )

    return make


@pytest.fixture(scope="session")
def front():
    """A camera on the -y axis that sees the unit ball."""

    def make(width=48, height=40, distance=6.0, **options):
        return look_at((0.3, -distance, 0.4), (0, 0, 0), width=width, height=height, **options)

    return make


@pytest.fixture(scope="session")
def psnr():
    """Peak signal to noise ratio [dB] of pictures in 0..1, and the largest difference."""

    def measure(found, wanted):
        difference = np.asarray(found, dtype=np.float64) - wanted
        error = np.mean(difference**2)
        return (10 * np.log10(1 / error) if error else np.inf), np.abs(difference).max()

    return measure


@pytest.fixture(scope="session")
def fast():
    return NumbaRenderer()


@pytest.fixture(scope="session")
def oracle():
    return ReferenceRenderer()


@pytest.fixture(params=["numba", "reference"])
def renderer(request, fast, oracle):
    return {"numba": fast, "reference": oracle}[request.param]


@pytest.fixture(scope="session")
def rounding(oracle):
    """How far float32 may take alpha and colour of each pixel from the reference's: two arrays (H, W)."""

    def one(splats, i, opacity):
        arrays = {name: getattr(splats, name) for name in type(splats).__dataclass_fields__}
        rows = {name: values if values is None else values[[i]] for name, values in arrays.items()}
        return RenderInput(**rows | {"opacities": rows["opacities"].astype(np.float64) * opacity})

    def bound(splats, camera):
        # The whitened coordinates are sums of three terms. None is larger than sqrt(log2(e) / 2 / 0.3) = 1.55 a pixel
        # times the picture's sides, plus the 2.83 at which alpha reaches its floor, and each is rounded four times to
        # 2^-24. Alpha is 2^-(e_x^2 + e_y^2): an error of a coordinate counts 2 * 2.83 * ln 2 fold, in both.
        coordinate = 4 * 2**-24 * 3 * (1.55 * (camera.width + camera.height) + 2.83)
        slack = 2 * (2 * 2.83 * np.log(2)) * coordinate + 2.6e-6
        # Gaussians whose alpha is so near its floor that rounding decides: there with a little more opacity, not with
        # a little less.
        undecided, layers = np.zeros((camera.height, camera.width)), np.zeros((camera.height, camera.width))
        for i in range(len(splats)):
            more = oracle.render(one(splats, i, 1 + slack), camera).alpha > 0
            undecided += more & (oracle.render(one(splats, i, 1 - slack), camera).alpha == 0)
            layers += more
        # Changing the alphas one after the other, front to back, changes what is seen by sum_i T_i (alpha'_i - alpha_i)
        # (c_i - what is behind). Weights T_i alpha_i add up to one at most, so all changes in proportion together count
        # once; colours are at most 0.5 + the sum of all harmonics. Each sum is rounded to 2^-24 at each layer, and 1e-4
        # of the light is not followed.
        alpha = slack / (1 - slack) + undecided * ALPHA_FLOOR * (1 + slack) + layers * 2**-23 + 1e-4
        return alpha, 2 * (0.5 + np.abs(splats.harmonics).sum(axis=1).max()) * alpha

    return bound
