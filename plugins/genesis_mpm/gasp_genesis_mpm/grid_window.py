"""Which part of space Genesis' grid covers. It is fixed once built, so it is placed around the points and follows them.

Genesis holds points and nodes back three cells before the end of its grid, and says nothing. No point ever comes there:
whoever comes near is given another place for the grid, or a larger one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["NODE_LIMIT", "TooWideError", "Window"]

Array = NDArray[Any]

NODE_LIMIT = 2**23
"""Half a gigabyte in float32; Genesis looks at every node in every substep."""
_HELD_BACK = 3
"""In cells, from the end of the grid: what Genesis does not let points go beyond."""
_CLEAR = 3
"""In cells, from there: a stencil's reach of one and a half, and what a point flies between two looks."""
_ROOM = 0.25
"""Of the points' extent: what they may spread before the grid has to be made anew."""
_LEAST_ROOM = 6
_GRAIN = 4
"""In cells, of half a side: clouds of about one size are given one size of grid, which is built once."""


class TooWideError(Exception):
    """The points span more nodes than there may be; carries their number."""

    def __init__(self, nodes: float) -> None:
        super().__init__(f"{nodes:.3g} grid nodes")
        self.nodes = nodes


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A box of the grid.

    Parameters
    ----------
    shift
        Its middle, in cells from the session's origin.
    half
        Half its sides, in cells.
    """

    shift: tuple[int, int, int]
    half: tuple[int, int, int]

    @property
    def node_count(self) -> float:
        """Nodes of the grid."""
        return float(np.prod(2.0 * np.array(self.half, dtype=np.float64) + 1))

    @classmethod
    def around(cls, cells: Array) -> Self:
        """A window around points (N, 3), with room to move.

        Raises
        ------
        TooWideError
            Where even the points alone span too many nodes.
        """
        low, high = cells.min(axis=0), cells.max(axis=0)
        middle = np.rint((low + high) / 2)
        extent = np.maximum(high - middle, middle - low)
        room = np.maximum(_ROOM * 2 * extent, _LEAST_ROOM)
        for spare in (room, np.full(3, 1.0)):
            half = _GRAIN * np.ceil((extent + spare + _CLEAR + _HELD_BACK) / _GRAIN)
            nodes = float(np.prod(2 * half + 1))
            if nodes <= NODE_LIMIT:
                return cls(shift=_integers(middle), half=_integers(half))
        raise TooWideError(nodes)

    def recentred(self, cells: Array) -> Window:
        """The window for points that have moved: this one, this one elsewhere, or another one.

        Raises
        ------
        TooWideError
            As `around`.
        """
        if self.holds(cells, _CLEAR):
            return self
        middle = np.rint((cells.min(axis=0) + cells.max(axis=0)) / 2)
        moved = Window(shift=_integers(middle), half=self.half)
        return moved if moved.holds(cells, _CLEAR + 1) else Window.around(cells)

    def holds(self, cells: Array, clear: float = 0.0) -> bool:
        """Whether all points are `clear` cells away from where Genesis would hold them back."""
        inside = np.array(self.half) - _HELD_BACK - clear
        return bool((np.abs(cells - np.array(self.shift)) <= inside).all())


def _integers(vector: Array) -> tuple[int, int, int]:
    x, y, z = (int(component) for component in vector)
    return x, y, z
