"""A scene as frozen dataclasses: SI units, right-handed axes, +z up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any, Literal

from gasp_core.engine.checks import Vector, finite, finite_vector
from gasp_core.engine.contract import EngineAccuracy, EngineDescriptor, Precision
from gasp_core.engine.forcing import Collider, Domain, Drive, ForceField
from gasp_core.engine.materials import Material
from gasp_core.engine.shapes import BoxShape, HalfSpace, SphereShape
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.scene.motions import FrameSequence, Motion

__all__ = [
    "CameraChoice",
    "EngineChoice",
    "Floaters",
    "MapChoice",
    "RecordingChoice",
    "Reduction",
    "Scene",
    "SplatObject",
    "UpAxis",
    "engine_notes",
]

UpAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
UP_AXES: tuple[UpAxis, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")


class Floaters(Enum):
    """What becomes of Gaussians outside the large connected components of an object."""

    DROP = "drop"
    """They are left out of the recording."""
    STILL = "still"
    """They are drawn where they are and never simulated."""
    KEEP = "keep"
    """They are simulated like the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction:
    """Which points an engine is given for an object, and what their motion moves.

    Parameters
    ----------
    mode
        "all": every vertex of every simplex, as in the paper. "cores": the corners of few Gaussians that stand for
        clusters of the object's own.
    fraction, count
        Cores for each Gaussian of the object that moves, in 0..1, or their number; one of the two, with "cores".
    levels
        Cores of cores: the engine moves the last of so many levels. None with "cores": 1.
    transfer
        "least-squares": a Gaussian follows an affine fit to the cores around it; "frame": the frame of its own core, as
        in the paper. None with "cores": "least-squares".

    Raises
    ------
    SceneError
        Where a value is impossible, or has no meaning in this mode.
    """

    mode: str = "all"
    fraction: float | None = None
    count: int | None = None
    levels: int | None = None
    transfer: Literal["least-squares", "frame"] | None = None

    def __post_init__(self) -> None:
        if self.mode == "volume":
            raise SceneError('Reduction.mode "volume" comes later: use "all" or "cores"')
        if self.mode not in ("all", "cores"):
            raise SceneError(f'Reduction.mode must be "all" or "cores", found {self.mode!r}')
        if self.mode == "all":
            for name in ("fraction", "count", "levels", "transfer"):
                if getattr(self, name) is not None:
                    raise SceneError(f'Reduction.{name} has no meaning with mode = "all": leave it out')
            return
        if (self.fraction is None) == (self.count is None):
            raise SceneError('Reduction.mode "cores" wants a fraction or a count: give one of them')
        if self.fraction is not None:
            finite(self, "fraction", low=0.0, open_low=True, high=1.0)
        object.__setattr__(self, "levels", 1 if self.levels is None else self.levels)
        for name in ("count", "levels"):
            value: object = getattr(self, name)
            if value is not None and type(value) is not int:
                raise SceneError(f"Reduction.{name} must be a whole number, found {value!r}")
        if self.count is not None:
            finite(self, "count", low=1)
        finite(self, "levels", low=1, high=8)
        object.__setattr__(self, "transfer", self.transfer or "least-squares")
        if self.transfer not in ("least-squares", "frame"):
            raise SceneError(f'Reduction.transfer must be "least-squares" or "frame", found {self.transfer!r}')

    def with_cores(self, *, fraction: float | None = None, count: int | None = None) -> Reduction:
        """The same with so many cores, levels and transfer as they are; with neither a fraction nor a count: "all"."""
        if fraction is None and count is None:
            return Reduction()
        own = self if self.mode == "cores" else Reduction(mode="cores", count=1)
        return replace(own, fraction=fraction, count=count)

    def cores_of(self, gaussians: int) -> int:
        """How many cores so many Gaussians get, at least one."""
        return self.count if self.count is not None else max(1, round((self.fraction or 1.0) * gaussians))


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatObject:
    """A splat, where it is put and what it is made of.

    Parameters
    ----------
    name
        Unique in the scene.
    splat
        A splat file (or folder, for unpacked .sog, or of frames), or the Gaussians themselves.
    material
        What it is made of; None only with `static`.
    static
        Drawn where it stands, never simulated.
    up
        The splat's axis that becomes +z. None: "-y" for a file, the habit of 3DGS captures, and "+z" for Gaussians
        built in memory, the frame of everything else here.
    height
        Extent along the up axis [m] that the robust bounding box is scaled to.
    metres_per_unit
        Length [m] of the splat's unit instead; 1 where neither is given.
    position
        Where the lower centre of the robust bounding box goes [m], so that an object stands on what is at its z.
        None: the splat's origin stays the world's origin.
    rotation
        Three angles [degrees] about the world's x, then y, then z axis, or a quaternion w x y z; applied to the
        object once it stands upright, before `position`.
    velocity
        Of the object's centre of volume at the start [m/s].
    angular_velocity
        About that centre at the start [rad/s].
    reduction
        Which points the engine is given.
    min_opacity
        Gaussians of a lower opacity (0..1) are left out.
    region
        Part of the world that is simulated; Gaussians whose centre is outside stay still.
    floaters
        What becomes of Gaussians outside the large connected components. "keep" by default: nobody's lettering or
        loose leaves are thrown away unasked; their number is reported all the same.
    vertices
        Vertices of a simplex for this object; None: as in `Scene.maps`.
    motion
        How it moves by itself before physics acts on it; None: not at all.

    Raises
    ------
    SceneError
        Where a value is impossible or two contradict each other.
    """

    name: str
    splat: Path | Gaussians
    material: Material | None = None
    static: bool = False
    up: UpAxis | None = None
    height: float | None = None
    metres_per_unit: float | None = None
    position: Vector | None = None
    rotation: tuple[float, ...] | None = None
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    reduction: Reduction = field(default_factory=Reduction)
    min_opacity: float = 0.0
    region: HalfSpace | BoxShape | SphereShape | None = None
    floaters: Floaters = Floaters.KEEP
    vertices: Literal[3, 4, "auto"] | None = None
    motion: Motion | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise SceneError("SplatObject.name must not be empty")
        if isinstance(self.splat, str):
            object.__setattr__(self, "splat", Path(self.splat))
        if self.static and self.material is not None:
            raise SceneError(f'SplatObject.material of "{self.name}" has no meaning with static: leave one of them out')
        if not self.static and self.material is None:
            raise SceneError(f'SplatObject.material of "{self.name}" is missing: name one, or say static = true')
        if self.up is not None and self.up not in UP_AXES:
            raise SceneError(f"SplatObject.up must be one of {', '.join(UP_AXES)}, found {self.up!r}")
        if self.height is not None and self.metres_per_unit is not None:
            raise SceneError("SplatObject.height and metres_per_unit contradict each other: give one of them")
        for name in ("height", "metres_per_unit"):
            if getattr(self, name) is not None:
                finite(self, name, low=0.0, open_low=True)
        if self.position is not None:
            finite_vector(self, "position")
        finite_vector(self, "velocity")
        finite_vector(self, "angular_velocity")
        finite(self, "min_opacity", low=0.0, high=1.0)
        if self.rotation is not None:
            _check_rotation(self)
        if self.vertices not in (None, 3, 4, "auto"):
            raise SceneError(f'SplatObject.vertices must be 3, 4 or "auto", found {self.vertices!r}')
        if self.motion is not None:
            _check_motion(self, self.motion)


def _check_motion(owner: SplatObject, motion: Motion) -> None:
    where = f'SplatObject.motion of "{owner.name}"'
    if owner.static:
        raise SceneError(f"{where} has no meaning with static: leave one of them out")
    if isinstance(motion, FrameSequence) and isinstance(owner.splat, Gaussians):
        raise SceneError(f"{where} wants a folder of frames for a splat, found Gaussians in memory")
    if motion.composition == "carried" and (owner.region is not None or owner.floaters is Floaters.STILL):
        key = "region" if owner.region is not None else 'floaters = "still"'
        raise SceneError(
            f"{where} would tear it off what {key} leaves still: leave that out"
            ' (a drive of kind "pinned" holds matter too), or say composition = "frozen"'
        )


def _check_rotation(owner: SplatObject) -> None:
    value: Any = owner.rotation
    try:
        rotation = tuple(float(component) for component in value)
    except (TypeError, ValueError):
        rotation = ()
    if len(rotation) not in (3, 4) or not all(math.isfinite(component) for component in rotation):
        raise SceneError(f"SplatObject.rotation must be three degrees or a quaternion w x y z, found {value!r}")
    if len(rotation) == 4 and not any(rotation):
        raise SceneError("SplatObject.rotation must not be the zero quaternion")
    object.__setattr__(owner, "rotation", rotation)


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineChoice:
    """Which engine runs the scene, and how.

    Parameters
    ----------
    name
        As `gasp engines` lists it.
    device, precision
        None: the engine's first.
    seed
        For whatever the engine draws at random.
    options
        What only this engine has; checked against its own option class when it is opened.
    isolate
        Run it in a process of its own, whose death is an error and not the end of this one.
    frame_limit
        Wall time [s] after which a frame is given up; None: an hour. Only an engine in a process of its own can be.
    """

    name: str = "warp-mpm"
    device: str | None = None
    precision: Precision | None = None
    seed: int = 0
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    isolate: bool = False
    frame_limit: float | None = None

    def __post_init__(self) -> None:
        if self.name == "auto":
            raise SceneError('EngineChoice.name "auto" comes later: name an engine yourself (see `gasp engines`)')
        if not self.name:
            raise SceneError("EngineChoice.name must not be empty")
        finite(self, "seed", low=0)
        if self.frame_limit is not None:
            finite(self, "frame_limit", low=0.0, open_low=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapChoice:
    """How Gaussians become simplices and back.

    Parameters
    ----------
    vertices
        3: the paper's triangle, 4: a tetrahedron for Gaussians that are not flat; "auto" looks at the splat.
    covariance
        "exact" (the covariance of the affinely deformed Gaussian) or "gram_schmidt" (the paper's).
    alpha
        Bound of the control rule on how far a Gaussian may stretch, > 0; inf switches it off.
    edge_floor
        Shortest edge an engine is given, as a fraction of its spacing; shorter ones are magnified on the way in and
        divided back. 0: the paper's own points.
    """

    vertices: Literal[3, 4, "auto"] = "auto"
    covariance: Literal["exact", "gram_schmidt"] = "exact"
    alpha: float = 2.0
    edge_floor: float = 0.25

    def __post_init__(self) -> None:
        if self.vertices not in (3, 4, "auto"):
            raise SceneError(f'MapChoice.vertices must be 3, 4 or "auto", found {self.vertices!r}')
        if self.covariance not in ("exact", "gram_schmidt"):
            raise SceneError(f'MapChoice.covariance must be "exact" or "gram_schmidt", found {self.covariance!r}')
        if self.alpha != math.inf:
            finite(self, "alpha", low=0.0, open_low=True)
        finite(self, "edge_floor", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingChoice:
    """What a recording holds besides positions, and how often it can be gone on from.

    Parameters
    ----------
    velocities
        Keep the points' velocities of every frame too (float32).
    checkpoint_seconds
        Wall time [s] after which the next frame is followed by a checkpoint.
    checkpoint_frames
        A checkpoint after every so many frames as well; None: by time alone.
    """

    velocities: bool = False
    checkpoint_seconds: float = 30.0
    checkpoint_frames: int | None = None

    def __post_init__(self) -> None:
        finite(self, "checkpoint_seconds", low=0.0)
        if self.checkpoint_frames is not None:
            finite(self, "checkpoint_frames", low=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """From where a scene is shown; it decides nothing about the simulation.

    Parameters
    ----------
    position, target
        Of the eye, and what it looks at [m]; both or none.
    field_of_view
        Vertical, of that camera [degrees].
    file
        A cameras.json of 3DGS or a NeRF-style transforms.json instead.
    view
        Of that file: number from 0, or name of the picture.
    object
        In whose splat's frame the file's cameras are; None: the first object's.

    Raises
    ------
    SceneError
        Where it says both, neither, or something impossible.
    """

    position: Vector | None = None
    target: Vector | None = None
    field_of_view: float = 40.0
    file: Path | None = None
    view: int | str = 0
    object: str | None = None

    def __post_init__(self) -> None:
        if (self.position is None) != (self.target is None):
            raise SceneError("CameraChoice.position and target belong together: give both")
        if (self.position is None) == (self.file is None):
            raise SceneError("CameraChoice.position (and target), or file: give one of them")
        if isinstance(self.file, str):
            object.__setattr__(self, "file", Path(self.file))
        if self.position is not None:
            finite_vector(self, "position")
            finite_vector(self, "target")
            if self.position == self.target:
                raise SceneError(f"CameraChoice.target must not be the position, found {self.target!r}")
        finite(self, "field_of_view", low=0.0, open_low=True, high=179.0)
        if isinstance(self.view, bool) or (isinstance(self.view, int) and self.view < 0):
            raise SceneError(f"CameraChoice.view must be a number from 0 or a name, found {self.view!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Everything a simulation needs.

    Parameters
    ----------
    duration
        Simulated time [s].
    frame_rate
        Frames a second of simulated time [1/s].
    objects
        At least one, of different names.
    gravity
        [m/s^2].
    colliders, drives, force_fields, domain
        What acts on the matter.
    engine, accuracy, maps, recording
        How it is computed and kept.
    camera
        From where it is shown; None: from where all of the motion is seen.

    Raises
    ------
    SceneError
        Where a value is impossible.
    """

    duration: float
    frame_rate: float
    objects: tuple[SplatObject, ...]
    gravity: Vector = (0.0, 0.0, -9.81)
    colliders: tuple[Collider, ...] = ()
    drives: tuple[Drive, ...] = ()
    force_fields: tuple[ForceField, ...] = ()
    domain: Domain | None = None
    engine: EngineChoice = field(default_factory=EngineChoice)
    accuracy: EngineAccuracy = field(default_factory=EngineAccuracy)
    maps: MapChoice = field(default_factory=MapChoice)
    recording: RecordingChoice = field(default_factory=RecordingChoice)
    camera: CameraChoice | None = None

    def __post_init__(self) -> None:
        finite(self, "duration", low=0.0, open_low=True)
        finite(self, "frame_rate", low=0.0, open_low=True)
        finite_vector(self, "gravity")
        for name in ("objects", "colliders", "drives", "force_fields"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.objects:
            raise SceneError("Scene.objects is empty: a scene needs at least one object")
        seen: set[str] = set()
        for item in self.objects:
            if item.name in seen:
                raise SceneError(f'Scene.objects has two objects named "{item.name}": give each a name of its own')
            seen.add(item.name)
        if self.camera is not None and self.camera.object is not None and self.camera.object not in seen:
            raise SceneError(
                f'Scene.camera is in the frame of the object "{self.camera.object}", which the scene does not have'
            )
        if self.frame_count > 10_000_000:
            raise SceneError(
                f"Scene.duration {self.duration:g} s at {self.frame_rate:g} frames a second makes {self.frame_count}"
                " frames, more than 10000000: shorten it"
            )

    def with_engine(
        self, engine: EngineDescriptor, *, device: str | None = None, precision: Precision | None = None
    ) -> Scene:
        """The scene as an engine runs it; `gasp run`, `compare` and `tradeoff` all choose their engine so.

        What the scene says of its own engine stays. Of another engine the options go, which are that engine's own;
        device and precision stay where this one declares them, and are its first where it does not, see
        `engine_notes`.

        Parameters
        ----------
        engine
            That is to run it.
        device, precision
            Asked for by name, whatever the scene says; refused by `check_supported` where the engine lacks them.
        """
        own, can = self.engine, engine.capabilities
        if own.name != engine.name:
            own = replace(
                own,
                name=engine.name,
                options={},
                device=own.device if own.device in can.devices else None,
                precision=own.precision if own.precision in can.precisions else None,
            )
        return replace(self, engine=replace(own, device=device or own.device, precision=precision or own.precision))

    def with_resolution(self, resolution: int) -> Scene:
        """The scene on a grid of so many cells along the largest body, instead of what it says itself."""
        return replace(self, accuracy=replace(self.accuracy, resolution=resolution, spacing=None))

    def with_cores(self, *, fraction: float | None = None, count: int | None = None) -> Scene:
        """The scene with so many cores in every object that moves; see `Reduction.with_cores`."""
        objects = tuple(
            item if item.static else replace(item, reduction=item.reduction.with_cores(fraction=fraction, count=count))
            for item in self.objects
        )
        return replace(self, objects=objects)

    @property
    def frame_count(self) -> int:
        """Number of frames, the one at time 0 included."""
        # A hair of tolerance: 0.3 s at 10 frames a second is three steps, though 0.3 * 10 is below 3 in binary.
        return 1 + math.floor(self.duration * self.frame_rate * (1 + 1e-12) + 1e-9)

    def time_of(self, frame: int) -> float:
        """Simulated time [s] of a frame; the same number however the run got there."""
        return frame / self.frame_rate


def engine_notes(asked: Scene, given: Scene, engine: EngineDescriptor) -> tuple[str, ...]:
    """What a scene asked of its own engine and `Scene.with_engine` could not keep with this one, a sentence each."""
    own, other = asked.engine, given.engine
    notes: list[str] = []
    if own.device is not None and other.device is None:
        notes.append(
            f"{engine.name} does not run on {own.device}, which the scene names for {own.name}:"
            f" it runs on {engine.capabilities.devices[0]}"
        )
    if own.precision is not None and other.precision is None:
        notes.append(
            f"{engine.name} does not compute in {own.precision.value}, which the scene names for {own.name}:"
            f" it computes in {engine.capabilities.precisions[0].value}"
        )
    return tuple(notes)
