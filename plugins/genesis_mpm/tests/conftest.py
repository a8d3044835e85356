from __future__ import annotations

import pytest

from gasp_core.engine.contract import PointEngine
from gasp_core.engine.registry import discover
from gasp_core.errors import EngineEnvironmentError


@pytest.fixture(scope="module")
def engine() -> PointEngine:
    """The engine in its environment, as a user has it; one worker serves a module's sessions in turn."""
    try:
        return discover().load("genesis-mpm")
    except EngineEnvironmentError as error:
        pytest.skip(str(error))
