"""Moving splats as footage."""

from __future__ import annotations

import zipfile
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.moving.header import HEADER
from gasp_core.moving.reading import MovingSplat
from gasp_core.render_input import RenderInput
from gasp_core.rendering.movers import BACKDROP, Movers, in_subject, size_of
from gasp_core.scene.placement import Placement, upright
from gasp_core.scene.settings import CameraChoice

__all__ = ["MovingFootage", "is_moving_splat"]

Array = NDArray[Any]


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
        self.colliders = splat.colliders
        self.camera: CameraChoice | None = None

    def splats(self, frame: int) -> RenderInput:
        """The Gaussians of a frame."""
        return self.splat.splats(frame)

    def drawn(self, frame: int) -> RenderInput:
        """These, and grains of what has flowed."""
        return self.splat.drawn(frame)

    @property
    def drawn_frames(self) -> MovingSplat:
        """Its frames as they are drawn, with where their colours are from."""
        return self.splat

    def subject(self, frame: int) -> RenderInput:
        """What moves, colliders too, and what stands still beside it, but for a backdrop."""
        drawn = self.drawn(frame)
        grains = np.ones(len(drawn) - len(self.in_subject), dtype=bool)
        return self.movers.joined(drawn.select(np.concatenate([self.in_subject, grains])), frame / self.frame_rate)

    def positions(self, frame: int) -> Array:
        """Means of the subject."""
        moved = [simplices[:, 0] for _, simplices in self.splat.simplices(frame)]
        return self.movers.beside(np.concatenate([self._still, *moved]), frame / self.frame_rate)

    @cached_property
    def in_subject(self) -> Array:
        """Mask (N,) of the Gaussians, as `RecordedFootage` has it; of a file that knows no objects, all."""
        objects, bodies = self.splat.header.objects, self.splat.header.bodies
        moving = [any(first <= body.first < last for body in bodies) for first, last in objects]
        return in_subject(self.splat.reference.means, [slice(*rows) for rows in objects], moving)

    @cached_property
    def _still(self) -> Array:
        still = self.in_subject.copy()
        still[self._moving] = False
        return self.splat.reference.means[still]

    @cached_property
    def _moving(self) -> Array:
        """Rows of the Gaussians that move."""
        return np.concatenate([np.arange(body.first, body.last) for body in self.splat.header.bodies])

    @cached_property
    def movers(self) -> Movers:
        """Colliders that move, but for those that are much larger than the Gaussians that do."""
        return Movers.of(self.colliders, BACKDROP * size_of(self.splat.reference.means[self._moving]))

    def placement(self, name: str | None) -> Placement:
        """How the splat in the file was put into the world."""
        return Placement(rotation=upright("-y"), scale=1.0, translation=np.array(self.splat.header.origin))
