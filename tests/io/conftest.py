"""What the tests of splat files share."""

import os
from pathlib import Path

import numpy as np
import pytest
import splat_files

from gasp_core import io as splat_io
from gasp_core.gaussians import Gaussians

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).resolve().parents[2] / ".." / "shared" / "data")


@pytest.fixture(scope="session")
def data_folder():
    if not (DATA / "splats").is_dir():
        pytest.skip(f"no real splats at {DATA}: set GASP_DATA")
    return DATA


@pytest.fixture(scope="session")
def some():
    """some(count, degree, seed) -> random Gaussians of ordinary sizes, float32."""

    def make(count=7, degree=3, seed=0):
        rng = np.random.default_rng(seed)
        f = np.float32
        return Gaussians(
            means=rng.normal(0, 1, (count, 3)).astype(f),
            quaternions=(rng.normal(0, 1, (count, 4)) * rng.uniform(0.5, 2, (count, 1))).astype(f),
            scales=np.exp(rng.uniform(-8, 0, (count, 3))).astype(f),
            opacities=rng.uniform(0, 1, count).astype(f),
            harmonics=rng.uniform(-0.9, 0.9, (count, (degree + 1) ** 2, 3)).astype(f),
        )

    return make


@pytest.fixture(scope="session")
def build():
    """The builders of tests/support/splat_files.py."""
    return splat_files


@pytest.fixture
def read(tmp_path):
    """read(bytes, name) -> Gaussians of a file with that content."""

    def read_bytes(content, name, **options):
        path = tmp_path / name
        path.write_bytes(content)
        return splat_io.read_splat(path, **options)

    return read_bytes
