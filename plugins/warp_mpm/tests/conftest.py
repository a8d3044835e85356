"""Warp keeps what it compiled on disk from run to run."""

import os

import numpy as np
import pytest
from gasp_warp_mpm.engine import WarpMpm

pytest.register_assert_rewrite("gasp_mpm_host.testing")

from gasp_mpm_host.testing import Kit  # noqa: E402 - its assertions are to say what they found


@pytest.fixture(scope="session")
def kit():
    return Kit(
        engine_open=WarpMpm().open,
        device=os.environ.get("GASP_TEST_DEVICE", "cpu"),
        rows=lambda session: session._held._rows(),
        nodes=lambda session: int(np.prod(list(session._held._tables.shape))),
    )
