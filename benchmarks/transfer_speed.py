"""Time to carry many vertices by their cores, a frame: least squares over 8 neighbours, and one core's frame.

    python benchmarks/transfer_speed.py [--vertices 3000000] [--fraction 0.05] [--threads 2] [--repeats 20]

Random Gaussians on a sphere and inside it, in the order a file might have them; median over the repeats, kernels warm.
"""

import argparse
import time

import numba
import numpy as np

from gasp_core import Gaussians
from gasp_core.games import magnify, to_simplices
from gasp_core.reduction.transfer import Cores, LeastSquares, OneFrame


def cloud(count, rng):
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    scales = np.exp(rng.uniform(-7, -5, size=(count, 3)))
    return Gaussians(
        means=directions * rng.uniform(0.9, 1.0, size=(count, 1)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )


def median_time(function, repeats):
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.median(times)), float(np.min(times))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=3_000_000)
    parser.add_argument("--fraction", type=float, default=0.05)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=20)
    arguments = parser.parse_args()
    numba.set_num_threads(arguments.threads)
    rng = np.random.default_rng(0)
    print(
        f"{arguments.vertices:,} vertices, {arguments.threads} threads, median (least) of {arguments.repeats} repeats"
    )
    for corners in (3, 4):
        gaussians = cloud(arguments.vertices // corners, rng)
        chosen = gaussians.select(np.arange(round(arguments.fraction * len(gaussians))))
        points = magnify(to_simplices(chosen, 4), 0.01)[0]
        cores = Cores(points=points)
        labels = rng.integers(len(chosen), size=len(gaussians))
        rest = to_simplices(gaussians, corners)
        start = time.perf_counter()
        fit = LeastSquares.build(cores, gaussians.means, labels)
        built = time.perf_counter() - start
        displacements = 0.1 * np.sin(points)
        kept = sum(array.nbytes for array in fit.arrays().values())
        print(
            f"{len(gaussians):,} simplices of {corners} vertices, {len(cores):,} cores:"
            f" built in {built:.1f} s, {kept / len(gaussians):.0f} bytes a simplex"
        )
        for transfer in (fit, OneFrame(labels=labels)):
            median, least = median_time(lambda: transfer.carry(cores, rest, displacements), arguments.repeats)  # noqa: B023
            print(f"  {transfer.kind:<14} {1e3 * median:6.1f} ms ({1e3 * least:.1f} ms)")


if __name__ == "__main__":
    main()
