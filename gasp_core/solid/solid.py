"""The body that a splat stands for: signed distance on a grid, thin matter beside it, and how sure both are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid.grid import Grid, interpolated
from gasp_core.solid.morphology import connected_parts

__all__ = ["Doubts", "MassProperties", "Sheets", "Solid", "filled_shares"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheets:
    """Matter too thin to be told apart on both sides: leaves, cloth, strings. Pieces of it, each a point.

    Parameters
    ----------
    positions : (S, 3)
    areas : (S,)
        Of the pieces, as one surface.
    thickness
        That they are given: a detail of the solid, since they are thinner than what it resolves.
    """

    positions: Array
    areas: Array
    thickness: float

    @classmethod
    def none(cls) -> Sheets:
        """No thin matter."""
        return cls(positions=np.zeros((0, 3)), areas=np.zeros(0), thickness=0.0)

    def above(self, height: float) -> Sheets:
        """Those that are higher."""
        kept = self.positions[:, 2] > height
        return Sheets(positions=self.positions[kept], areas=self.areas[kept], thickness=self.thickness)

    @property
    def volumes(self) -> Array:
        """(S,)."""
        return self.areas * self.thickness


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubts:
    """How sure a solid is.

    Parameters
    ----------
    undecided
        Share of its volume that is neither dark nor lit nor beside a surface.
    volume_uncertainty
        What its volume may be off by: what two coarser solids say of it, see `solid_of`.
    underside_closed
        Whether it ends at its lowest layer because the Gaussians leave its underside open.
    gaussians
        That it was made of, and, among them, left out as `faint`, `hazy`, `far` (see `surfels.LeftOut`) and `floating`
        apart from the large parts.
    """

    undecided: float = 0.0
    volume_uncertainty: float = 0.0
    underside_closed: bool = False
    gaussians: int = 0
    faint: int = 0
    hazy: int = 0
    far: int = 0
    floating: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MassProperties:
    """Of matter of density one.

    Parameters
    ----------
    volume
    centre : (3,)
        Of mass.
    inertia : (3, 3)
        About the centre.
    """

    volume: float
    centre: Array
    inertia: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A body, in the frame and unit of the Gaussians it was made of, +z up.

    Parameters
    ----------
    grid
        Of the distances.
    distance : (X, Y, Z) float32
        To its outer surface, negative within; within two spacings of the surface to a fraction of a spacing.
    detail
        Size of the smallest thing that was told apart.
    sheets
        Matter too thin for that.
    doubts
        How sure it is.
    wall
        Deeper than this below its outer surface it is air. Nodes know nothing of it: between them a wall that is
        thinner than their spacing would be lost.
    """

    grid: Grid
    distance: Array
    detail: float
    sheets: Sheets
    doubts: Doubts
    wall: float = np.inf

    @property
    def is_empty(self) -> bool:
        """Whether nothing is inside; there may be sheets."""
        return bool((self.distance > 0).all())

    @property
    def volume(self) -> float:
        """Of what is inside, without the sheets."""
        return float(self._shares().sum() * self.grid.spacing**3)

    @property
    def filled(self) -> Solid:
        """The same without its hollow."""
        return replace(self, wall=np.inf)

    @property
    def mean_depth(self) -> float:
        """Of its matter below its surface: a quarter of its thickness in a slab, and of its radius in a ball; 0 where
        nothing is inside."""
        inside = self.distance[self.distance < 0]
        return min(-float(inside.mean(dtype=np.float64)), self.wall / 4) if len(inside) else 0.0

    def distance_at(self, points: Array) -> Array:
        """Signed distance (N,) at points (N, 3), trilinear; with a wall that to the nearer one of its sides.

        Beyond the grid that of its edge and the way there.
        """
        places = self.grid.places(np.asarray(points, dtype=np.float64))
        beyond = places - np.clip(places, 0.0, np.array(self.grid.shape) - 1.0)
        outer = interpolated([self.distance], places)[:, 0] + self.grid.spacing * np.linalg.norm(beyond, axis=1)
        return np.maximum(outer, -outer - self.wall)

    def mass_properties(self) -> MassProperties:
        """Volume, centre and inertia of what is inside and of the sheets.

        A cell that the surface cuts counts by the signed distance of its middle.
        """
        shares, spacing = self._shares(), self.grid.spacing
        filled = np.argwhere(shares > 0)
        masses = np.concatenate([shares[tuple(filled.T)] * spacing**3, self.sheets.volumes])
        places = np.concatenate([self.grid.origin + spacing * filled, self.sheets.positions])
        volume = float(masses.sum())
        if volume == 0.0:
            return MassProperties(volume=0.0, centre=np.zeros(3), inertia=np.zeros((3, 3)))
        centre = masses @ places / volume
        arms = places - centre
        second = (arms * masses[:, None]).T @ arms
        # Each cell is a cube and not a point.
        second += np.eye(3) * masses[: len(filled)].sum() * spacing**2 / 12
        return MassProperties(volume=volume, centre=centre, inertia=np.eye(3) * np.trace(second) - second)

    def parts(self) -> tuple[Array, int]:
        """Numbers 1, 2, ... (X, Y, Z) of the connected parts, the largest first, 0 outside; and how many there are.

        What a part has within its wall is of the part.
        """
        labels, sizes = connected_parts(self.distance < 0)
        renumbered = np.zeros(len(sizes), dtype=np.int32)
        renumbered[np.argsort(-sizes[1:], kind="stable") + 1] = np.arange(1, len(sizes))
        return renumbered[labels], len(sizes) - 1

    def hollowed(self, wall: float) -> Solid:
        """The same as a shell: what is deeper inside than `wall` is air."""
        return replace(self, wall=wall)

    def _shares(self) -> Array:
        return filled_shares(self.distance.astype(np.float64), self.grid.spacing, self.wall)


def filled_shares(distances: Array, side: float, wall: float = np.inf) -> Array:
    """Shares (...), 0..1, of cubes of this side that are inside.

    Parameters
    ----------
    distances : (...)
        Of their middles to the outer surface, negative within. It is taken to cut cubes along their faces: that is
        exact there, and in the mean of many cubes where it cuts across.
    side
    wall
        Deeper inside is air.
    """
    # What is within the outer surface less what is within the inner one: right however thin the wall.
    within, hollow = (np.clip(0.5 - depth / side, 0.0, 1.0) for depth in (distances, distances + wall))
    return within - hollow
