import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from gasp_core import io, progress
from gasp_core.cli.main import main
from gasp_core.discovery.registry import discover
from gasp_core.io import write_splat
from gasp_core.toy import make_toy

FAKES = Path(__file__).parents[1] / "fake_plugins"

SCENE = """\
[scene]
duration = 0.08
frame_rate = 25

[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
height = 0.3
position = [0, 0, 0.2]
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }

[engine]
name = "ballistic"
"""


@dataclass(frozen=True)
class Outcome:
    status: int
    out: str
    err: str


def everything_under(folder):
    """Path, kind and content of all there is in a folder, less what Python keeps beside a file it imports."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
        if "__pycache__" not in path.parts
    }


@pytest.fixture
def interrupted_at(monkeypatch):
    """Ctrl-C as a splat file of this name is written."""
    written = io.write_splat

    def ready(name):
        def interrupted(path, gaussians):
            if path.name == name:
                raise KeyboardInterrupt
            written(path, gaussians)

        monkeypatch.setattr(io, "write_splat", interrupted)

    return ready


@pytest.fixture(scope="session")
def toy():
    return make_toy(64)


@pytest.fixture
def workplace(tmp_path, monkeypatch, toy):
    """An empty folder but for a toy and a scene of it, as the current one, with the ballistic engine installed."""
    monkeypatch.chdir(tmp_path)
    write_splat(tmp_path / "toy.ply", toy)
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


@pytest.fixture
def installed(monkeypatch):
    """Put distributions of the tests on the import path, as if installed."""

    def install(*names):
        for name in names:
            assert (FAKES / name).is_dir()
            monkeypatch.syspath_prepend(FAKES / name)
        forget()

    def forget():
        discover.cache_clear()
        for name in [name for name in sys.modules if name.startswith("fake_")]:
            del sys.modules[name]

    install("ballistic")
    yield install
    forget()


@pytest.fixture
def gasp(workplace, installed, capfd, monkeypatch):
    """Run ``gasp`` in this process, as the console script does, and as on a machine that is never slow: without lines
    of progress."""
    monkeypatch.setattr(progress._Lines, "pause", 1e6)

    def run(*arguments):
        capfd.readouterr()
        status = main([str(argument) for argument in arguments])
        return Outcome(status, *capfd.readouterr())

    return run


@pytest.fixture
def refused(gasp, workplace):
    """Run ``gasp`` with bad input: one line that says all these things, status 2, and nothing left behind."""

    def run(*arguments, says):
        before = everything_under(workplace)
        outcome = gasp(*arguments)
        assert outcome.err.startswith("gasp: "), outcome
        assert outcome.err.count("\n") == 1, outcome.err
        assert outcome.err.endswith("\n")
        assert "Traceback" not in outcome.err
        assert "internal error" not in outcome.err
        for said in says:
            assert said in outcome.err
        assert outcome.status == 2
        assert everything_under(workplace) == before
        return outcome.err

    return run


@pytest.fixture
def gasp_process(workplace):
    """Run ``gasp`` as a process of its own, with distributions of the tests installed."""

    def run(*arguments, fakes=("ballistic",), variables=(), **options):
        options.setdefault("stdout", subprocess.PIPE)
        return subprocess.run(
            [sys.executable, "-m", "gasp_core.cli.main", *map(str, arguments)],
            cwd=workplace,
            # No bytecode: where a test limits the size of files, half a module would be left in everybody's cache.
            env=os.environ
            | {
                "PYTHONPATH": os.pathsep.join(
                    [*(str(FAKES / name) for name in fakes), *filter(None, [os.environ.get("PYTHONPATH")])]
                ),
                "PYTHONDONTWRITEBYTECODE": "1",
            }
            | dict(variables),
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            **options,
        )

    return run
