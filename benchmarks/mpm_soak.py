"""A million substeps in one session: does memory grow, energy rise, momentum drift?

A soft block of 512 points, two along every axis of a cell, flies, turns and sways without gravity or walls, in single
precision. Every twentieth of the way it is asked for its momentum, its energy (kinetic, and elastic from the
deformation gradients: what the affine velocities hold is left out) and the memory of the process. Some minutes an
engine. Ends with status 1 where

- resident memory grows by more than 1 % and 4 MB after the first twentieth,
- the energy of any sample exceeds that of the start by 2 %, or the smallest before it by 2 % of the start's,
- momentum drifts by more than 1e-9 of that of the start a substep: the limit of 1e-5 in ten thousand steps that single
  precision is held to everywhere, a hundred times as long.

    python benchmarks/mpm_soak.py [--engines warp-mpm taichi-mpm] [--substeps 1000000]
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from gasp_core.contract import Elastic, EngineAccuracy, Field, PointCloud, PointProblem, Precision, Status
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine

SPACING, PER_AXIS = 0.1, 8
SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
SAMPLES = 20


def block() -> PointProblem:
    """The block, its mean velocity 0.3 m/s, turning at a radian a second and stretching by a fifth of that."""
    cells = np.stack(np.meshgrid(*[np.arange(PER_AXIS)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    offset = np.random.default_rng(0).uniform(-0.3, 0.3, cells.shape)
    positions = (cells + 0.5 + offset) * (SPACING / 2)
    rates = np.array([[0.2, -1.0, 0.0], [1.0, -0.1, 0.0], [0.0, 0.0, -0.1]])
    count = len(positions)
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=(positions - positions.mean(axis=0)) @ rates.T + np.array([0.2, -0.2, 0.1]),
            reference_volumes=np.full(count, (SPACING / 2) ** 3),
            material_ids=np.zeros(count, dtype=int),
            body_ids=np.zeros(count, dtype=int),
        ),
        materials=(SOFT,),
        gravity=(0.0, 0.0, 0.0),
    )


def elastic_energy(deformation_gradients: NDArray[Any], volumes: NDArray[Any]) -> float:
    """Fixed-corotated: sum V (mu |F - R|^2 + lambda/2 (J - 1)^2) [J]; |F - R|^2 = sum (s - 1)^2."""
    stretches = np.linalg.svd(deformation_gradients, compute_uv=False)
    dilation = np.linalg.det(deformation_gradients) - 1
    density = SOFT.shear_modulus * ((stretches - 1) ** 2).sum(axis=1) + SOFT.lame_lambda / 2 * dilation**2
    return float(volumes @ density)


def soak(engine: str, substeps: int) -> bool:
    """Whether the engine holds out."""
    problem = block()
    process = psutil.Process()
    wanted = frozenset({Field.VELOCITIES, Field.DEFORMATION_GRADIENTS})
    print(f"{engine}: {'substeps':>10} {'memory MB':>10} {'energy':>10} {'momentum':>10} {'wall s':>8}")
    taken, begin = 0, time.perf_counter()
    memory: list[float] = []
    energies: list[float] = []
    drift = 0.0
    start: NDArray[Any] | None = None
    with open_engine(discover().offer(engine)).open(
        problem,
        device="cpu",
        precision=Precision.FLOAT32,
        seed=0,
        accuracy=EngineAccuracy(spacing=SPACING, substep_limit=2 * substeps),
    ) as session:
        # The first step tells how large they are here.
        probe = session.advance_to(1e-2)
        slice_length = substeps / SAMPLES * 1e-2 / probe.substep_count
        taken = probe.substep_count
        while True:
            state = session.read(wanted)
            momentum = problem.masses @ state.velocities
            kinetic = float(problem.masses @ (np.asarray(state.velocities) ** 2).sum(axis=1)) / 2
            energy = kinetic + elastic_energy(np.asarray(state.deformation_gradients), problem.points.reference_volumes)
            start = problem.masses @ problem.points.initial_velocities if start is None else start
            drift = max(drift, float(np.linalg.norm(momentum - start) / np.linalg.norm(start)))
            memory.append(process.memory_info().rss / 2**20)
            energies.append(energy)
            print(
                f"{'':>{len(engine) + 1}} {taken:>10,} {memory[-1]:>10.1f} {energy / energies[0]:>10.6f} {drift:>10.1e}"
                f" {time.perf_counter() - begin:>8.1f}",
                flush=True,
            )
            if taken >= substeps:
                break
            report = session.advance_to(session.time + slice_length)
            if report.status is not Status.OK:
                print(f"{engine} stopped: {report.warnings}")
                return False
            taken += report.substep_count
    growth = max(memory[1:]) - memory[1]
    risen = max(later - min(energies[: index + 1]) for index, later in enumerate(energies[1:])) / energies[0]
    print(f"{engine}: memory grew by {growth:.1f} MB, energy rose by {risen:.1e}, momentum drifted by {drift:.1e}\n")
    return growth <= max(4.0, 0.01 * memory[1]) and risen <= 0.02 and drift <= 1e-9 * taken


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["warp-mpm", "taichi-mpm"])
    parser.add_argument("--substeps", type=int, default=1_000_000)
    arguments = parser.parse_args()
    held = [soak(engine, arguments.substeps) for engine in arguments.engines]
    sys.exit(not all(held))


if __name__ == "__main__":
    main()
