"""The solid behind an object of a scene, in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.scene.objects import UpAxis
from gasp_core.scene.placement import Placement, robust_box, upright
from gasp_core.solid import MassProperties, Solid, SolidOptions
from gasp_core.solid.remembered import remembered

__all__ = ["FEW", "PlacedSolid", "solid_behind"]

FEW = 2_000
"""Gaussians up to which an object is simulated as it is: no solid is looked for behind so few."""
_FAR = 1024
"""Extents off its origin from which on a splat is brought there: nearer to it single precision knows places to 6e-5 of
the extent, a four-hundredth of the details that are told apart."""

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedSolid:
    """A solid and the similarity that takes it into the world: world = scale * rotation @ solid + translation.

    Parameters
    ----------
    solid
        In the splat's unit, upright.
    rotation : (3, 3)
    scale
        [m] per unit.
    translation : (3,) [m]
    """

    solid: Solid
    rotation: Array
    scale: float
    translation: Array

    def distance_at(self, points: Array) -> Array:
        """Signed distances (N,) [m] of points (N, 3) [m], negative inside."""
        return self.scale * self.solid.distance_at(((points - self.translation) / self.scale) @ self.rotation)

    def gradient_at(self, points: Array) -> Array:
        """Unit directions (N, 3) away from the surface at points (N, 3) [m]; zero where there is none."""
        step, outer = self.spacing / 2, self.filled.distance_at
        ends = [outer(points + shift) - outer(points - shift) for shift in step * np.eye(3)]
        slopes = np.stack(ends, axis=1)
        if np.isfinite(self.wall):
            # Nearer to the inner side of a wall than to the outer one: the way out is inwards.
            slopes *= np.where(outer(points) < -self.wall / 2, -1.0, 1.0)[:, None]
        lengths = np.linalg.norm(slopes, axis=1, keepdims=True)
        return slopes / np.where(lengths > 0, lengths, 1.0)

    def to_world(self, points: Array) -> Array:
        """Points (N, 3) of the solid's frame in the world [m]."""
        return self.scale * points @ self.rotation.T + self.translation

    @property
    def filled(self) -> PlacedSolid:
        """The same without its hollow."""
        return replace(self, solid=self.solid.filled)

    def thickened(self, wall: float) -> PlacedSolid:
        """The same with a wall of this [m] at least, inwards; what is filled stays so."""
        return replace(self, solid=self.solid.hollowed(max(self.wall, wall) / self.scale))

    @property
    def wall(self) -> float:
        """Thickness of its shell [m]; infinite where it is filled."""
        return self.solid.wall * self.scale

    @property
    def volume(self) -> float:
        """Of what is inside [m^3], without the sheets."""
        return self.solid.volume * self.scale**3

    @property
    def spacing(self) -> float:
        """Of its grid [m]."""
        return self.solid.grid.spacing * self.scale

    @property
    def detail(self) -> float:
        """Size of the smallest thing that was told apart [m]."""
        return self.solid.detail * self.scale

    def mass_properties(self) -> MassProperties:
        """Volume [m^3], centre [m] and inertia [m^5] of matter of density one, the sheets included."""
        own = self.solid.mass_properties()
        return MassProperties(
            volume=own.volume * self.scale**3,
            centre=self.to_world(own.centre[None])[0],
            inertia=self.scale**5 * self.rotation @ own.inertia @ self.rotation.T,
        )

    def lowest(self) -> float:
        """Height [m] of the lowest point of what is inside; of the sheets where nothing is, or where they are lower.

        Of sheets the lowest hundredth does not count: fuzz hangs below what one would call the thing's foot.
        """
        # As far as a node is inside, the ball around it is inside too.
        depths = self.scale * self.solid.distance[self.solid.distance < 0].astype(np.float64)
        lowest = float((self.nodes_inside()[:, 2] + depths).min(initial=np.inf))
        sheets, areas = self.sheet_positions()[:, 2], self.solid.sheets.areas
        if len(areas):
            order = np.argsort(sheets)
            first = int(np.searchsorted(np.cumsum(areas[order]), 0.01 * float(areas.sum())))
            lowest = min(lowest, float(sheets[order[first]]))
        return lowest

    def nodes_inside(self) -> Array:
        """The grid's nodes inside, (N, 3) [m]; in a hollow too."""
        inside = np.argwhere(self.solid.distance < 0)
        return self.to_world(self.solid.grid.origin + self.solid.grid.spacing * inside)

    def surface_positions(self) -> Array:
        """Places on its surface and on its sheets, about a spacing apart, (N, 3) [m]."""
        depths = -self.scale * self.solid.distance[self.solid.distance < 0].astype(np.float64)
        nodes, found = self.nodes_inside(), [self.sheet_positions()]
        for side in (self.wall, 0.0):
            beside = (depths >= side) & (depths < side + self.spacing)
            outwards = self.filled.gradient_at(nodes[beside])
            found.insert(0, nodes[beside] + (depths[beside, None] - side) * outwards)
        return np.concatenate(found)

    def sheet_positions(self) -> Array:
        """The pieces of sheets, (S, 3) [m]."""
        return self.to_world(self.solid.sheets.positions)


def solid_behind(
    gaussians: Gaussians, placement: Placement, up: UpAxis, options: SolidOptions | None = None
) -> PlacedSolid:
    """The solid of Gaussians that have been placed, and do not float.

    It is made of the splat before it is scaled, turned by the user and moved, so that it is made once wherever the
    object is put.

    Parameters
    ----------
    gaussians
        In the world.
    placement
        How they got there.
    up
        The splat's own axis that is up: what its underside is does not depend on how the object is turned.
    options
        Of the solid, its wall in metres.
    """
    options = options or SolidOptions()
    if options.wall is not None:
        options = replace(options, wall=options.wall / placement.scale)
    turn = placement.rotation @ upright(up).T
    quaternions = gaussians.quaternions
    if not np.array_equal(turn, np.eye(3)):
        quaternions = rotation_quaternions(turn.T @ rotation_matrices(quaternions))
    own = (gaussians.means - placement.translation) / placement.scale @ turn
    middle = _far_middle(own)
    # In single precision, which files have: roundings of the placement are gone, and the digest is that of the splat.
    local = Gaussians(
        means=(own - middle).astype(np.float32),
        quaternions=quaternions.astype(np.float32),
        scales=(gaussians.scales.astype(np.float64) / placement.scale).astype(np.float32),
        opacities=gaussians.opacities.astype(np.float32),
        harmonics=gaussians.harmonics[:, :1],
    )
    return PlacedSolid(
        solid=remembered(local, options),
        rotation=turn,
        scale=placement.scale,
        translation=placement.translation + placement.scale * turn @ middle,
    )


def _far_middle(means: Array) -> Array:
    """About the middle (3,) of means (N, 3) that are far off the origin, as on a map; zero for all others."""
    lower, upper = robust_box(means)
    middle, extent = (lower + upper) / 2, float((upper - lower).max())
    if not 0.0 < _FAR * extent < np.abs(middle).max():
        return np.zeros(3)
    # In whole steps of a power of two, so that roundings of the placement hardly ever change it.
    step = 2.0 ** np.ceil(np.log2(extent))
    return step * np.rint(middle / step)
