"""The checks among what pytest collects: their names, their order, and which of them a run is about."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module

import pytest

from gasp_conformance.checks import MARK, Check, Level

__all__ = ["SUITE", "Collected", "collected_checks", "is_complete", "name_for_selection", "summary_of"]

SUITE = "gasp_conformance"
"""The package the checks lie in."""

_LEVELS = list(Level)


@dataclass(frozen=True, slots=True, kw_only=True)
class Collected:
    """A check that pytest is going to run.

    Parameters
    ----------
    name
        With the id of its parameters.
    """

    item: pytest.Item
    name: str
    check: Check


def collected_checks(items: Iterable[pytest.Item]) -> list[Collected]:
    """The checks among `items`, core first; items of others are left out.

    Raises
    ------
    pytest.UsageError
        Where a test of the suite is no check, or two checks have one name.
    """
    found: dict[str, Collected] = {}
    for item in items:
        mark = _mark(item)
        if mark is None:
            if _module(item).partition(".")[0] == SUITE:
                raise pytest.UsageError(f"{item.nodeid} is part of the suite, but no check: put @check above it")
            continue
        one = Collected(item=item, name=_name(item, mark), check=mark.args[0])
        if one.name in found:
            raise pytest.UsageError(f'{item.nodeid} and {found[one.name].item.nodeid} are both called "{one.name}"')
        found[one.name] = one
    return sorted(found.values(), key=lambda one: _LEVELS.index(one.check.level))


def is_complete(items: Iterable[pytest.Item]) -> bool:
    """Whether every module of checks that the suite has is among what was collected."""
    modules = {_module(item) for item in items}
    path: Sequence[str] = import_module(SUITE).__path__
    return all(
        f"{SUITE}.{module.name}" in modules for module in pkgutil.iter_modules(path) if module.name.startswith("test_")
    )


def name_for_selection(checks: Iterable[Collected]) -> None:
    """Have pytest's -k find checks by their names and levels."""
    for one in checks:
        one.item.extra_keyword_matches |= {one.name, one.check.level.value}


def summary_of(one: Collected) -> str:
    """The first line of a check's docstring, or its function's name in words."""
    function = getattr(one.item, "function", None)
    text = (getattr(function, "__doc__", None) or "").strip()
    if text:
        return text.splitlines()[0]
    return getattr(function, "__name__", one.name).removeprefix("test_").replace("_", " ")


def _mark(item: pytest.Item) -> pytest.Mark | None:
    # That of a parameter says more than that of the function.
    return _parameter_mark(item) or item.get_closest_marker(MARK)


def _parameter_mark(item: pytest.Item) -> pytest.Mark | None:
    call = getattr(item, "callspec", None)
    return next((mark for mark in getattr(call, "marks", ()) if mark.name == MARK), None)


def _name(item: pytest.Item, mark: pytest.Mark) -> str:
    name: str = mark.args[0].name
    call = getattr(item, "callspec", None)
    # A parameter with a mark of its own has named itself.
    return name if call is None or mark is _parameter_mark(item) else f"{name}[{call.id}]"


def _module(item: pytest.Item) -> str:
    return getattr(getattr(item, "module", None), "__name__", "")
