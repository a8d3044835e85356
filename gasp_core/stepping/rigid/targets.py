"""What contacts ask of velocities: how fast surfaces may close, how they bounce, and what of a bounce is allowed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gasp_core.contract import ContactCondition
from gasp_core.stepping.rigid.contacts import CONDITIONS, NO_BODY, Contacts, relative_velocities
from gasp_core.stepping.rigid.surfaces import unit
from gasp_core.stepping.vectors import crossed, lengths

__all__ = ["Targets", "bounce_shares", "targets_of"]

Array = NDArray[Any]

_PARTING = CONDITIONS[ContactCondition.SEPARATE]


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """What C contacts want of relative velocities.

    Parameters
    ----------
    frames : (C, 3, 3)
        Rows: the normal, and two directions across it.
    offsets : (C, 3) [m/s]
        What the walls have along them.
    stopped, bounced : (C,) [m/s]
        The least along the normal, without restitution and with it.
    """

    frames: Array
    offsets: Array
    stopped: Array
    bounced: Array

    @property
    def bounce(self) -> bool:
        """Whether anything leaves faster than it must."""
        return bool((self.bounced > self.stopped).any())


def targets_of(
    contacts: Contacts, before: Array, velocities: Array, centers: Array, step: float, resting: float
) -> Targets:
    """What contacts want of bodies with these velocities (B, 6), which had those of `before` when the step began.

    An open gap may close within the step, but no further. What comes faster than `resting` [m/s] and would touch within
    it leaves with its restitution's share of what it had before: with what the step's gravity has added, too, it would
    rise higher than it fell from.
    """
    closing = relative_velocities(contacts, velocities, centers)
    normals = contacts.normals
    across = closing - np.sum(closing * normals, axis=1, keepdims=True) * normals
    # Across it first along what slides: the second direction then has little to do.
    aside = np.eye(3)[np.abs(normals).argmin(axis=1)] if len(normals) else np.zeros((0, 3))
    slow = lengths(across) < 1e-9
    across[slow] = crossed(normals[slow], aside[slow])
    across = unit(across)
    frames = np.stack([normals, across, crossed(normals, across)], axis=1)
    offsets = np.einsum("cij,cj->ci", frames, contacts.velocities)
    approach = -np.sum(closing * normals, axis=1)
    room = np.maximum(contacts.gaps, 0.0) / step
    parting = contacts.conditions == _PARTING
    stopped = np.where(parting, -room, 0.0)
    bouncing = parting & (approach > resting) & (approach >= room) & (contacts.restitutions > 0)
    came = -np.sum(relative_velocities(contacts, before, centers) * normals, axis=1)
    bounced = np.where(bouncing, np.maximum(contacts.restitutions * came, stopped), stopped)
    return Targets(frames=frames, offsets=offsets, stopped=stopped, bounced=bounced)


def bounce_shares(
    contacts: Contacts,
    frames: Array,
    centers: Array,
    held: Sequence[int],
    before: Array,
    velocities: tuple[Array, Array],
    impulses: tuple[Array, Array],
) -> Array:
    """Shares (B,) of their bounce that bodies get, all that touch each other the same: 1 but where energy would rise.

    Newton's restitution and Coulomb's friction may do work together (Kane and Levinson 1985, "Dynamics", p. 348): of a
    rod that spins, friction turns what it has along the wall around. Half the sum of impulses times relative velocities
    before and after is that work; between no bounce and all of it, it is a parabola. What lies between two motions in
    which nothing enters anything, with friction within its cone, is another such.

    Parameters
    ----------
    frames : (C, 3, 3)
    centers : (B, 3) [m]
    held
        Bodies that contact does not move.
    before : (B, 6)
        Velocities before gravity and contact.
    velocities, impulses : (B, 6), (C, 3) [N s]
        After contact without a bounce, and with it; the impulses along the frames' rows.
    """
    islands = _islands(contacts, held, len(centers))
    first = np.where(np.isin(contacts.first, held) & (contacts.second != NO_BODY), contacts.second, contacts.first)
    least, most = (np.einsum("ci,cij->cj", impulse, frames) for impulse in impulses)
    came, stopped, bounced = (relative_velocities(contacts, one, centers) for one in (before, *velocities))
    given, faster, sums = most - least, bounced - stopped, came + stopped

    def summed(products: Array) -> Array:
        return np.bincount(islands[first], 0.5 * products.sum(axis=1), int(islands.max(initial=-1)) + 1)

    start = summed(least * sums)
    slope, bend = summed(given * sums + least * faster), summed(given * faster)
    # Without a bounce it is below zero, but for what gravity presses together that was about to part.
    room = np.maximum(-start, 0.0)
    excess = slope + bend > room
    # The larger root of bend s^2 + slope s = room; nothing leaves faster by being pushed less: bend >= 0.
    root = np.sqrt(np.maximum(slope**2 + 4 * bend * room, 0.0))
    shares = np.where(excess, (root - slope) / np.maximum(2 * bend, 1e-300), 1.0)
    return np.clip(shares, 0.0, 1.0)[islands]


def _islands(contacts: Contacts, held: Sequence[int], count: int) -> Array:
    """Numbers (B,), the same for bodies that touch each other, or others in between that are not held."""
    pairs = (contacts.second != NO_BODY) & ~np.isin(contacts.first, held) & ~np.isin(contacts.second, held)
    ends = (contacts.first[pairs], contacts.second[pairs])
    touching = coo_array((np.ones(int(pairs.sum())), ends), shape=(count, count))
    return connected_components(touching, directed=False)[1]
