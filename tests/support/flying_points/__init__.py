"""The engine of the tests: every point flies by itself, in small steps whose rounding depends on all steps before.

And it does what engines must not do, where it is told to: see `Options.fault`. Tests hand it over as it is here; as
"frail" the distribution in fake_plugins/frail offers it. The installed "ballistic" is another one: a parabola, which
tests know in closed form, beside this one's steps.

What is computed here must not change by a bit: the recordings of earlier versions are gone on with.
"""

from __future__ import annotations

import math
import os
import pickle
import sys
import time as clock
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flying_points.faults import commit
from gasp_core.contract import (
    ContactCondition,
    Determinism,
    Driven,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    Fluid,
    HalfSpace,
    Impulse,
    Pinned,
    PointState,
    Precision,
    Status,
    StepReport,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays

STEPS_PER_SECOND = 1000
MOST_STEPS = 1_000_000


@dataclass(frozen=True)
class Options:
    fault: str = ""
    """What goes wrong: of the results, as `Session` has it, or of the process, as `commit` has it; with "open:" before
    it already as the scene is set up."""
    fault_time: float = 0.1
    """At the first frame that is not before this time [s]."""
    pause: float = 0.0
    """Real time that each frame takes in addition [s]."""
    spin: float = 0.0
    """Angular velocity about z that is added to the way of every point [rad/s]."""
    note: Path | None = None
    """A file in which `open` leaves what it was given, and where it runs."""


def descriptor(*, checkpoints: bool = True, fields: frozenset[Field] | None = None) -> EngineDescriptor:
    capabilities = EngineCapabilities(
        materials=frozenset({Elastic, Fluid}),
        collider_shapes=frozenset({HalfSpace}),
        contact_conditions=frozenset({ContactCondition.SEPARATE}),
        drives=frozenset({Pinned, Driven, Impulse}),
        force_fields=frozenset({Wind}),
        output_fields=fields if fields is not None else frozenset(Field) - {Field.TRACER_POSITIONS},
        conserved=frozenset(),
        devices=("cpu",),
        precisions=(Precision.FLOAT64,),
        determinism=Determinism.BITWISE,
        checkpoints=checkpoints,
    )
    return EngineDescriptor(
        name="ballistic",
        summary="flies",
        contract_version=(1, 0),
        capabilities=capabilities,
        factory="flying_points:Ballistic",
        options=Options,
    )


class Ballistic:
    def __init__(self):
        self.opened = []

    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        self.opened.append((problem, accuracy, options, restart))
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
        return Session(problem, options, restart)


class Session:
    def __init__(self, problem, options, restart):
        self.problem, self.options = problem, options
        points = problem.points
        if restart is not None:
            whole = {"steps": (), "x": points.reference_positions.shape, "v": points.reference_positions.shape}
            restart = checkpoint_arrays(restart, whole, "ballistic")
            if not 0 <= restart["steps"] < MOST_STEPS:
                raise SceneError("ballistic: the checkpoint is of no time of a run")
        self.steps = 0 if restart is None else int(restart["steps"])
        start = (points.reference_positions, points.initial_velocities)
        self.positions, self.velocities = (
            np.array(array) for array in (start if restart is None else (restart["x"], restart["v"]))
        )
        self.time = self.steps / STEPS_PER_SECOND
        self.open = True

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()

    def close(self):
        if self.open and self.options.fault == "close":
            commit("segfault")
        self.open = False

    def advance_to(self, time):
        if not time >= self.time:
            raise ValueError(f"{time!r} is before {self.time!r}")
        step = 1 / STEPS_PER_SECOND
        gravity = np.asarray(self.problem.gravity)
        wanted = round(time * STEPS_PER_SECOND)
        count = wanted - self.steps
        while self.steps < wanted:
            self.steps += 1
            turn = np.cross([0.0, 0.0, self.options.spin * step], self.positions)
            self.velocities = self.velocities + step * gravity
            self.positions = self.positions + step * self.velocities + turn
        if self.options.pause:
            clock.sleep(self.options.pause)
        self.time = time
        status, warnings = Status.OK, ()
        match self._fault():
            case "" | "stretch" | "close" | "too few" | "late" | "half":
                pass
            case "no report":
                return None
            case "nan":
                self.positions[3] = np.nan
            case "gain":
                self.velocities = self.velocities * 3
            case "jump":
                self.positions[5] += 100.0
            case "limit":
                status, warnings = Status.SUBSTEP_LIMIT, ("too many substeps: coarsen the resolution",)
            case "boundless":
                step = math.inf
            case "idle":
                count, step = 0, math.inf
            case "warn":
                warnings = ("so so",)
            case "interrupt":
                # Once: whoever goes on from here is not interrupted again.
                if abs(time - self.options.fault_time) < 1e-9:
                    commit("interrupt")
            case fault:
                commit(fault)
        return StepReport(
            status=status, substep_count=count, smallest_substep=step, largest_substep=step, warnings=warnings
        )

    def _fault(self):
        """The fault that is due, or nothing."""
        return self.options.fault if self.time >= self.options.fault_time - 1e-9 else ""

    def read(self, fields):
        eye = np.tile(np.eye(3), (len(self.positions), 1, 1))
        if self._fault() == "stretch":
            eye *= 3.0
        tracers = self.problem.points.tracer_positions
        time, positions = self.time, self.positions.copy()
        match self._fault():
            case "too few":
                positions = positions[:-1]
            case "late":
                time -= 1.0
            case "half":
                positions = positions.astype(np.float16)
            case _:
                pass
        return PointState(
            time=time,
            positions=positions,
            velocities=self.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=eye if Field.DEFORMATION_GRADIENTS in fields else None,
            tracer_positions=(
                tracers + self.positions[0] if tracers is not None and Field.TRACER_POSITIONS in fields else None
            ),
        )

    def checkpoint(self):
        # With an array of each shape and kind that is easily lost on the way.
        return {
            "steps": np.array(self.steps),
            "x": self.positions,
            "v": self.velocities,
            "none": np.zeros((0, 3)),
            "on": np.True_,
        }
