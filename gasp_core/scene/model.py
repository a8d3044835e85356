"""A scene as a frozen dataclass: SI units, right-handed axes, +z up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from gasp_core.contract import (
    Collider,
    Domain,
    Drive,
    EngineAccuracy,
    EngineDescriptor,
    ForceField,
    Precision,
)
from gasp_core.contract.validation import Vector, finite, finite_vector, instance, members
from gasp_core.errors import SceneError
from gasp_core.notebooks import ShownInNotebooks
from gasp_core.scene.body_contacts import ContactRule, check_rules
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.settings import CameraChoice, EngineChoice, MapChoice, RecordingChoice

__all__ = ["Scene", "engine_notes"]

_ENTRIES = {
    "objects": SplatObject, "contacts": ContactRule, "colliders": Collider, "drives": Drive, "force_fields": ForceField,
}  # fmt: skip
"""What may stand there several times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene(ShownInNotebooks):
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
    contacts
        How objects meet; those that no rule names part and slide on each other.
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
    contacts: tuple[ContactRule, ...] = ()
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
        for name, kind in _ENTRIES.items():
            members(self, name, kind)
        instance(self, "engine", EngineChoice, hint=', e.g. EngineChoice(name="taichi-mpm")')
        instance(self, "accuracy", EngineAccuracy, hint=", e.g. EngineAccuracy(resolution=32)")
        instance(self, "maps", MapChoice)
        instance(self, "recording", RecordingChoice)
        instance(self, "camera", CameraChoice, type(None))
        instance(self, "domain", Domain, type(None))
        if not self.objects:
            raise SceneError("Scene.objects is empty: a scene needs at least one object")
        seen: set[str] = set()
        for item in self.objects:
            if item.name in seen:
                raise SceneError(f'Scene.objects has two objects named "{item.name}": give each a name of its own')
            seen.add(item.name)
        check_rules(
            self.contacts,
            [item.name for item in self.objects],
            [item.name for item in self.objects if item.static],
        )
        if self.camera is not None and self.camera.object is not None and self.camera.object not in seen:
            raise SceneError(
                f'Scene.camera is in the frame of the object "{self.camera.object}", which the scene does not have'
            )
        # The product of two finite numbers may be infinite, which is no number of frames.
        frames = self.duration * self.frame_rate
        if frames > 10_000_000:
            raise SceneError(
                f"Scene.duration {self.duration:g} s at {self.frame_rate:g} frames a second makes {frames:.8g}"
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
                device=own.device if own.device is not None and can.runs_on(own.device) else None,
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
