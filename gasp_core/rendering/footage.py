"""What can be shown: a recording, or a splat file as a recording of one frame."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.errors import RecordingError
from gasp_core.io import read_splat
from gasp_core.recording import Recording
from gasp_core.render_input import RenderInput
from gasp_core.scene.file_shapes import FileShape
from gasp_core.scene.objects import SplatObject, UpAxis
from gasp_core.scene.placed_solid import PlacedSolid
from gasp_core.scene.placement import Placement
from gasp_core.scene.selection import place_object
from gasp_core.scene.settings import CameraChoice

__all__ = ["Footage", "RecordedFootage", "Still", "open_footage"]

Array = NDArray[Any]


class Footage(Protocol):
    """Frames to be shown, in metres and +z up."""

    @property
    def path(self) -> Path:
        """Where it came from."""
        ...

    @property
    def frame_count(self) -> int:
        """Frames there are now; grows while a run goes on."""
        ...

    @property
    def frame_rate(self) -> float:
        """Frames a second of simulated time."""
        ...

    @property
    def colliders(self) -> tuple[Collider, ...]:
        """What matter met."""
        ...

    @property
    def camera(self) -> CameraChoice | None:
        """The camera its scene asks for."""
        ...

    def splats(self, frame: int) -> RenderInput:
        """What is drawn in a frame."""
        ...

    def positions(self, frame: int) -> Array:
        """Centres of what is drawn, (M, 3) [m], cheaper than `splats`."""
        ...

    def placement(self, name: str | None) -> Placement:
        """How an object's file was put into the world; None: the first object's."""
        ...


class RecordedFootage:
    """The frames of a recording, finished or not."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.path = recording.path

    @property
    def frame_count(self) -> int:
        """Frames there are now."""
        return self.recording.frame_count

    @property
    def frame_rate(self) -> float:
        """Of the scene."""
        return self.recording.header.frame_rate

    @property
    def colliders(self) -> tuple[Collider, ...]:
        """Of the scene, those that a formula describes: what a file describes is drawn as an object where it is one."""
        return tuple(one for one in self.recording.scene.colliders if not isinstance(one.shape, FileShape))

    @property
    def camera(self) -> CameraChoice | None:
        """Of the scene."""
        return self.recording.scene.camera

    def splats(self, frame: int) -> RenderInput:
        """What is drawn in a frame."""
        return self.recording.splats(frame)

    def positions(self, frame: int) -> Array:
        """Means of all Gaussians: first vertices of the moved simplices, and those that never move."""
        moved = [simplices[:, 0] for simplices in self.recording.simplices(frame).values()]
        return np.concatenate([self._still, *moved])

    @cached_property
    def _still(self) -> Array:
        return self.recording.reference.means[~self.recording.moving]

    def placement(self, name: str | None) -> Placement:
        """How an object's file was put into the world."""
        return self.recording.placement(self.recording.header.objects[0].name if name is None else name)


class Still:
    """A splat file, stood upright, in units of its own; Gaussians that cannot be drawn are left out.

    Raises
    ------
    SplatFormatError, SceneError
        Where the file cannot be read, or nothing in it can be drawn.
    """

    frame_count = 1
    frame_rate = 25.0
    colliders: tuple[Collider, ...] = ()
    camera: CameraChoice | None = None

    def __init__(self, path: Path, up: UpAxis = "-y") -> None:
        self.path = path
        item = SplatObject(name=path.stem, splat=path, static=True, up=up)
        self._placed = place_object(item, read_splat(path))

    def splats(self, frame: int) -> RenderInput:
        """All there is."""
        return RenderInput.of(self._placed.gaussians)

    def positions(self, frame: int) -> Array:
        """Means of what does not float apart from the rest."""
        return self._placed.gaussians.means[~self._placed.floating]

    def solid(self) -> PlacedSolid:
        """The body that the splat is the surface of."""
        return self._placed.solid()

    def placement(self, name: str | None) -> Placement:
        """How the file was stood upright."""
        return self._placed.placement


def open_footage(path: str | Path, up: UpAxis = "-y") -> Footage:
    """A recording, or a splat file that is stood upright.

    Parameters
    ----------
    path
        A folder that gasp run wrote, or a splat file (or folder, for unpacked .sog).
    up
        A splat file's axis that points up.

    Raises
    ------
    RecordingError, SplatFormatError
        Where it is neither, or damaged.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such recording or splat file")
    if path.suffix == ".gasp" or (path / "zarr.json").exists():
        return RecordedFootage(Recording.open(path))
    return Still(path, up)
