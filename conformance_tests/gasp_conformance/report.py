"""What a run of the suite found, as data and as a JSON file that says the same."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from gasp_conformance.checks import Level
from gasp_conformance.ledger import Figure
from gasp_core.errors import GaspError
from gasp_core.io.atomic import replacing

__all__ = [
    "CheckResult",
    "EngineIdentity",
    "Extent",
    "Machine",
    "Outcome",
    "Report",
    "ReportError",
    "Unproven",
    "Verdict",
    "VerdictOutcome",
    "read_report",
    "write_report",
]

FORMAT = "gasp-conformance-report"
VERSION = 1


class ReportError(GaspError):
    """A file is no report of the suite, or reports do not go together."""


class Outcome(Enum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    DEVIATES = "deviates"
    """Failed, as the engine's own list of deviations says it does."""
    STALE = "stale"
    """Listed as a deviation, but it passes or does not apply."""
    UNDECLARED = "undeclared"
    """The engine says itself that it does not do what the check needs."""
    SKIPPED = "skipped"
    """Could not be run here, e.g. for want of a device."""
    ERROR = "error"
    """Something raised before or after the check itself."""

    @property
    def fails(self) -> bool:
        """Whether an engine with such a check fails."""
        return self in (Outcome.FAILED, Outcome.STALE, Outcome.ERROR)


class Extent(Enum):
    """How much of the suite was asked for."""

    QUICK = "quick"
    FULL = "full"


class VerdictOutcome(Enum):
    """What is said of an engine."""

    PASSES = "passes"
    FAILS = "fails"
    PARTIAL = "partial"
    """Nothing failed, but not every check was asked for: this says nothing of the engine as a whole."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """One check.

    Parameters
    ----------
    name
        With the id of its parameters, e.g. "V8[4 cells]"; what a deviation has to name.
    seconds
        It took, with its set-up.
    figures
        Measured, in the order in which they were.
    reason
        Why it did not pass; "" where it did.
    notes
        What else it wrote down: scenes nobody would build, with all their numbers.
    """

    name: str
    level: Level
    outcome: Outcome
    seconds: float
    figures: tuple[Figure, ...] = ()
    reason: str = ""
    notes: tuple[str, ...] = ()

    @property
    def worst(self) -> Figure | None:
        """The figure nearest to its bound or farthest beyond it."""
        return max(self.figures, key=lambda figure: figure.share, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineIdentity:
    """Which engine, and how it was run; its own options are always its defaults."""

    name: str
    distribution: str
    version: str
    contract_version: tuple[int, int]
    device: str
    precision: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """Where it was run."""

    python: str
    numpy: str
    platform: str
    processors: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Unproven:
    """A declared capability that no check showed.

    Parameters
    ----------
    capability
        The check that would have shown it, e.g. "material:sand".
    reason
        Why it did not.
    excused
        Whether the reason is this run and not the engine, so that the engine does not fail for it.
    """

    capability: str
    reason: str
    excused: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is said of the engine, and why."""

    outcome: VerdictOutcome
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A run of the suite on one engine.

    Parameters
    ----------
    suite_version
        Of gasp-conformance.
    oracle
        The engine it was compared with, or None.
    checks
        Those that ended, in the order in which they ran.
    unproven
        Declared, and not shown.
    running
        The check that was under way when this was written, "collection" before the first; "" once the run has ended.
    finished
        Whether the run had ended when this was written.
    """

    suite_version: str
    engine: EngineIdentity
    machine: Machine
    extent: Extent
    verdict: Verdict
    oracle: str | None = None
    checks: tuple[CheckResult, ...] = ()
    unproven: tuple[Unproven, ...] = ()
    running: str = "collection"
    finished: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain values; a number that JSON does not have is one of "NaN", "Infinity", "-Infinity"."""
        plain: dict[str, Any] = _plain(dataclasses.asdict(self))
        return {"format": FORMAT, "version": VERSION} | plain

    @classmethod
    def from_json(cls, document: Any) -> Report:
        """The report that `to_json` was made of.

        Raises
        ------
        ReportError
            Where it is something else.
        """
        if not isinstance(document, Mapping) or document.get("format") != FORMAT:
            raise ReportError(f'is no report of the suite: "format" is not "{FORMAT}"; write one with --json')
        if document.get("version") != VERSION:
            raise ReportError(
                f"is a report of version {document.get('version')!r}, this suite reads {VERSION}:"
                " run the engine again with this suite"
            )
        try:
            engine = dict(document["engine"])
            engine["contract_version"] = tuple(engine["contract_version"])
            return cls(
                suite_version=document["suite_version"],
                engine=EngineIdentity(**engine),
                machine=Machine(**document["machine"]),
                extent=Extent(document["extent"]),
                verdict=Verdict(
                    outcome=VerdictOutcome(document["verdict"]["outcome"]),
                    reasons=tuple(document["verdict"]["reasons"]),
                ),
                oracle=document["oracle"],
                checks=tuple(_check(one) for one in document["checks"]),
                unproven=tuple(Unproven(**one) for one in document["unproven"]),
                running=document["running"],
                finished=document["finished"],
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ReportError(f"is a damaged report ({type(error).__name__}: {error}): run the engine again") from error


def write_report(report: Report, path: Path) -> None:
    """Write a report whole or not at all.

    Raises
    ------
    GaspError
        Where the folder or the disk refuses.
    """
    text = json.dumps(report.to_json(), indent=1, ensure_ascii=False, allow_nan=False)
    with replacing(path) as stream:
        stream.write(text.encode() + b"\n")


def read_report(path: Path) -> Report:
    """Read what `write_report` wrote.

    Raises
    ------
    ReportError
        Where the file cannot be read or is something else.
    """
    try:
        return Report.from_json(json.loads(path.read_bytes()))
    except OSError as error:
        raise ReportError(f"{path}: {error.strerror}: name a report that --json wrote") from error
    except ValueError as error:
        raise ReportError(f"{path} is not JSON ({error}): name a report that --json wrote") from error
    except ReportError as error:
        raise ReportError(f"{path} {error}") from error


def _check(document: Mapping[str, Any]) -> CheckResult:
    figures = (
        Figure(
            case=one["case"],
            figure=one["figure"],
            value=float(one["value"]),
            bound=float(one["bound"]),
            sense=one["sense"],
        )
        for one in document["figures"]
    )
    return CheckResult(
        name=document["name"],
        level=Level(document["level"]),
        outcome=Outcome(document["outcome"]),
        seconds=float(document["seconds"]),
        figures=tuple(figures),
        reason=document["reason"],
        notes=tuple(document.get("notes", ())),
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
