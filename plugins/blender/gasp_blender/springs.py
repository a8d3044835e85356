"""The network of springs in a cage: its edges, and which stiffness makes it the material asked for.

Blender's springs pull along their length with a force in proportion to their strain, the same for every spring of an
object: k = a / l of a spring of length l, a being a force [N]. Each voxel has a quarter of a spring along each of its
edges, half a one across each way over its faces, and a quarter along each of its four diagonals, so that the whole has
one along edges, one over faces, and a quarter within: isotropic to a twentieth (Zener's ratio 1.05). Quarters are what
Blender gets, an edge of its mesh for each, several between the same two nodes. A network of central forces has Cauchy's
symmetry and so Poisson's ratio 1/4, whatever is asked for (Love 1927, note B). The force is chosen so that the
network's energy is that of the material, E eps^2 / 2 a volume, when it is stretched along its longest side.

Springs lie in layers, and what they add up over a thickness is the trapezoidal rule, which makes a plate of two voxels
bend by a quarter too little. So layers weigh what Gregory's rule of third order says, 3/8, 7/6, 23/24, 1, 1, ... (for
two voxels Simpson's 1/3, 4/3, 1/3), which is right for the square of the height. Blender weighs a spring by the fourth
power of the mean of its ends' weights.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage
from gasp_blender.voxel_rows import ranks

__all__ = ["POISSONS_RATIO", "fastest_pulse", "node_weights", "spring_edges", "spring_force", "spring_shares"]

Array = NDArray[Any]

POISSONS_RATIO = 0.25
"""Of the network, whatever the material's is."""

_BITS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_PAIRS = np.array([(a, b) for a in range(8) for b in range(a + 1, 8)])
_QUARTERS = np.array([0, 1, 2, 1])[np.abs(_BITS[_PAIRS[:, 0]] - _BITS[_PAIRS[:, 1]]).sum(axis=1)]
"""Of a spring, for a voxel's edges, the ways over its faces, and its diagonals."""
_GREGORY = np.array([-1 / 8, 1 / 6, -1 / 24])
"""What the first three weights differ by from those of the trapezoidal rule."""
_EQUAL = 0.05
"""Sides that differ by less are equally long."""
_ROUNDS = 60


def spring_edges(cage: Cage) -> tuple[Array, Array]:
    """Pairs of nodes (E, 2), each once, sorted, and how many quarters of a spring are between them, (E,)."""
    pairs = np.sort(cage.voxels[:, _PAIRS].reshape(-1, 2), axis=1)
    edges, own = np.unique(pairs, axis=0, return_inverse=True)
    quarters = np.bincount(own.reshape(-1), np.tile(_QUARTERS, len(cage.voxels)))
    return edges, quarters.astype(np.int64)


def node_weights(cage: Cage) -> Array:
    """Of each node (V,), in (0, 1]: the fourth root of what it weighs in Gregory's rule over the trapezoidal one."""
    places = _lattice(cage)
    factors = np.ones(len(places))
    for axis in range(3):
        factors *= _line_factors(places, axis)
    return (factors / factors.max()) ** 0.25


def _lattice(cage: Cage) -> Array:
    """Places of nodes in voxels, (V, 3)."""
    sizes = cage.nodes[cage.voxels[0, 7]] - cage.nodes[cage.voxels[0, 0]]
    return np.rint((cage.nodes - cage.nodes.min(axis=0)) / sizes).astype(np.int64)


def _line_factors(places: Array, axis: int) -> Array:
    """Of nodes (V,), along the straight rows of neighbours in which they lie."""
    before, after = ranks(places, axis)
    weights = np.where((before == 0) | (after == 0), 0.5, 1.0)
    trapezoidal = weights.copy()
    for k, gain in enumerate(_GREGORY):
        weights += gain * ((before == k) + 1.0 * (after == k))
    # Over a single voxel both are the same.
    return np.where(before + after > 1, weights / trapezoidal, 1.0)


def spring_shares(weights: Array, edges: Array, quarters: Array) -> Array:
    """How many springs of weight one are between nodes, (E,)."""
    return quarters / 4 * weights[edges].mean(axis=1) ** 4


def spring_force(nodes: Array, edges: Array, shares: Array, youngs_modulus: float, volume: float) -> float:
    """Force a spring of weight one bears at a strain of one [N].

    Parameters
    ----------
    nodes, edges
        (V, 3) [m] and (E, 2).
    shares : (E,)
        How many springs there are.
    youngs_modulus
        E [Pa].
    volume
        Of the matter in the cage [m^3].
    """
    spans = nodes[edges[:, 1]] - nodes[edges[:, 0]]
    lengths = np.linalg.norm(spans, axis=1)
    directions = spans / lengths[:, None]
    along = directions**2
    # n . eps n under unit strain along each axis in turn, the others narrowing.
    strains = (1 + POISSONS_RATIO) * along - POISSONS_RATIO
    sizes = np.ptp(nodes, axis=0)
    longest = sizes >= (1 - _EQUAL) * sizes.max()
    energy = float(np.mean(((shares * lengths)[:, None] * strains**2).sum(axis=0)[longest]))
    return youngs_modulus * volume / energy


def fastest_pulse(nodes: Array, edges: Array, forces: Array, masses: Array) -> float:
    """Angular frequency [rad/s] of the network's stiffest mode, by power iteration.

    Forces (E,) [N] are those of springs at a strain of one, masses (V,) [kg].
    """
    spans = nodes[edges[:, 1]] - nodes[edges[:, 0]]
    lengths = np.linalg.norm(spans, axis=1)
    directions = spans / lengths[:, None]
    stiffness = (forces / lengths)[:, None]
    # Of no symmetry, and the same in every run.
    shape = np.sin(np.arange(1.0, 3 * len(nodes) + 1) ** 2).reshape(-1, 3)
    shape /= np.linalg.norm(shape)
    roots = np.sqrt(masses)[:, None]
    square = 0.0
    for _ in range(_ROUNDS):
        moved = shape / roots
        pull = stiffness * directions * ((moved[edges[:, 1]] - moved[edges[:, 0]]) * directions).sum(axis=1)[:, None]
        net = np.stack(
            [
                np.bincount(edges[:, 0], -pull[:, k], minlength=len(nodes))
                + np.bincount(edges[:, 1], pull[:, k], minlength=len(nodes))
                for k in range(3)
            ],
            axis=1,
        )
        shape = net / roots
        square = float(np.linalg.norm(shape))
        shape /= square
    # Power iteration comes from below; Gershgorin's circles bound it from above.
    ceiling = 2 * np.max(
        (np.bincount(edges[:, 0], stiffness[:, 0], len(nodes)) + np.bincount(edges[:, 1], stiffness[:, 0], len(nodes)))
        / masses
    )
    return float(np.sqrt(min(1.1 * square, ceiling)))
