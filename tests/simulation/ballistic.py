"""An engine for tests: every point flies by itself, in small steps whose rounding depends on all steps before."""

from __future__ import annotations

import time as clock
from dataclasses import dataclass

import numpy as np

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

STEPS_PER_SECOND = 1000


@dataclass(frozen=True)
class Options:
    fault: str = ""
    fault_time: float = 0.1
    pause: float = 0.0
    spin: float = 0.0


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
        factory="ballistic:Ballistic",
        options=Options,
    )


class Ballistic:
    def __init__(self):
        self.opened = []

    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        self.opened.append((problem, accuracy, options, restart))
        return Session(problem, options, restart)


class Session:
    def __init__(self, problem, options, restart):
        self.problem, self.options = problem, options
        self.steps = 0 if restart is None else int(restart["steps"])
        points = problem.points
        start = (points.reference_positions, points.initial_velocities)
        self.positions, self.velocities = (
            np.array(array) for array in (start if restart is None else (restart["x"], restart["v"]))
        )
        self.time = self.steps / STEPS_PER_SECOND

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()

    def close(self):
        pass

    def advance_to(self, time):
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
        fault = self.options.fault if time >= self.options.fault_time - 1e-9 else ""
        if fault == "nan":
            self.positions[3] = np.nan
        elif fault == "gain":
            self.velocities = self.velocities * 3
        elif fault == "jump":
            self.positions[5] += 100.0
        elif fault == "limit":
            return StepReport(
                status=Status.SUBSTEP_LIMIT,
                substep_count=count,
                smallest_substep=step,
                largest_substep=step,
                warnings=("too many substeps: coarsen the resolution",),
            )
        elif fault == "interrupt" and abs(time - self.options.fault_time) < 1e-9:
            import os
            import signal

            os.kill(os.getpid(), signal.SIGINT)
        elif fault == "crash":
            raise ZeroDivisionError("the engine fell over")
        return StepReport(status=Status.OK, substep_count=count, smallest_substep=step, largest_substep=step)

    def read(self, fields):
        eye = np.tile(np.eye(3), (len(self.positions), 1, 1))
        if self.options.fault == "stretch" and self.time >= self.options.fault_time - 1e-9:
            eye *= 3.0
        return PointState(
            time=self.time,
            positions=self.positions.copy(),
            velocities=self.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=eye if Field.DEFORMATION_GRADIENTS in fields else None,
        )

    def checkpoint(self):
        return {"steps": np.array(self.steps), "x": self.positions, "v": self.velocities, "none": np.zeros((0, 3))}
