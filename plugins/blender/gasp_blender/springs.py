"""The network of springs in a cage: its edges, and which stiffness makes it the material asked for.

Blender's springs pull along their length with a force in proportion to their strain, the same for every spring of an
object: k = a / l of a spring of length l, a being a force [N]. Springs along the edges of voxels and across their faces
alone are too soft in shear by a sixth; with one of the four diagonals of each voxel, in turn, the network is isotropic
to a twentieth (Zener's ratio 1.05). A network of central forces has Cauchy's symmetry and so Poisson's ratio 1/4,
whatever is asked for (Love 1927, note B). The force is chosen so that the network's energy is that of the material,
E eps^2 / 2 a volume, when it is stretched along its longest side.

A spring in a body's surface stands for half as much matter as one within. Blender weighs a spring by the fourth power
of the mean of its ends' weights: a node's is the fourth root of the share of its eight voxels that are there, which
halves springs along a face, and is a compromise for those that lead away from one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage

__all__ = ["POISSONS_RATIO", "fastest_pulse", "node_weights", "spring_edges", "spring_force", "spring_weights"]

Array = NDArray[Any]

POISSONS_RATIO = 0.25
"""Of the network, whatever the material's is."""

_BITS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_PAIRS = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_BITS[a] - _BITS[b]).sum() <= 2])
_DIAGONALS = np.array([(0, 7), (1, 6), (2, 5), (3, 4)])
_EQUAL = 0.05
"""Sides that differ by less are equally long."""
_ROUNDS = 60


def spring_edges(cage: Cage) -> Array:
    """Pairs of nodes (E, 2), each once, sorted."""
    turn = (cage.parity[:, 0] + 2 * cage.parity[:, 1] + 3 * cage.parity[:, 2]) % 4
    diagonal = np.take_along_axis(cage.voxels, _DIAGONALS[turn], axis=1)
    pairs = np.concatenate([cage.voxels[:, _PAIRS].reshape(-1, 2), diagonal])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def node_weights(cage: Cage) -> Array:
    """Of each node (V,), in (0, 1]: the fourth root of the share of its voxels that are there."""
    return (np.bincount(cage.voxels.ravel(), minlength=len(cage.nodes)) / 8) ** 0.25


def spring_weights(weights: Array, edges: Array) -> Array:
    """What Blender makes of them for a spring, (E,)."""
    return weights[edges].mean(axis=1) ** 4


def spring_force(nodes: Array, edges: Array, weights: Array, youngs_modulus: float, volume: float) -> float:
    """Force a spring of weight one bears at a strain of one [N].

    Parameters
    ----------
    nodes, edges, weights
        (V, 3) [m], (E, 2), and of springs (E,).
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
    energy = float(np.mean(((weights * lengths)[:, None] * strains**2).sum(axis=0)[longest]))
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
