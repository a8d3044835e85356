"""What runs are measured by: a closed form, or a run finer than all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.accuracy.trajectories import SimplicesAt, TrajectoryDistance, distance, distance_from
from gasp_core.dynamics.function_motion import load_function
from gasp_core.errors import AccuracyError, SceneError
from gasp_core.recording.reader import Recording
from gasp_core.studies.tradeoff.richardson import Remainder

__all__ = ["ClosedForm", "Refined", "Truth", "load_truth"]

Array = NDArray[Any]
Function = Callable[[Any, float], Any]


class Truth(Protocol):
    """Where the Gaussians truly are, as far as it is known."""

    @property
    def remainder(self) -> float:
        """How far it may itself be from the truth, root mean square over vertices and frames [diagonals]."""
        ...

    def error_of(self, run: Recording) -> TrajectoryDistance:
        """How far a run is from it, over all frames of the run.

        Raises
        ------
        AccuracyError
            Where that cannot be said.
        """
        ...

    def description(self) -> dict[str, Any]:
        """As JSON values; `sentence` is for people."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """A finer run.

    Parameters
    ----------
    recording
        Its frames.
    resolutions
        Of the runs that its own error was estimated from, the last its own.
    precision
        Of all three.
    substep_fraction
        Its own, half of that of the three.
    left
        Its own error, in diagonals.
    """

    recording: Recording
    resolutions: tuple[int, int, int]
    precision: str
    substep_fraction: float
    left: Remainder

    @property
    def remainder(self) -> float:
        """See `Truth`."""
        return self.left.value

    def error_of(self, run: Recording) -> TrajectoryDistance:
        """See `Truth`."""
        return distance(run, self.recording)

    def description(self) -> dict[str, Any]:
        """See `Truth`."""
        coarse, middle, fine = self.resolutions
        seen = "the three runs do not draw nearer to each other" if self.left.order == 0 else "order {:.2g} seen"
        return {
            "kind": "refined",
            "resolutions": list(self.resolutions),
            "precision": self.precision,
            "substep_fraction": self.substep_fraction,
            "order": self.left.order,
            "expected_order": self.left.expected_order,
            "safety": self.left.safety,
            "own_error_share": self.remainder,
            "own_error_of_substeps": self.left.substeps,
            "sentence": (
                f"errors are against all vertices at resolution {fine} in {self.precision} at a substep fraction of"
                f" {self.substep_fraction:g}, itself within {100 * self.remainder:.2g} % of the diagonal of the limit:"
                f" from resolutions {coarse}, {middle} and {fine}, {seen.format(self.left.order)}, safety"
                f" {self.left.safety:g}, and {100 * self.left.substeps:.2g} % of it for the substeps"
            ),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm:
    """A function that knows where every point is.

    Parameters
    ----------
    function
        Of points at the start (M, 3) [m], vertices of all simplices of all bodies in the order of the scene, and a
        time [s]; returns where they are then, (M, 3) [m].
    name
        What messages call it.
    """

    function: Function
    name: str

    @property
    def remainder(self) -> float:
        """See `Truth`."""
        return 0.0

    def error_of(self, run: Recording) -> TrajectoryDistance:
        """See `Truth`."""
        return distance_from(run, self._simplices(run), range(run.frame_count))

    def description(self) -> dict[str, Any]:
        """See `Truth`."""
        return {
            "kind": "closed form",
            "function": self.name,
            "own_error_share": 0.0,
            "sentence": f"errors are against the closed form {self.name}",
        }

    def _simplices(self, run: Recording) -> SimplicesAt:
        rest = run.simplices(0)
        points = np.concatenate([simplices.reshape(-1, 3) for simplices in rest.values()])
        ends = np.cumsum([simplices.size // 3 for simplices in rest.values()])[:-1]
        times = run.times

        def simplices_at(frame: int) -> Mapping[str, Array]:
            parts = np.split(self._at(points, float(times[frame])), ends)
            return {name: part.reshape(own.shape) for (name, own), part in zip(rest.items(), parts)}

        return simplices_at

    def _at(self, points: Array, time: float) -> Array:
        where = f"truth {self.name} at {time:g} s"
        try:
            # A copy each time: functions like to work in place.
            moved = np.asarray(self.function(points.copy(), time), dtype=np.float64)
        except Exception as error:
            said = " ".join(str(error).split())
            raise AccuracyError(f"{where}: {type(error).__name__}{': ' if said else ''}{said}") from error
        if moved.shape != points.shape:
            raise AccuracyError(f"{where}: gave an array of shape {moved.shape}, expected {points.shape}")
        bad = np.flatnonzero(~np.isfinite(moved).all(axis=1))
        if len(bad):
            raise AccuracyError(f"{where}: is not finite at {len(bad)} of {len(points)} points, first {bad[0]}")
        return moved


def load_truth(text: str) -> ClosedForm:
    """The closed form that "FILE.py:FUNCTION" names, or "module:FUNCTION".

    Raises
    ------
    AccuracyError
        Where there is none, or its file fails.
    """
    file, _, function = text.rpartition(":")
    if not file or not function.isidentifier():
        raise AccuracyError(f'a truth must be written "FILE.py:FUNCTION", found "{text}"')
    if file.endswith(".py") and not Path(file).is_file():
        raise AccuracyError(f"truth {text}: there is no file {file}")
    try:
        return ClosedForm(function=load_function(text), name=text)
    except SceneError as error:
        raise AccuracyError(str(error).replace("motion ", "truth ", 1)) from error
