"""How an object moves by itself, psi, before physics, phi, acts on it: as the user asks for it.

What these classes ask for is done in `gasp_core.dynamics`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import numpy as np

from gasp_core.contract.validation import Vector, finite, finite_vector, positive, unit_vector
from gasp_core.errors import SceneError

__all__ = ["MOTIONS", "Bend", "DMiSoMotion", "FrameSequence", "Motion", "PythonMotion", "Swing", "Wave"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What all motions have.

    Parameters
    ----------
    composition
        "carried": psi goes on, and physics carries it along. "frozen": psi stops at `start`, the rest is physics.
        "driven": psi goes on in the parts of the object that are driven, and drives the rest, which is physics.
    start
        Scene time s0 [s] at which the simulation begins.
    rate
        Scene time that passes in a second of simulated time; at zero psi stands still, below it runs backwards.
    schedule
        Instead of those: pairs of a simulated time, the first 0, and the scene time [s] then. In between it passes
        evenly, and after the last pair not at all.
    start_velocity
        Whether physics begins with the velocity that psi has at s0; not with "carried", else None is True. A carried
        psi keeps its velocity: physics must not have it as well.

    Raises
    ------
    SceneError
        Where a value is impossible.
    """

    kind: ClassVar[str] = ""
    composition: Literal["carried", "frozen", "driven"] = "carried"
    start: float = 0.0
    rate: float = 1.0
    schedule: tuple[tuple[float, float], ...] | None = None
    start_velocity: bool | None = None

    def __post_init__(self) -> None:
        name = type(self).__name__
        if self.composition not in ("carried", "frozen", "driven"):
            raise SceneError(f'{name}.composition must be "carried", "frozen" or "driven", found {self.composition!r}')
        finite(self, "start")
        finite(self, "rate")
        if self.schedule is not None:
            _check_schedule(self)
        if self.composition == "carried" and self.start_velocity is not None:
            raise SceneError(
                f'{name}.start_velocity has no meaning with composition = "carried", where psi keeps its velocity:'
                " leave it out"
            )

    def scene_time(self, time: float) -> float:
        """Scene time [s] at a simulated time [s]."""
        if self.schedule is None:
            return self.start + self.rate * time
        pairs = np.array(self.schedule)
        return float(np.interp(time, pairs[:, 0], pairs[:, 1]))

    @property
    def rate_at_start(self) -> float:
        """Scene time that passes in a second of simulated time when the simulation begins."""
        if self.schedule is None:
            return self.rate
        if len(self.schedule) == 1:
            return 0.0
        (begin, first), (end, second) = self.schedule[:2]
        return (second - first) / (end - begin)


def _check_schedule(owner: Motion) -> None:
    name, given = f"{type(owner).__name__}.schedule", cast("Any", owner.schedule)
    try:
        pairs = tuple((float(time), float(scene_time)) for time, scene_time in given)
    except (TypeError, ValueError):
        pairs = ()
    if not all(math.isfinite(number) for pair in pairs for number in pair):
        raise SceneError(f"{name} must have finite numbers, found {given!r}")
    if not pairs:
        raise SceneError(f"{name} must be pairs of a simulated time and a scene time [s], found {given!r}")
    if pairs[0][0] != 0 or any(not one[0] < other[0] for one, other in pairwise(pairs)):
        raise SceneError(f"{name}: its simulated times must rise from 0, found {[pair[0] for pair in pairs]}")
    if owner.start != 0 or owner.rate != 1:
        raise SceneError(f"{name} contradicts start and rate: leave them out, its first pair says where psi starts")
    object.__setattr__(owner, "schedule", pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSequence(Motion):
    """The object's splat is a folder: a splat a frame, in the natural order of their names.

    Parameters
    ----------
    frame_rate
        Frames a second of scene time; the first is at 0.
    match
        "rows": row n is the same Gaussian in all frames, however it looks. None: it is, but is refused where it seems
        not to be.
    """

    kind: ClassVar[str] = "frames"
    frame_rate: float = 25.0
    match: Literal["rows"] | None = None

    def __post_init__(self) -> None:
        Motion.__post_init__(self)
        positive(self, "frame_rate")
        if self.match not in (None, "rows"):
            raise SceneError(f'FrameSequence.match must be "rows", or be left out, found {self.match!r}')


@dataclass(frozen=True, slots=True, kw_only=True)
class DMiSoMotion(Motion):
    """The object's splat is the folder of a trained D-MiSo (Waczynska et al., 2024), whose networks move its Gaussians.

    Parameters
    ----------
    duration
        Scene time [s] from the first to the last picture that it was trained on, its times 0 and 1.
    iteration
        Which one of those that training kept: "best" or a number. None: the best, where it was kept, else the last.
    """

    kind: ClassVar[str] = "d-miso"
    duration: float = 1.0
    iteration: str | None = None

    def __post_init__(self) -> None:
        Motion.__post_init__(self)
        positive(self, "duration")
        iteration: Any = self.iteration
        if iteration is not None and not (iteration == "best" or (type(iteration) is str and iteration.isdecimal())):
            raise SceneError(f'DMiSoMotion.iteration must be "best" or a number in quotes, found {iteration!r}')


@dataclass(frozen=True, slots=True, kw_only=True)
class PythonMotion(Motion):
    """psi(V, s) -> V', any Python function.

    Parameters
    ----------
    function
        "module:function", or the function itself. It is given the simplices of all Gaussians of the file, (N, V, 3)
        float64 in the frame and unit of the file, and the scene time [s], and returns them moved.
    span
        Scene times [s] for which it is defined; it stands still before and after. None: all.
    step
        Scene time [s] over which a difference gives its velocity.
    """

    kind: ClassVar[str] = "python"
    function: str | Callable[[Any, float], Any]
    span: tuple[float, float] | None = None
    step: float = 1e-3

    def __post_init__(self) -> None:
        Motion.__post_init__(self)
        positive(self, "step")
        if isinstance(self.function, str):
            module, _, function = self.function.rpartition(":")
            if not module or not function.isidentifier():
                raise SceneError(f'PythonMotion.function must be written "module:function", found "{self.function}"')
        elif not callable(self.function):
            raise SceneError(f'PythonMotion.function must be a function or "module:function", found {self.function!r}')
        if self.span is not None:
            _check_span(self)

    @property
    def file(self) -> Path | None:
        """Of the function, where it is named by one; None where Python finds its module, or it is at hand."""
        module = self.function.rpartition(":")[0] if isinstance(self.function, str) else ""
        return Path(module) if module.endswith(".py") else None


def _check_span(owner: PythonMotion) -> None:
    value: Any = owner.span
    try:
        first, last = (float(bound) for bound in value)
    except (TypeError, ValueError):
        first, last = math.nan, math.nan
    if not (math.isfinite(first) and math.isfinite(last) and first <= last):
        raise SceneError(f"PythonMotion.span must be two times, the first not after the second, found {value!r}")
    object.__setattr__(owner, "span", (first, last))


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing(Motion):
    """A rigid swing about an axis: the angle is amplitude sin(2 pi frequency s + phase).

    Parameters
    ----------
    axis, pivot
        Direction, and a point on it [m]; in the world.
    amplitude, phase
        [degrees].
    frequency
        [1/s].
    """

    kind: ClassVar[str] = "swing"
    axis: Vector
    pivot: Vector
    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        Motion.__post_init__(self)
        unit_vector(self, "axis")
        finite_vector(self, "pivot")
        finite(self, "amplitude")
        positive(self, "frequency")
        finite(self, "phase")


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend(Swing):
    """A swing whose angle grows with the square of the distance from the pivot, as a rooted stem bends.

    Parameters
    ----------
    direction
        Along which the distance is measured; behind the pivot nothing moves.
    length
        Distance [m] at which the angle is that of a `Swing`.
    """

    kind: ClassVar[str] = "bend"
    length: float
    direction: Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        Swing.__post_init__(self)
        unit_vector(self, "direction")
        positive(self, "length")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave(Motion):
    """A wave that runs through the object: a displacement amplitude sin(2 pi (frequency s - d / wavelength) + phase).

    Parameters
    ----------
    axis
        Direction of the displacement.
    amplitude, wavelength
        [m].
    frequency
        [1/s].
    direction, pivot
        d is the distance from the pivot [m] along the direction; in the world.
    phase
        [degrees].
    """

    kind: ClassVar[str] = "wave"
    axis: Vector
    amplitude: float
    frequency: float
    wavelength: float
    direction: Vector
    pivot: Vector = (0.0, 0.0, 0.0)
    phase: float = 0.0

    def __post_init__(self) -> None:
        Motion.__post_init__(self)
        unit_vector(self, "axis")
        unit_vector(self, "direction")
        finite_vector(self, "pivot")
        finite(self, "amplitude")
        positive(self, "frequency", "wavelength")
        finite(self, "phase")


MOTIONS: dict[str, type[Motion]] = {
    motion.kind: motion for motion in (FrameSequence, DMiSoMotion, PythonMotion, Bend, Swing, Wave)
}
"""Motions by the name that scene files give them."""
