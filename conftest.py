"""The same tests wherever they are run.

Property tests draw the same examples every time where CI is set, new ones everywhere else, and none fails because the
machine is busy. And Ctrl-C reaches the programs that tests start: whatever is started in the background of a shell
ignores it, and so do its children.

Of several processes that share the tests out, each takes whole files, and one takes all of Taichi, which compiles for a
minute what its tests have in common, once a process.
"""

import os
import signal

import pytest
from hypothesis import settings

settings.register_profile("own", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "own")

signal.signal(signal.SIGINT, signal.default_int_handler)

COMPILES_LONG = "taichi_mpm"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Say which tests one process has to take."""
    for item in items:
        parts = item.path.parts
        group = COMPILES_LONG if COMPILES_LONG in parts else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))
