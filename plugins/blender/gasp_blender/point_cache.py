"""Blender's point caches on disk: the one way to give a soft body a velocity, and to read it.

Blender has no property for the velocity of a vertex. Its simulations read the state of a frame from a file when there
is one, and go on from what they read; that makes a frame a function from state to state. A file is "BPHYSICS", the kind
of simulation, the number of points and a mask of what is kept of each, then so many float32 a point.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CLOTH", "Kind", "SOFT_BODY", "StateFiles"]

Array = NDArray[Any]

_MAGIC = b"BPHYSICS"
_HEADER = struct.Struct("<III")


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """Number of a kind of simulation, mask of what it keeps, and how many floats of each point that is."""

    number: int
    mask: int
    width: int


SOFT_BODY = Kind(number=0, mask=0b110, width=6)
"""Place and velocity."""
CLOTH = Kind(number=2, mask=0b10110, width=9)
"""Place, velocity, and where the vertex is pinned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateFiles:
    """The files of one object.

    Parameters
    ----------
    folder
        Of Blender's disk caches.
    name
        Of the object's cache.
    kind
        What it simulates.
    """

    folder: Path
    name: str
    kind: Kind

    def path(self, frame: int) -> Path:
        """Where the state of a frame lies."""
        return self.folder / f"{self.name}_{frame:06d}_00.bphys"

    def read(self, frame: int) -> Array:
        """Places and velocities (V, 6) float32 of a frame."""
        data = self.path(frame).read_bytes()
        kind, count, mask = _HEADER.unpack_from(data, len(_MAGIC))
        width = self.kind.width
        start = len(_MAGIC) + _HEADER.size
        if data[: len(_MAGIC)] != _MAGIC or (kind, mask) != (self.kind.number, self.kind.mask):
            raise RuntimeError(f"Blender wrote a state of kind {kind}, {mask:b}, expected {self.kind}")
        return np.frombuffer(data, np.float32, count * width, start).reshape(count, width)[:, :6].copy()

    def write(self, frame: int, state: Array) -> None:
        """Put places and velocities (V, 6) in the place of what Blender kept of a frame."""
        # What cloth keeps besides is where it is pinned, which is nowhere.
        kept = np.zeros((len(state), self.kind.width), np.float32)
        kept[:, :6] = state
        header = _HEADER.pack(self.kind.number, len(state), self.kind.mask)
        self.path(frame).write_bytes(_MAGIC + header + kept.tobytes())

    def forget(self, frame: int) -> None:
        """Remove the state of a frame."""
        self.path(frame).unlink(missing_ok=True)
