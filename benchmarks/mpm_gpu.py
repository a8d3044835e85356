"""Speed of the MPM engines on a GPU beside the CPU of the same machine, and how far apart they end.

The scene of `mpm_speed.py`: a cube of jittered points, eight a cell, fixed-corotated, steps of 1e-4 s, on the smallest
of the grids of 1/32 to 1/256 m that holds it. Every configuration runs in a process of its own, which has the machine
to itself; the first burst compiles and is not counted; a figure is the median of the bursts after it. Everything that
a session does is in it: sorting, looking at every point every 20 substeps, a floor.

    python benchmarks/mpm_gpu.py --run warp-mpm:cuda warp-mpm:cpu taichi-mpm:cuda
    python benchmarks/mpm_gpu.py --genesis genesis/bin/python --run warp-mpm:cuda genesis:cuda

At the end the positions are compared with those of the first configuration, in cells. Genesis needs an environment of
its own, see `mpm_speed.py`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent / "mpm"
GRIDS = (32, 64, 128, 256)
MARGIN = 10
"""Cells of a grid that hold no point of the cube, see `mpm/scene.py`."""


def grid_for(points: int) -> int:
    """Cells of the smallest grid that holds a cube of so many points."""
    return next(cells for cells in GRIDS if round(points ** (1 / 3)) <= 2 * (cells - MARGIN))


def measure(engine: str, device: str, points: int, arguments: argparse.Namespace, places: Path) -> dict[str, Any]:
    """A row: its bursts, and positions in a file."""
    python = str(arguments.genesis) if engine == "genesis" else sys.executable
    shape = [str(grid_for(points)), str(points), str(arguments.threads), arguments.precision, "elastic", device]
    command = [python, str(HERE / "worker.py"), engine, *shape]
    process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ask(word: str) -> dict[str, Any]:
        """What it answers; nothing once it has ended."""
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            print(word, file=process.stdin, flush=True)
        line = process.stdout.readline()
        return json.loads(line) if line else {}

    first = ask(str(arguments.substeps))
    answers = [ask(str(arguments.substeps)) for _ in range(arguments.bursts)]
    ask(str(places))
    with contextlib.suppress(BrokenPipeError):
        process.communicate()
    if not (first and all(answers)):
        return {}
    rates = [answer["points"] * arguments.substeps / answer["wall"] / 1e6 for answer in answers]
    return {"points": first["points"], "start": first["since_start"], "rates": rates}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", nargs="+", metavar="ENGINE:DEVICE", default=["warp-mpm:cuda", "warp-mpm:cpu"])
    parser.add_argument("--genesis", type=Path, help="Python of an environment that has Genesis")
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 100_000, 1_000_000, 10_000_000])
    parser.add_argument("--threads", type=int, default=0, help="of the CPU; 0 for as many as there are")
    parser.add_argument("--precision", choices=["float32", "float64"], default="float32")
    parser.add_argument("--bursts", type=int, default=7)
    parser.add_argument("--substeps", type=int, default=40, help="a burst")
    arguments = parser.parse_args()
    if arguments.genesis is None and any(name.startswith("genesis:") for name in arguments.run):
        parser.error("--genesis PYTHON says where Genesis is")
    print(f"{arguments.precision}; million point-substeps a second by the clock, of {arguments.bursts} bursts")
    print(f"{'grid':>6} {'points':>10}  {'engine':<18} {'median':>9} {'worst':>9} {'best':>9} {'start s':>8} apart/dx")
    for points in arguments.points:
        cells = grid_for(points)
        expected = None
        with tempfile.TemporaryDirectory() as folder:
            for index, name in enumerate(arguments.run):
                engine, device = name.split(":", 1)
                places = Path(folder) / f"{index}.npy"
                row = measure(engine, device, points, arguments, places)
                if not row:
                    print(f"{cells:>4}^3 {points:>10,}  {name:<18} did not run: see above", flush=True)
                    continue
                found = np.load(places)
                expected = found if expected is None else expected
                rates = row["rates"]
                print(
                    f"{cells:>4}^3 {row['points']:>10,}  {name:<18} {statistics.median(rates):>9.1f}"
                    f" {min(rates):>9.1f} {max(rates):>9.1f} {row['start']:>8.1f}"
                    f" {np.abs(found - expected).max() * cells:>8.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
