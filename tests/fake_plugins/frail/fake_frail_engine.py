"""Points fly, in steps whose rounding depends on all steps before, until the fault that is asked for."""

import ctypes
import os
import pickle
import signal
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np

from gasp_core.contract import Field, PointState, Status, StepReport
from gasp_core.errors import EngineDivergedError, SceneError, UnsupportedSceneError

STEP = 1e-3


class OddSceneError(SceneError):
    pass


class Frail:
    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        if options.note is not None:
            note = {
                "pid": os.getpid(),
                "modules": sorted(sys.modules),
                "folder": str(Path.cwd()),
                "prefix": sys.prefix,
                "given": (problem, device, precision, seed, accuracy, options, restart),
            }
            options.note.write_bytes(pickle.dumps(note))
        if options.fault.startswith("open:"):
            commit(options.fault.removeprefix("open:"))
        return FrailSession(problem, options, restart)


class FrailSession:
    def __init__(self, problem, options, restart):
        points = problem.points
        start = {"x": points.reference_positions, "v": points.initial_velocities, "time": np.array(0.0)}
        state = dict(start if restart is None else restart)
        self._x, self._v, self._time = np.array(state["x"]), np.array(state["v"]), float(state["time"])
        self._tracers = points.tracer_positions
        self._gravity = np.asarray(problem.gravity)
        self._options = options
        self._open = True

    @property
    def time(self):
        return self._time

    def advance_to(self, time):
        if not time >= self._time:
            raise ValueError(f"{time!r} is before {self._time!r}")
        count = round((time - self._time) / STEP)
        for _ in range(count):
            self._v = self._v + STEP * (self._gravity + self._options.spin * np.cross([0.0, 0.0, 1.0], self._x))
            self._x = self._x + STEP * self._v
        self._time = time
        if self._options.fault and time >= self._options.fault_time - 1e-9:
            if self._options.fault == "nan":
                self._x[3] = np.nan
            elif self._options.fault != "close":
                commit(self._options.fault)
        return StepReport(
            status=Status.OK, substep_count=count, smallest_substep=STEP, largest_substep=STEP, warnings=("so so",)
        )

    def read(self, fields):
        return PointState(
            time=self._time,
            positions=self._x.copy(),
            velocities=self._v.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=(
                np.tile(np.eye(3), (len(self._x), 1, 1)) if Field.DEFORMATION_GRADIENTS in fields else None
            ),
            tracer_positions=(
                None if self._tracers is None or Field.TRACER_POSITIONS not in fields else self._tracers + self._x[0]
            ),
        )

    def checkpoint(self):
        return {"time": np.array(self._time), "x": self._x, "v": self._v, "none": np.zeros((0, 3)), "on": np.True_}

    def close(self):
        if self._open and self._options.fault == "close":
            commit("segfault")
        self._open = False

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()


def commit(fault):
    """Do the deed."""
    if fault == "segfault":
        print("about to fall", flush=True)
        ctypes.string_at(0)
    elif fault == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif fault == "hang":
        print("about to hang", flush=True)
        clock.sleep(3600)
    elif fault == "hang in C":
        # Holds the interpreter's lock, so that no other thread of the process runs.
        ctypes.PyDLL(None).sleep(3600)
    elif fault == "exit":
        sys.exit(3)
    elif fault == "exit at once":
        os._exit(3)
    elif fault == "orphans":
        # Both keep the channel open, if they can.
        if os.fork() == 0:
            clock.sleep(3600)
        subprocess.Popen(["sleep", "3600"])
        os.kill(os.getpid(), signal.SIGKILL)
    elif fault == "prints":
        print('{"done": {"time": 7.0}}')
        os.write(1, b"\xff not even text\n")
        subprocess.run(["echo", "from a program"], check=True)
        print("x" * 200_000)
    elif fault == "error":
        raise ZeroDivisionError("the engine\nfell over")
    elif fault == "refuse":
        raise UnsupportedSceneError("of that I know nothing: ask another")
    elif fault == "refuse oddly":
        raise OddSceneError("odd")
    elif fault == "value":
        raise ValueError("not so")
    elif fault == "diverged":
        report = StepReport(status=Status.NOT_CONVERGED, substep_count=1, smallest_substep=1.0, largest_substep=2.0)
        raise EngineDivergedError("gone", report)
    elif fault == "import":
        import fake_backend_that_nobody_has  # noqa: F401
    else:
        raise AssertionError(fault)
