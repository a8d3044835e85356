"""pytest plugin: which engine the suite looks at, what it measured, and why a check was left out.

    pytest --pyargs gasp_conformance --gasp-engine=NAME

It is loaded into every pytest run where the suite is installed, so it imports nothing of it until an engine is named.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from gasp_conformance.subject import Subject

__all__ = ["Ledger", "ledger", "oracle", "subject"]

_PROPERTY = "gasp figure"
_SUBJECT = pytest.StashKey["Subject | None"]()
_ORACLE = pytest.StashKey["Subject | None"]()


class Ledger:
    """Records what a case measured beside what it was allowed, and holds the one against the other."""

    def __init__(self, record: Any) -> None:
        self._record = record

    def at_most(self, case: str, figure: str, value: float, bound: float) -> None:
        """|value| <= bound."""
        self._record(_PROPERTY, {"case": case, "figure": figure, "value": float(value), "bound": f"<= {bound:.3g}"})
        assert abs(value) <= bound, f"{case}: {figure} is {value:.4g}, bound {bound:.4g}"

    def at_least(self, case: str, figure: str, value: float, bound: float) -> None:
        """Value >= bound."""
        self._record(_PROPERTY, {"case": case, "figure": figure, "value": float(value), "bound": f">= {bound:.5g}"})
        assert value >= bound, f"{case}: {figure} is {value:.4g}, bound {bound:.4g}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the suite."""
    group = parser.getgroup("gasp", "conformance of GASP point engines")
    group.addoption("--gasp-engine", metavar="NAME", help="the engine to look at, as `gasp engines` lists it")
    group.addoption("--gasp-oracle", metavar="NAME", help="an engine of the same method, to compare it with")
    group.addoption(
        "--gasp-precision",
        choices=("float32", "float64"),
        help="precision to run the engine in (default: the first it declares)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Find the engines before anything is collected, so that a misspelt name is one line and not a page."""
    config.stash[_SUBJECT] = config.stash[_ORACLE] = None
    names = [config.getoption("--gasp-engine"), config.getoption("--gasp-oracle")]
    if not any(names):
        return
    from gasp_conformance.subject import find_subject
    from gasp_core.engine.contract import Precision
    from gasp_core.errors import GaspError

    asked = config.getoption("--gasp-precision")
    try:
        if names[0]:
            config.stash[_SUBJECT] = find_subject(names[0], Precision(asked) if asked else None)
        if names[1]:
            config.stash[_ORACLE] = find_subject(names[1], None)
    except GaspError as error:
        raise pytest.UsageError(str(error)) from None


@pytest.fixture
def subject(pytestconfig: pytest.Config) -> Subject:
    """The engine the suite looks at."""
    found = pytestconfig.stash[_SUBJECT]
    if found is None:
        pytest.skip("no engine named: run with --gasp-engine=NAME")
    return found


@pytest.fixture
def oracle(pytestconfig: pytest.Config) -> Subject:
    """The engine it is compared with."""
    found = pytestconfig.stash[_ORACLE]
    if found is None:
        pytest.skip("no engine to compare with: run with --gasp-oracle=NAME")
    return found


@pytest.fixture
def ledger(record_property: Any) -> Ledger:
    """Where figures are recorded and judged."""
    return Ledger(record_property)


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    """What an engine does not declare is skipped and said, not failed."""
    if not pyfuncitem.module.__name__.startswith("gasp_conformance"):
        return (yield)
    from gasp_conformance.subject import Undeclared

    try:
        return (yield)
    except Undeclared as missing:
        pytest.skip(str(missing))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line a figure."""
    reports = [*terminalreporter.getreports("passed"), *terminalreporter.getreports("failed")]
    figures = [value for report in reports for name, value in report.user_properties if name == _PROPERTY]
    if not figures:
        return
    terminalreporter.section("figures")
    for figure in sorted(figures, key=lambda one: one["case"]):
        terminalreporter.line("{case:<22} {figure:<46} {value:>11.4g}   {bound}".format(**figure))
