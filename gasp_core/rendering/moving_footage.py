"""Moving splats as footage."""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side, SphereShape
from gasp_core.errors import RecordingError, SceneError
from gasp_core.moving.header import HEADER
from gasp_core.moving.reading import MovingSplat
from gasp_core.render_input import RenderInput
from gasp_core.scene.placement import Placement, upright
from gasp_core.scene.settings import CameraChoice

__all__ = ["SHAPES", "MovingFootage", "is_moving_splat"]

Array = NDArray[Any]

SHAPES = {shape.kind: shape for shape in (HalfSpace, SphereShape, BoxShape)}
"""Of colliders, by the names that a file has for them."""


def is_moving_splat(path: Path) -> bool:
    """Whether a file is one: a .sog whose Gaussians move."""
    if not path.is_file() or not zipfile.is_zipfile(path):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return HEADER in archive.namelist()
    # Nothing is hidden: it is read as an ordinary splat then, and that says what is wrong with it.
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return False


class MovingFootage:
    """The frames of a moving splat."""

    def __init__(self, splat: MovingSplat) -> None:
        self.splat = splat
        self.path = splat.path
        self.frame_count = len(splat)
        self.frame_rate = splat.header.frame_rate
        self.colliders = tuple(
            _collider(one, splat.path) for one in splat.header.colliders if one.get("kind") in SHAPES
        )
        self.camera: CameraChoice | None = None

    def splats(self, frame: int) -> RenderInput:
        """The Gaussians of a frame."""
        return self.splat.splats(frame)

    def drawn(self, frame: int) -> RenderInput:
        """The same."""
        return self.splats(frame)

    def subject(self, frame: int) -> RenderInput:
        """All there is."""
        return self.splats(frame)

    def positions(self, frame: int) -> Array:
        """Means of what moves."""
        return np.concatenate([simplices[:, 0] for _, simplices in self.splat.simplices(frame)])

    def placement(self, name: str | None) -> Placement:
        """How the splat in the file was put into the world."""
        return Placement(rotation=upright("-y"), scale=1.0, translation=np.array(self.splat.header.origin))


def _collider(told: Mapping[str, Any], path: Path) -> Collider:
    shape = SHAPES[told["kind"]]
    try:
        values = {field.name: told[field.name] for field in dataclasses.fields(shape)}
        return Collider(shape=shape(**values), side=Side(told["side"]))
    except (KeyError, TypeError, ValueError, SceneError) as error:
        raise RecordingError(f"{path}: a collider is damaged: {error}") from error
