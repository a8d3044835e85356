"""What was measured, summed up: rows, a table for people, CSV and JSON for programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gasp_core.studies.runs import RunStatus
from gasp_core.studies.tradeoff.measuring import Measurement
from gasp_core.studies.tradeoff.settings import Setting
from gasp_core.studies.tradeoff.statistics import CHANCE, Summary, dominated, summary

__all__ = ["HEADER", "Row", "Tradeoff", "cautions", "rows_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A setting, its error and its time.

    Parameters
    ----------
    setting
        Which.
    ending, reason
        How its runs ended; the other fields are empty where that is not complete.
    error, error_low, error_high
        Root mean square over vertices and frames, from the truth, and where the true one is [diagonals].
    p95, shape, centre
        Other measures of `gasp_core.accuracy.trajectories` [diagonals].
    repeats_differ
        Whether repeats gave different frames; the spread of their errors is in the interval then.
    start, run, cpu
        Seconds until it was in its stride, those of its frames, and processor time of these.
    repeats
        Run seconds of each repeat.
    points, substeps, peak_bytes
        What the engine moved, in how many substeps, in how much memory.
    beaten
        Probability that another setting is no slower and no less accurate.
    """

    setting: Setting
    ending: RunStatus
    reason: str = ""
    error: float | None = None
    error_low: float | None = None
    error_high: float | None = None
    p95: float | None = None
    shape: float | None = None
    centre: float | None = None
    repeats_differ: bool = False
    start: Summary | None = None
    run: Summary | None = None
    cpu: Summary | None = None
    repeats: tuple[float, ...] = ()
    points: int = 0
    substeps: int = 0
    peak_bytes: int = 0
    beaten: float | None = None

    @property
    def on_front(self) -> bool:
        """Whether no other setting beats it."""
        return self.beaten is not None and self.beaten < CHANCE

    def flat(self) -> dict[str, Any]:
        """Its columns, in the order of the CSV."""
        columns: dict[str, Any] = {
            "resolution": self.setting.resolution,
            "cores": self.setting.cores,
            "precision": self.setting.precision.value,
            "substep_fraction": self.setting.substep_fraction,
            "ending": self.ending.value,
            "error_share": self.error,
            "error_low": self.error_low,
            "error_high": self.error_high,
            "p95_share": self.p95,
            "shape_share": self.shape,
            "centre_share": self.centre,
        }
        for name, times in {"run_seconds": self.run, "cpu_seconds": self.cpu, "start_seconds": self.start}.items():
            for field in ("median", "deviation", "low", "high"):
                key = name if field == "median" else f"{name}_{field}"
                columns[key] = None if times is None else getattr(times, field)
        return columns | {
            "points": self.points,
            "substeps": self.substeps,
            "peak_bytes": self.peak_bytes,
            "beaten": self.beaten,
            "on_front": self.on_front,
            "repeats_differ": self.repeats_differ,
            "reason": self.reason,
        }


HEADER = (
    *("RESOLUTION", "CORES", "PRECISION", "SUBSTEP"),
    *("ERROR %", "BETWEEN", "RUN s", "BETWEEN", "CPU s", "START s", "FRONT"),
)
"""Of the table; errors are shares of the diagonal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tradeoff:
    """Error against time of a scene with an engine.

    Parameters
    ----------
    scene
        Its name.
    engine
        Its name, version and device.
    rows
        In the order the settings were asked for.
    truth
        As `Truth.description` has it.
    machine
        Where the times were measured.
    notes
        What the scene asks of its own engine and this one does not have.
    """

    scene: str
    engine: dict[str, Any]
    rows: tuple[Row, ...]
    truth: dict[str, Any]
    machine: dict[str, Any]
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        rows = [row.flat() | {"run_seconds_of_repeats": list(row.repeats)} for row in self.rows]
        return {
            "scene": self.scene,
            "engine": self.engine,
            "truth": self.truth,
            "machine": self.machine,
            "notes": list(self.notes),
            "settings": rows,
        }

    def json_text(self) -> str:
        """The JSON file."""
        return json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n"

    def csv_text(self) -> str:
        """The CSV file, a row a setting."""
        stream = io.StringIO()
        flat = [row.flat() for row in self.rows]
        writer = csv.DictWriter(stream, list(flat[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)  # what is None is left empty
        return stream.getvalue()

    def table(self) -> list[list[str]]:
        """Rows of cells under `HEADER`; where there are no numbers, the reason stands in their place."""
        return [_cells(row) for row in self.rows]


def rows_of(found: Sequence[Measurement], remainder: float, seed: int = 0) -> tuple[Row, ...]:
    """Sum up measurements by a truth that may itself be wrong by `remainder` [diagonals]."""
    complete = [index for index, own in enumerate(found) if own.ending is RunStatus.COMPLETE]
    times = [[outcome.run_seconds for outcome in found[index].timed] for index in complete]
    beaten = dominated(times, [found[index].errors for index in complete], seed) if complete else []
    chances = dict(zip(complete, map(float, beaten)))
    return tuple(_row(own, remainder, chances.get(index), seed) for index, own in enumerate(found))


def cautions(rows: Sequence[Row]) -> tuple[str, ...]:
    """What keeps a table from saying which setting is the better one: a sentence each."""
    front = [row for row in rows if row.on_front]
    lows = [row.error_low for row in front if row.error_low is not None]
    highs = [row.error_high for row in front if row.error_high is not None]
    found: list[str] = []
    if len(front) > 1 and max(lows) <= min(highs):
        found.append(
            f"the errors of the {len(front)} settings on the front cannot be told apart: all may be between"
            f" {100 * max(lows):.2g} and {100 * min(highs):.2g} %, as what they are measured by is known no better."
            " That one of them is on it says that it is fast; finer --resolutions make a better truth"
        )
    if any(len(row.repeats) == 1 for row in rows):
        found.append("each setting was timed once: how far times spread is not known, --repeats 9 says it")
    return tuple(found)


def _row(own: Measurement, remainder: float, beaten: float | None, seed: int) -> Row:
    if beaten is None or own.error is None:
        return Row(setting=own.setting, ending=own.ending, reason=own.reason, points=own.points)
    lowest, highest = min(own.errors), max(own.errors)
    return Row(
        setting=own.setting,
        ending=own.ending,
        error=summary(own.errors).median,
        error_low=max(0.0, lowest - remainder),
        error_high=highest + remainder,
        p95=own.error.p95_share,
        shape=own.error.shape_share,
        centre=own.error.centre_share,
        repeats_differ=len(own.errors) > 1,
        start=summary([outcome.start_seconds for outcome in own.timed], seed),
        run=summary([outcome.run_seconds for outcome in own.timed], seed),
        cpu=summary([outcome.run_cpu_seconds for outcome in own.timed], seed),
        repeats=tuple(outcome.run_seconds for outcome in own.timed),
        points=own.points,
        substeps=own.timed[-1].substeps,
        peak_bytes=max(outcome.peak_bytes for outcome in own.timed),
        beaten=beaten,
    )


def _cells(row: Row) -> list[str]:
    setting = row.setting
    cells = [str(setting.resolution), setting.cores, setting.precision.value, f"{setting.substep_fraction:g}"]
    if row.error is None or row.error_low is None or row.error_high is None:
        return [*cells, f"{row.ending.value}: {row.reason}"]
    assert row.run is not None and row.cpu is not None and row.start is not None
    return [
        *cells,
        f"{100 * row.error:.3g}{' ~' if row.repeats_differ else ''}",
        f"{100 * row.error_low:.3g}..{100 * row.error_high:.3g}",
        f"{row.run.median:.3g}",
        # Of one run there is nothing to say how far another would be from it.
        f"{row.run.low:.3g}..{row.run.high:.3g}" if len(row.repeats) > 1 else "-",
        f"{row.cpu.median:.3g}",
        f"{row.start.median:.3g}",
        "*" if row.on_front else "",
    ]
