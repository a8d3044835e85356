import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gasp_core.discovery.registry import discover

FAKES = Path(__file__).parents[1] / "fake_plugins"


def forget_fakes():
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture
def installed(monkeypatch):
    """Put distributions of the tests on the import path, as if installed, and discover what there is then."""

    def install(*names):
        for name in names:
            assert (FAKES / name).is_dir()
            monkeypatch.syspath_prepend(FAKES / name)
        forget_fakes()
        return discover()

    yield install
    forget_fakes()


@pytest.fixture
def in_process_of_its_own():
    """Run Python code in a fresh interpreter in which these distributions of the tests are installed."""

    def run(arguments, *names):
        path = os.pathsep.join(str(FAKES / name) for name in names)
        return subprocess.run(
            [sys.executable, *arguments],
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=120,
        )

    return run


@pytest.fixture
def listed(in_process_of_its_own):
    """What ``gasp engines --json`` says where these distributions are installed, by name and distribution."""

    def rows(*names):
        done = in_process_of_its_own(["-m", "gasp_core.cli.main", "engines", "--json"], *names)
        assert done.returncode == 0, done.stderr
        return {(row["name"], row["distribution"]): row for row in json.loads(done.stdout)["engines"]}

    return rows
