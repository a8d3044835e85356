"""Elastic bodies that touch each other: nodes of one that come into voxels of another are stopped and put out again.

Each contact is a node against the point of the other cage where it is, which the corners of that voxel carry with their
trilinear weights. What the node is given the corners lose: the momentum of both is kept to rounding, and angular
momentum as far as a voxel is a parallelepiped. Contact is without friction, and takes what closes in, as an inelastic
impact of these nodes alone would; bodies rebound by their springs.

A node that has come in goes out by the face through which it came: the nearest one is wrong at a body's edges. One that
was inside at the start is let alone until it has left.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import CORNERS, Cage
from gasp_blender.volume import middle_gradients
from gasp_blender.voxel_rows import ranks

__all__ = ["Meeting"]

Array = NDArray[Any]

_FREE, _STARTED_INSIDE = -1, -2
_GUESSED = 6
"""Added to the number of a face, of 0 to 5, by which a node cannot have come within a step."""
_NEAR = 1e-3
"""In voxels: how far a node may be beside a voxel and still be in it, and how deep it is taken to be at least."""
_LATE = 0.1
"""In voxels: how deep a node may be that comes in, as voxels are taken for parallelepipeds; and how far one is put out
within a step."""
_ROUNDS = 20
"""Of relaxation: contacts share nodes."""
_MOST_PAIRS = 4_000_000
"""Of nodes and voxels looked at together."""


class Meeting:
    """The contact of the bodies of a scene.

    Parameters
    ----------
    cage
        Of all bodies together, at rest [m].
    bodies : (V,)
        Of nodes, 0 to B - 1.
    masses : (V,) [kg]
    """

    def __init__(self, cage: Cage, bodies: Array, masses: Array) -> None:
        voxels, nodes = cage.voxels, cage.nodes
        self._voxels, self._masses = voxels, masses
        self._gradients = middle_gradients(nodes, voxels)
        self._sizes = nodes[voxels[:, 7]] - nodes[voxels[:, 0]]
        owners = bodies[voxels[:, 0]]
        self._own = [np.flatnonzero(owners == body) for body in range(int(bodies.max()) + 1)]
        self._beyond = np.zeros((len(voxels), 6))
        for own in self._own:
            low = nodes[voxels[own, 0]]
            places = np.rint((low - low.min(axis=0)) / self._sizes[own]).astype(np.int64)
            # Along x, y, z: voxels before, then voxels after.
            self._beyond[own] = np.stack([one for axis in range(3) for one in ranks(places, axis)], axis=1)
        # Nodes within a body are behind others, that touch first.
        skin = np.bincount(voxels.ravel(), minlength=len(nodes)) < len(CORNERS)
        self._skins = [np.flatnonzero(skin & (bodies == body)) for body in range(len(self._own))]
        self.faces: Array = np.full((len(nodes), len(self._own)), _FREE, np.int8)
        """By which face each node has come into each body, (V, B)."""
        pairs: list[str] = []
        for one in range(len(self._own)):
            for other in range(len(self._own)):
                inside, voxels, within, _ = self._found(one, other, nodes)
                # What lies against another body touches it, and is not inside.
                deep = inside[self._ways_out(voxels, within).min(axis=1) > _LATE]
                self.faces[deep, other] = _STARTED_INSIDE
                if len(deep):
                    pairs.append(f"{len(deep)} nodes of the {one + 1}. in the {other + 1}.")
        more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
        self.told: list[str] = (
            [
                f"elastic bodies start inside each other ({', '.join(pairs[:3])}{more}): what is inside is felt only"
                " once it has left; move them apart if they should touch at once"
            ]
            if pairs
            else []
        )
        """For the user."""

    def touch(self, places: Array, velocities: Array, step: float) -> tuple[Array, Array] | None:
        """Places [m] and velocities [m/s] (V, 3) after contact in a `step` [s]; None where there is none."""
        low = np.array([places[skin].min(axis=0) for skin in self._skins])
        high = np.array([places[skin].max(axis=0) for skin in self._skins])
        near = (low[:, None] <= high).all(axis=2) & (high[:, None] >= low).all(axis=2)
        parts: list[tuple[Array, Array, Array, Array, Array]] = []
        for one, other in np.argwhere(~near):
            self.faces[self._skins[one], other] = _FREE
        for one, other in np.argwhere(near):
            if one != other:
                parts.append(self._contacts(int(one), int(other), places, velocities, step))
        if sum(len(part[0]) for part in parts) == 0:
            return None
        first, second, third, fourth, fifth = (np.concatenate(columns) for columns in zip(*parts))
        return self._resolved(first, second, third, fourth, fifth, places.copy(), velocities.copy())

    def _found(self, one: int, other: int, places: Array) -> tuple[Array, Array, Array, Array]:
        """Nodes of one body in voxels of another: rows, voxels, places in them (K, 3) in 0 to 1, and d(those)/dx."""
        skin, own = self._skins[one], self._own[other]
        corners = places[self._voxels[own]]
        lows, highs = corners.min(axis=1), corners.max(axis=1)
        room = _NEAR * (highs - lows)
        lows, highs = lows - room, highs + room
        skin = skin[((places[skin] >= lows.min(axis=0)) & (places[skin] <= highs.max(axis=0))).all(axis=1)]
        if one == other or len(skin) == 0:
            return _NOTHING
        close = ((highs >= places[skin].min(axis=0)) & (lows <= places[skin].max(axis=0))).all(axis=1)
        own, corners, lows, highs = own[close], corners[close], lows[close], highs[close]
        chunk = max(1, _MOST_PAIRS // max(1, len(own)))
        pairs = [
            np.argwhere(((places[rows, None] >= lows) & (places[rows, None] <= highs)).all(axis=2)) + [first, 0]
            for first in range(0, len(skin), chunk)
            for rows in [skin[first : first + chunk]]
        ]
        rows, which = np.concatenate(pairs).T
        stretch = corners[which].transpose(0, 2, 1) @ self._gradients[own[which]]
        sound = np.abs(np.linalg.det(stretch)) > _NEAR
        rows, which = rows[sound], which[sound]
        back = np.linalg.inv(stretch[sound]) / self._sizes[own[which]][:, :, None]
        within = 0.5 + (back @ (places[skin[rows]] - corners[which].mean(axis=1))[:, :, None])[:, :, 0]
        outside = np.abs(within - 0.5).max(axis=1)
        # The voxel that it is most in, of several; ordered by node, then by how far out it is.
        order = np.lexsort((outside, rows))
        order = order[outside[order] <= 0.5 + _NEAR]
        order = order[np.unique(rows[order], return_index=True)[1]]
        return skin[rows[order]], own[which[order]], np.clip(within[order], 0.0, 1.0), back[order]

    def _ways_out(self, voxels: Array, within: Array) -> Array:
        """Through each of the six faces of a body, in its voxels, (K, 6)."""
        return np.stack([within, 1 - within], axis=2).reshape(-1, 6) + self._beyond[voxels]

    def _contacts(
        self, one: int, other: int, places: Array, velocities: Array, step: float
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Nodes (K,), corners (K, 8) and their weights, normals out of the other body (K, 3), ways out (K,) [m]."""
        nodes, voxels, within, back = self._found(one, other, places)
        corners = self._voxels[voxels]
        weights = np.where(CORNERS, within[:, None], 1 - within[:, None]).prod(axis=2)
        # Of the six faces: normals over thickness of a voxel, and how many voxels deep the node is.
        slopes = np.stack([-back, back], axis=2).reshape(-1, 6, 3)
        lengths = np.linalg.norm(slopes, axis=2)
        depths = self._ways_out(voxels, within) / lengths
        normals = slopes / lengths[:, :, None]
        closing = velocities[nodes] - (weights[:, :, None] * velocities[corners]).sum(axis=1)
        speeds = -(normals * closing[:, None]).sum(axis=2)
        # Through which face it may have come within this step, and for how long it has been in by that.
        closing_speeds = np.maximum(speeds, 0.0)
        ages = (depths + _NEAR / lengths) / np.maximum(closing_speeds, 1e-300)
        came = depths <= 2 * closing_speeds * step + _LATE / lengths
        first = np.argmin(np.where(came, ages, np.inf), axis=1)
        lost = ~came.any(axis=1)
        first[lost] = _GUESSED + np.argmin(ages[lost], axis=1)
        kept = self.faces[nodes, other]
        faces = np.where(kept == _FREE, first, kept)
        self.faces[self._skins[one], other] = _FREE
        self.faces[nodes, other] = faces
        real = np.flatnonzero(faces != _STARTED_INSIDE)
        chosen = faces[real] % _GUESSED
        # To put it out at once from deep within, or by a face that is a guess, would add energy.
        ways = np.minimum(depths, np.where((faces >= _GUESSED)[:, None], closing_speeds * step, _LATE / lengths))
        return nodes[real], corners[real], weights[real], normals[real, chosen], ways[real, chosen]

    def _resolved(
        self,
        nodes: Array,
        corners: Array,
        weights: Array,
        normals: Array,
        ways: Array,
        places: Array,
        velocities: Array,
    ) -> tuple[Array, Array]:
        """What `_contacts` found, done to places and velocities (V, 3), which are changed."""
        gives = 1 / self._masses[nodes]
        backs = weights / self._masses[corners]
        crowd = np.bincount(nodes, minlength=len(places)) + np.bincount(corners.ravel(), minlength=len(places))
        share = 1 / ((gives + (weights * backs).sum(axis=1)) * np.maximum(crowd[nodes], crowd[corners].max(axis=1)))

        def push(moved: Array, amounts: Array) -> None:
            pushes = (amounts * share)[:, None] * normals
            np.add.at(moved, nodes, gives[:, None] * pushes)
            np.add.at(moved, corners, -backs[:, :, None] * pushes[:, None])

        push(places, ways)
        for _ in range(_ROUNDS):
            apart = velocities[nodes] - (weights[:, :, None] * velocities[corners]).sum(axis=1)
            speeds = (apart * normals).sum(axis=1)
            push(velocities, np.maximum(-speeds, 0.0))
        return places, velocities


_NOTHING = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
