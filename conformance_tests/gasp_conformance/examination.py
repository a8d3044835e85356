"""One run of the suite on one engine: what pytest does with every check, and what is said in the end."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import os
import platform
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gasp_conformance.checks import Level
from gasp_conformance.collection import Collected, collected_checks, is_complete, name_for_selection
from gasp_conformance.declarations import declared, unproven
from gasp_conformance.deviations import FILE_NAME, Deviation
from gasp_conformance.ledger import NOTE, Figure
from gasp_conformance.patience import waiting
from gasp_conformance.report import (
    CheckResult,
    EngineIdentity,
    Extent,
    Machine,
    Outcome,
    Report,
    Verdict,
    VerdictOutcome,
    write_report,
)
from gasp_conformance.subject import Subject, Undeclared
from gasp_conformance.table import report_lines
from gasp_conformance.verdict import judge
from gasp_core.errors import EngineCrashedError, GaspError

__all__ = ["Examination"]

_LONGEST_REASON = 400

_COLLECTED = pytest.StashKey[Collected]()


class Examination:
    """pytest hooks of a run with an engine.

    The report is written before the first check and again before each one, with the verdict that would be right if
    the process died there; so whatever becomes of the process, the file tells.

    Parameters
    ----------
    deviations
        Those that apply to the run's precision and device.
    path
        Where the report goes; None for nowhere.

    Raises
    ------
    GaspError
        Where nothing can be written there.
    """

    def __init__(
        self,
        subject: Subject,
        *,
        oracle: Subject | None,
        deviations: Sequence[Deviation],
        extent: Extent,
        path: Path | None,
    ) -> None:
        self._subject = subject
        self._deviations = {one.check: one for one in deviations}
        self._path = path
        self._planned: list[str] = []
        self._left_out: list[str] = []
        self._unknown: list[str] = []
        self._broken: list[str] = []
        self._complete = False
        self._phases: list[pytest.TestReport] = []
        self._undeclared = self._left_away = self._stale = False
        self._report = Report(
            suite_version=_version("gasp-conformance"),
            engine=_identity(subject),
            machine=_machine(),
            extent=extent,
            oracle=None if oracle is None else oracle.name,
            verdict=Verdict(outcome=VerdictOutcome.FAILS, reasons=("no check has run",)),
        )
        self._write()

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Name the checks, put core first, leave out what a quick run leaves out, expect what is known to fail."""
        checks = collected_checks(items)
        self._complete = is_complete(items)
        name_for_selection(checks)
        names = {one.name for one in checks}
        if self._complete:
            self._unknown = [name for name in self._deviations if name not in names]
        left_out: list[Collected] = []
        kept: list[Collected] = []
        for one in checks:
            one.item.stash[_COLLECTED] = one
            self._expect(one)
            quick = self._report.extent is Extent.QUICK
            (left_out if quick and one.check.full else kept).append(one)
        self._left_out = [one.name for one in left_out]
        self._planned = [one.name for one in kept]
        if left_out:
            config.hook.pytest_deselected(items=[one.item for one in left_out])
        items[:] = [item for item in items if _COLLECTED not in item.stash] + [one.item for one in kept]

    def _expect(self, one: Collected) -> None:
        known = self._deviations.get(one.name)
        if known is None:
            return
        if one.check.level is Level.CORE:
            raise pytest.UsageError(
                f'{FILE_NAME}: "{one.name}" is a core check, which cannot be excused: mend the engine'
            )
        one.item.add_marker(pytest.mark.xfail(reason=known.reason, strict=True))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Remember what could not even be imported."""
        if report.failed:
            self._broken.append(report.nodeid)

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """See whether a selection was made of the checks."""
        chosen = [item.stash[_COLLECTED].name for item in session.items if _COLLECTED in item.stash]
        self._complete = self._complete and len(chosen) == len(self._planned)
        self._planned = chosen

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Say which check is under way, then how it ended."""
        one = item.stash.get(_COLLECTED, None)
        if one is None:
            return (yield)
        self._phases = []
        self._undeclared = self._left_away = self._stale = False
        self._report = replace(
            self._report,
            running=one.name,
            verdict=Verdict(outcome=VerdictOutcome.FAILS, reasons=(f"the process ended in check {one.name}",)),
        )
        self._write()
        with waiting(one.name, functools.partial(_aloud, item.config)):
            answer = yield
        result = self._result(one)
        self._report = replace(self._report, checks=(*self._report.checks, result))
        if result.outcome.fails:
            # At once: the summary may be hours away, and nobody knows whether there will be one.
            _aloud(item.config, f"{result.name} {result.outcome.value}: {result.reason}")
        return answer

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Generator[None, object, object]:
        """What an engine does not declare is skipped and said, not failed."""
        return (yield from self._declared_only())

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, object, object]:
        """As for the set-up."""
        return (yield from self._declared_only())

    def _declared_only(self) -> Generator[None, object, object]:
        try:
            return (yield)
        except Undeclared as missing:
            self._undeclared = True
            pytest.skip(str(missing))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """A core check that is left out has failed, and so has any that is excused by anyone but the engine's list."""
        report = yield
        one = item.stash.get(_COLLECTED, None)
        if one is None:
            return report
        excused = hasattr(report, "wasxfail")
        listed = one.name in self._deviations
        if excused and listed and call.excinfo is not None and not _is_excusable(call.excinfo.value):
            # A figure beside its bound is known, and that an engine refuses; what breaks in it is not.
            _fail(report, f"{one.name} may deviate, but not break: {call.excinfo.exconly()}")
        elif report.skipped and (one.check.level is Level.CORE or (excused and not listed)):
            self._left_away = True
            _fail(report, f"{one.name} may not be {'excused' if excused else 'left out'}: {_why(report)}")
        if report.when == "call" and report.failed and call.excinfo is None and one.name in self._deviations:
            self._stale = True
        self._phases.append(report)
        return report

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Judge, write the report, and let a failing verdict fail the run."""
        ended = {result.name for result in self._report.checks}
        names = declared(self._subject.descriptor.capabilities, self._subject.precision)
        shown = unproven(names, self._report.checks, self._left_out) if self._complete else ()
        verdict = judge(
            self._report.checks,
            unrun=[name for name in self._planned if name not in ended],
            broken=self._broken,
            unknown=self._unknown,
            unproven=shown,
            complete=self._complete,
        )
        self._report = replace(self._report, running="", finished=True, unproven=shown, verdict=verdict)
        self._write()
        if verdict.outcome is VerdictOutcome.FAILS and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """The table and the verdict; every figure unless -q."""
        figures = [figure for result in self._report.checks for figure in result.figures]
        if figures and terminalreporter.verbosity >= 0:
            terminalreporter.section("figures")
            for figure in figures:
                numbers = f"{figure.value:>11.4g}   {figure.sense} {figure.bound:.5g}"
                terminalreporter.line(f"{figure.case:<22} {figure.figure:<46} {numbers}")
        terminalreporter.section("conformance")
        width = terminalreporter.config.get_terminal_writer().fullwidth if terminalreporter.isatty else None
        for line in report_lines(self._report, width):
            terminalreporter.line(line.text, **({line.colour: True} if line.colour else {}))

    def _result(self, one: Collected) -> CheckResult:
        outcome, reason = self._ending(one.name)
        figures = [value for _, value in one.item.user_properties if isinstance(value, Figure)]
        return CheckResult(
            name=one.name,
            level=one.check.level,
            outcome=outcome,
            seconds=round(sum(phase.duration for phase in self._phases), 3),
            figures=tuple(figures),
            reason=reason,
            notes=tuple(str(value) for key, value in one.item.user_properties if key == NOTE),
        )

    def _ending(self, name: str) -> tuple[Outcome, str]:
        listed = self._deviations.get(name)
        last = next((phase for phase in self._phases if not phase.passed), None)
        if self._stale or (listed is not None and (last is None or self._undeclared)):
            why = "needs what is not declared" if self._undeclared else "passes"
            return Outcome.STALE, f"listed in {FILE_NAME}, but {why}: remove the entry"
        if last is None:
            return Outcome.PASSED, ""
        if last.failed:
            own = last.when == "call" or self._left_away
            return (Outcome.FAILED if own else Outcome.ERROR), _why(last)
        if listed is not None and hasattr(last, "wasxfail"):
            return Outcome.DEVIATES, listed.reason
        return (Outcome.UNDECLARED if self._undeclared else Outcome.SKIPPED), _why(last)

    def _write(self) -> None:
        if self._path is not None:
            write_report(self._report, self._path)


def _why(report: pytest.TestReport) -> str:
    """One line."""
    if hasattr(report, "wasxfail"):
        return report.wasxfail.removeprefix("reason: ")
    said = report.longrepr
    if isinstance(said, tuple):
        # (path, line, "Skipped: reason")
        return " ".join(str(said[2]).split()).removeprefix("Skipped: ")
    crash = getattr(said, "reprcrash", None)
    text = str(crash.message if crash is not None else said).strip()
    if text.startswith("AssertionError: "):
        # What follows the message is pytest's explanation of the expression.
        text = text.removeprefix("AssertionError: ").partition("\n")[0]
    return " ".join(text.split())[:_LONGEST_REASON]


def _fail(report: pytest.TestReport, why: str) -> None:
    """Make of what was excused or left out a failure."""
    report.outcome, report.longrepr = "failed", why
    # To pytest whatever has this attribute was expected to end so, and is no failure: with it the run would pass.
    if hasattr(report, "wasxfail"):
        del report.wasxfail


def _is_excusable(error: BaseException) -> bool:
    """Whether an engine's list may excuse that a check ends so: beside its bound, or refused, but not broken."""
    if isinstance(error, EngineCrashedError):
        return False
    return isinstance(error, (AssertionError, GaspError, pytest.fail.Exception, pytest.skip.Exception, Undeclared))


def _aloud(config: pytest.Config, line: str) -> None:
    """Say something beside the dots, also while a check goes on, whose own words are kept back."""
    capture = config.pluginmanager.get_plugin("capturemanager")
    with contextlib.nullcontext() if capture is None else capture.global_and_fixture_disabled():
        config.get_terminal_writer().line(f"\n{line}", flush=True)


def _identity(subject: Subject) -> EngineIdentity:
    return EngineIdentity(
        name=subject.name,
        distribution=subject.distribution,
        version=_version(subject.distribution),
        contract_version=subject.descriptor.contract_version,
        device=subject.device,
        precision=subject.precision.value,
    )


def _machine() -> Machine:
    return Machine(
        python=platform.python_version(),
        numpy=np.__version__,
        platform=platform.platform(),
        processors=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
    )


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution) if distribution else ""
    except importlib.metadata.PackageNotFoundError:
        return ""
