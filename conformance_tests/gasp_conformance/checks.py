"""What a check is called, and how much hangs on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

import pytest

__all__ = ["MARK", "Check", "Level", "check"]

Function = TypeVar("Function", bound=Callable[..., Any])

MARK = "gasp_check"
"""Name of the pytest mark that every check of the suite carries."""


class Level(Enum):
    """What a failed check says about an engine. In the order in which they are reported."""

    CORE = "core"
    """The contract itself: nothing here may be left out or excused."""
    CAPABILITY = "capability"
    """Something the engine declares: it has to show it, or not declare it."""
    VERIFICATION = "verification"
    """Physics against a closed form."""
    CONVERGENCE = "convergence"
    """A declared order, measured."""
    EXTREMES = "extremes"
    """Inputs far from what is usual: right, or refused with a reason; never a NaN, a hang, a crash."""
    AGREEMENT = "agreement"
    """Another engine of the same method, the same scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check.

    Parameters
    ----------
    name
        As reports, deviations and tests of the suite name it: "V3", "lands-on-time", "material:sand". A check of
        several parameters has their ids behind it, in brackets: "V8[4 cells]".
    level
        What it says.
    full
        Takes long: left out by --quick.
    """

    name: str
    level: Level
    full: bool = False


def check(name: str, level: Level, *, full: bool = False) -> Callable[[Function], Function]:
    """Mark a test function as a check."""
    return getattr(pytest.mark, MARK)(Check(name=name, level=level, full=full))
