"""Environments of engines: what state they are in, how one is built, and what the engine finds in it."""

import dataclasses
import fcntl
import os
import signal
import socket
import subprocess
import sys
import time
import venv
import zipfile
from pathlib import Path

import numpy
import pluggy
import psutil
import pytest

from gasp_core.cli.main import main
from gasp_core.contract import EngineEnvironment
from gasp_core.discovery.environments import EnvironmentState, folder_of, stamp, state_of
from gasp_core.engines.installation import install, remove
from gasp_core.engines.interpreters import find_python, version_of
from gasp_core.engines.opening import open_engine
from gasp_core.errors import EngineEnvironmentError

FAKES = Path(__file__).parents[1] / "fake_plugins"
SUPPORT = Path(__file__).parents[1] / "support"
PATIENCE = 60.0


@pytest.fixture
def away(registry):
    """The descriptor of an engine with an environment of its own."""
    return registry.descriptor("away")


@pytest.fixture
def built(away, monkeypatch):
    """The environment of that engine, with nothing but NumPy and Pluggy in it, made without pip."""
    folder = folder_of(away)
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for package in (numpy, pluggy):
        home = Path(package.__file__).parent
        for part in (home, home.with_name(f"{home.name}.libs")):
            if part.exists():
                (site / part.name).symlink_to(part)
    stamp(folder, away.environment)
    return folder


@pytest.fixture
def wheel(tmp_path):
    """The wheel of the backend that nobody has."""
    path = tmp_path / "wheels" / "gasp_fake_backend-1.0-py3-none-any.whl"
    path.parent.mkdir()
    about = "gasp_fake_backend-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("fake_backend_that_nobody_has.py", "")
        archive.writestr(f"{about}/METADATA", "Metadata-Version: 2.1\nName: gasp-fake-backend\nVersion: 1.0\n")
        archive.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/RECORD", "")
    return path


def everything(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_an_engine_without_its_environment_says_what_to_do(registry):
    with pytest.raises(EngineEnvironmentError, match=r'"away".* is not installed: gasp engines install away'):
        open_engine(registry.offer("away"))


def test_states(away, built):
    assert state_of(away) is EnvironmentState.READY
    for other in (
        EngineEnvironment(python="3.11", packages=away.environment.packages),
        EngineEnvironment(python=away.environment.python, packages=("gasp-fake-backend==1.1",)),
    ):
        assert state_of(dataclasses.replace(away, environment=other)) is EnvironmentState.OUTDATED
    python = built / "bin" / "python"
    python.unlink()
    python.symlink_to("/nowhere/python")
    assert state_of(away) is EnvironmentState.OUTDATED
    (built / "gasp-environment.json").write_text("{")
    assert state_of(away) is EnvironmentState.OUTDATED
    assert remove(away)
    assert state_of(away) is EnvironmentState.MISSING
    assert not remove(away)


def test_the_engine_runs_in_its_environment_with_what_it_is_lent_alone(
    registry, built, opened, problem, told, monkeypatch
):
    # What points the Python of this process to its packages must not reach that one.
    monkeypatch.setenv("PYTHONPATH", str(FAKES / "ballistic"))
    note, read = told
    engine = open_engine(registry.offer("away"))
    with opened(engine, problem, note=note) as session, opened(open_engine(registry.offer("frail")), problem) as here:
        for one in (session, here):
            one.advance_to(0.05)
        assert numpy.array_equal(session.read(frozenset()).positions, here.read(frozenset()).positions)
        modules = set(read()["modules"])
    assert Path(read()["prefix"]) == built
    assert {"gasp_core.contract", "flying_points.faults", "fake_frail"} <= modules
    for name in ("fake_ballistic", "scipy", "click", "gasp_reference_mpm"):
        code = f"import {name}"
        done = subprocess.run([built / "bin/python", "-I", "-c", code], capture_output=True, text=True)
        assert "ModuleNotFoundError" in done.stderr, name


def test_a_backend_that_is_not_in_the_environment(registry, built, opened, problem):
    from gasp_core.errors import EngineCrashedError

    with (
        pytest.raises(EngineCrashedError, match="No module named 'fake_backend_that_nobody_has'"),
        opened(open_engine(registry.offer("away")), problem, fault="import") as session,
    ):
        session.advance_to(0.1)


def test_gasp_engines_tells_the_state(registry, away, capfd, monkeypatch):
    import json

    def row():
        assert main(["engines", "--json"]) == 0
        return next(row for row in json.loads(capfd.readouterr().out)["engines"] if row["name"] == "away")

    assert row()["status"] == "not installed"
    assert row()["error"] == "the environment it runs in is not installed: gasp engines install away"
    assert row()["environment"] == {
        "python": ">=3.11,<3.14",
        "packages": ["gasp-fake-backend==1.0"],
        "folder": str(folder_of(away)),
    }
    folder_of(away).mkdir(parents=True)
    assert row()["status"] == "outdated"
    assert "gasp engines install away" in row()["error"]


def test_gasp_engines_tells_that_it_is_ready(registry, built, capfd):
    assert main(["engines"]) == 0
    (line,) = [line for line in capfd.readouterr().out.splitlines() if line.startswith("away ")]
    assert line.split()[1] == "ready"


def refused(capfd, *arguments):
    assert main([str(argument) for argument in arguments]) == 2
    said = capfd.readouterr().err
    assert said.splitlines()[-1].startswith("gasp: ")
    assert "Traceback" not in said
    return said.splitlines()[-1]


def test_bad_input_of_the_commands(registry, capfd, tmp_path, monkeypatch):
    assert "runs in the environment it is installed in" in refused(capfd, "engines", "install", "frail")
    assert 'no engine named "awai"' in refused(capfd, "engines", "install", "awai")
    said = refused(capfd, "engines", "install", "away", "--python", tmp_path / "python")
    assert "is no Python that runs" in said
    old = tmp_path / "old-python"
    old.write_text("#!/bin/sh\necho 3.9.1\n")
    old.chmod(0o755)
    said = refused(capfd, "engines", "install", "away", "--python", old)
    assert 'is Python 3.9.1, and engine "away" needs >=3.11,<3.14' in said
    assert main(["engines", "remove", "away"]) == 0
    assert "has no environment here" in capfd.readouterr().out
    monkeypatch.setenv("GASP_ENVIRONMENTS", "/dev/null/environments")
    assert "GASP_ENVIRONMENTS" in refused(capfd, "engines", "install", "away")
    assert not (tmp_path / "environments").exists()


@pytest.mark.thorough
def test_a_failed_build_leaves_what_was_there(away, built, capfd, monkeypatch):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    other = dataclasses.replace(away, environment=EngineEnvironment(python="3.11", packages=("gasp-no-such",)))
    kept = everything(built)
    with pytest.raises(EngineEnvironmentError, match='engine "away": pip could not install gasp-no-such'):
        install(other, print)
    assert "gasp-no-such" in capfd.readouterr().err
    assert everything(built) == kept
    assert everything(built.parent) == [".away.lock", "away"]
    assert state_of(away) is EnvironmentState.READY


def test_two_builds_at_once(away, tmp_path, capfd):
    folder = folder_of(away)
    folder.parent.mkdir(parents=True)
    with (folder.parent / ".away.lock").open("w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        assert "another process is building" in refused(capfd, "engines", "install", "away")
    assert not folder.exists()


@pytest.fixture
def endless_index(monkeypatch):
    """A package index that accepts and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setenv("PIP_INDEX_URL", f"http://127.0.0.1:{server.getsockname()[1]}/")
        monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
        monkeypatch.setenv("PIP_RETRIES", "0")
        monkeypatch.setenv("PIP_DEFAULT_TIMEOUT", "30")
        yield server


@pytest.fixture
def building(away, endless_index):
    """A process that builds the environment and waits for the index."""
    path = os.pathsep.join([str(FAKES / "frail"), str(SUPPORT), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.Popen(
        [sys.executable, "-m", "gasp_core.cli.main", "engines", "install", "away"],
        env=os.environ | {"PYTHONPATH": path},
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    endless_index.settimeout(PATIENCE)
    connection, _ = endless_index.accept()
    with connection, process:
        yield process


@pytest.mark.thorough
def test_ctrl_c_leaves_nothing_of_a_build(away, building):
    building.send_signal(signal.SIGINT)
    _, err = building.communicate(timeout=PATIENCE)
    assert building.returncode == 130
    assert err.splitlines()[-1] == "gasp: interrupted"
    assert state_of(away) is EnvironmentState.MISSING
    assert everything(folder_of(away).parent) == [".away.lock"]


@pytest.mark.thorough
def test_a_killed_build_is_no_environment_and_the_next_begins_anew(away, building, monkeypatch, capfd):
    (pip,) = psutil.Process(building.pid).children()
    building.kill()
    building.wait()
    assert state_of(away) is EnvironmentState.MISSING
    with pytest.raises(EngineEnvironmentError, match="another process is building"):
        install(away, print)
    pip.kill()
    psutil.wait_procs([pip], timeout=PATIENCE)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(EngineEnvironmentError, match="pip could not install"):
        install(away, print)
    assert everything(folder_of(away).parent) == [".away.lock"]


@pytest.mark.slow
def test_a_true_build(registry, away, wheel, opened, problem, told, capfd):
    environment = EngineEnvironment(python=">=3.11,<3.14", packages=(f"gasp-fake-backend @ {wheel.as_uri()}",))
    wanted = dataclasses.replace(away, environment=environment)
    said = []
    folder = install(wanted, said.append)
    assert state_of(wanted) is EnvironmentState.READY
    assert state_of(away) is EnvironmentState.OUTDATED
    assert everything(folder.parent) == [".away.lock", "away"]
    assert said[-1] == "away is ready"

    from gasp_core.engines.worker.engine import Interpreter, WorkerEngine

    note, read = told
    engine = WorkerEngine(wanted, Interpreter(python=folder / "bin" / "python", path=None), "")
    with opened(engine, problem, fault="import", note=note) as session:
        session.advance_to(0.2)
    assert Path(read()["prefix"]) == folder

    begun = time.time()
    assert install(wanted, said.append) == folder
    assert said[-1].startswith("away is ready: ")
    assert (folder / "pyvenv.cfg").stat().st_mtime < begun


@pytest.mark.parametrize("asked", [f"3.{sys.version_info.minor}", ">=3.11,<4", "~=3.11"])
def test_this_python_is_taken_where_it_fits(asked):
    assert find_python(asked) == Path(sys.executable)


def test_another_python_is_looked_for_on_the_path(tmp_path, monkeypatch):
    for name, body in (
        ("python3.19", "echo 'not here' >&2; exit 127"),  # a shim of a version manager
        ("python3.18", "echo 3.18.2"),
        ("python3.17", "echo 3.17.0"),
    ):
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}/bin")
    assert version_of(tmp_path / "python3.19") is None
    assert find_python(">=3.17,<4") == tmp_path / "python3.18"
    assert find_python("3.17") == tmp_path / "python3.17"
    with pytest.raises(EngineEnvironmentError, match=r"no Python 3\.16 found: .* uv python install 3\.16"):
        find_python("3.16")
    (tmp_path / "uv").write_text(f'#!/bin/sh\ntest "$1 $2 $3" = "python find 3.16" && echo {tmp_path}/hidden\n')
    (tmp_path / "hidden").write_text("#!/bin/sh\necho 3.16.1\n")
    for name in ("uv", "hidden"):
        (tmp_path / name).chmod(0o755)
    assert find_python("3.16") == tmp_path / "hidden"


@pytest.mark.parametrize("asked", ["", "three", ">=", "3.x"])
def test_a_version_that_is_none(asked):
    with pytest.raises(EngineEnvironmentError, match="must be a version such as"):
        find_python(asked)
