"""An engine for tests: all matter falls as one rigid body that turns about the vertical through the origin.

x(t) = R(w t) x(0) + g t^2 / 2 is known at every time, so every frame's truth is.

Run as a program, ``falling.py OUT GATE``, it records a small toy into OUT; frame k waits until GATE/k exists.
"""

from __future__ import annotations

import sys
import time as clock
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gasp_core.contract import (
    BoxShape,
    ContactCondition,
    Determinism,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    HalfSpace,
    PointState,
    Precision,
    SphereShape,
    Status,
    StepReport,
)

TURN = 8.0
"""Angular velocity about +z [rad/s]."""


@dataclass(frozen=True)
class Options:
    gate: str = ""


def descriptor() -> EngineDescriptor:
    return EngineDescriptor(
        name="falling",
        summary="falls and turns",
        contract_version=(1, 0),
        capabilities=EngineCapabilities(
            materials=frozenset({Elastic}),
            collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
            contact_conditions=frozenset(ContactCondition),
            drives=frozenset(),
            force_fields=frozenset(),
            output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
            conserved=frozenset(),
            devices=("cpu",),
            precisions=(Precision.FLOAT64,),
            determinism=Determinism.BITWISE,
            checkpoints=True,
        ),
        factory="falling:Falling",
        options=Options,
    )


class Falling:
    def open(self, problem, *, device, precision, seed, accuracy, options, restart=None):
        return Session(problem, options, 0.0 if restart is None else float(restart["time"]))


class Session:
    def __init__(self, problem, options, time):
        self.start = problem.points.reference_positions
        self.gravity = np.asarray(problem.gravity)
        self.gate, self.time = options.gate, time

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()

    def close(self):
        pass

    def advance_to(self, time):
        while self.gate and not (Path(self.gate) / str(round(25 * time))).exists():
            clock.sleep(0.01)
        step, self.time = time - self.time, time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=step, largest_substep=step)

    def read(self, fields):
        return PointState(
            time=self.time,
            positions=positions(self.start, self.time, self.gravity),
            velocities=velocities(self.start, self.time, self.gravity) if Field.VELOCITIES in fields else None,
            deformation_gradients=None,
        )

    def checkpoint(self):
        return {"time": np.array(self.time)}


def rotation(time):
    c, s = np.cos(TURN * time), np.sin(TURN * time)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def positions(start, time, gravity):
    return start @ rotation(time).T + 0.5 * time**2 * gravity


def velocities(start, time, gravity):
    return np.cross([0.0, 0.0, TURN], start @ rotation(time).T) + time * gravity


def main(out, gate):
    from gasp_core import EngineChoice, RecordingChoice, Scene, SplatObject, simulate
    from gasp_core.toy import make_toy

    toy = SplatObject(
        name="toy",
        splat=make_toy(200),
        angular_velocity=(0, 0, TURN),
        material=Elastic(density=500, youngs_modulus=1e5, poissons_ratio=0.3),
    )
    scene = Scene(
        duration=5 / 25,
        frame_rate=25,
        objects=(toy,),
        engine=EngineChoice(name="falling", options={"gate": gate}),
        recording=RecordingChoice(checkpoint_frames=2),
    )
    simulate(scene, engine=(descriptor(), Falling()), out=out, progress=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
