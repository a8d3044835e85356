"""Speed of the MPM engines, ours and others': million point-substeps per second, per processor and by the clock.

One scene (`mpm/scene.py`): a cube of jittered points, eight a cell, fixed-corotated (or neo-Hookean), E = 1e5 Pa,
nu = 0.2, steps of 1e-4 s, on grids of 1/64 and 1/128 m. Every configuration runs in a process of its own and takes
bursts of substeps in random order, turn by turn, so that whatever else the machine does meets all alike; a row is the
median of its bursts. The first burst is not counted: it compiles. Everything a session of ours does is in the figure:
looking at every point every 20 substeps, guarding drift, sorting, inversion, a floor.

At the end the positions are compared with those of the first engine, in cells: the work has to be the same. Ours
differ from Genesis by the kernel of the stress (`benchmarks/stress_kernel.py`).

Genesis needs an environment of its own (4 GB):

    python3.11 -m venv genesis && genesis/bin/pip install torch==2.13.0 genesis-world==1.4.5
    python benchmarks/mpm_speed.py --genesis genesis/bin/python

The defaults take a few minutes; --all, with 3 million points, about an hour. A plot is written beside the table.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent / "mpm"
OURS = ("warp-mpm", "taichi-mpm")
SIZES = (30_000, 100_000, 300_000, 1_000_000, 3_000_000)
MOST = {64: 1_000_000, 128: 3_000_000}
"""Points that fit into the box of so many cells."""
PUBLISHED = """Not run here; others' figures for this scene on another machine, million point-substeps per CPU-second:
  taichi_elements .70-1.04, PhysGaussian's Warp engine .88-1.16 (both with an SVD a point and atomic additions)"""


@dataclass
class Runner:
    """A configuration in its process."""

    engine: str
    threads: int
    process: subprocess.Popen[str]
    first: dict[str, Any] = field(default_factory=dict)
    answers: list[dict[str, Any]] = field(default_factory=list)

    def ask(self, word: str) -> dict[str, Any]:
        """What it answers."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(word, file=self.process.stdin, flush=True)
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.engine} on {self.threads} thread(s) ended with status {self.process.wait()}")
        return json.loads(line)

    def rate(self, clock: str, substeps: int) -> list[float]:
        """Million point-substeps a second of every burst, by the "wall" or "cpu" clock."""
        return [answer["points"] * substeps / answer[clock] / 1e6 for answer in self.answers]


def measure(arguments: argparse.Namespace, cells: int, points: int) -> list[dict[str, Any]]:
    """A row for every engine and number of threads."""
    pythons = dict.fromkeys(arguments.engines, sys.executable)
    if arguments.genesis and points <= arguments.genesis_most:
        pythons["genesis"] = str(arguments.genesis)
    runners = []
    log = (arguments.out / "mpm_speed.log").open("a")
    for engine, python in pythons.items():
        for threads in arguments.threads:
            shape = [str(cells), str(points), str(threads), arguments.precision, arguments.material, "cpu"]
            command = [python, str(HERE / "worker.py"), engine, *shape]
            process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
            runner = Runner(engine, threads, process)
            runner.first = runner.ask(str(arguments.substeps))
            runners.append(runner)
    order = random.Random(0)
    for _ in range(arguments.bursts):
        for runner in order.sample(runners, len(runners)):
            runner.answers.append(runner.ask(str(arguments.substeps)))
    places = []
    with tempfile.TemporaryDirectory() as folder:
        for index, runner in enumerate(runners):
            runner.ask(f"{folder}/{index}.npy")
            places.append(np.load(f"{folder}/{index}.npy"))
            assert runner.process.stdin is not None
            runner.process.stdin.close()
            runner.process.wait()
    log.close()
    return [
        {
            "engine": runner.engine,
            "threads": runner.threads,
            "cells": cells,
            "points": runner.first["points"],
            "cpu": statistics.median(runner.rate("cpu", arguments.substeps)),
            "wall": statistics.median(runner.rate("wall", arguments.substeps)),
            "best": max(runner.rate("wall", arguments.substeps)),
            "start": runner.first["since_start"],
            "peak": max(answer["peak_bytes"] for answer in runner.answers) / 2**20,
            "apart": float(np.abs(place - places[0]).max()) * cells,
        }
        for runner, place in zip(runners, places, strict=True)
    ]


def show(rows: list[dict[str, Any]]) -> None:
    """The rows of one scene."""
    for row in rows:
        print(
            f"{row['cells']:>4}^3 {row['points']:>9,}  {row['engine']:<11} {row['threads']} "
            f"{row['cpu']:>10.2f} {row['wall']:>8.2f} {row['best']:>8.2f} {row['start']:>9.1f} {row['peak']:>8.0f}"
            f" {row['apart']:>10.1e}",
            flush=True,
        )


def summarise(rows: list[dict[str, Any]]) -> None:
    """What the rows say together: threads, how time grows with points, engine against engine."""
    wall = {(row["engine"], row["threads"], row["cells"], row["points"]): row["wall"] for row in rows}
    cpu = {(row["engine"], row["cells"], row["points"]): row["cpu"] for row in rows if row["threads"] == 1}
    print("\nTwo threads over one, by the clock:")
    for (engine, threads, cells, points), rate in wall.items():
        alone = wall.get((engine, 1, cells, points))
        if threads == 2 and alone:
            print(f"  {engine:<11} {cells}^3 {points:>9,}: {rate / alone:.2f}")
    print("Time a substep as a power of the number of points (one thread):")
    for engine, cells in dict.fromkeys((engine, cells) for engine, cells, _ in cpu):
        found = sorted((points, rate) for (name, grid, points), rate in cpu.items() if (name, grid) == (engine, cells))
        if len(found) > 1:
            points, rates = np.array(found).T
            exponent = np.polyfit(np.log(points), np.log(points / rates), 1)[0]
            print(f"  {engine:<11} {cells}^3, {points[0]:,.0f} to {points[-1]:,.0f} points: {exponent:.3f}")
    print("Times as fast as Genesis, a CPU-second (one thread):")
    for (engine, cells, points), rate in cpu.items():
        other = cpu.get(("genesis", cells, points))
        if engine != "genesis" and other:
            print(f"  {engine:<11} {cells}^3 {points:>9,}: {rate / other:.1f}")
    print("Times as fast as Genesis on two threads, by the clock:")
    for (engine, threads, cells, points), rate in wall.items():
        other = wall.get(("genesis", threads, cells, points))
        if engine != "genesis" and other and threads == 2:
            print(f"  {engine:<11} {cells}^3 {points:>9,}: {rate / other:.1f}")


def draw(rows: list[dict[str, Any]], path: Path, title: str) -> None:
    """Speed by the clock over the number of points, a line an engine, grid and number of threads."""
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    colours = {name: f"C{index}" for index, name in enumerate(dict.fromkeys(row["engine"] for row in rows))}
    for engine, threads, cells in dict.fromkeys((row["engine"], row["threads"], row["cells"]) for row in rows):
        line = [row for row in rows if (row["engine"], row["threads"], row["cells"]) == (engine, threads, cells)]
        axes.plot(
            [row["points"] for row in line],
            [row["wall"] for row in line],
            color=colours[engine],
            linestyle="-" if threads == 1 else "--",
            marker="o" if cells == 64 else "s",
            label=f"{engine}, {threads} thread{'s' * (threads > 1)}, {cells}³",
        )
    axes.set(xscale="log", yscale="log", xlabel="points", ylabel="million point-substeps per second", title=title)
    axes.grid(which="both", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=list(OURS))
    parser.add_argument("--genesis", type=Path, help="Python of an environment that has Genesis")
    parser.add_argument("--genesis-most", type=int, default=300_000, help="points above which Genesis is left out")
    parser.add_argument("--points", type=int, nargs="+", default=[100_000, 300_000])
    parser.add_argument("--cells", type=int, nargs="+", default=[64, 128])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--precision", choices=["float32", "float64"], default="float32")
    parser.add_argument("--material", choices=["elastic", "neo-hookean"], default="elastic")
    parser.add_argument("--bursts", type=int, default=7)
    parser.add_argument("--substeps", type=int, default=20, help="a burst")
    parser.add_argument("--all", action="store_true", help="30 thousand to 3 million points")
    parser.add_argument("--out", type=Path, default=Path("build"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    print(
        f"{arguments.material}, {arguments.precision}; million point-substeps a second, medians of {arguments.bursts}"
    )
    print(f"{'grid':>6} {'points':>9}  {'engine':<11} thr {'CPU-s':>8} {'wall':>8} {'best':>8} {'start s':>9}", end="")
    print(f" {'peak MB':>8} {'apart/dx':>10}")
    rows: list[dict[str, Any]] = []
    for cells in arguments.cells:
        for points in SIZES if arguments.all else arguments.points:
            if points <= MOST.get(cells, points):
                found = measure(arguments, cells, points)
                show(found)
                rows += found
    summarise(rows)
    if not arguments.genesis:
        print("Genesis was left out: --help says how to have it")
    print(PUBLISHED)
    path = arguments.out / "mpm_speed.png"
    draw(rows, path, f"{arguments.material}, {arguments.precision}")
    print(f"plot: {path}")


if __name__ == "__main__":
    main()
