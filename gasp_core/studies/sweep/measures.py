"""What is measured of each run of a sweep, where it was made."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.accuracy.trajectories import distance
from gasp_core.errors import AccuracyError
from gasp_core.recording import Recording
from gasp_core.recording.places import places_at, places_at_start
from gasp_core.studies.comparison.parting import parting_of

__all__ = ["Measures", "Observable", "load_observable"]


_TAKEN = frozenset({
    "status", "reason", "frames", "substeps", "wall_seconds", "start_seconds", "run_seconds", "cpu_seconds",
    "peak_bytes", "engine", "points", "recording", "rms_share", "p95_share", "shape_share", "centre_share", "apart_at",
    "not_compared", "not_observed",
})  # fmt: skip
"""Names of other columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observable:
    """A function of the user's: a number of a recording. Its text travels, so that workers need not see its file.

    Parameters
    ----------
    name
        Of the function, and of the column.
    text
        Of its module.
    file
        For messages.
    """

    name: str
    text: str
    file: str

    def __call__(self, recording: Recording) -> float:
        """What it gives."""
        module: dict[str, Any] = {"__name__": "observable", "__file__": self.file}
        exec(compile(self.text, self.file, "exec"), module)
        function: Callable[[Recording], Any] = module[self.name]
        return float(function(recording))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """Called with a recording; gives columns by their names.

    Parameters
    ----------
    observables
        Of the user's.
    reference
        A recording that distances are from; None: no such.

    Raises
    ------
    AccuracyError
        Where two columns would have one name.
    """

    observables: tuple[Observable, ...] = ()
    reference: Path | None = None

    def __post_init__(self) -> None:
        names = [own.name for own in self.observables]
        for name in names:
            if name in _TAKEN or names.count(name) > 1:
                raise AccuracyError(f'there is a column "{name}" already: give the function that observes another name')

    def __call__(self, recording: Recording) -> Mapping[str, Any]:
        """Of each object, in metres: the middle of its places at the end (see `gasp_core.recording.places`), the lowest
        and the highest of them, and how far one has gone at most in any frame; then what the user wants; distances.
        """
        found: dict[str, Any] = {"engine": recording.engine.name, "points": len(recording.start_points)}
        found |= _of_objects(recording)
        failures: list[str] = []
        for own in self.observables:
            try:
                value = own(recording)
                found[own.name] = value if math.isfinite(value) else None
                if not math.isfinite(value):
                    failures.append(f"{own.name} is {value}")
            except (Exception, SystemExit) as error:  # a function of the user's may raise anything
                found[own.name] = None
                failures.append(f"{own.name} fails: {type(error).__name__}: {error}")
        if failures:
            found["not_observed"] = "; ".join(failures)
        if self.reference is not None:
            try:
                found |= _distances(Recording.open(self.reference), recording)
            except AccuracyError as error:
                # Of other Gaussians: the run is what it is.
                found["not_compared"] = str(error)
        return found


def load_observable(text: str) -> Observable:
    """The function that "FILE.py:FUNCTION" names.

    Raises
    ------
    AccuracyError
        Where there is none, or its file fails.
    """
    file, _, name = text.rpartition(":")
    if not file.endswith(".py") or not name.isidentifier():
        raise AccuracyError(f'an observable must be written "FILE.py:FUNCTION", found "{text}"')
    try:
        source = Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise AccuracyError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    module: dict[str, Any] = {"__name__": "observable", "__file__": file}
    try:
        exec(compile(source, file, "exec"), module)
    except Exception as error:
        raise AccuracyError(f"{file}: fails: {type(error).__name__}: {error}") from None
    if not callable(module.get(name)):
        raise AccuracyError(f"{file}: has no function {name}")
    return Observable(name=name, text=source, file=file)


def _of_objects(recording: Recording) -> dict[str, float]:
    start = places_at_start(recording)
    gone = dict.fromkeys(start, 0.0)
    places = start
    for frame in range(recording.frame_count):
        places = places_at(recording, frame, start)
        for name, own in places.items():
            squares = ((own - start[name]) ** 2).sum(axis=1)
            gone[name] = max(gone[name], math.sqrt(float(squares.max())))
    found: dict[str, float] = {}
    for name, own in places.items():
        for axis, value in zip("xyz", own.mean(axis=0)):
            found[f"{name}.centre_{axis}"] = float(value)
        found[f"{name}.lowest"], found[f"{name}.highest"] = float(own[:, 2].min()), float(own[:, 2].max())
        found[f"{name}.moved"] = gone[name]
    return found


def _distances(reference: Recording, recording: Recording) -> dict[str, Any]:
    apart = distance(reference, recording)
    return {
        "rms_share": apart.rms_share,
        "p95_share": apart.p95_share,
        "shape_share": apart.shape_share,
        "centre_share": apart.centre_share,
        "apart_at": parting_of(apart, (None, None)).apart_at,
    }
