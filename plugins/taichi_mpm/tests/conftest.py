"""Taichi keeps what it compiled on disk from run to run.

These tests compile every material in both precisions, and most of their time would be spent on improving what runs for
a second. The suite judges what users get.
"""

import os

import numpy as np
import pytest
from gasp_taichi_mpm import runtime, words
from gasp_taichi_mpm.engine import TaichiMpm

pytest.register_assert_rewrite("gasp_mpm_host.testing")

from gasp_mpm_host.testing import Kit  # noqa: E402 - its assertions are to say what they found

os.environ["TI_ADVANCED_OPTIMIZATION"] = "0"


@pytest.fixture(scope="session")
def kit():
    return Kit(
        engine_open=TaichiMpm().open,
        device=os.environ.get("GASP_TEST_DEVICE", "cpu"),
        rows=lambda session: session._held._rows(),
        nodes=lambda session: int(np.prod(session._held._control[words.SHAPE : words.SHAPE + 3])),
    )


@pytest.fixture(autouse=True)
def nothing_left_open():
    """Taichi is one for all sessions: whoever opens one, or fails to, leaves it to the next."""
    yield
    assert runtime._open_sessions == 0
