"""The stiffness of one cell of a cage: a hexahedron of assumed stresses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.stepping.embedding import CORNERS

__all__ = ["cell_stiffness", "elasticity"]

Array = NDArray[Any]

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
    locks. So the stresses of a cell are assumed, 18 of them, and of all that are in equilibrium in it, the ones are
    taken whose strains come nearest to those of the displacements (Hellinger and Reissner; Pian and Tong 1986,
    Int. J. Numer. Meth. Engng 22, 173). Constant strains have the energy of Hooke's law, so does pure bending, and as
    compliances are finite at any ratio up to 1/2, nothing locks.

    Parameters
    ----------
    sides : (3,) [m]
    law : (6, 6) [Pa]
        `elasticity`.
    """
    half = np.asarray(sides, dtype=float) / 2
    signs = 2.0 * CORNERS - 1
    compliance = np.linalg.inv(law)
    flexibility, coupling = np.zeros((18, 18)), np.zeros((18, 24))
    for place in _GAUSS * signs:
        # d/dx of prod (1 + s xi) / 8.
        parts = 1 + signs * place
        slopes = signs * parts[:, [1, 2, 0]] * parts[:, [2, 0, 1]] / 8 / half
        strain = np.concatenate([_strain(slope) for slope in slopes], axis=1)
        stress = _stresses(place)
        flexibility += stress.T @ compliance @ stress * half.prod()
        coupling += stress.T @ strain * half.prod()
    return _balanced(coupling.T @ np.linalg.solve(flexibility, coupling))


def _stresses(place: Array) -> Array:
    """The assumed stresses (6, 18) at a place (3,) from -1 to 1: each constant, and what bends and twists a box."""
    x, y, z = place
    modes = np.zeros((6, 18))
    modes[:, :6] = np.eye(6)
    modes[0, 6:9] = y, z, y * z
    modes[1, 9:12] = z, x, z * x
    modes[2, 12:15] = x, y, x * y
    modes[[3, 4, 5], [15, 16, 17]] = z, x, y
    return modes


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
