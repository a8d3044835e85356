"""Time of T^-1 with quaternions and scales for a million Gaussians, over that of copying what it reads and writes.

python benchmarks/inverse_speed.py
"""

import time

import numba
import numpy as np

from gasp_core import games
from gasp_core.gaussians import Gaussians

COUNT, REPEATS = 1_000_000, 15


def seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def main():
    rng = np.random.default_rng(0)
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    print(f"{COUNT:,} Gaussians, {numba.get_num_threads()} threads, median of {REPEATS} interleaved runs")
    print(f"{'vertices':>8} {'inverse':<14} {'T^-1 [ms]':>10} {'copy [ms]':>10} {'ratio':>6}")
    for vertices in (3, 4):
        gaussians = Gaussians(
            means=rng.uniform(-1, 1, (COUNT, 3)),
            quaternions=rng.normal(size=(COUNT, 4)),
            scales=10 ** rng.uniform(-3, -1, (COUNT, 3)),
            opacities=np.ones(COUNT),
            harmonics=np.zeros((COUNT, 1, 3)),
        )
        simplices = games.to_simplices(gaussians, vertices) @ (np.eye(3) + 0.1 * rng.normal(size=(3, 3)))
        for inverse in ("exact", "gram_schmidt"):

            def invert(simplices=simplices, gaussians=gaussians, inverse=inverse):
                return games.from_simplices(simplices, reference=gaussians, covariance=inverse)

            result = invert()
            arrays = [simplices, gaussians.scales, result.means, result.quaternions, result.scales]
            times, copies = [], []
            for _ in range(REPEATS):
                times.append(seconds(invert))
                # Fresh memory each time, as the results of T^-1 are.
                copies.append(seconds(lambda arrays=arrays: [array.copy() for array in arrays]))
            took, copied = np.median(times), np.median(copies)
            print(f"{vertices:>8} {inverse:<14} {1e3 * took:>10.1f} {1e3 * copied:>10.1f} {took / copied:>6.2f}")


if __name__ == "__main__":
    main()
