"""Speed of the Taichi engine: million point-substeps per second, wall clock and per CPU-second.

The scene of the comparison between engines: a jittered cube of 97,336 points, 8 a cell, fixed-corotated, E = 1e5 Pa,
nu = 0.2, steps of 1e-4 s, in the space of a grid of 64^3. Compilation is timed apart. Everything a session does is
in the figure: choosing steps, guarding drift, sorting, forcing.

    python benchmarks/taichi_speed.py [--points-per-axis 46] [--cells 64] [--material elastic] [--precision float32]
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np

from gasp_core.engine.contract import EngineAccuracy, PointCloud, PointProblem, Precision, Status
from gasp_core.engine.forcing import Collider
from gasp_core.engine.materials import Elastic, Fluid, NeoHookean, Sand
from gasp_core.engine.shapes import HalfSpace

SPACING = 1 / 64
STEP = 1e-4
MATERIALS = {
    "elastic": Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.2),
    "neo-hookean": NeoHookean(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.2),
    "sand": Sand(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.2),
    "fluid": Fluid(density=1000.0, bulk_modulus=1e5),
}


def jittered_cube(per_axis: int, material: str, spacing: float = SPACING) -> PointProblem:
    """`per_axis`^3 points, two along every axis of a cell, above a floor they reach during the run."""
    cells = np.stack(np.meshgrid(*[np.arange(per_axis)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    offset = np.random.default_rng(0).uniform(-0.3, 0.3, cells.shape)
    count = len(cells)
    return PointProblem(
        points=PointCloud(
            reference_positions=((cells + 0.5 + offset) / 2 + 2) * spacing,
            initial_velocities=np.broadcast_to([0.0, 0.0, -1.0], cells.shape).copy(),
            reference_volumes=np.full(count, (spacing / 2) ** 3),
            material_ids=np.zeros(count, dtype=int),
            body_ids=np.zeros(count, dtype=int),
        ),
        materials=(MATERIALS[material],),
        colliders=(Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=0.4),),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points-per-axis", type=int, default=46)
    parser.add_argument("--cells", type=int, default=64, help="cells a metre")
    parser.add_argument("--material", choices=MATERIALS, default="elastic")
    parser.add_argument("--precision", choices=[precision.value for precision in Precision], default="float32")
    parser.add_argument("--threads", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--substeps", type=int, default=60, help="a repeat")
    arguments = parser.parse_args()

    begin = time.perf_counter()
    from gasp_mpm_host.options import ThreadOptions
    from gasp_taichi_mpm.engine import TaichiMpm

    print(f"import {time.perf_counter() - begin:.2f} s")
    spacing = 1 / arguments.cells
    problem = jittered_cube(arguments.points_per_axis, arguments.material, spacing)
    count = len(problem.points)
    sessions = {}
    for threads in arguments.threads:
        begin = time.perf_counter()
        session = TaichiMpm().open(
            problem,
            precision=Precision(arguments.precision),
            accuracy=EngineAccuracy(spacing=spacing, substep=STEP, substep_limit=10**6),
            options=ThreadOptions(threads=threads),
        )
        opened = time.perf_counter() - begin
        begin = time.perf_counter()
        session.advance_to(STEP)
        print(f"{threads} thread(s): open {opened:.2f} s, first step {time.perf_counter() - begin:.2f} s")
        sessions[threads] = session
    walls: dict[int, list[float]] = {threads: [] for threads in sessions}
    burdens: dict[int, list[float]] = {threads: [] for threads in sessions}
    for _ in range(arguments.repeats):
        # Interleaved: whatever else the machine does meets every configuration alike.
        for threads, session in sessions.items():
            wall, burden = time.perf_counter(), time.process_time()
            report = session.advance_to(session.time + arguments.substeps * STEP)
            if report.status is not Status.OK:
                raise SystemExit(f"stopped: {report.warnings}")
            work = count * report.substep_count / 1e6
            walls[threads].append(work / (time.perf_counter() - wall))
            burdens[threads].append(work / (time.process_time() - burden))
    print(f"{count:,} points, {arguments.material}, {arguments.precision}; million point-substeps per second:")
    for threads in sessions:
        wall, burden = walls[threads], burdens[threads]
        print(
            f"{threads} thread(s): wall median {statistics.median(wall):.2f} (best {max(wall):.2f}),"
            f" per CPU-second median {statistics.median(burden):.2f} (best {max(burden):.2f})"
        )


if __name__ == "__main__":
    main()
