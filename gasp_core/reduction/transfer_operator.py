"""The one interface of a reduction, in two halves: which points an engine is given, and what their motion moves.

A mode is a function from a `Block` to a `Sample`. Its positions and volumes go to the engine; its carrier brings their
displacements back as simplices. Nothing in between knows the mode: points may be vertices, the corners of cores or
material points that fill a volume; tracers ride with whatever carries, and a rigid body would have one core.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["TransferOperator", "Sample", "bounds_of"]

Array = NDArray[Any]


class TransferOperator(Protocol):
    """How the motion of the P points of a body becomes that of its N simplices."""

    kind: ClassVar[str]
    """Name in recordings."""

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """Simplices (N, V, 3) [m]: phi(X) + F(X) (Y - X), F the deformation gradient of phi at each Gaussian.

        Parameters
        ----------
        rest : (N, V, 3) [m]
            X, about the centre of the body.
        displacements : (P, 3) [m]
            Of the points. At displacement zero the result is Y, and X to the last bit where that is Y.
        drifted : (N, V, 3) [m]
            Y, where the object has moved to by itself, see `gasp_core.dynamics`; None: it is where it was.
        """
        ...

    def gather(self, rest: Array, velocities: Array) -> Array:
        """Velocities of the points (P, 3) [m/s] of a body whose simplices (N, V, 3) [m] have velocities (N, V, 3)."""
        ...

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """From displacements (N, V, 3) [m] of simplices, at rest (N, V, 3) [m], to those of the points, (P, 3) [m].

        Unlike velocities these may be those of a rotation by any angle. It is made once and asked for every frame, in
        turn.
        """
        ...

    @property
    def leaders(self) -> Array:
        """For each Gaussian (N,) the point, a row of the body's, whose motion is nearest to that of its mean."""
        ...

    @property
    def followers(self) -> Array:
        """For each point (P,) a Gaussian, a row of the body's, that may stand for it in a picture."""
        ...

    def arrays(self) -> Mapping[str, Array]:
        """What a recording keeps of it, by path."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """The points that stand for a body.

    Parameters
    ----------
    positions : (P, 3) [m]
        About the centre of the body.
    volumes : (P,) [m^3]
        > 0; in all, those of the cells that the body occupies. Times the density of its material: masses.
    carrier
        The way back.
    bounds : (2, 3) [m]
        Lowest and highest corner of the matter they stand for, about the centre of the body.
    notes
        Sentences for the user, without their subject.
    faces : (F, 3)
        Triangles of points, where these are a sheet; None where they are not.
    """

    positions: Array
    volumes: Array
    carrier: TransferOperator
    bounds: Array
    notes: tuple[str, ...] = ()
    faces: Array | None = None


def bounds_of(points: Array) -> Array:
    """Lowest and highest corner, (2, 3), of points (P, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])
