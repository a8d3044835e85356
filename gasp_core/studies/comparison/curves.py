"""What a run did over time: heights, energy, momentum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.recording import Recording

__all__ = ["RunCurves", "curves_of"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCurves:
    """Of a run; its matter is the engine's points with their masses, without what moves it by itself (`Motion`).

    Parameters
    ----------
    times : (T,) [s]
    heights
        Of each body's centre of mass over the world's origin, (T,) [m], by name.
    energy : (T,) [J]
        Kinetic, and potential of gravity against the start, as the recording has them; NaN where the engine shows no
        velocities. What is stored in deformed matter is not in it.
    momentum_times : (T - 1,) [s]
        In the middle of two frames.
    momentum : (T - 1, 3) [kg m/s]
        Of all bodies: mass times how far their centres went from frame to frame, so that of the mean velocity between.
    """

    times: Array
    heights: Mapping[str, Array]
    energy: Array
    momentum_times: Array
    momentum: Array


def curves_of(recording: Recording, masses: Array) -> RunCurves:
    """Read a recording frame by frame.

    Parameters
    ----------
    recording
        With at least one frame.
    masses : (P,) [kg]
        Of the engine's points.

    Raises
    ------
    RecordingError
        Where they are of other points, or a frame is damaged.
    """
    start = recording.start_points
    if len(masses) != len(start):
        raise RecordingError(f"{recording.path}: has {len(start)} points, not the {len(masses)} of its scene")
    bodies = [slice(entry.first, entry.last) for entry in recording.header.bodies]
    totals = np.array([masses[rows].sum() for rows in bodies])
    origins = np.array([masses[rows] @ start[rows] for rows in bodies]) / totals[:, None]
    count = recording.frame_count
    # Displacements, not places: far from the origin, a difference of places is mostly rounding.
    moved = np.empty((count, len(bodies), 3))
    energy = np.empty(count)
    for frame in range(count):
        relative, means = recording.displacements(frame)
        moved[frame] = means + np.array([masses[rows] @ relative[rows] for rows in bodies]) / totals[:, None]
        known = recording.diagnostics(frame)
        parts = known["kinetic_energy"], known["potential_energy"]
        energy[frame] = np.nan if None in parts else sum(parts)
    rate = recording.header.frame_rate
    times = np.arange(count) / rate
    names = [recording.header.objects[entry.item].name for entry in recording.header.bodies]
    return RunCurves(
        times=times,
        heights={name: origins[index, 2] + moved[:, index, 2] for index, name in enumerate(names)},
        energy=energy,
        momentum_times=(times[1:] + times[:-1]) / 2,
        momentum=np.einsum("b,tbi->ti", totals, np.diff(moved, axis=0)) * rate,
    )
