"""How a scene is computed, kept and shown."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from gasp_core.contract import (
    Precision,
)
from gasp_core.contract.validation import Vector, finite, finite_vector, member, whole_number
from gasp_core.errors import SceneError
from gasp_core.scene.near_words import did_you_mean

__all__ = ["VIEWS", "CameraChoice", "EngineChoice", "MapChoice", "RecordingChoice", "Viewpoint"]

VIEWS: dict[str, tuple[float, float]] = {
    "three-quarter": (35.0, 18.0),
    "front": (0.0, 8.0),
    "right": (90.0, 8.0),
    "back": (180.0, 8.0),
    "left": (270.0, 8.0),
    "top": (0.0, 89.0),
    "three-quarter-left": (325.0, 18.0),
}
"""Views by name: degrees around from the front (seen along +y) to the right, and degrees above the horizon."""
_VIEW_NAMES = ", ".join(VIEWS)


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
        if self.precision is not None:
            member(self, "precision", Precision)
        whole_number(self, "seed", low=0)
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
        Bound of the control rule on how far a Gaussian may stretch, >= 1; inf switches it off. Below 1 it would shrink
        what is at rest.
    control
        "bounded": nothing grows beyond alpha times what it was. "as_printed", only with "gram_schmidt": the paper's
        rule to the letter, which makes some sheared triangles larger; to compare with.
    edge_floor
        Shortest edge an engine is given, as a fraction of its spacing; shorter ones are magnified on the way in and
        divided back. 0: the paper's own points.
    """

    vertices: Literal[3, 4, "auto"] = "auto"
    covariance: Literal["exact", "gram_schmidt"] = "exact"
    alpha: float = 2.0
    edge_floor: float = 0.25
    control: Literal["bounded", "as_printed"] = "bounded"

    def __post_init__(self) -> None:
        if self.vertices not in (3, 4, "auto"):
            hint = did_you_mean(self.vertices, ["auto"])
            raise SceneError(f'MapChoice.vertices must be 3, 4 or "auto", found {self.vertices!r}{hint}')
        for name, words in (("covariance", ("exact", "gram_schmidt")), ("control", ("bounded", "as_printed"))):
            said = getattr(self, name)
            if said not in words:
                allowed = " or ".join(f'"{word}"' for word in words)
                raise SceneError(f"MapChoice.{name} must be {allowed}, found {said!r}{did_you_mean(said, words)}")
        if self.control == "as_printed" and self.covariance == "exact":
            raise SceneError('MapChoice.control = "as_printed" belongs to covariance = "gram_schmidt": say both')
        if self.alpha != math.inf:
            finite(self, "alpha", low=1.0)
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
            whole_number(self, "checkpoint_frames", low=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewpoint:
    """Where a camera stands at a moment, and what it looks at.

    Parameters
    ----------
    time
        Of the simulation [s].
    position, target
        Of the eye, and what it looks at [m].

    Raises
    ------
    SceneError
        Where a number is not finite, or the two are one place.
    """

    time: float
    position: Vector
    target: Vector

    def __post_init__(self) -> None:
        finite(self, "time")
        finite_vector(self, "position")
        finite_vector(self, "target")
        if self.position == self.target:
            raise SceneError(f"Viewpoint.target must not be the position, found {self.target!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """From where a scene is shown; it decides nothing about the simulation.

    One of a place, a path, a file, or, where none of them is given, a view by its name.

    Parameters
    ----------
    position, target
        Of the eye, and what it looks at [m]; both or none.
    path
        Viewpoints, their times rising: the eye goes smoothly from one to the next, and stands before the first and
        after the last.
    field_of_view
        Vertical, of a camera with a place or a path [degrees].
    file
        A cameras.json of 3DGS or a NeRF-style transforms.json.
    view
        Of that file: number from 0, or name of the picture; None: its first. Without a file, one of `VIEWS`, 0 the
        first: all that moves is in the picture, and fills it; None: the first, or "three-quarter-left" where less is
        hidden behind colliders that stand still.
    object
        In whose splat's frame the file's cameras are; None: the first object's.
    follow
        A view by its name goes along with what moves; None: where it goes several times as far as it is large.
    turns
        How often a view by its name goes around during the film, to the right; below 0 to the left.

    Raises
    ------
    SceneError
        Where it says more than one of them, or something impossible.
    """

    position: Vector | None = None
    target: Vector | None = None
    path: tuple[Viewpoint, ...] = ()
    field_of_view: float = 40.0
    file: Path | None = None
    view: int | str | None = None
    object: str | None = None
    follow: bool | None = None
    turns: float = 0.0

    def __post_init__(self) -> None:
        if (self.position is None) != (self.target is None):
            raise SceneError("CameraChoice.target belongs to position: give both")
        if isinstance(self.file, str):
            object.__setattr__(self, "file", Path(self.file))
        object.__setattr__(self, "path", tuple(self.path))
        said = [name for name in ("position", "path", "file") if getattr(self, name) not in (None, ())]
        if len(said) > 1:
            raise SceneError(f"CameraChoice.{said[1]} contradicts {said[0]}: give one of them")
        if self.position is not None:
            finite_vector(self, "position")
            finite_vector(self, "target")
            if self.position == self.target:
                raise SceneError(f"CameraChoice.target must not be the position, found {self.target!r}")
        for one, other in pairwise(self.path):
            if not one.time < other.time:
                raise SceneError(f"CameraChoice.path must have rising times, found {other.time!r} after {one.time!r}")
        finite(self, "field_of_view", low=0.0, open_low=True, high=179.0)
        finite(self, "turns")
        if isinstance(self.view, bool) or (isinstance(self.view, int) and self.view < 0):
            raise SceneError(f"CameraChoice.view must be a number from 0 or a name, found {self.view!r}")
        if said:
            if self.follow or self.turns:
                which = "follow" if self.follow else "turns"
                raise SceneError(
                    f"CameraChoice.{which} has no meaning with {said[0]}: it is for views by their names, {_VIEW_NAMES}"
                )
        elif self.view not in (None, 0, *VIEWS):
            hint = did_you_mean(self.view, VIEWS)
            raise SceneError(f"CameraChoice.view must be one of {_VIEW_NAMES}, or of a file, found {self.view!r}{hint}")

    @property
    def sees_all(self) -> bool:
        """Whether it is a view by its name, which stands where all that moves is seen."""
        return self.position is None and self.file is None and not self.path

    @property
    def direction(self) -> tuple[float, float]:
        """Of a view by its name, else of the first: degrees around from the front to the right, above the horizon."""
        return VIEWS[self.view if isinstance(self.view, str) else next(iter(VIEWS))]
