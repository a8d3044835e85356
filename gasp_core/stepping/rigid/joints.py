"""What sticks or slips holds on to what it has touched, and keeps the distance that it took hold at.

A step moves centres straight on while bodies turn, so that a pair that spins as one would come apart by half the square
of the angle of a step in every step. Of what turns as one, contact therefore asks that the ways of the two surfaces
within the step agree, not their velocities at its beginning; what is left goes with the cube of that angle. A gap that
opens all the same is closed. Both act by impulses that one body gives and the other takes at one place.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import ContactCondition
from gasp_core.stepping.rigid.contacts import CONDITIONS, NO_BODY, Contacts, relative_velocities
from gasp_core.stepping.vectors import crossed, lengths

__all__ = ["NOT_JOINED", "Joints"]

Array = NDArray[Any]

_PARTING, _STICKING = CONDITIONS[ContactCondition.SEPARATE], CONDITIONS[ContactCondition.STICK]
NOT_JOINED = -1.0
_AS_ONE = 0.01
"""Of their angular velocities, by which those of two that turn as one may differ."""
_STILL = 1e-3
"""Of an overlap that is left alone: what comes no nearer than by that in a step stands still."""
_CLOSED = 0.05
"""Of a gap that has opened, in a step,"""
_CLOSING_SPEED = 0.5
"""and radii of the largest body, in a second: as what overlaps is moved apart."""


class Joints:
    """Which surfaces hold on to each other.

    Attributes
    ----------
    gaps : (B, B + W) [m]
        Between a body and another one, or a wall, where they are joined: the least that there has been. `NOT_JOINED`
        where they are not.
    """

    def __init__(self, bodies: int, walls: int) -> None:
        self.gaps: Array = np.full((bodies, bodies + walls), NOT_JOINED)

    def holding(self, contacts: Contacts, velocities: Array, centers: Array, radius: float, step: float) -> Contacts:
        """The contacts as they act in this step; which are joined is known anew.

        What sticks or slips takes hold where it is near and comes no nearer. What does, or may be near only within the
        step, is kept from going further than to touch, and is otherwise free.

        Parameters
        ----------
        velocities : (B, 6)
            As the step begins.
        centers : (B, 3) [m]
        radius
            Of the largest body [m].
        """
        holds = contacts.conditions != _PARTING
        if not holds.any():
            self.gaps[:] = NOT_JOINED
            return contacts
        # Of two bodies either one's samples say how near they are.
        pairs = (np.minimum(contacts.first, contacts.others), np.maximum(contacts.first, contacts.others))
        nearest = np.full(self.gaps.shape, np.inf)
        np.minimum.at(nearest, pairs, np.where(holds, np.maximum(contacts.gaps, 0.0), np.inf))
        touching = np.zeros(self.gaps.shape, dtype=np.bool_)
        approach = -np.sum(relative_velocities(contacts, velocities, centers) * contacts.normals, axis=1)
        arrived = (contacts.gaps < contacts.slacks) | (step * approach < _STILL * contacts.slacks)
        np.logical_or.at(touching, pairs, holds & arrived & (contacts.gaps < contacts.nears))
        were = self.gaps != NOT_JOINED
        joined = np.isfinite(nearest) & (were | touching)
        self.gaps = np.where(joined, np.where(were, np.minimum(self.gaps, nearest), nearest), NOT_JOINED)
        opened = np.where(joined, nearest - self.gaps, 0.0)[pairs]
        # As near as what was joined would be, had no gap opened.
        held = holds & joined[pairs] & (contacts.gaps < contacts.nears + opened)
        free = holds & ~held
        speeds = np.minimum(_CLOSED * opened / step, _CLOSING_SPEED * radius)
        wanted = -_bends(contacts, velocities, centers, step)
        along = np.sum(wanted * contacts.normals, axis=1, keepdims=True) * contacts.normals
        wanted = np.where((contacts.conditions == _STICKING)[:, None], wanted, along)
        wanted -= speeds[:, None] * contacts.normals
        return replace(
            contacts,
            conditions=np.where(free, _PARTING, contacts.conditions),
            frictions=np.where(free, 0.0, contacts.frictions),
            restitutions=np.where(holds, 0.0, contacts.restitutions),
            velocities=contacts.velocities + np.where(held[:, None], wanted, 0.0),
        )


def _bends(contacts: Contacts, velocities: Array, centers: Array, step: float) -> Array:
    """What (C, 3) [m/s] mean velocities of first surfaces over second ones have beyond those at the step's start.

    Where the two turn as one, and of walls it is in their velocities already. What rolls touches elsewhere in the end.
    """
    bodies = contacts.second != NO_BODY
    own, others = velocities[contacts.first, 3:], contacts.turns.copy()
    arms = contacts.places - centers[contacts.first]
    others[bodies] = velocities[contacts.second[bodies], 3:]
    arms[bodies] = centers[contacts.second[bodies]] - centers[contacts.first[bodies]]
    apart = lengths(own - others)
    as_one = apart <= _AS_ONE * (lengths(own) + lengths(others))
    turns = 0.5 * (own + others)
    return np.where(as_one[:, None], 0.5 * step * crossed(turns, crossed(turns, arms)), 0.0)
