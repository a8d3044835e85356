"""Where bodies meet on the grid: each has a velocity of its own at a node, and here these are made compatible.

At a node that several bodies speak to, two of them are in contact if they approach each other and their surfaces touch
(Bardenhagen et al. 2001, "An improved contact algorithm for the material point method and application to stress
propagation in granular material"). They exchange opposite impulses at one place, along the normal and, by friction,
across it; so linear and angular momentum of the pair are kept to rounding, and energy does not rise.

Sharing a node says little about touching: bodies do so across a gap of two cells. How far apart their surfaces are is
asked of the points around the node now and then, `gasp_reference_mpm.separation`, as in Nairn, Hammerquist and Smith
2020 ("New material point method contact algorithms for improved accuracy, large-deformation problems, and proper null
space filtering").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BodyContact, ContactCondition, PointProblem
from gasp_core.stepping.mpm import HELD_TOGETHER
from gasp_reference_mpm.separation import Separation, keys_of, separated
from gasp_reference_mpm.transfer import GridMomentum, NodeFields, Stencil

__all__ = ["looked", "met"]

Array = NDArray[Any]


def met(
    problem: PointProblem,
    stencil: Stencil,
    grid: GridMomentum,
    velocities: Array,
    held: Array,
    separation: Separation,
    spacing: float,
    step: float,
) -> tuple[Array, Separation]:
    """Velocities (G, 3) [m/s] of the nodes after `step` [s] of contact between all bodies, and how far these are then.

    Where more than two bodies share a node, its pairs take turns in the order of the bodies' numbers, (0, 1), (0, 2),
    (1, 2), and back again; each meets with the velocities that the turns before have left.

    Parameters
    ----------
    velocities : (G, 3) [m/s]
    held : (G,)
        Nodes whose velocity is prescribed: no impulse moves them.
    separation
        Of the bodies before the step; where it says nothing there is no contact.
    """
    pairs = _pairs(stencil.fields, grid.nodes)
    if not len(pairs.first):
        return velocities, separation
    rows = separation.rows_of(keys_of(stencil, grid, pairs.first, pairs.second))
    known = rows >= 0
    normals, gaps = np.zeros((len(rows), 3)), np.full(len(rows), np.inf)
    normals[known], gaps[known] = separation.normals[rows[known]], separation.gaps[rows[known]]
    velocities = velocities.copy()
    inverse_masses = np.where(held, 0.0, 1 / grid.mass)
    bodies = stencil.fields.bodies_of(grid.nodes)
    for turn in pairs.turns:
        for low, high in np.unique(np.stack([bodies[pairs.first[turn]], bodies[pairs.second[turn]]], 1), axis=0):
            own = turn[(bodies[pairs.first[turn]] == low) & (bodies[pairs.second[turn]] == high)]
            first, second = pairs.first[own], pairs.second[own]
            contact = problem.contact_between(int(low), int(high))
            closing = velocities[first] - velocities[second]
            shares = inverse_masses[first] + inverse_masses[second]
            inertia = np.where(shares > 0, 1 / np.where(shares > 0, shares, 1.0), 0.0)
            impulses = inertia[:, None] * _taken(contact, closing, normals[own], gaps[own], spacing, step)
            velocities[first] -= inverse_masses[first, None] * impulses
            velocities[second] += inverse_masses[second, None] * impulses
    approach = np.sum((velocities[pairs.first] - velocities[pairs.second]) * normals, axis=1)
    return velocities, separation.closed(rows[known], step * approach[known])


def looked(stencil: Stencil, grid: GridMomentum, reaches: Array, spacing: float) -> Separation:
    """How far apart all bodies are now; `reaches` (N, 3, 3) [m] is half of what each point stands for, s/2 F."""
    pairs = _pairs(stencil.fields, grid.nodes)
    if not len(pairs.first):
        return Separation(keys=np.zeros((0, 5), dtype=np.int64), normals=np.zeros((0, 3)), gaps=np.zeros(0))
    return separated(stencil, grid, pairs.first, pairs.second, reaches, spacing)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pairs:
    """What meets.

    Parameters
    ----------
    first, second : (P,)
        Rows of the grid that are one node of two bodies, `first` being of the body with the lower number.
    turns
        Indices of pairs, no node twice among them, in the order in which they meet.
    """

    first: Array
    second: Array
    turns: list[Array]


def _pairs(fields: NodeFields, nodes: Array) -> _Pairs:
    """Pairs among the nodes (G,) that have mass."""
    nothing = np.zeros(0, dtype=np.int64)
    if len(fields.corners) == 1:
        return _Pairs(first=nothing, second=nothing, turns=[])
    coordinates = fields.coordinates(nodes)
    key = np.ravel_multi_index(tuple((coordinates - coordinates.min(axis=0)).T), tuple(np.ptp(coordinates, axis=0) + 1))
    order: Array = np.argsort(key, kind="stable")  # rows of one node stay in the order of their bodies
    starts = np.flatnonzero(np.diff(np.asarray(key)[order], prepend=-1))
    counts = np.diff(starts, append=len(order))
    most = int(counts.max())
    first, second, forth, back = [nothing], [nothing], list[Array](), list[Array]()
    begin = 0
    for low in range(most):
        for high in range(low + 1, most):
            there = counts > high
            first.append(order[starts[there] + low])
            second.append(order[starts[there] + high])
            pairs = np.arange(begin, begin + np.count_nonzero(there))
            begin += len(pairs)
            forth.append(pairs)
            # The last pair of a node has just met.
            is_last = (counts[there] == high + 1) & (low + 1 == high)
            back.append(pairs[~is_last])
    return _Pairs(first=np.concatenate(first), second=np.concatenate(second), turns=forth + back[::-1])


def _taken(contact: BodyContact, closing: Array, normals: Array, gaps: Array, spacing: float, step: float) -> Array:
    """What contact takes of `closing` (P, 3) [m/s], the velocity of the first body relative to the second."""
    approach = np.sum(closing * normals, axis=1, keepdims=True)
    across = closing - approach * normals
    touching = (gaps <= HELD_TOGETHER * spacing)[:, None]
    match contact.contact:
        case ContactCondition.STICK:
            return np.where(touching, closing, 0.0)
        case ContactCondition.SLIP:
            return np.where(touching, approach * normals, 0.0)
        case ContactCondition.SEPARATE:
            # An open gap may close within the step, but no further.
            stopped = np.maximum(approach - np.maximum(gaps, 0.0)[:, None] / step, 0.0)
            speed = np.linalg.norm(across, axis=1, keepdims=True)
            braked = np.minimum(contact.friction * stopped / np.where(speed > 0, speed, 1.0), 1.0)
            return stopped * normals + braked * across
