"""Products and lengths of a few vectors are NumPy's own, to the last bit."""

import numpy as np
import pytest

from gasp_core.gaussians import rotation_matrices
from gasp_core.stepping.rigid.turning import rotations_of
from gasp_core.stepping.vectors import crossed, lengths


@pytest.fixture
def vectors():
    rng = np.random.default_rng(0)
    return rng.normal(size=(2, 500, 3)) * 10.0 ** rng.integers(-150, 150, (2, 500, 3))


def test_cross_products(vectors):
    one, other = vectors
    assert np.array_equal(crossed(one, other), np.cross(one, other))
    assert np.array_equal(crossed(one[0], other), np.cross(one[0], other))
    assert np.array_equal(crossed(one[0], other[0]), np.cross(one[0], other[0]))
    # Columns of a wider array, and nothing.
    wide = np.concatenate([one, other], axis=1)
    assert np.array_equal(crossed(wide[:, 3:], one), np.cross(other, one))
    assert crossed(one[:0], other[:0]).shape == (0, 3)


def test_lengths(vectors):
    one, _ = vectors
    assert np.array_equal(lengths(one), np.linalg.norm(one, axis=1))
    assert lengths(one[:0]).shape == (0,)


def test_rotations():
    quaternions = np.random.default_rng(0).normal(size=(500, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    assert np.array_equal(rotations_of(quaternions), rotation_matrices(quaternions))
