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

from gasp_core.stepping.mpm import GRADIENT_SHARE

__all__ = [
    "GridMomentum",
    "NodeFields",
    "Stencil",
    "brought",
    "carried",
    "gather",
    "inverse_inertia",
    "local_means",
    "reaching",
    "scatter",
    "stencil_around",
    "weighted_sums",
]

Array = NDArray[Any]

_NEIGHBOURS = np.array(list(itertools.product(range(3), repeat=3)))


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeFields:
    """Nodes of B bodies, each of which has a velocity field of its own: a box of nodes around each of them.

    The boxes lie one behind the other, and each has a layer more than its body speaks to, so that every node that has
    mass has its neighbours along the axes too.

    Parameters
    ----------
    corners : (B, 3)
        Whole-number coordinates of each box's lowest node, in cells.
    shapes : (B, 3)
        Number of nodes of each box along each axis.
    starts : (B + 1,)
        Flat index of each box's lowest node, and the number of nodes.
    """

    corners: Array
    shapes: Array
    starts: Array

    @property
    def size(self) -> int:
        """Number of nodes of all boxes."""
        return int(self.starts[-1])

    @property
    def strides(self) -> Array:
        """(B, 3): how far a node's neighbours along the axes are from it in flat indices."""
        return np.stack(
            [self.shapes[:, 1] * self.shapes[:, 2], self.shapes[:, 2], np.ones_like(self.shapes[:, 2])], axis=1
        )

    def flat(self, bodies: Array, coordinates: Array) -> Array:
        """Flat indices (...) of nodes at whole-number coordinates (..., 3) in the fields of bodies (...)."""
        return self.starts[bodies] + np.sum((coordinates - self.corners[bodies]) * self.strides[bodies], axis=-1)

    def bodies_of(self, nodes: Array) -> Array:
        """Whose the nodes (G,) are, (G,)."""
        return np.searchsorted(self.starts, nodes, side="right") - 1

    def coordinates(self, nodes: Array) -> Array:
        """Whole-number coordinates (G, 3) of nodes (G,), in cells."""
        bodies = self.bodies_of(nodes)
        strides, rest = self.strides[bodies], nodes - self.starts[bodies]
        i, rest = np.divmod(rest, strides[:, 0])
        j, k = np.divmod(rest, strides[:, 1])
        return np.stack([i, j, k], axis=1) + self.corners[bodies]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stencil:
    """The nodes each point speaks to.

    Parameters
    ----------
    nodes : (N, 27)
        Flat index of each node in the field of the point's body.
    weights : (N, 27)
        B-spline values; each row sums to one.
    arms : (N, 27, 3) [m]
        From point to node; each row's weighted sum is zero.
    gradients : (N, 27, 3) [1/m]
        The kernel by which stress acts; each row sums to zero, and to the identity with the arms.
    fields
        Where the nodes lie.
    """

    nodes: Array
    weights: Array
    arms: Array
    gradients: Array
    fields: NodeFields


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMomentum:
    """What the points gave to the nodes that received anything.

    Parameters
    ----------
    nodes : (G,)
        Flat indices of the nodes with mass.
    mass : (G,) [kg]
    momentum : (G, 3) [kg m/s]
        After the step's stress.
    positions : (G, 3) [m]
    """

    nodes: Array
    mass: Array
    momentum: Array
    positions: Array


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


def _fields_around(base: Array, bodies: Array) -> NodeFields:
    """Of points whose lowest nodes are at `base` (N, 3), in cells, and which are of bodies (N,)."""
    count = int(bodies.max()) + 1
    lowest = np.zeros((count, 3), dtype=np.int64)
    shapes = np.zeros((count, 3), dtype=np.int64)
    for body in range(count):
        own = base[bodies == body] if count > 1 else base
        if len(own):
            lowest[body] = own.min(axis=0) - 1
            shapes[body] = own.max(axis=0) - lowest[body] + 4
    return NodeFields(corners=lowest, shapes=shapes, starts=np.concatenate([[0], np.cumsum(shapes.prod(axis=1))]))


def stencil_around(positions: Array, spacing: float, bodies: Array) -> Stencil:
    """Nodes, weights and arms of points at `positions` (N, 3) [m], nodes being the multiples of `spacing` [m].

    `bodies` (N,) says whose field each point speaks to: 0, 1, 2, ...
    """
    base, offset, along = _splines(positions / spacing)
    arms = np.arange(3)[:, None] - offset[:, None, :]
    slopes = np.stack([offset - 1.5, 2 - 2 * offset, offset - 0.5], axis=1)
    pull = ((1 - GRADIENT_SHARE) * 4 * along * arms + GRADIENT_SHARE * slopes) / spacing
    fields = _fields_around(base, bodies)
    i, j, k = _NEIGHBOURS.T
    return Stencil(
        nodes=fields.flat(bodies, base)[:, None] + fields.strides[bodies] @ _NEIGHBOURS.T,
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
        fields=fields,
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
    size = stencil.fields.size
    rows = stencil.nodes.ravel()
    mass = np.bincount(rows, (stencil.weights * masses[:, None]).ravel(), size)
    nodes = np.flatnonzero(mass)
    given = _given(stencil, masses, velocities, affine_velocities) - stencil.gradients @ tensions.transpose(0, 2, 1)
    return GridMomentum(
        nodes=nodes,
        mass=mass[nodes],
        momentum=_sums(stencil, nodes, given),
        positions=stencil.fields.coordinates(nodes) * spacing,
    )


def brought(stencil: Stencil, nodes: Array, masses: Array, velocities: Array, affine_velocities: Array) -> Array:
    """Momentum (G, 3) [kg m/s] at `nodes` before any stress acts; arrays as of `scatter`."""
    return _sums(stencil, nodes, _given(stencil, masses, velocities, affine_velocities))


def _given(stencil: Stencil, masses: Array, velocities: Array, affine_velocities: Array) -> Array:
    given = velocities[:, None, :] + stencil.arms @ affine_velocities.transpose(0, 2, 1)
    given *= (masses[:, None] * stencil.weights)[..., None]
    return given


def _sums(stencil: Stencil, nodes: Array, given: Array) -> Array:
    """What nodes (G,) get of what each point gives to those around it (N, 27, 3)."""
    rows, size = stencil.nodes.ravel(), stencil.fields.size
    return np.stack([np.bincount(rows, given[..., axis].ravel(), size)[nodes] for axis in range(3)], axis=1)


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
    place = np.zeros(stencil.fields.size, dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    around = grid_velocities[place[stencil.nodes]]
    weighted = stencil.weights[..., None] * around
    affine_velocities = inverse_inertia(spacing) * (weighted.transpose(0, 2, 1) @ stencil.arms)
    return weighted.sum(axis=1), affine_velocities, around.transpose(0, 2, 1) @ stencil.gradients


def weighted_sums(stencil: Stencil, nodes: Array, values: Array) -> Array:
    """sum_i w_i q_i (N,) of values (G,) at nodes (G,), among them every node of the stencil."""
    everywhere = np.zeros(stencil.fields.size)
    everywhere[nodes] = values
    return np.sum(stencil.weights * everywhere[stencil.nodes], axis=1)


def carried(
    stencil: Stencil,
    spacing: float,
    nodes: Array,
    present: Array,
    grid_velocities: Array,
    places: Array,
    bodies: Array,
) -> Array:
    """Velocities (M, 3) [m/s] of massless tracers at `places` (M, 3) [m].

    The mean over the nodes around each, weighted by the B-splines and by how much matter a node stands for; where there
    is none, zero.

    Parameters
    ----------
    stencil
        Of the points: where the nodes are.
    nodes, present : (G,)
        Which of them have mass, and how much each counts (`gasp_core.stepping.mpm.presence`).
    grid_velocities : (G, 3) [m/s]
    bodies : (M,)
        Whose matter carries each.
    """
    fields = stencil.fields
    # What is too far away to be counted in cells is as far as anything outside the boxes.
    lowest, highest = fields.corners.min(axis=0), (fields.corners + fields.shapes).max(axis=0)
    base, _, along = _splines(np.clip(places / spacing, lowest - 9.0, highest + 9.0))
    node, products = base[:, None, :] + _NEIGHBOURS, _products(along)
    place = np.zeros(fields.size, dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    counts = np.zeros(fields.size)
    counts[nodes] = present
    total, sums = np.zeros(len(places)), np.zeros((len(places), 3))
    for body, (corner, shape) in enumerate(zip(fields.corners, fields.shapes)):
        within: Array = np.all((node >= corner) & (node < corner + shape), axis=2) & (bodies == body)[:, None]
        if not within.any():
            continue
        flat = fields.flat(np.array(body), np.where(within[..., None], node, corner))
        weights = np.where(within, products * counts[flat], 0.0)
        total += weights.sum(axis=1)
        sums += (weights[:, None, :] @ grid_velocities[place[flat]])[:, 0]
    return sums / np.where(total > 0, total, 1.0)[:, None]


def local_means(stencil: Stencil, rows: Array, volumes: Array, values: Array) -> Array:
    """Means (K,) of values (K,) over the nodes around the points `rows` (K,), which weigh by volumes (K,) [m^3]."""
    nodes, weights = stencil.nodes[rows], stencil.weights[rows]
    size = stencil.fields.size
    shares = weights * volumes[:, None]
    total = np.bincount(nodes.ravel(), (shares * values[:, None]).ravel(), size)
    volume = np.bincount(nodes.ravel(), shares.ravel(), size)
    # A share may round to nothing, and then its node's mean is nothing that anybody asks for.
    means = total / np.where(volume > 0, volume, 1.0)
    return np.sum(weights * means[nodes], axis=1)


def reaching(stencil: Stencil, nodes: Array) -> Array:
    """Mask (N,) of the points that speak to any of these nodes, flat indices (K,)."""
    marked = np.zeros(stencil.fields.size, dtype=np.bool_)
    marked[nodes] = True
    return np.any(marked[stencil.nodes] & (stencil.weights > 0), axis=1)
