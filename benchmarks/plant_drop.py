"""A real potted plant, 113,648 Gaussians, dropped on a floor: does it arrive, and what does it cost?

    GASP_DATA=... python benchmarks/plant_drop.py [--engine warp-mpm] [--resolution 64] [--out FOLDER]

The plant is 0.4 m tall, elastic, and falls 0.3 m on a floor with friction; 2 s at 25 frames a second; triangles, so
340,944 points.
"""

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

import gasp_core as gasp

DATA = Path(os.environ.get("GASP_DATA", "../shared/data"))
DROP = 0.3


def plant_scene(arguments):
    plant = gasp.SplatObject(
        name="plant",
        splat=DATA / "splats" / "plant.splat",
        up="-y",
        height=0.4,
        position=(0, 0, DROP),
        material=gasp.Elastic(density=400, youngs_modulus=arguments.youngs_modulus, poissons_ratio=0.3),
        floaters=gasp.Floaters(arguments.floaters),
        vertices=3,
        reduction=gasp.Reduction(mode="all"),
    )
    floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
    return gasp.Scene(
        duration=arguments.duration,
        frame_rate=25,
        objects=(plant,),
        colliders=(floor,),
        engine=gasp.EngineChoice(name=arguments.engine),
        accuracy=gasp.EngineAccuracy(resolution=arguments.resolution),
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--resolution", type=int, default=64)
    parser.add_argument("--youngs-modulus", type=float, default=2e5)
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--floaters", default="drop", choices=["drop", "still", "keep"])
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    scene = plant_scene(arguments)
    out = arguments.out or Path(tempfile.mkdtemp()) / "plant.gasp"

    # The first frame pays for reading, placing, opening and compiling.
    start = time.perf_counter()
    gasp.simulate(scene, out=out, frames=2)
    first, first_cpu = time.perf_counter() - start, time.process_time()
    start = time.perf_counter()
    run = gasp.simulate(scene, out=out, resume=True)
    wall, cpu = time.perf_counter() - start, time.process_time() - first_cpu

    frames = run.diagnostics()
    substeps = sum(frame["substeps"] for frame in frames[2:])
    count = len(run.start_points)
    spacing = run.header.spacing
    finite = all(np.isfinite(run.points(frame)).all() for frame in range(run.frame_count))
    last = run.points(run.frame_count - 1)
    low = np.percentile(last[:, 2], 1)
    excess = max((frame["kinetic_energy"] + frame["potential_energy"]) for frame in frames[1:])
    released = max(-frame["potential_energy"] for frame in frames[1:])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rows = {
        "run": f"{arguments.engine}, {count:,} points, spacing {1e3 * spacing:.2f} mm, {arguments.youngs_modulus:g} Pa",
        "status": f"{run.status}, {run.frame_count} frames, all finite: {finite}",
        "lowest percent of points at the end": f"{low / spacing:+.2f} cells from the floor",
        "largest kinetic - released energy": f"{excess:+.3g} J of {released:.3g} J released",
        "degenerate simplices in a frame": f"{max(frame['degenerate'] for frame in frames)} at most",
        "set-up and first frame, compiling too": f"{first:.1f} s",
        f"the other {run.frame_count - 2} frames": f"{wall:.1f} s wall, {cpu:.1f} s CPU, {substeps:,} substeps",
        "particle-substeps per wall second": f"{count * substeps / wall / 1e6:.2f} million, recording included",
        "particle-substeps per CPU second": f"{count * substeps / cpu / 1e6:.2f} million",
        "peak memory": f"{peak:,.0f} MB",
    }
    for name, figure in rows.items():
        print(f"{name:<40} {figure}")


if __name__ == "__main__":
    main()
