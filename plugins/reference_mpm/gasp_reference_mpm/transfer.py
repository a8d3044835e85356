"""Between points and grid: affine particle-in-cell transfers with quadratic B-splines.

A point speaks to the 3 x 3 x 3 nodes around it. It carries its velocity v and an affine field C about itself, so that
what it gives to the grid and takes back is exact for every velocity field that is affine in space, and linear and
angular momentum are conserved (Jiang et al. 2015, 10.1145/2766996; the moving-least-squares form is Hu et al. 2018,
10.1145/3197517.3201293). Stress acts, and the rate of deformation is read, by the kernel of `gasp_core.stepping.mpm`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.mpm import GRADIENT_SHARE, presence

__all__ = [
    "GridMomentum",
    "Stencil",
    "carried",
    "gather",
    "inverse_inertia",
    "local_means",
    "reaching",
    "scatter",
    "stencil_around",
]

Array = NDArray[Any]

_NEIGHBOURS = np.array(list(itertools.product(range(3), repeat=3)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stencil:
    """The nodes each point speaks to.

    Parameters
    ----------
    nodes : (N, 27)
        Flat index of each node in the box of nodes around the cloud.
    weights : (N, 27)
        B-spline values; each row sums to one.
    arms : (N, 27, 3) [m]
        From point to node; each row's weighted sum is zero.
    gradients : (N, 27, 3) [1/m]
        The kernel by which stress acts; each row sums to zero, and to the identity with the arms.
    corner : (3,)
        Whole-number coordinates of the box's lowest node, in cells.
    shape
        Number of nodes of the box along each axis.
    """

    nodes: Array
    weights: Array
    arms: Array
    gradients: Array
    corner: Array
    shape: tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMomentum:
    """What the points gave to the nodes that received anything.

    Parameters
    ----------
    nodes : (G,)
        Flat indices of the nodes with mass.
    mass : (G,) [kg]
    momentum : (G, 3) [kg m/s]
    positions : (G, 3) [m]
    presence : (G,)
        How much a node counts for tracers.
    """

    nodes: Array
    mass: Array
    momentum: Array
    positions: Array
    presence: Array


def inverse_inertia(spacing: float) -> float:
    """1/D [1/m^2], where D I = sum_i w_i (x_i - x_p)(x_i - x_p)^T is the same wherever the point is in its cell."""
    return 4.0 / spacing**2


def _splines(cells: Array) -> tuple[Array, Array, Array]:
    """First node (N, 3), offset from it (N, 3) and B-spline values along each axis (N, 3, 3) at places in cells."""
    base = np.floor(cells - 0.5).astype(np.int64)
    offset = cells - base  # in [1/2, 3/2): the middle node of the three is the nearest one
    return base, offset, np.stack([0.5 * (1.5 - offset) ** 2, 0.75 - (offset - 1) ** 2, 0.5 * (offset - 0.5) ** 2], 1)


def _products(along: Array) -> Array:
    """Weights (N, 27) of the nodes from those along each axis (N, 3, 3)."""
    i, j, k = _NEIGHBOURS.T
    return along[:, i, 0] * along[:, j, 1] * along[:, k, 2]


def stencil_around(positions: Array, spacing: float) -> Stencil:
    """Nodes, weights and arms of points at `positions` (N, 3) [m], nodes being the multiples of `spacing` [m]."""
    base, offset, along = _splines(positions / spacing)
    arms = np.arange(3)[:, None] - offset[:, None, :]
    slopes = np.stack([offset - 1.5, 2 - 2 * offset, offset - 0.5], axis=1)
    pull = ((1 - GRADIENT_SHARE) * 4 * along * arms + GRADIENT_SHARE * slopes) / spacing
    corner = base.min(axis=0)
    shape = tuple(int(length) for length in base.max(axis=0) - corner + 3)
    node = (base - corner)[:, None, :] + _NEIGHBOURS
    i, j, k = _NEIGHBOURS.T
    return Stencil(
        nodes=(node[..., 0] * shape[1] + node[..., 1]) * shape[2] + node[..., 2],
        weights=_products(along),
        arms=(_NEIGHBOURS - offset[:, None, :]) * spacing,
        gradients=np.stack(
            [
                pull[:, i, 0] * along[:, j, 1] * along[:, k, 2],
                along[:, i, 0] * pull[:, j, 1] * along[:, k, 2],
                along[:, i, 0] * along[:, j, 1] * pull[:, k, 2],
            ],
            axis=-1,
        ),
        corner=corner,
        shape=(shape[0], shape[1], shape[2]),
    )


def scatter(
    stencil: Stencil, spacing: float, masses: Array, velocities: Array, affine_velocities: Array, tensions: Array
) -> GridMomentum:
    """Points to grid: p_i = sum_p w m (v + C (x_i - x_p)) - T a_i, m_i = sum_p w m, a the kernel of the stress.

    Parameters
    ----------
    masses : (N,) [kg]
    velocities : (N, 3) [m/s]
    affine_velocities : (N, 3, 3) [1/s]
        C.
    tensions : (N, 3, 3) [N m s]
        T = dt V0 tau, what a point's stress gives in a step.
    """
    size = int(np.prod(stencil.shape))
    rows = stencil.nodes.ravel()
    mass = np.bincount(rows, (stencil.weights * masses[:, None]).ravel(), size)
    nodes = np.flatnonzero(mass)
    given = velocities[:, None, :] + stencil.arms @ affine_velocities.transpose(0, 2, 1)
    given *= (masses[:, None] * stencil.weights)[..., None]
    given -= stencil.gradients @ tensions.transpose(0, 2, 1)
    momentum = np.stack([np.bincount(rows, given[..., axis].ravel(), size)[nodes] for axis in range(3)], axis=1)
    index = np.stack(np.unravel_index(nodes, stencil.shape), axis=1) + stencil.corner
    return GridMomentum(
        nodes=nodes,
        mass=mass[nodes],
        momentum=momentum,
        positions=index * spacing,
        presence=presence(mass[nodes], float(masses.mean())),
    )


def gather(stencil: Stencil, spacing: float, nodes: Array, grid_velocities: Array) -> tuple[Array, Array, Array]:
    """Grid to points: v = sum_i w v_i, C = 1/D sum_i w v_i (x_i - x_p)^T and L = sum_i v_i a_i^T.

    Parameters
    ----------
    nodes : (G,)
        Flat indices of the nodes that have a velocity, among them every node of the stencil.
    grid_velocities : (G, 3) [m/s]

    Returns
    -------
    velocities (N, 3) [m/s], affine velocities C (N, 3, 3) [1/s], velocity gradients L (N, 3, 3) [1/s].
    """
    place = np.zeros(int(np.prod(stencil.shape)), dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    around = grid_velocities[place[stencil.nodes]]
    weighted = stencil.weights[..., None] * around
    affine_velocities = inverse_inertia(spacing) * (weighted.transpose(0, 2, 1) @ stencil.arms)
    return weighted.sum(axis=1), affine_velocities, around.transpose(0, 2, 1) @ stencil.gradients


def carried(stencil: Stencil, spacing: float, grid: GridMomentum, grid_velocities: Array, places: Array) -> Array:
    """Velocities (M, 3) [m/s] of massless tracers at `places` (M, 3) [m].

    The mean over the nodes around each, weighted by the B-splines and by how much matter a node stands for
    (`gasp_core.stepping.mpm.presence`); where there is none, zero.

    Parameters
    ----------
    stencil
        Of the points: where the nodes are.
    grid
        What the points gave to them.
    grid_velocities : (G, 3) [m/s]
    """
    box = np.array(stencil.shape)
    # What is too far away to be counted in cells is as far as anything outside the box.
    base, _, along = _splines(np.clip(places / spacing, stencil.corner - 9.0, stencil.corner + box + 9.0))
    node = (base - stencil.corner)[:, None, :] + _NEIGHBOURS
    within: Array = np.all((node >= 0) & (node < box), axis=2)
    node = np.where(within[..., None], node, 0)
    size = int(np.prod(box))
    place = np.zeros(size, dtype=np.int64)
    place[grid.nodes] = np.arange(len(grid.nodes))
    present = np.zeros(size)
    present[grid.nodes] = grid.presence
    flat = (node[..., 0] * box[1] + node[..., 1]) * box[2] + node[..., 2]
    weights = np.where(within, _products(along) * present[flat], 0.0)
    total = weights.sum(axis=1)
    sums = (weights[:, None, :] @ grid_velocities[place[flat]])[:, 0]
    return sums / np.where(total > 0, total, 1.0)[:, None]


def local_means(stencil: Stencil, rows: Array, volumes: Array, values: Array) -> Array:
    """Means (K,) of values (K,) over the nodes around the points `rows` (K,), which weigh by volumes (K,) [m^3]."""
    nodes, weights = stencil.nodes[rows], stencil.weights[rows]
    size = int(np.prod(stencil.shape))
    shares = weights * volumes[:, None]
    total = np.bincount(nodes.ravel(), (shares * values[:, None]).ravel(), size)
    volume = np.bincount(nodes.ravel(), shares.ravel(), size)
    # A share may round to nothing, and then its node's mean is nothing that anybody asks for.
    means = total / np.where(volume > 0, volume, 1.0)
    return np.sum(weights * means[nodes], axis=1)


def reaching(stencil: Stencil, nodes: Array) -> Array:
    """Mask (N,) of the points that speak to any of these nodes, flat indices (K,)."""
    marked = np.zeros(int(np.prod(stencil.shape)), dtype=np.bool_)
    marked[nodes] = True
    return np.any(marked[stencil.nodes] & (stencil.weights > 0), axis=1)
