"""What a comparison found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gasp_core.studies.runs import Outcome, RunStatus

if TYPE_CHECKING:
    from gasp_core.accuracy.trajectories import Distance, TrajectoryDistance
    from gasp_core.studies.comparison.parting import Parting

__all__ = ["Comparison", "Likeness", "Pair", "Row"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """An engine and what came of its run.

    Parameters
    ----------
    engine
        Its name.
    version
        Of its distribution; empty where it is not known.
    device, precision
        It ran on and in; empty where it did not run.
    outcome
        What came of it; its recording, where there is one, is in the comparison's folder.
    film
        Of that recording; None where there is none.
    """

    engine: str
    version: str
    device: str
    precision: str
    outcome: Outcome
    film: Path | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values; paths by their names in the folder."""
        outcome = self.outcome
        numbers = {
            field.name: getattr(outcome, field.name)
            for field in fields(outcome)
            if field.name not in ("key", "ending", "recording")
        }
        return {
            "engine": self.engine,
            "version": self.version,
            "device": self.device,
            "precision": self.precision,
            "status": outcome.ending.value,
            "recording": None if outcome.recording is None else outcome.recording.name,
            "film": None if self.film is None else self.film.name,
            **numbers,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """How like the pictures of two runs are, from the same camera.

    Parameters
    ----------
    frames
        Their numbers; frame 0 is the same for all and never among them.
    psnr
        Of the squared difference over all of them [dB]; inf where they are equal.
    ssim
        Their mean, -1..1.
    """

    frames: tuple[int, ...]
    psnr: float
    ssim: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """How far apart two engines are, over the frames that both have.

    Parameters
    ----------
    first, second
        Names of the engines.
    distance
        Of their trajectories; None where they cannot be compared, for the reason in `reason`.
    likeness
        Of their pictures; None where they were not compared.
    reason
        Why there is no distance; empty otherwise.
    parting
        When they part, and whether something had met something by then; None where there is no distance.
    """

    first: str
    second: str
    distance: TrajectoryDistance | None
    likeness: Likeness | None = None
    reason: str = ""
    parting: Parting | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        likeness = self.likeness
        return {
            "engines": [self.first, self.second],
            "reason": self.reason,
            "distance": None if self.distance is None else _whole_to_json(self.distance),
            "apart_at": None if self.parting is None else self.parting.apart_at,
            "met_at": None if self.parting is None else self.parting.met_at,
            "pictures": None
            if likeness is None
            else {"frames": list(likeness.frames), "psnr": likeness.psnr, "ssim": likeness.ssim},
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The same scene through several engines.

    Parameters
    ----------
    scene
        Its name.
    folder
        Holds the recordings and films, ``comparison.json`` and ``comparison.html``.
    frames_wanted, frame_rate [1/s]
        Of the scene.
    resolution
        Cells across the largest object, as asked for.
    size [px]
        Of the pictures.
    machine
        What it ran on, in words.
    rows
        The engines, in the order asked for.
    pairs
        Of those engines that have frames.
    notes
        What was left out or set otherwise, and why.
    """

    scene: str
    folder: Path
    frames_wanted: int
    frame_rate: float
    resolution: int
    size: tuple[int, int]
    machine: str
    rows: tuple[Row, ...]
    pairs: tuple[Pair, ...]
    notes: tuple[str, ...]

    @property
    def page(self) -> Path:
        """What to look at."""
        return self.folder / "comparison.html"

    @property
    def completed(self) -> tuple[Row, ...]:
        """Engines that came to the end."""
        return tuple(row for row in self.rows if row.outcome.ending is RunStatus.COMPLETE)

    def to_json(self) -> dict[str, Any]:
        """Plain values, as in ``comparison.json``: numbers that are not finite as None."""
        found: dict[str, Any] = _finite(
            {
                "scene": self.scene,
                "frames_wanted": self.frames_wanted,
                "frame_rate": self.frame_rate,
                "resolution": self.resolution,
                "size": list(self.size),
                "machine": self.machine,
                "engines": [row.to_json() for row in self.rows],
                "pairs": [pair.to_json() for pair in self.pairs],
                "notes": list(self.notes),
            }
        )
        return found


_MEASURES = ("rms", "p95", "shape_rms", "centre_of_mass")


def _whole_to_json(distance: TrajectoryDistance) -> dict[str, Any]:
    return {
        "frames": len(distance.frames),
        **_to_json(distance),
        "per_frame": {name: np.asarray(getattr(distance.per_frame, name)).tolist() for name in _MEASURES},
        "bodies": {name: _to_json(own) for name, own in distance.bodies.items()},
    }


def _to_json(distance: Distance) -> dict[str, Any]:
    """Lengths [m], and the same as shares of the diagonal."""
    lengths = {name: getattr(distance, name) for name in ("diagonal", *_MEASURES)}
    shares = {f"{name}_share": getattr(distance, name) / distance.diagonal for name in _MEASURES}
    return {"vertices": distance.vertices, **lengths, **shares}


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_finite(item) for item in value]
    return value
