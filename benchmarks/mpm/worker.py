"""Times one engine in a process of its own: opens it once, then takes bursts of substeps when it is told to.

    python worker.py ENGINE CELLS POINTS THREADS PRECISION MATERIAL DEVICE

Answers a line of JSON to every line on standard input: the number of substeps of the next burst, or the name of a file
for the positions, in single precision. Whatever the engine prints goes to standard error.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scene import DENSITY, GRAVITY, POISSONS_RATIO, STEP, YOUNGS_MODULUS, jittered_cube, velocities_of

Burst = Callable[[int], None]
Read = Callable[[], Any]


def open_genesis(
    cells: int, points: int, threads: int, precision: str, material: str, device: str
) -> tuple[int, Burst, Read]:
    """Genesis; its scenes are stepped by a fixed number of substeps, that of the first burst."""
    os.environ["QD_NUM_THREADS"] = str(threads)
    import genesis as gs
    import torch

    backend = gs.cpu if device == "cpu" else gs.cuda
    gs.init(backend=backend, precision="32" if precision == "float32" else "64", logging_level="error", seed=0)
    positions = jittered_cube(points, cells)
    model = {"elastic": "corotation", "neo-hookean": "neohooken"}[material]
    scene: Any = None
    cube: Any = None

    def burst(substeps: int) -> None:
        nonlocal scene, cube
        if scene is None:
            scene = gs.Scene(
                sim_options=gs.options.SimOptions(dt=substeps * STEP, substeps=substeps, gravity=GRAVITY),
                mpm_options=gs.options.MPMOptions(
                    grid_density=cells, lower_bound=(0, 0, 0), upper_bound=(1, 1, 1), particle_size=0.5 / cells
                ),
                show_viewer=False,
            )
            cube = scene.add_entity(
                morph=gs.morphs.Nowhere(n_particles=len(positions)),
                material=gs.materials.MPM.Elastic(E=YOUNGS_MODULUS, nu=POISSONS_RATIO, rho=DENSITY, model=model),
                surface=gs.surfaces.Default(vis_mode="particle"),
            )
            scene.build()
            real = np.float32 if precision == "float32" else np.float64
            cube.set_particles_pos(torch.from_numpy(positions.astype(real)))
            cube.set_particles_vel(torch.from_numpy(velocities_of(positions).astype(real)))
            cube.set_particles_active(torch.ones(len(positions), dtype=torch.bool))
        scene.step(update_visualizer=False)
        if device != "cpu":
            torch.cuda.synchronize()

    return len(positions), burst, lambda: cube.get_particles_pos().cpu().numpy()


def open_ours(
    engine: str, cells: int, points: int, threads: int, precision: str, material: str, device: str
) -> tuple[int, Burst, Read]:
    """An engine of GASP, with a floor, and all that guards a session."""
    from gasp_core.contract import (
        Collider,
        Elastic,
        EngineAccuracy,
        HalfSpace,
        NeoHookean,
        PointCloud,
        PointProblem,
        Precision,
        Status,
    )
    from gasp_core.discovery.registry import discover
    from gasp_core.engines.opening import open_engine

    registry = discover()
    options = registry.descriptor(engine).options
    law = {"elastic": Elastic, "neo-hookean": NeoHookean}[material]
    positions = jittered_cube(points, cells)
    count = len(positions)
    problem = PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=velocities_of(positions),
            reference_volumes=np.full(count, 1 / (2 * cells) ** 3),
            material_ids=np.zeros(count, dtype=int),
            body_ids=np.zeros(count, dtype=int),
        ),
        materials=(law(density=DENSITY, youngs_modulus=YOUNGS_MODULUS, poissons_ratio=POISSONS_RATIO),),
        gravity=GRAVITY,
        colliders=(Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=0.4),),
    )
    session = open_engine(registry.offer(engine)).open(
        problem,
        device=device,
        precision=Precision(precision),
        seed=0,
        accuracy=EngineAccuracy(spacing=1 / cells, substep=STEP, substep_limit=10**6),
        options=None if options is None else options(threads=threads),
    )

    def burst(substeps: int) -> None:
        report = session.advance_to(session.time + substeps * STEP)
        if report.status is not Status.OK or report.substep_count != substeps:
            raise SystemExit(f"{engine}: {report}")

    return count, burst, lambda: session.read(frozenset()).positions


def main() -> None:
    # Engines print where they please; the answers go to the standard output that was.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    engine, cells, points, threads, precision, material, device = sys.argv[1:]
    shape = (int(cells), int(points), int(threads), precision, material, device)
    begin = time.perf_counter()
    count, burst, read = open_genesis(*shape) if engine == "genesis" else open_ours(engine, *shape)
    for line in sys.stdin:
        word = line.strip()
        if not word.isdigit():
            np.save(word, read().astype(np.float32))
            print(json.dumps({}), file=answers)
            continue
        wall, burden = time.perf_counter(), time.process_time()
        burst(int(word))
        answer = {
            "points": count,
            "wall": time.perf_counter() - wall,
            "cpu": time.process_time() - burden,
            "since_start": time.perf_counter() - begin,
            "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        }
        print(json.dumps(answer), file=answers)


if __name__ == "__main__":
    main()
