from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gasp_core.accuracy.images import LpipsWeights, load_lpips_weights


@pytest.fixture(scope="session")
def trained_file(data) -> Path:
    file = data / "weights" / "lpips_alexnet.npz"
    if not file.is_file():
        pytest.skip(f"no weights of LPIPS at {file} (set GASP_DATA)")
    return file


@pytest.fixture(scope="session")
def trained(trained_file) -> LpipsWeights:
    return load_lpips_weights(trained_file)


@pytest.fixture(scope="session")
def untrained() -> LpipsWeights:
    """Random weights, for what holds whatever the weights are."""
    rng = np.random.default_rng(0)
    shapes = [(11, 11, 3, 64), (5, 5, 64, 192), (3, 3, 192, 384), (3, 3, 384, 256), (3, 3, 256, 256)]
    return LpipsWeights(
        # Scaled so that features neither die out nor grow from layer to layer.
        kernels=tuple(rng.normal(size=shape) * np.sqrt(2 / np.prod(shape[:3])) for shape in shapes),
        biases=tuple(rng.normal(size=shape[3]) / 10 for shape in shapes),
        heads=tuple(rng.uniform(size=shape[3]) for shape in shapes),
    )


@pytest.fixture
def random_picture():
    """Makes a picture of random pixels, a different one for every seed."""

    def make(height: int = 64, width: int = 64, seed: int = 0):
        return np.random.default_rng(seed).uniform(size=(height, width, 3))

    return make
