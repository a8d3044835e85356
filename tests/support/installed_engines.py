"""Engines that a test needs, and that may not be there: those of other environments, or of a part of the project."""

from __future__ import annotations

import pytest

from gasp_core.discovery.registry import discover
from gasp_core.discovery.status import engine_rows

__all__ = ["ready"]


def ready(name: str) -> None:
    """Skip the test where an engine cannot be run here, and say why."""
    rows = {row.name: row.status for row in engine_rows(discover())}
    if rows.get(name) != "ready":
        pytest.skip(f"{name} is not installed, or not ready ({rows.get(name)})")
