"""What can be shown: a recording, or a splat or a scene as a recording of one frame."""

from __future__ import annotations

import logging
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.dynamics.placed_scene import PlacedScene, place_scene
from gasp_core.errors import GaspError, RecordingError, SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat
from gasp_core.io.near_files import did_you_mean_file
from gasp_core.moving.reading import MovingSplat
from gasp_core.recording import Recording
from gasp_core.recording.addresses import local_copy
from gasp_core.recording.drawn import DrawnFrames
from gasp_core.render_input import RenderInput
from gasp_core.rendering.movers import BACKDROP, Movers, in_subject, size_of
from gasp_core.rendering.moving_footage import MovingFootage, is_moving_splat
from gasp_core.scene.file_shapes import SplatShape, resolved
from gasp_core.scene.loading import load_scene
from gasp_core.scene.model import Scene
from gasp_core.scene.named_code import code_of, without_code
from gasp_core.scene.objects import SplatObject, UpAxis
from gasp_core.scene.placed_solid import PlacedSolid
from gasp_core.scene.placement import Placement
from gasp_core.scene.selection import place_object
from gasp_core.scene.settings import CameraChoice

__all__ = ["Footage", "Moving", "RecordedFootage", "SceneFootage", "Still", "open_footage"]

Array = NDArray[Any]

_LOG = logging.getLogger(__name__)

_PLACED = ("up", "height", "metres_per_unit", "position", "rotation")
"""By which an object and a collider of one splat are one thing."""


class Moving(Protocol):
    """What is to be in the pictures, frame by frame, in metres and +z up."""

    @property
    def path(self) -> Path:
        """Where it came from."""
        ...

    @property
    def frame_count(self) -> int:
        """Frames there are now; grows while a run goes on."""
        ...

    def subject(self, frame: int) -> RenderInput:
        """Of what is drawn in a frame, that which is to be in the picture."""
        ...

    def positions(self, frame: int) -> Array:
        """Centres of the subject, (M, 3) [m], cheaper than `subject`."""
        ...


class Footage(Moving, Protocol):
    """Frames to be shown."""

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
        """The Gaussians of a frame, a row each from the first frame to the last."""
        ...

    def drawn(self, frame: int) -> RenderInput:
        """What is drawn in a frame: these, and what they have come apart into."""
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
        """Of the scene, those that can be drawn."""
        return self._colliders

    @cached_property
    def _colliders(self) -> tuple[Collider, ...]:
        return _drawable(self.recording.scene)

    @property
    def camera(self) -> CameraChoice | None:
        """Of the scene."""
        return self.recording.scene.camera

    def splats(self, frame: int) -> RenderInput:
        """The Gaussians of a frame."""
        return self.recording.splats(frame)

    def drawn(self, frame: int) -> RenderInput:
        """These, and grains of what has flowed."""
        return self.drawn_frames.splats(frame)

    @cached_property
    def drawn_frames(self) -> DrawnFrames:
        """Its frames as they are drawn."""
        return DrawnFrames(self.recording)

    def subject(self, frame: int) -> RenderInput:
        """What moves, colliders too, and what stands still beside it, but for a backdrop."""
        return self.movers.joined(self.matter(frame), frame / self.frame_rate)

    def matter(self, frame: int) -> RenderInput:
        """The same without colliders."""
        drawn = self.drawn(frame)
        grains = np.ones(len(drawn) - len(self.in_subject), dtype=bool)
        return drawn.select(np.concatenate([self.in_subject, grains]))

    def positions(self, frame: int) -> Array:
        """Means of the subject: first vertices of the moved simplices, and those that never move."""
        moved = [simplices[:, 0] for simplices in self.recording.simplices(frame).values()]
        return self.movers.beside(np.concatenate([self._still, *moved]), frame / self.frame_rate)

    @cached_property
    def movers(self) -> Movers:
        """Colliders that move, but for those that are much larger than all that is simulated."""
        moving = self.recording.reference.means[self.recording.moving]
        return Movers.of(self.colliders, BACKDROP * size_of(moving))

    @cached_property
    def _still(self) -> Array:
        return self.recording.reference.means[self.in_subject & ~self.recording.moving]

    @cached_property
    def in_subject(self) -> Array:
        """Mask (N,) of the drawn Gaussians without those of objects that stand still and are much larger than all that
        moves.
        """
        simulated = {body.item for body in self.recording.header.bodies}
        rows = [slice(entry.first, entry.last) for entry in self.recording.header.objects]
        return in_subject(self.recording.reference.means, rows, [item in simulated for item in range(len(rows))])

    def placement(self, name: str | None) -> Placement:
        """How an object's file was put into the world."""
        return self.recording.placement(self.recording.header.objects[0].name if name is None else name)


class Still:
    """A splat, stood upright, in units of its own; Gaussians that cannot be drawn are left out.

    Parameters
    ----------
    gaussians
        As their file holds them.
    up
        The file's axis that points up.
    path
        Where they came from.

    Raises
    ------
    SceneError
        Where nothing of it can be drawn.
    """

    frame_count = 1
    frame_rate = 25.0
    colliders: tuple[Collider, ...] = ()
    camera: CameraChoice | None = None

    def __init__(self, gaussians: Gaussians, up: UpAxis, path: Path) -> None:
        self.path = path
        item = SplatObject(name=path.stem, splat=gaussians, static=True, up=up)
        self._placed = place_object(item, gaussians)

    def splats(self, frame: int) -> RenderInput:
        """All there is."""
        return RenderInput.of(self._placed.gaussians)

    def drawn(self, frame: int) -> RenderInput:
        """All there is."""
        return self.splats(frame)

    def subject(self, frame: int) -> RenderInput:
        """What does not float apart from the rest."""
        return RenderInput.of(self._placed.gaussians).select(~self._placed.floating)

    def positions(self, frame: int) -> Array:
        """Means of the subject."""
        return self._placed.gaussians.means[~self._placed.floating]

    def solid(self) -> PlacedSolid:
        """The body that the splat is the surface of."""
        return self._placed.solid()

    def placement(self, name: str | None) -> Placement:
        """How the file was stood upright."""
        return self._placed.placement


class SceneFootage:
    """A scene as it stands before its first step; what code of its own would move stands as its file has it.

    Parameters
    ----------
    scene
        Whose splats are read and placed.
    path
        Where it came from.

    Raises
    ------
    SceneError, SplatFormatError
        Where a splat cannot be read, or nothing of it is left.
    """

    frame_count = 1

    def __init__(self, scene: Scene, path: Path) -> None:
        self.path = path
        self.scene = scene
        self.frame_rate = scene.frame_rate
        self.camera = scene.camera
        for code in code_of(scene):
            _LOG.warning(
                '%s: object "%s" is shown as its file has it: its motion runs code, and a picture runs none',
                path,
                code.owner,
            )
        self._placed: PlacedScene = place_scene(without_code(scene))
        self._gaussians = self._placed.gaussians

    @property
    def colliders(self) -> tuple[Collider, ...]:
        """Those that can be drawn."""
        return self._colliders

    @cached_property
    def _colliders(self) -> tuple[Collider, ...]:
        return _drawable(self.scene)

    def splats(self, frame: int) -> RenderInput:
        """All objects."""
        return RenderInput.of(self._gaussians)

    def drawn(self, frame: int) -> RenderInput:
        """All objects."""
        return self.splats(frame)

    def subject(self, frame: int) -> RenderInput:
        """What will move, and what stands still beside it, but for a backdrop."""
        return self.splats(frame).select(self.in_subject)

    def positions(self, frame: int) -> Array:
        """Means of the subject."""
        return self._gaussians.means[self.in_subject]

    @cached_property
    def in_subject(self) -> Array:
        """Mask (N,) of the drawn Gaussians, as `RecordedFootage` has it, without what floats apart from its object."""
        ends = np.cumsum([len(one.gaussians) for one in self._placed.objects]).tolist()
        rows = [slice(end - len(one.gaussians), end) for end, one in zip(ends, self._placed.objects)]
        floating = np.concatenate([one.floating for one in self._placed.objects])
        moving = [not item.static for item in self.scene.objects]
        return in_subject(self._gaussians.means, rows, moving) & ~floating

    def placement(self, name: str | None) -> Placement:
        """How an object's file was put into the world."""
        for one in self._placed.objects:
            if name is None or one.item.name == name:
                return one.placement
        raise SceneError(f'{self.path}: has no object "{name}"')


def open_footage(source: Recording | Scene | Gaussians | str | Path, up: UpAxis = "-y") -> Footage:
    """A recording, a scene before its first step, or a splat file that is stood upright.

    Parameters
    ----------
    source
        A folder that gasp run wrote, or its address, what gasp pack made of it, a scene file (.toml), or a splat file
        (or folder, for unpacked .sog); or what is read from one of these.
    up
        A splat file's axis that points up.

    Raises
    ------
    RecordingError, SceneError, SplatFormatError
        Where it is none of them, or damaged.
    """
    if isinstance(source, Recording):
        return RecordedFootage(source)
    if isinstance(source, Scene):
        return SceneFootage(source, Path("scene"))
    if isinstance(source, Gaussians):
        return Still(source, up, Path("gaussians"))
    path = local_copy(source)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such recording, scene or splat file{did_you_mean_file(path)}")
    if path.suffix == ".gasp" or (path / "zarr.json").exists():
        return RecordedFootage(Recording.open(path))
    if path.suffix == ".toml":
        return SceneFootage(load_scene(path), path)
    if path.suffix.lower() == ".sog" and is_moving_splat(path):
        return MovingFootage(MovingSplat.open(path))
    return Still(read_splat(path), up, path)


def _drawable(scene: Scene) -> tuple[Collider, ...]:
    """The colliders of a scene, without splats that are objects too, and those whose file is gone, which is said."""
    # One thing only as long as both stay where they are.
    seen = [(item.splat, *_placed(item)) for item in scene.objects if item.static]
    found: list[Collider] = []
    for number, one in enumerate(scene.colliders, start=1):
        shape, stands = one.shape, one.motion is None
        if stands and isinstance(shape, SplatShape) and (shape.file, *_placed(shape)) in seen:
            continue
        try:
            found.append(resolved(one))
        except (GaspError, OSError) as error:
            _LOG.warning("collider %d is not drawn: %s", number, error)
    return tuple(found)


def _placed(one: SplatObject | SplatShape) -> tuple[Any, ...]:
    return tuple(getattr(one, name) for name in _PLACED)
