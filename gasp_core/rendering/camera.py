"""A pinhole camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError

__all__ = ["LARGEST_SIDE", "Camera", "check_size", "look_at"]

Array = NDArray[Any]

LARGEST_SIDE = 16_384
"""Pixels; more is a mistake in the units rather than a picture."""

_BAND = 2**16
"""Pixels."""

_ORTHOGONAL = 1e-3
"""Largest entry of R R^T - 1 of a rotation read from a file with few digits."""


def check_size(width: Any, height: Any) -> None:
    """Refuse a size [px] that no picture can have.

    Raises
    ------
    RenderingError
        Where that is so.
    """
    for name, size in (("width", width), ("height", height)):
        if not isinstance(size, (int, np.integer)) or not 1 <= size <= LARGEST_SIDE:
            raise RenderingError(f"a picture's {name} must be 1 to {LARGEST_SIDE} pixels, found {size!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Where a picture is taken from: x_camera = rotation @ x_world + translation; x right, y down, z into the picture.

    Pixel centres are at half-integers; the picture spans 0..width and 0..height.

    Parameters
    ----------
    width, height [px]
    focal_x, focal_y [px]
        Focal lengths.
    center_x, center_y [px]
        Where the axis of view meets the picture.
    rotation : (3, 3)
        World to camera, orthogonal, det +1.
    translation : (3,)
        In the world's unit.
    near
        Depth before which nothing is drawn, in the world's unit.

    Raises
    ------
    RenderingError
        Where a number is not finite or impossible.
    """

    width: int
    height: int
    focal_x: float
    focal_y: float
    center_x: float
    center_y: float
    rotation: Array
    translation: Array
    near: float = 0.01

    def __post_init__(self) -> None:
        check_size(self.width, self.height)
        for name in ("focal_x", "focal_y", "near"):
            value = float(getattr(self, name))
            if not (math.isfinite(value) and value > 0):
                raise RenderingError(f"the camera's {name} must be a number > 0, found {value!r}")
        for name in ("center_x", "center_y"):
            if not math.isfinite(getattr(self, name)):
                raise RenderingError(f"the camera's {name} must be a number, found {getattr(self, name)!r}")
        rotation = np.array(self.rotation, dtype=np.float64)
        translation = np.array(self.translation, dtype=np.float64)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise RenderingError(
                f"the camera's rotation and translation have shapes {rotation.shape}, {translation.shape},"
                " expected (3, 3), (3,)"
            )
        if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
            raise RenderingError("the camera's position or direction is not finite: look for a NaN where it comes from")
        with np.errstate(over="ignore", invalid="ignore"):
            error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        # Asked so that a NaN, of entries whose squares are infinite, is none either.
        if not error <= _ORTHOGONAL:
            raise RenderingError(f"the camera's rotation is none (largest entry of R R^T - 1: {error:.2g})")
        if (determinant := float(np.linalg.det(rotation))) < 0:
            raise RenderingError(f"the camera's rotation is none: it is a reflection (determinant {determinant:.2g})")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @property
    def position(self) -> Array:
        """The eye in the world, (3,)."""
        return -self.rotation.T @ self.translation

    @property
    def field_of_view(self) -> float:
        """Vertical, in degrees."""
        return math.degrees(2 * math.atan(self.height / (2 * self.focal_y)))

    def resized(self, width: int, height: int) -> Camera:
        """The same view in another size: as high as before; as wide as the new shape makes it."""
        factor = height / self.height
        return replace(
            self,
            width=width,
            height=height,
            focal_x=self.focal_x * factor,
            focal_y=self.focal_y * factor,
            center_x=(self.center_x - self.width / 2) * factor + width / 2,
            center_y=self.center_y * factor,
        )

    def project(self, points: Array) -> tuple[Array, Array]:
        """Where points (N, 3) of the world are in the picture, (N, 2) [px], and their depths (N,)."""
        seen = np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation
        depth = seen[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            x = self.focal_x * seen[:, 0] / depth + self.center_x
            y = self.focal_y * seen[:, 1] / depth + self.center_y
        return np.stack([x, y], axis=1), depth

    def bands(self) -> list[slice]:
        """All rows of the picture, a few at a time: what is computed for a band stays in the cache."""
        rows = max(1, _BAND // self.width)
        return [slice(start, min(start + rows, self.height)) for start in range(0, self.height, rows)]

    def slopes(self, rows: slice = slice(None)) -> tuple[Array, Array]:
        """x / z (1, W) and y / z (H, 1) of the pixel centres of rows, in the camera's frame."""
        x = (np.arange(self.width) + 0.5 - self.center_x) / self.focal_x
        y = (np.arange(self.height)[rows] + 0.5 - self.center_y) / self.focal_y
        return x[None, :], y[:, None]

    def rays(self, rows: slice = slice(None)) -> Array:
        """Directions in the world through all pixel centres of rows, (H, W, 3), of unit length along the axis of view.

        Eye + depth * ray is what stands at that depth.
        """
        x, y = self.slopes(rows)
        return x[:, :, None] * self.rotation[0] + (y[:, :, None] * self.rotation[1] + self.rotation[2])


def look_at(
    position: Sequence[float] | Array,
    target: Sequence[float] | Array,
    *,
    width: int,
    height: int,
    up: Sequence[float] | Array = (0.0, 0.0, 1.0),
    field_of_view: float = 40.0,
    near: float = 0.01,
) -> Camera:
    """A camera at `position` that looks at `target` with a vertical field of view [degrees].

    Where it looks along `up`, another axis takes its place.

    Raises
    ------
    RenderingError
        Where position and target coincide or a number is impossible.
    """
    eye, aim = np.asarray(position, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if not (math.isfinite(field_of_view) and 0 < field_of_view < 180):
        raise RenderingError(f"the camera's field of view must be between 0 and 180 degrees, found {field_of_view!r}")
    if not (np.isfinite(eye).all() and np.isfinite(aim).all()):
        raise RenderingError(f"the camera's position {position!r} or target {target!r} is not finite")
    forward = aim - eye
    distance = float(np.linalg.norm(forward))
    if distance == 0:
        raise RenderingError("the camera stands where it looks at: move its position or its target")
    forward /= distance
    right = np.cross(forward, np.asarray(up, dtype=np.float64))
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    focal = 0.5 * height / math.tan(math.radians(field_of_view) / 2)
    return Camera(
        width=width,
        height=height,
        focal_x=focal,
        focal_y=focal,
        center_x=width / 2,
        center_y=height / 2,
        rotation=rotation,
        translation=-rotation @ eye,
        near=near,
    )
