"""Soft captures dropped on a floor, filled by points on finer and finer grids, and by every vertex: error and cost.

    GASP_DATA=... python benchmarks/volume_convergence.py [--only massa ...] [--grids 24 32 48 64] [--all 48]
                                                          [--variant drop|rest|held|thrown]
                                                          [--substep-fraction F] [--mass-damping A] [--out FOLDER]

Each run is a process of its own, whose processor time is that of the whole, splat and body read or found included. The
first table has the cost, the mass, and how far the object tilts; the second how far apart runs are, over all vertices
and frames, in percent of the diagonal, and what the best rigid fit of each frame leaves of it.

Variants tell what keeps runs apart: "drop", from 2 cm; "rest", put on the floor; "held", its lowest tenth pinned, so
that nothing bounces, slides or rocks; "thrown", on the floor with the velocity that the drop would have given it.
What the integrator damps grows with the number of substeps: a fraction tells how much of the motion it decides, and
damping of the material how much is left of that where matter comes to rest by itself.
"""

import argparse
import itertools
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from gasp_core import Recording

DATA = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute() / "splats"
GASP = str(Path(sys.executable).parent / "gasp")
FILES = {
    "angel": "statue-angel.sog",
    "massa": "statue-massa.sog",
    "peter": "statue-st-peter.sog",
    "skull": "skull.sog",
    "plant": "plant.splat",
}
HEIGHT = 0.4
VARIANTS = {"drop": (0.02, 0.0), "rest": (0.0, 0.0), "held": (0.0, 0.0), "thrown": (0.0, -((2 * 9.81 * 0.02) ** 0.5))}
"""Height of the lowest point [m] and upward velocity [m/s] at the start."""
PIN = f"""
[[drive]]
kind = "pinned"
region = {{ shape = "box", center = [0, 0, 0], half_extents = [9, 9, {HEIGHT / 10}] }}
"""


def scene_text(name, mode, cells, variant, youngs_modulus, duration, substep_fraction=None, mass_damping=0.0):
    fraction = "" if substep_fraction is None else f"substep_fraction = {substep_fraction}"
    height, velocity = VARIANTS[variant]
    numbers = f"density = 400, youngs_modulus = {youngs_modulus}, poissons_ratio = 0.3, mass_damping = {mass_damping}"
    return f"""collider = [{{ shape = "plane", height = 0.0, friction = 0.4 }}]
[scene]
duration = {duration}
frame_rate = 25
[[object]]
name = "{name}"
splat = "{DATA / FILES[name]}"
height = {HEIGHT}
position = [0, 0, {height}]
velocity = [0, 0, {velocity:.4f}]
material = {{ model = "elastic", {numbers} }}
reduction = {{ mode = "{mode}" }}
[accuracy]
resolution = {cells}
{fraction}
{PIN if variant == "held" else ""}"""


def carried_out(folder, name, mode, cells, arguments):
    """A run, and its processor time [s]."""
    path = folder / f"{name}-{mode}-{cells}-{arguments.variant}.gasp"
    scene = path.with_suffix(".toml")
    options = (arguments.variant, arguments.youngs_modulus, arguments.duration, arguments.substep_fraction)
    scene.write_text(scene_text(name, mode, cells, *options, arguments.mass_damping))
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    finished = subprocess.run(
        [GASP, "run", scene, "--out", path, "--overwrite"], capture_output=True, text=True, check=False
    )
    if finished.returncode:
        raise SystemExit(f"{scene}: {finished.stderr[-500:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Recording.open(path), cpu, time.perf_counter() - begin


def mass_of(recording):
    """[kg], from the scene: a recording keeps places alone."""
    from gasp_core.simulation.splat_sources import prepare

    return float(prepare(recording.scene).assembly.problem.masses.sum())


def turned(start, end):
    """The rotation (3, 3) that takes points (N, 3) about their mean nearest to others."""
    left, _, right = np.linalg.svd((start - start.mean(axis=0)).T @ (end - end.mean(axis=0)))
    return (left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right).T


def vertices(recording, frame):
    (own,) = recording.simplices(frame).values()
    return own.reshape(-1, 3)


def tilt(recording):
    """The largest angle and the last one [degrees] between the object's up and the world's."""
    start = vertices(recording, 0)[::7]
    angles = [
        np.degrees(np.arccos(np.clip(turned(start, vertices(recording, frame)[::7])[2, 2], -1, 1)))
        for frame in range(recording.frame_count)
    ]
    return max(angles), angles[-1]


def apart(one, other):
    """Root mean square over vertices and frames, whole and after the best rigid fit, in percent of the diagonal."""
    whole, shape = [], []
    for frame in range(one.frame_count):
        here, there = vertices(one, frame), vertices(other, frame)
        whole.append(np.mean(np.sum((here - there) ** 2, axis=1)))
        turn = turned(there, here)
        left = (there - there.mean(axis=0)) @ turn.T - (here - here.mean(axis=0))
        shape.append(np.mean(np.sum(left**2, axis=1)))
    diagonal = np.linalg.norm(np.ptp(vertices(one, 0), axis=0))
    return 100 * np.sqrt(np.mean(whole)) / diagonal, 100 * np.sqrt(np.mean(shape)) / diagonal


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=FILES, default=["angel", "massa", "peter", "skull"])
    parser.add_argument("--grids", nargs="*", type=int, default=[24, 32, 48, 64])
    parser.add_argument("--all", nargs="*", type=int, default=[], help="Grids for every vertex, as in the paper.")
    parser.add_argument("--variant", choices=VARIANTS, default="drop")
    parser.add_argument("--youngs-modulus", type=float, default=2e5)
    parser.add_argument("--mass-damping", type=float, default=0.0, help="Of the material, in 1/s.")
    parser.add_argument("--duration", type=float, default=1.0)
    parser.add_argument("--substep-fraction", type=float, help="Of the largest stable step; else the engine's own.")
    parser.add_argument("--out", type=Path, help="Where recordings are kept.")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    folder = arguments.out or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    for name in arguments.only:
        print(f"{name:8}{'mode':>8}{'cells':>7}{'points':>10}{'substeps':>10}{'CPU s':>8}{'wall s':>8}{'mass kg':>9}"
              f"{'tilt':>7}{'at end':>8}")  # fmt: skip
        runs = {}
        for mode, cells in [*(("volume", n) for n in arguments.grids), *(("all", n) for n in arguments.all)]:
            run, cpu, wall = carried_out(folder, name, mode, cells, arguments)
            runs[mode, cells] = run
            substeps = sum(run.diagnostics(frame)["substeps"] for frame in range(run.frame_count))
            most, last = tilt(run)
            print(f"{name:8}{mode:>8}{cells:7}{len(run.start_points):10,}{substeps:10,}{cpu:8.1f}{wall:8.1f}"
                  f"{mass_of(run):9.3f}{most:7.1f}{last:8.1f}", flush=True)  # fmt: skip
        filled = [key for key in runs if key[0] == "volume"]
        pairs = list(itertools.pairwise(filled))
        pairs += [(key, filled[-1]) for key in runs if filled and (key, filled[-1]) not in pairs and key != filled[-1]]
        for one, other in pairs:
            whole, shape = apart(runs[one], runs[other])
            print(f"{name:8}{one[0]:>8} {one[1]:3} - {other[0]} {other[1]:3}: {whole:6.2f} %, shape {shape:5.2f} %",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
