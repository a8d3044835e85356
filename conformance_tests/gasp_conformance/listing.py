"""`--gasp-list`: what the suite checks, without running it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from gasp_conformance.collection import Collected, collected_checks, name_for_selection, summary_of

__all__ = ["Listing"]


class Listing:
    """pytest hooks of a run that only lists."""

    def __init__(self) -> None:
        self._checks: list[Collected] = []

    @pytest.hookimpl(wrapper=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Iterator[None]:
        """Have the checks selected by their names, then take every one away before it is run."""
        name_for_selection(collected_checks(items))
        yield
        self._checks = collected_checks(items)
        items.clear()

    @pytest.hookimpl(tryfirst=True)
    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """One line a check."""
        width = max((len(one.name) for one in self._checks), default=0)
        for one in self._checks:
            long = "full  " if one.check.full else "quick "
            terminalreporter.line(f"{one.check.level.value:<12}  {one.name:<{width}}  {long} {summary_of(one)}")
