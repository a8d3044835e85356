"""What many runs cost beside themselves: on this machine, and by workers of Dask and of Ray on it.

Each run is a small toy that falls for .2 s. Printed are wall time, what of it the processors were busy with runs (their
processor time, start-up included, over wall time times processors), what a run takes longer in a sweep than its own
process did (wall time times runs at a time over runs, less the mean of theirs), and how much the memory of the process
that asked for them grew from a tenth of the runs on to the last.

    python benchmarks/sweeps.py [--runs 200] [--backends loky,dask,ray] [--jobs 2]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import psutil

from gasp_core.io import write_splat
from gasp_core.stepping.threads import processors
from gasp_core.studies.runs import Limits, chosen_backend
from gasp_core.studies.sweep import planned, settings_of, sweep, sweeping
from gasp_core.toy import make_toy

SCENE = """
[scene]
schema = 2
duration = 0.2
frame_rate = 25

[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
height = 0.3
position = [0, 0, 0.05]
material = { model = "elastic", density = 500, youngs_modulus = 3e4, poissons_ratio = 0.3 }

[[collider]]
shape = "plane"
height = 0
contact = "separate"

[engine]
name = "warp-mpm"

[accuracy]
resolution = 16
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--backends", default="loky,dask,ray")
    parser.add_argument("--jobs", type=int, default=processors())
    arguments = parser.parse_args()
    print(f"{arguments.runs} runs, {arguments.jobs} at a time, {processors()} processors")
    print("backend    wall s   a run s   beside it s   busy   driver grew MB   complete")
    for name in arguments.backends.split(","):
        print(row(name, arguments.runs, arguments.jobs), flush=True)


def row(name: str, runs: int, jobs: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.toml"
        scene.write_text(SCENE)
        write_splat(scene.parent / "toy.ply", make_toy(1_000))
        moduli = ",".join(f"{1e4 * (1 + 9 * k / runs):.1f}" for k in range(runs))
        plan = planned(scene, settings_of([f"object.toy.material.youngs_modulus={moduli}"]))
        # The first run compiles what has not been compiled on this machine yet.
        sweep(plan[:1], Path(folder) / "first", progress=False)
        memory: list[int] = []
        kept = sweeping._keep

        def watched(*given: object) -> None:
            kept(*given)
            memory.append(psutil.Process().memory_info().rss)

        sweeping._keep = watched
        begin = time.perf_counter()
        limits = Limits(threads=max(1, processors() // jobs))
        backend = chosen_backend(name, at_once=jobs)
        found = sweep(plan, Path(folder) / "out", backend=backend, limits=limits, progress=False)
        wall = time.perf_counter() - begin
        sweeping._keep = kept
    own = sum(each.columns["wall_seconds"] for each in found.rows) / runs
    busy = sum(each.columns["cpu_seconds"] for each in found.rows) / (wall * min(jobs, processors()))
    beside = wall * jobs / runs - own
    grown = (memory[-1] - memory[len(memory) // 10]) / 1e6
    done = len(found.completed)
    return f"{name:8}{wall:9.1f}{own:10.2f}{beside:14.2f}{busy:7.2f}{grown:17.1f}{done:11d}"


if __name__ == "__main__":
    main()
