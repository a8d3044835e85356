from __future__ import annotations

import importlib.util

import pytest
from gasp_genesis_mpm.engine import GenesisMpm


@pytest.fixture(scope="session")
def engine() -> GenesisMpm:
    """The engine itself, where it can run."""
    if importlib.util.find_spec("genesis") is None:
        pytest.skip("genesis is not installed here: gasp engines install genesis-mpm")
    return GenesisMpm()
