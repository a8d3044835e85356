"""What a run says of an engine as a whole."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_conformance.checks import Level
from gasp_conformance.report import CheckResult, Outcome, Unproven, Verdict, VerdictOutcome

__all__ = ["judge"]

_FAILURES = {
    Outcome.FAILED: "failed",
    Outcome.ERROR: "ended in an error",
    Outcome.STALE: "listed as a deviation, but passes or does not apply",
}


def judge(
    results: Sequence[CheckResult],
    *,
    unrun: Sequence[str],
    broken: Sequence[str],
    unknown: Sequence[str],
    unproven: Sequence[Unproven],
    complete: bool,
) -> Verdict:
    """The verdict on an engine.

    Parameters
    ----------
    results
        Of every check that ended.
    unrun
        Names of checks that were asked for and did not end, e.g. because the run was stopped.
    broken
        Modules of checks that could not be imported.
    unknown
        Deviations that name no check of the suite.
    unproven
        Declared, and not shown.
    complete
        Whether everything was asked for; a run of a selection never passes.
    """
    reasons: list[str] = []
    for outcome, words in _FAILURES.items():
        names = [result.name for result in results if result.outcome is outcome]
        if names:
            reasons.append(f"{words}: {', '.join(names)}")
    if unrun:
        reasons.append(f"{len(unrun)} checks did not run, the first is {unrun[0]}")
    if broken:
        reasons.append(f"could not be collected: {', '.join(broken)}")
    if unknown:
        reasons.append(f"listed as deviations, but no check is called so: {', '.join(unknown)}")
    undone = [one for one in unproven if not one.excused]
    for why in dict.fromkeys(one.reason for one in undone):
        names = [one.capability for one in undone if one.reason == why]
        reasons.append(f"declared, but {why}: {', '.join(names)}")
    if complete and not any(result.level is Level.CORE for result in results):
        reasons.append("no core check ran")
    if reasons:
        return Verdict(outcome=VerdictOutcome.FAILS, reasons=tuple(reasons))
    if complete:
        return Verdict(outcome=VerdictOutcome.PASSES)
    return Verdict(outcome=VerdictOutcome.PARTIAL, reasons=("only a selection of the checks was run",))
