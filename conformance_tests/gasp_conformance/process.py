"""The suite in a process of its own, where nothing but the installed packages reaches it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from gasp_core.processes import guard
from gasp_core.processes.group import end_group, interrupt_group

__all__ = ["NOTHING_MATCHED", "USAGE", "SuiteInterrupted", "is_orderly", "run_suite"]

# As pytest.ExitCode has them; importing it would take longer than everything else here.
_OK, _TESTS_FAILED, _INTERRUPTED = 0, 1, 2
USAGE = 4
"""Exit status of a run that could not begin; why is on stderr."""

NOTHING_MATCHED = 5
"""Exit status of a run of which a selection left nothing."""

_PATIENCE = 5.0
"""Seconds it may take to write its report once it is interrupted: who ends a container waits for ten, then kills."""


class SuiteInterrupted(KeyboardInterrupt):
    """Raised once a suite that was interrupted has ended, with the exit `status` of its process."""

    def __init__(self, status: int) -> None:
        super().__init__()
        self.status = status


def run_suite(options: Sequence[str], folder: Path) -> int:
    """Run pytest on the suite in an empty folder and return its exit status; < 0 is a signal.

    Neither configuration, conftest files nor environment variables of the user's own change what it does, nor do
    other pytest plugins that happen to be installed. Its process and all that starts do not outlive this one.

    Raises
    ------
    SuiteInterrupted
        After Ctrl-C, and SIGTERM, which `gasp` takes for one: once the process has ended, too.
    """
    settings = folder / "pytest.ini"
    settings.write_text("[pytest]\n")
    command = [
        sys.executable,
        "-m",
        guard.__name__,
        "pytest",
        "--pyargs",
        "gasp_conformance",
        "-c",
        str(settings),
        "--rootdir",
        str(folder),
    ]
    command += [
        "--noconftest",
        "--import-mode=importlib",
        "-p",
        "gasp_conformance.pytest_plugin",
        "-p",
        "no:cacheprovider",
    ]
    command += ["--basetemp", str(folder / "tmp"), "-q", "--tb=short", "-rN", "--disable-warnings", *options]
    with subprocess.Popen(
        command, cwd=folder, env=_environment(os.environ), stdin=subprocess.PIPE, start_new_session=True
    ) as process:
        try:
            process.wait()
        except KeyboardInterrupt as error:
            # Ctrl-C on the terminal has not reached the session it leads.
            interrupt_group(process)
            raise SuiteInterrupted(end_group(process, _PATIENCE)) from error
        finally:
            status = end_group(process)
        return status


def is_orderly(status: int) -> bool:
    """Whether pytest itself ended the process, whatever it found."""
    return status in (_OK, _TESTS_FAILED, _INTERRUPTED)


def _environment(own: Mapping[str, str]) -> dict[str, str]:
    changed = {key: value for key, value in own.items() if not key.startswith("PYTEST_")}
    changed["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    if own.get("PYTHONPATH"):
        # Relative entries are meant from the user's folder.
        changed["PYTHONPATH"] = os.pathsep.join(
            str(Path(entry).absolute()) for entry in own["PYTHONPATH"].split(os.pathsep)
        )
    return changed
