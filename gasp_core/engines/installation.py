"""Building the environment of an engine, beside its place, and putting it there when it is whole."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from gasp_core.contract import EngineDescriptor, EngineEnvironment
from gasp_core.discovery.environments import EnvironmentState, folder_of, python_in, stamp, state_of
from gasp_core.engines.interpreters import find_python, fits, version_of, wanted_versions
from gasp_core.engines.worker.engine import Interpreter, WorkerEngine
from gasp_core.errors import EngineEnvironmentError, GaspError

try:
    import fcntl
except ImportError:  # Windows, where there are no workers either
    fcntl = None

__all__ = ["install", "remove"]

_CONTRACT_NEEDS = ("numpy>=1.26", "pluggy>=1.5")
"""What the borrowed part of GASP imports."""
_PATIENCE = 10.0


def install(descriptor: EngineDescriptor, say: Callable[[str], None], python: Path | None = None) -> Path:
    """Build the environment an engine declares, in place of an outdated one; what pip says goes to stderr.

    Parameters
    ----------
    descriptor
        The engine.
    say
        Told what is being done.
    python
        Interpreter to build it with; None: one is looked for.

    Returns
    -------
    Path
        The folder. Where it is ready already, nothing is done.

    Raises
    ------
    EngineEnvironmentError
        Where the engine declares no environment, there is no fitting Python, a package cannot be installed, the disk
        refuses, or another process is at it. What was there before is still there then, as after Ctrl-C.
    """
    name, environment = descriptor.name, descriptor.environment
    if environment is None:
        raise EngineEnvironmentError(f'engine "{name}" runs in the environment it is installed in: it has no other')
    folder = folder_of(descriptor)
    if state_of(descriptor) is EnvironmentState.READY:
        say(f"{name} is ready: {folder}")
        return folder
    base = find_python(environment.python) if python is None else _checked(python, environment, name)
    with _alone(folder) as lock:
        beside = folder.with_name(f".{name}.part")
        _remove(beside)  # of one that was killed
        try:
            say(f"building an environment for {name} with Python {version_of(base)}: {folder}")
            _build(beside, base, environment, name, lock)
            say("trying it")
            _try(beside, descriptor)
            stamp(beside, environment)
            _replace(folder, beside)
        finally:
            _remove(beside)
    say(f"{name} is ready")
    return folder


def remove(descriptor: EngineDescriptor) -> bool:
    """Remove the environment of an engine; whether there was one.

    Raises
    ------
    EngineEnvironmentError
        Where the disk refuses, or another process builds it.
    """
    folder = folder_of(descriptor)
    if not folder.is_dir():
        return False
    with _alone(folder):
        # Out of the way at once: half an environment must not pass for a whole one.
        doomed = folder.with_name(f".{folder.name}.old")
        _remove(doomed)
        folder.rename(doomed)
        _remove(doomed)
    return True


def _checked(python: Path, environment: EngineEnvironment, name: str) -> Path:
    version = version_of(python)
    if version is None:
        raise EngineEnvironmentError(f"{python}: is no Python that runs: give the path of an interpreter")
    if not fits(version, wanted_versions(environment.python)):
        raise EngineEnvironmentError(
            f'{python}: is Python {version}, and engine "{name}" needs {environment.python}: give another one'
        )
    return python


@contextmanager
def _alone(folder: Path) -> Generator[int]:
    """Keep other processes from building or removing the same environment; the disk's refusals in one line.

    Gives the descriptor that holds the lock: a process that inherits it holds it, too.
    """
    if fcntl is None:
        raise EngineEnvironmentError(f"environments of engines need Linux or macOS, and this is {sys.platform}")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with folder.with_name(f".{folder.name}.lock").open("w") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise EngineEnvironmentError(
                    f"{folder}: another process is building or removing it: wait for that to end"
                ) from None
            yield stream.fileno()
    except OSError as error:
        raise EngineEnvironmentError(
            f"{error.filename or folder}: {error.strerror or error}: make room there, or name another folder in"
            " GASP_ENVIRONMENTS"
        ) from error


def _build(folder: Path, base: Path, environment: EngineEnvironment, name: str, lock: int) -> None:
    if _run([str(base), "-I", "-m", "venv", str(folder)], lock) != 0:
        raise EngineEnvironmentError(
            f"{base} cannot make environments, for the reason above: install its venv module, or give another --python"
        )
    packages = [*environment.packages, *_CONTRACT_NEEDS]
    pip = [str(python_in(folder)), "-m", "pip", "install", "--disable-pip-version-check", "--no-input"]
    if _run([*pip, *packages], lock) != 0:
        raise EngineEnvironmentError(
            f'engine "{name}": pip could not install {", ".join(environment.packages)}, for the reason above;'
            " once that is mended, the same command tries again"
        )


def _run(command: Sequence[str], lock: int) -> int:
    """Run a command that shows its progress on stderr, and see it end whatever happens.

    Where this process is killed, the command goes on, and keeps the lock: nobody builds in its place meanwhile.
    """
    # Variables that are meant for the Python of this process would mislead the other one.
    surroundings = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    stderr = 2
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=stderr, env=surroundings, pass_fds=(lock,), start_new_session=True
    ) as process:
        try:
            return process.wait()
        except BaseException:
            # Told once, it clears up; Ctrl-C on the terminal has not reached the session it leads.
            with contextlib.suppress(OSError, subprocess.TimeoutExpired):
                os.killpg(process.pid, signal.SIGINT)
                process.wait(_PATIENCE)
            with contextlib.suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)
            raise


def _try(folder: Path, descriptor: EngineDescriptor) -> None:
    """See a worker come up."""
    engine = WorkerEngine(descriptor, Interpreter(python=python_in(folder), path=None), remedy="")
    try:
        engine.probe()
    except GaspError as error:
        raise EngineEnvironmentError(f"the environment was built, and no worker starts in it: {error}") from error


def _replace(folder: Path, beside: Path) -> None:
    old = folder.with_name(f".{folder.name}.old")
    _remove(old)
    if folder.exists():
        folder.rename(old)
    beside.rename(folder)
    _remove(old)


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)
