"""What it costs that an engine runs in a process of its own: wall time a frame for a million points.

The engine does nothing: it shows the same arrays every time, so that all the time is that of the way. The same calls
within one process, where nothing is copied, stand beside it.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np

from gasp_core.contract import (
    Determinism,
    Elastic,
    EngineAccuracy,
    EngineCapabilities,
    EngineDescriptor,
    EngineSession,
    Field,
    PointCloud,
    PointEngine,
    PointProblem,
    PointState,
    Precision,
    Status,
    StepReport,
)
from gasp_core.engines.worker.engine import WorkerEngine, own_interpreter

POINTS = 1_000_000
FRAMES = 40
OUTPUTS = {
    "positions": frozenset({Field.POSITIONS}),
    "with velocities": frozenset({Field.POSITIONS, Field.VELOCITIES}),
    "with deformation gradients": frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}),
}


class StillEngine:
    def open(self, problem, **settings):
        return StillSession(problem.points)


class StillSession:
    def __init__(self, points):
        self.time = 0.0
        self._arrays = {
            Field.POSITIONS: np.array(points.reference_positions),
            Field.VELOCITIES: np.array(points.initial_velocities),
            Field.DEFORMATION_GRADIENTS: np.tile(np.eye(3), (len(points), 1, 1)),
        }

    def advance_to(self, time):
        self.time = time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=1.0, largest_substep=1.0)

    def read(self, fields):
        return PointState(time=self.time, **{field.value: self._arrays[field] for field in fields})

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()


DESCRIPTOR = EngineDescriptor(
    name="still",
    summary="does nothing",
    contract_version=(1, 0),
    capabilities=EngineCapabilities(
        materials=frozenset({Elastic}),
        collider_shapes=frozenset(),
        contact_conditions=frozenset(),
        drives=frozenset(),
        force_fields=frozenset(),
        output_fields=frozenset(Field),
        conserved=frozenset(),
        devices=("cpu",),
        precisions=(Precision.FLOAT64,),
        determinism=Determinism.BITWISE,
    ),
    factory="worker_round_trip:StillEngine",
)


def still_problem(count: int) -> PointProblem:
    positions = np.random.default_rng(0).random((count, 3))
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, 1.0 / count),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=points, materials=(Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3),))


def frame_times(session: EngineSession, fields: frozenset[Field]) -> list[float]:
    times: list[float] = []
    for frame in range(1, FRAMES + 1):
        begun = time.perf_counter()
        session.advance_to(session.time + frame)
        state = session.read(fields)
        times.append(1e3 * (time.perf_counter() - begun))
        assert len(state.positions) == POINTS
    return times


def opened(make: Callable[[], PointEngine], problem: PointProblem) -> EngineSession:
    return make().open(
        problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=EngineAccuracy(), options=None
    )


def main() -> None:
    problem = still_problem(POINTS)
    begun = time.perf_counter()
    apart = opened(lambda: WorkerEngine(DESCRIPTOR, own_interpreter(), ""), problem)
    print(f"{POINTS:,} points; a worker with them is open after {time.perf_counter() - begun:.2f} s")
    print(f"{'read':<28} {'MB':>5} {'ms a frame: least':>18} {'median':>7} {'90 %':>7} {'in one process':>15}")
    with apart, opened(StillEngine, problem) as here:
        for name, fields in OUTPUTS.items():
            times = frame_times(apart, fields)
            state = here.read(fields)
            size = sum(getattr(state, field.value).nbytes for field in fields) / 1e6
            median, tenth = statistics.median(times), statistics.quantiles(times, n=10)[-1]
            alone = statistics.median(frame_times(here, fields))
            print(f"{name:<28} {size:5.0f} {min(times):18.1f} {median:7.1f} {tenth:7.1f} {alone:15.3f}")


if __name__ == "__main__":
    sys.exit(main())
