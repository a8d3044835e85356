"""What a test needs and may not be there: engines of other environments, and parts of the project that are plugins."""

from __future__ import annotations

import importlib.util

import pytest

from gasp_core.discovery.registry import discover
from gasp_core.discovery.status import engine_rows

__all__ = ["needs_renderer", "ready"]

needs_renderer = pytest.mark.skipif(
    importlib.util.find_spec("gasp_renderer") is None, reason="no renderer here: pip install -e plugins/renderer"
)
"""The core may be installed without it; `make test` installs it, so that nothing is left out there."""


def ready(name: str) -> None:
    """Skip the test where an engine cannot be run here, and say why."""
    rows = {row.name: row.status for row in engine_rows(discover())}
    if rows.get(name) != "ready":
        pytest.skip(f"{name} is not installed, or not ready ({rows.get(name)})")
