"""The stiffness of one cell of a cage: a hexahedron with incompatible modes."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["CORNERS", "cell_stiffness", "elasticity"]

Array = NDArray[Any]

CORNERS: Array = np.array(list(itertools.product((0, 1), repeat=3)))
"""Corners of a cell, (8, 3) in cells: x slowest, z fastest, as MuJoCo orders the nodes of a lattice."""

_GAUSS = 1 / np.sqrt(3)


def elasticity(youngs_modulus: float, poissons_ratio: float) -> Array:
    """Hooke's law, (6, 6) [Pa], for strains (xx, yy, zz, 2 xy, 2 yz, 2 zx)."""
    shear = youngs_modulus / (2 * (1 + poissons_ratio))
    lame = youngs_modulus * poissons_ratio / ((1 + poissons_ratio) * (1 - 2 * poissons_ratio))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    return law


def cell_stiffness(sides: ArrayLike, law: Array) -> Array:
    """Stiffness (24, 24) [N/m] of a box, rows x, y, z of each of `CORNERS`, by eight-point Gauss quadrature.

    Trilinear displacements alone cannot bend: a cell that should curve shears instead, and one that keeps its volume
    locks. So each component has three modes of the cell's own, 1 - xi^2 along each axis, which no neighbour sees; they
    are eliminated by static condensation (Wilson et al. 1973, "Incompatible displacement models"; on boxes they pass
    the patch test as they stand, Taylor, Beresford and Wilson 1976, 10.1002/nme.1620100602). A constant strain does not
    move them, so that stretch and shear stay exact.

    Parameters
    ----------
    sides : (3,) [m]
    law : (6, 6) [Pa]
        `elasticity`.
    """
    half = np.asarray(sides, dtype=float) / 2
    signs = 2.0 * CORNERS - 1
    stiffness = np.zeros((33, 33))
    for place in _GAUSS * signs:
        # d/dx of prod (1 + s xi) / 8, and of 1 - xi^2.
        parts = 1 + signs * place
        slopes = signs * parts[:, [1, 2, 0]] * parts[:, [2, 0, 1]] / 8
        gradients = np.concatenate([slopes, np.diag(-2 * place)]) / half
        strain = np.concatenate([_strain(gradient) for gradient in gradients], axis=1)
        stiffness += strain.T @ law @ strain * half.prod()
    nodal, own = slice(0, 24), slice(24, 33)
    condensed = np.linalg.solve(stiffness[own, own], stiffness[own, nodal])
    return _balanced(stiffness[nodal, nodal] - stiffness[nodal, own] @ condensed)


def _balanced(stiffness: Array) -> Array:
    """The same, without what rounding left of forces on a cell that is only shifted: it would add up to momentum."""
    blocks = stiffness.reshape(8, 3, 8, 3)
    blocks = blocks - blocks.mean(axis=0, keepdims=True)
    blocks = blocks - blocks.mean(axis=2, keepdims=True)
    return blocks.reshape(24, 24)


def _strain(gradient: Array) -> Array:
    """Strain (6, 3) that the three components of a displacement with this gradient (3,) [1/m] make."""
    x, y, z = gradient
    return np.array([[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]])
