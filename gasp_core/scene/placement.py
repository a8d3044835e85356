"""The one place where a splat's own axes and units become metres and +z up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.validation import Vector
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.harmonics import turn_coefficients
from gasp_core.scene.objects import SplatObject, UpAxis

__all__ = [
    "Placement",
    "place",
    "placement_of",
    "robust_box",
    "similarity",
    "turned",
    "up_axis",
    "upright",
    "whole_box",
    "with_up",
]

Array = NDArray[Any]

# Columns are where the splat's x, y, z axes go. Each is a turn by 0, 90 or 180 degrees about x or y, so that for the
# usual "-y" (x right, y down, z away from the camera) the camera keeps its right hand and looks along +y.
_UPRIGHT: dict[str, list[list[float]]] = {
    "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "+y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "+x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """A similarity: world = scale * rotation @ splat + translation.

    Parameters
    ----------
    rotation : (3, 3)
        Orthogonal, det +1.
    scale
        Metres per unit of the splat.
    translation : (3,) [m]
    """

    rotation: Array
    scale: float
    translation: Array


def up_axis(item: SplatObject) -> UpAxis:
    """The splat's axis that becomes +z: as the object says, or "-y" for files and "+z" for Gaussians in memory."""
    return item.up or ("+z" if isinstance(item.splat, Gaussians) else "-y")


def upright(up: UpAxis) -> Array:
    """Rotation (3, 3) that takes the axis `up` to +z."""
    return np.array(_UPRIGHT[up], dtype=np.float64)


def with_up(gaussians: Gaussians, up: UpAxis) -> Gaussians:
    """Gaussians whose +z is up, turned so that `up` is; put into a scene that says so they stand as they did."""
    return turned(gaussians, "+z", up)


def turned(gaussians: Gaussians, up: UpAxis, wanted: UpAxis) -> Gaussians:
    """Gaussians whose axis `up` is up, turned so that `wanted` is."""
    rotation = upright(wanted).T @ upright(up)
    return place(gaussians, Placement(rotation=rotation, scale=1.0, translation=np.zeros(3)))


def robust_box(positions: Array) -> tuple[Array, Array]:
    """Lower and upper corner of all but the outermost thousandth of positions (N, 3) on each side of each axis.

    A capture's bounding box belongs to its worst floater. Below 1000 positions nothing is cut off.
    """
    lower = np.percentile(positions, 0.1, axis=0, method="lower")
    upper = np.percentile(positions, 99.9, axis=0, method="higher")
    return lower, upper


def placement_of(item: SplatObject, gaussians: Gaussians) -> Placement:
    """How the Gaussians of an object are put into the world.

    Parameters
    ----------
    item
        Says the up axis, height or unit, rotation and position.
    gaussians
        Those that stay, in the splat's own frame; the robust box is theirs.

    Raises
    ------
    SceneError
        Where a height is asked of a splat that has none.
    """
    return similarity(
        gaussians.means.astype(np.float64),
        robust_box,
        up=up_axis(item),
        height=item.height,
        metres_per_unit=item.metres_per_unit,
        rotation=item.rotation,
        position=item.position,
        name=f'object "{item.name}"',
    )


def whole_box(positions: Array) -> tuple[Array, Array]:
    """Lower and upper corner of all positions (N, 3)."""
    return positions.min(axis=0), positions.max(axis=0)


def similarity(
    points: Array,
    box: Callable[[Array], tuple[Array, Array]],
    *,
    up: UpAxis,
    height: float | None,
    metres_per_unit: float | None,
    rotation: tuple[float, ...] | None,
    position: Vector | None,
    name: str,
) -> Placement:
    """How points (N, 3) of a file are put into the world.

    Parameters
    ----------
    points
        In the file's own frame.
    box
        Lower and upper corner of what points say where the thing is: `robust_box` where some are noise.
    up, height, metres_per_unit, rotation, position
        As of `SplatObject`.
    name
        Of the thing, for messages.

    Raises
    ------
    SceneError
        Where a height is asked of what has none.
    """
    turn = upright(up)
    scale = 1.0 if metres_per_unit is None else metres_per_unit
    if height is not None:
        lower, upper = box(points @ turn.T)
        if not upper[2] > lower[2]:
            raise SceneError(
                f"{name}: height = {height:g} cannot be met, it has no extent along its"
                f" up axis {up}: say metres_per_unit instead"
            )
        scale = height / float(upper[2] - lower[2])
    if rotation is not None:
        turn = _turn(rotation) @ turn
    translation = np.zeros(3)
    if position is not None:
        lower, upper = box(points @ (scale * turn).T)
        foot = np.array([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, lower[2]])
        translation = np.asarray(position) - foot
    return Placement(rotation=turn, scale=scale, translation=translation)


def place(gaussians: Gaussians, placement: Placement) -> Gaussians:
    """The Gaussians in the world: metres, +z up, means in float64; harmonics turned with the rest.

    A placement that does not turn leaves quaternions and harmonics bit for bit as they are.
    """
    means = gaussians.means.astype(np.float64)
    scales = gaussians.scales
    if placement.scale != 1.0:
        means = means * placement.scale
        scales = scales.astype(np.float64) * placement.scale
    if np.array_equal(placement.rotation, np.eye(3)):
        return gaussians.with_(means=means + placement.translation, scales=scales)
    turned = placement.rotation @ rotation_matrices(gaussians.quaternions)
    return gaussians.with_(
        means=means @ placement.rotation.T + placement.translation,
        scales=scales,
        quaternions=rotation_quaternions(turned),
        harmonics=turn_coefficients(gaussians.harmonics, np.broadcast_to(placement.rotation, (len(gaussians), 3, 3))),
    )


def _turn(rotation: tuple[float, ...]) -> Array:
    """Rotation (3, 3) of three angles [degrees] about x, then y, then z, or of a quaternion w x y z."""
    if len(rotation) == 4:
        return rotation_matrices(np.array([rotation]))[0]
    matrix = np.eye(3)
    for axis, angle in enumerate(rotation):
        matrix = _about(axis, angle) @ matrix
    return matrix


def _about(axis: int, degrees: float) -> Array:
    # Exact at multiples of 90 degrees, where cos(pi/2) = 6e-17 would tilt what the user asked to be level.
    quarter = (degrees / 90.0) % 4.0
    if quarter == int(quarter):
        cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter)]
    else:
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix
