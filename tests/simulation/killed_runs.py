"""Runs a scene again and again, each time in a forked process that is killed at a random moment.

Usage: killed_runs.py FOLDER COUNT SEED. A process of its own, so that forks start from a state without threads.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

# Slow to import, so once for all forks: numba's registries, and zarr.
import numba.core.cpu
import numba.np.ufunc.parallel
import scenery
import zarr.codecs
from flying_points import Ballistic, descriptor

import gasp_core

_WARM = (numba.core.cpu, numba.np.ufunc.parallel, zarr.codecs, gasp_core.simulate)


def main(folder: Path, count: int, seed: int) -> None:
    draw = random.Random(seed)
    for trial in range(count):
        path = folder / f"{trial}.gasp"
        # Every fifth trial is killed around the recording's own birth, the others at a frame.
        frame = draw.randrange(scenery.FRAMES - 2) if trial % 5 else -1
        child = os.fork()
        if child == 0:
            gasp_core.simulate(scenery.scene(), (descriptor(), Ballistic()), path, progress=False)
            os._exit(0)
        begun = f"{path.name}/commits/{frame:08d}/zarr.json" if frame >= 0 else f".{path.name}.*"
        while not (any(folder.glob(begun)) or (path.exists() and frame < 0)) and os.waitpid(child, os.WNOHANG) == (
            0,
            0,
        ):
            time.sleep(0.0005)
        time.sleep(draw.uniform(0, 0.06))
        try:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        except (ProcessLookupError, ChildProcessError):
            pass
        print(trial, frame, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
