"""Time to carry many vertices, a frame: by cores, least squares over 8 neighbours, or one core's frame; by the points
that fill a ball.

    python benchmarks/transfer_speed.py [--vertices 3000000] [--fraction 0.05] [--cells 32] [--threads 2] [--repeats 20]

Gaussians on a shell, in random order (as in a trained .ply) and along a Morton curve (as packed formats have them): in
random order the loop waits for the cores it reads. Wall time and the processors' time (of all threads; on a machine
with other work only that, over the threads, says what the wall time would be), median over the repeats, kernels warm.
"""

import argparse
import time

import numba
import numpy as np
from scipy.spatial import KDTree

from gasp_core import Gaussians
from gasp_core.games import magnify, to_simplices
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.reduction.transfer import Cores, LeastSquares, OneFrame


def shell(count, rng):
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Gaussians(
        means=directions * rng.uniform(0.9, 1.0, size=(count, 1)),
        quaternions=rng.normal(size=(count, 4)),
        scales=np.exp(rng.uniform(-7, -5, size=(count, 3))),
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )


def along_a_curve(means):
    """Order of positions in -1..1 along a Morton curve of 1024^3 cells."""
    cells = ((means + 1) * 511.5).astype(np.int64)
    codes = np.zeros(len(means), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(codes, kind="stable")


def median_times(function, repeats):
    function()
    times = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        function()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return 1e3 * np.median(times, axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=3_000_000)
    parser.add_argument("--fraction", type=float, default=0.05)
    parser.add_argument("--cells", type=int, default=32, help="Along the ball that is filled.")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=20)
    arguments = parser.parse_args()
    numba.set_num_threads(arguments.threads)
    print(f"{arguments.vertices:,} vertices, {arguments.threads} threads, median of {arguments.repeats}")
    for corners in (3, 4):
        scattered = shell(arguments.vertices // corners, np.random.default_rng(0))
        ordered = scattered.select(along_a_curve(scattered.means))
        for name, gaussians in {"random order": scattered, "Morton order": ordered}.items():
            chosen = gaussians.select(np.arange(0, len(gaussians), round(1 / arguments.fraction)))
            cores = Cores(points=magnify(to_simplices(chosen, 4), 0.01)[0])
            rest = to_simplices(gaussians, corners)
            labels = KDTree(cores.centres).query(gaussians.means)[1]
            start = time.process_time()
            fit = LeastSquares.build(cores, gaussians.means, labels)
            built = time.process_time() - start
            kept = sum(array.nbytes for array in fit.arrays().values()) / len(gaussians)
            displacements = 0.1 * np.sin(cores.points)
            frame = OneFrame(labels=labels)
            print(f"{len(gaussians):,} simplices of {corners} vertices, {len(cores):,} cores, {name}")
            print(f"  built in {built:.1f} s of processor time, {kept:.0f} bytes a simplex")
            for transfer in (fit, frame):
                wall, cpu = median_times(lambda: transfer.carry(cores, rest, displacements), arguments.repeats)  # noqa: B023
                print(f"  {transfer.kind:<14} {wall:6.1f} ms a frame, {cpu:6.1f} ms of processor time")
            filled(gaussians, rest, arguments)


def nowhere_open(rows, others):
    return np.zeros(len(rows), dtype=bool)


def filled(gaussians, rest, arguments):
    """The same vertices, carried by points two to a cell."""
    step = 1 / arguments.cells
    axis = np.arange(-1 + step / 2, 1, step)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[np.linalg.norm(points, axis=1) < 1]
    wall, cpu = time.perf_counter(), time.process_time()
    carrier = PointFrames.build(points, step, gaussians.means, gaussians.means, nowhere_open)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    kept = sum(array.nbytes for array in carrier.arrays().values()) / len(gaussians)
    print(f"  {len(points):,} points: built in {wall:.1f} s, {cpu:.1f} s of processor time, {kept:.0f} bytes a simplex")
    displacements = 0.1 * np.sin(points)
    wall, cpu = median_times(lambda: carrier.carry(rest, displacements), arguments.repeats)
    print(f"  {carrier.kind:<14} {wall:6.1f} ms a frame, {cpu:6.1f} ms of processor time")


if __name__ == "__main__":
    main()
