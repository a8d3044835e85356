import time

import psutil
import pytest

PATIENCE = 20.0
"""Seconds; a limit of hanging."""


def lives(pid):
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.fixture
def alive():
    """Which of some processes live."""
    return lambda *pids: [pid for pid in pids if lives(pid)]


@pytest.fixture
def gone(alive):
    """Wait until processes are gone; whether they are."""

    def wait(*pids):
        deadline = time.monotonic() + PATIENCE
        while alive(*pids) and time.monotonic() < deadline:
            time.sleep(0.02)
        return not alive(*pids)

    return wait
