"""What an engine can do to the process it runs in, and errors that it can raise."""

import ctypes
import os
import signal
import subprocess
import sys
import time

from gasp_core.contract import Status, StepReport
from gasp_core.errors import EngineDivergedError, SceneError, UnsupportedSceneError


class OddSceneError(SceneError):
    pass


def commit(fault):
    """Do the deed."""
    match fault:
        case "segfault":
            print("about to fall", flush=True)
            ctypes.string_at(0)
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "interrupt":
            os.kill(os.getpid(), signal.SIGINT)
        case "hang":
            print("about to hang", flush=True)
            time.sleep(3600)
        case "hang in C":
            # Holds the interpreter's lock, so that no other thread of the process runs.
            ctypes.PyDLL(None).sleep(3600)
        case "exit":
            sys.exit(3)
        case "exit at once":
            os._exit(3)
        case "orphans":
            # Both keep the channel open, if they can.
            if os.fork() == 0:
                time.sleep(3600)
            subprocess.Popen(["sleep", "3600"])
            os.kill(os.getpid(), signal.SIGKILL)
        case "prints":
            print('{"done": {"time": 7.0}}')
            os.write(1, b"\xff not even text\n")
            subprocess.run(["echo", "from a program"], check=True)
            print("x" * 200_000)
        case "error":
            raise ZeroDivisionError("the engine\nfell over")
        case "refuse":
            raise UnsupportedSceneError("of that I know nothing: ask another")
        case "refuse oddly":
            raise OddSceneError("odd")
        case "value":
            raise ValueError("not so")
        case "diverged":
            report = StepReport(status=Status.NOT_CONVERGED, substep_count=1, smallest_substep=1.0, largest_substep=2.0)
            raise EngineDivergedError("gone", report)
        case "import":
            import fake_backend_that_nobody_has  # noqa: F401
        case _:
            raise AssertionError(fault)
