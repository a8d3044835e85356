"""Triangles as copies of one right-angled triangle, which is how viser draws many of them in colours of their own.

A copy is turned, scaled along its axes and moved, never sheared, so a triangle is cut at the height over its longest
side into two that are right-angled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import rotation_quaternions

__all__ = ["FACE", "PackedFaces", "pack_faces", "simplex_faces"]

Array = NDArray[Any]

FACE: tuple[Array, Array] = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32),
    np.array([[0, 1, 2]], dtype=np.uint32),
)
"""Vertices and faces of the triangle that is copied."""

_TETRAHEDRON = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedFaces:
    """Copies of `FACE`; rows 2 n and 2 n + 1 are the halves of triangle n.

    Parameters
    ----------
    positions : (2 N, 3) float32
        Of the right angle.
    quaternions : (2 N, 4) float32
        w x y z.
    scales : (2 N, 3) float32
        Lengths of the legs, and 1.
    colours : (2 N, 3) uint8
        As bytes of a linear scale: viser takes the colours of copies for that, unlike all its others.
    """

    positions: Array
    quaternions: Array
    scales: Array
    colours: Array

    @property
    def nbytes(self) -> int:
        """Memory it takes."""
        return self.positions.nbytes + self.quaternions.nbytes + self.scales.nbytes + self.colours.nbytes


def simplex_faces(simplices: Array) -> Array:
    """Faces of simplices (N, V, 3): themselves, (N, 3, 3), or four of each tetrahedron, (4 N, 3, 3)."""
    if simplices.shape[1] == 3:
        return simplices
    return simplices[:, _TETRAHEDRON].reshape(-1, 3, 3)


def pack_faces(triangles: Array, colours: Array) -> PackedFaces:
    """Pack triangles.

    Parameters
    ----------
    triangles : (N, 3, 3)
        Corners, on the stage.
    colours : (N, 3)
        In 0..1, as displays take them (sRGB).
    """
    count = len(triangles)
    corners = np.asarray(triangles, dtype=np.float64)
    opposite = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
    apex = np.argmax(opposite, axis=1)
    rows = np.arange(count)
    top, left, right = (corners[rows, (apex + k) % 3] for k in range(3))
    base = opposite[rows, apex]
    along = _unit(right - left, base, np.array([1.0, 0.0, 0.0]))
    reach = np.einsum("ni,ni->n", top - left, along)
    foot = left + reach[:, None] * along
    height = np.linalg.norm(top - foot, axis=1)
    # Where the triangle is a line, any direction across it will do.
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    up = _unit(top - foot, height, across / np.linalg.norm(across, axis=1, keepdims=True))
    # Rounding leaves `up` a little along the base where the triangle is nearly a line.
    up -= np.einsum("ni,ni->n", up, along)[:, None] * along
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    normal = np.cross(along, up)
    forward = np.stack([along, up, normal], axis=2)
    backward = np.stack([-along, up, -normal], axis=2)
    one = np.ones(count)
    return PackedFaces(
        positions=np.repeat(foot, 2, axis=0).astype(np.float32),
        quaternions=rotation_quaternions(_interleaved(forward, backward)).astype(np.float32),
        scales=_interleaved(
            np.stack([base - reach, height, one], axis=1), np.stack([reach, height, one], axis=1)
        ).astype(np.float32),
        colours=np.repeat(_linear_bytes(colours), 2, axis=0),
    )


def _unit(vectors: Array, lengths: Array, otherwise: Array) -> Array:
    """Vectors (N, 3) over their lengths (N,); where these vanish, something else."""
    whole = lengths > 0
    return np.where(whole[:, None], vectors / np.where(whole, lengths, 1.0)[:, None], otherwise)


def _interleaved(first: Array, second: Array) -> Array:
    return np.stack([first, second], axis=1).reshape(-1, *first.shape[1:])


def _linear_bytes(colours: Array) -> Array:
    """Bytes of linear light (IEC 61966-2-1) of display colours in 0..1."""
    c = np.clip(colours, 0.0, 1.0)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return np.rint(linear * 255).astype(np.uint8)
