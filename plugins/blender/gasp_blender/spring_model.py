"""Elastic bodies as one network of springs, in SI units, and how points ride on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage, build_cage, gather, scatter
from gasp_blender.springs import fastest_pulse, node_weights, spring_edges, spring_force, spring_shares
from gasp_core.contract import Elastic, PointProblem
from gasp_core.errors import SceneError

__all__ = ["Matter", "connected", "elastic_matter", "elastic_rows", "half_side", "node_velocities"]

Array = NDArray[Any]

_LEAST_MASS = 0.1
"""Of a cage's mean nodal mass. A node inside a hollow shell has no points and would have none."""
_SOLVES = 600
"""Rounds of conjugate gradients at most; a regular cage takes some tens."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Matter:
    """The network and its points.

    Parameters
    ----------
    rows : (N,)
        Of the problem's points that it carries.
    cage
        Of all bodies together.
    edges : (E, 2)
        Springs, rows of the cage's nodes.
    quarters : (E,)
        How many quarters of a spring each is.
    bodies : (V,)
        Of the nodes, 0 to B - 1.
    masses : (V,) [kg]
        Of the nodes.
    forces : (V,) [N]
        Of a spring of the node's body, at a strain of one.
    point_masses : (N,) [kg]
    coupling : (V,) [kg]
        What the points bring to each node; 0 inside a hollow body.
    stable_step
        Largest step [s]: of an undamped explicit scheme, two over the fastest angular frequency.
    weights : (V,)
        Of the nodes' springs, as Blender has them.
    sizes : (V,) [m]
        How far the matter of each node goes beyond it: half the thickness of a net, nothing of a cage.
    is_cloth
        Whether it is a net of quads and triangles.
    """

    rows: Array
    cage: Cage
    edges: Array
    quarters: Array
    bodies: Array
    masses: Array
    forces: Array
    point_masses: Array
    coupling: Array
    stable_step: float
    weights: Array
    sizes: Array
    is_cloth: bool = False


def elastic_matter(problem: PointProblem, spacing: float, most_voxels: int) -> list[Matter]:
    """All bodies of elastic material in cages, as one; none where there are none."""
    parts = [_one_body(problem, rows, spacing, most_voxels) for rows in elastic_rows(problem)]
    return [_joined(parts)] if parts else []


def elastic_rows(problem: PointProblem) -> list[Array]:
    """Rows of the points of each body of elastic material."""
    kinds = np.array([isinstance(material, Elastic) for material in problem.materials])
    chosen = np.flatnonzero(kinds[problem.points.material_ids])
    bodies = problem.points.body_ids[chosen]
    return [chosen[bodies == body] for body in np.unique(bodies)]


def _joined(parts: Sequence[Matter]) -> Matter:
    """Bodies in cages, side by side."""
    starts = np.cumsum([0] + [len(part.masses) for part in parts])
    cage = Cage(
        nodes=np.concatenate([part.cage.nodes for part in parts]),
        voxels=np.concatenate([part.cage.voxels + start for part, start in zip(parts, starts)]),
        parity=np.concatenate([part.cage.parity for part in parts]),
        corners=np.concatenate([part.cage.corners + start for part, start in zip(parts, starts)]),
        weights=np.concatenate([part.cage.weights for part in parts]),
        coarseness=max(part.cage.coarseness for part in parts),
    )
    return Matter(
        rows=np.concatenate([part.rows for part in parts]),
        cage=cage,
        edges=np.concatenate([part.edges + start for part, start in zip(parts, starts)]),
        quarters=np.concatenate([part.quarters for part in parts]),
        bodies=np.repeat(np.arange(len(parts)), [len(part.masses) for part in parts]),
        masses=np.concatenate([part.masses for part in parts]),
        forces=np.concatenate([part.forces for part in parts]),
        point_masses=np.concatenate([part.point_masses for part in parts]),
        coupling=np.concatenate([part.coupling for part in parts]),
        stable_step=min(part.stable_step for part in parts),
        weights=np.concatenate([part.weights for part in parts]),
        sizes=np.concatenate([part.sizes for part in parts]),
    )


def _one_body(problem: PointProblem, rows: Array, spacing: float, most_voxels: int) -> Matter:
    points = problem.points
    volumes = points.reference_volumes[rows]
    margin = half_side(points.reference_positions[rows], volumes)
    cage = build_cage(points.reference_positions[rows], margin, spacing, most_voxels)
    edges, quarters = spring_edges(cage)
    moduli = np.array([getattr(material, "youngs_modulus", 0.0) for material in problem.materials])
    own = moduli[points.material_ids[rows]]
    if own.min() < own.max():
        raise SceneError(
            f"blender: body {int(points.body_ids[rows[0]])} has parts of {own.min():.3g} to {own.max():.3g} Pa, and its"
            " springs one stiffness for all of a body: give it one youngs_modulus, or choose warp-mpm or mujoco-flex"
        )
    modulus = float(own[0])
    weights = node_weights(cage)
    shares = spring_shares(weights, edges, quarters)
    force = spring_force(cage.nodes, edges, shares, modulus, float(volumes.sum()))
    point_masses = problem.masses[rows]
    coupling = scatter(cage, point_masses)
    masses = np.maximum(coupling, _LEAST_MASS * coupling.mean())
    masses *= coupling.sum() / masses.sum()
    return Matter(
        rows=rows,
        cage=cage,
        edges=edges,
        quarters=quarters,
        bodies=np.zeros(len(masses), np.int64),
        masses=masses,
        forces=np.full(len(masses), force),
        point_masses=point_masses,
        coupling=coupling,
        stable_step=2 / fastest_pulse(cage.nodes, edges, force * shares, masses),
        weights=weights,
        sizes=np.zeros(len(masses)),
    )


def half_side(positions: Array, volumes: Array) -> float:
    """Half the side of the cube that a place stands for [m]; points at one place share it."""
    return float((volumes.sum() / len(np.unique(positions, axis=0))) ** (1 / 3)) / 2


def node_velocities(matter: Matter, velocities: Array) -> Array:
    """Velocities of nodes (V, 3) that give the points theirs (N, 3) as nearly as can be [m/s].

    Least squares weighted by mass, by conjugate gradients. They begin with what points around a node have in the mean,
    so that a node without points of its own is not left standing, and where points have the velocities of a field that
    is linear in each voxel they end with that field: a thrown, turning body keeps its spin.
    """
    found = _spread(matter, velocities)
    normal = _voxel_masses(matter)
    wanted = scatter(matter.cage, matter.point_masses[:, None] * velocities)
    residual = wanted - normal(found)
    # Scaled by the lumped mass, which is what the diagonal is within a factor of a few.
    scale = np.where(matter.coupling > 0, 1 / np.where(matter.coupling > 0, matter.coupling, 1.0), 0.0)[:, None]
    direction = scale * residual
    square = float((residual * direction).sum())
    # Where the affine field is all there is, nothing is left to find but rounding.
    target = float((wanted * scale * wanted).sum()) * 1e-28
    for _ in range(_SOLVES):
        if square <= target or square == 0.0:
            break
        image = normal(direction)
        share = square / float((direction * image).sum())
        found = found + share * direction
        residual = residual - share * image
        after = float((residual * scale * residual).sum())
        direction = scale * residual + after / square * direction
        square = after
    return found


def _voxel_masses(matter: Matter) -> Callable[[Array], Array]:
    """Consistent masses: what gathers velocities of nodes at the points and scatters their momenta back, by voxels.

    There are hundreds of points in a voxel, and what they do between its corners is one matrix (8, 8).
    """
    corners, weights = matter.cage.corners, matter.cage.weights
    # A voxel's lowest corner is the lowest of no other.
    _, first, voxel = np.unique(corners[:, 0], return_index=True, return_inverse=True)
    voxel = voxel.reshape(-1)
    blocks = np.empty((len(first), 8, 8))
    for i in range(8):
        for j in range(i + 1):
            products = np.bincount(voxel, matter.point_masses * weights[:, i] * weights[:, j], len(first))
            blocks[:, i, j] = blocks[:, j, i] = products
    rows, count = corners[first], len(matter.masses)

    def momenta(nodes: Array) -> Array:
        shares = np.einsum("gij,gjk->gik", blocks, nodes[rows])
        return np.stack([np.bincount(rows.ravel(), shares[..., k].ravel(), count) for k in range(3)], axis=1)

    return momenta


def _spread(matter: Matter, velocities: Array) -> Array:
    """The affine field of each connected body that is nearest to the velocities of its points, at its nodes."""
    found = np.zeros_like(matter.cage.nodes)
    owners = connected(matter)
    point_owners = owners[matter.cage.corners[:, 0]]
    positions = gather(matter.cage, matter.cage.nodes)
    for body in np.unique(owners):
        own, ours = point_owners == body, owners == body
        mass = matter.point_masses[own][:, None]
        center = (mass * positions[own]).sum(axis=0) / mass.sum()
        mean = (mass * velocities[own]).sum(axis=0) / mass.sum()
        arms = positions[own] - center
        gradient = np.linalg.lstsq(np.sqrt(mass) * arms, np.sqrt(mass) * (velocities[own] - mean), rcond=1e-9)[0]
        found[ours] = mean + (matter.cage.nodes[ours] - center) @ gradient
    return found


def connected(matter: Matter) -> Array:
    """For each node, the least node it is connected with by springs."""
    label = np.arange(len(matter.masses))
    while True:
        least = np.minimum(label[matter.edges[:, 0]], label[matter.edges[:, 1]])
        after = label.copy()
        np.minimum.at(after, matter.edges[:, 0], least)
        np.minimum.at(after, matter.edges[:, 1], least)
        after = after[after]
        if np.array_equal(after, label):
            return label
        label = after
