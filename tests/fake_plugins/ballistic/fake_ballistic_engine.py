"""x = x0 + v0 t + g t^2 / 2 for every point."""

import sys

import numpy as np

from gasp_core.contract import PointState, Status, StepReport

STDOUT_AT_IMPORT = sys.stdout


class Ballistic:
    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        scale = 1.0 if options is None else options.time_scale
        return Flight(problem, scale, 0.0 if restart is None else float(restart["time"]))


class Flight:
    def __init__(self, problem, scale, time):
        self._start = problem.points.reference_positions
        self._velocities = problem.points.initial_velocities
        self._gravity = np.asarray(problem.gravity)
        self._scale = scale
        self.time = time

    def advance_to(self, time):
        step = time - self.time
        self.time = time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=step, largest_substep=step)

    def read(self, fields):
        t = self.time * self._scale
        return PointState(
            time=self.time,
            positions=self._start + self._velocities * t + self._gravity * t * t / 2,
            velocities=(self._velocities + self._gravity * t) * self._scale,
        )

    def checkpoint(self):
        return {"time": np.array(self.time)}

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()
