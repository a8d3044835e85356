"""What things cost in an MPM engine: tracers, guards, walls, precision, materials; each as a ratio to the plain run.

The plain run is 97,336 elastic points in single precision on one thread, with a floor, and everything that guards a
session. The others differ by one thing. All are open at once and take bursts of 20 substeps in random order; a figure
is the ratio of the medians of processor time.

The share of what cannot be left out - looking at every point after every 20 substeps, sorting, the detector that looks
at every frame - is timed by itself.

    python benchmarks/mpm_costs.py [--engine warp-mpm]
"""

from __future__ import annotations

import argparse
import random
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gasp_core.contract import (
    BoxShape,
    Collider,
    Domain,
    DomainPolicy,
    Elastic,
    EngineAccuracy,
    Field,
    Fluid,
    Foam,
    HalfSpace,
    Metal,
    NeoHookean,
    Plasticine,
    PointCloud,
    PointProblem,
    Precision,
    Sand,
    Snow,
    Status,
    Wind,
)
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.simulation.monitor import inspect, watch_over

sys.path.insert(0, str(Path(__file__).parent / "mpm"))
from scene import GRAVITY, STEP, jittered_cube, velocities_of

CELLS, SUBSTEPS = 64, 20
LAW = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.2}
FLOOR = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=0.4)
EVERYWHERE = BoxShape(center=(0.5, 0.5, 0.5), half_extents=(5.0, 5.0, 5.0))


def cube(points: int) -> PointProblem:
    """The plain run."""
    positions = jittered_cube(points, CELLS)
    count = len(positions)
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=velocities_of(positions),
            reference_volumes=np.full(count, 1 / (2 * CELLS) ** 3),
            material_ids=np.zeros(count, dtype=int),
            body_ids=np.zeros(count, dtype=int),
        ),
        materials=(Elastic(**LAW),),
        gravity=GRAVITY,
        colliders=(FLOOR,),
    )


def variants(plain: PointProblem) -> dict[str, PointProblem]:
    """The others, by name."""
    points = plain.points
    places = points.reference_positions + np.random.default_rng(1).uniform(-0.2, 0.2, (len(points), 3)) / CELLS
    soft = {"yield_stress": 2e3}
    materials = {
        "neo-Hookean": NeoHookean(**LAW),
        "nearly incompressible (nu .49)": Elastic(**{**LAW, "poissons_ratio": 0.49}),
        "sand": Sand(**LAW),
        "fluid": Fluid(density=1000.0, bulk_modulus=1e5),
        "snow": Snow(**LAW),
        "metal": Metal(**LAW, **soft),
        "plasticine": Plasticine(**LAW, **soft),
        "foam": Foam(**LAW, **soft, plastic_viscosity=100.0),
    }
    clamp = Domain(lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 1.0), policy=DomainPolicy.CLAMP)
    return {
        "as many tracers as points": replace(plain, points=replace(points, tracer_positions=places)),
        "without the floor": replace(plain, colliders=()),
        "four floors": replace(plain, colliders=(FLOOR,) * 4),
        "a wind everywhere": replace(
            plain, force_fields=(Wind(velocity=(1.0, 0.0, 0.0), drag=0.1, region=EVERYWHERE),)
        ),
        "a domain that clamps": replace(plain, domain=clamp),
        **{name: replace(plain, materials=(material,)) for name, material in materials.items()},
    }


def timed(work: Callable[[], Any]) -> float:
    """Processor time [s]."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--points", type=int, default=97_336)
    parser.add_argument("--bursts", type=int, default=9)
    arguments = parser.parse_args()
    registry = discover()
    engine, options = open_engine(registry.offer(arguments.engine)), registry.descriptor(arguments.engine).options

    def opened(problem: PointProblem, precision: Precision = Precision.FLOAT32) -> Any:
        accuracy = EngineAccuracy(spacing=1 / CELLS, substep=STEP, substep_limit=10**6)
        own = None if options is None else options(threads=1)
        return engine.open(problem, device="cpu", precision=precision, seed=0, accuracy=accuracy, options=own)

    plain = cube(arguments.points)
    sessions = {"plain": opened(plain), "double precision": opened(plain, Precision.FLOAT64)}
    sessions |= {name: opened(problem) for name, problem in variants(plain).items()}

    def burst(session: Any) -> float:
        report: Any = None

        def work() -> None:
            nonlocal report
            report = session.advance_to(session.time + SUBSTEPS * STEP)

        spent = timed(work)
        if report.status is not Status.OK or report.substep_count != SUBSTEPS:
            raise SystemExit(f"{arguments.engine}: {report}")
        return spent

    for session in sessions.values():
        burst(session)
    spent: dict[str, list[float]] = {name: [] for name in sessions}
    order = random.Random(0)
    for _ in range(arguments.bursts):
        for name in order.sample(list(sessions), len(sessions)):
            spent[name].append(burst(sessions[name]))
    medians = {name: statistics.median(times) for name, times in spent.items()}
    usual = medians["plain"]
    rate = len(plain.points) * SUBSTEPS / usual / 1e6
    print(f"{arguments.engine}, {len(plain.points):,} points: plain {rate:.2f} million point-substeps per CPU-second")
    for name, median in medians.items():
        print(f"  {name:<32} {median / usual:.2f}")
    print(f"  a tracer over a point            {medians['as many tracers as points'] / usual - 1:.2f}")
    cloud = sessions["plain"].held()
    looking = statistics.median(timed(cloud.survey) for _ in range(arguments.bursts))
    sorting = statistics.median(timed(cloud.sort) for _ in range(arguments.bursts))
    print(f"  of it, looking at every point    {looking / usual:.2f}")
    print(f"  a sort, in substeps              {sorting / usual * SUBSTEPS:.1f}")
    watch, state = watch_over(plain, 0.04), sessions["plain"].read(frozenset(Field) - {Field.TRACER_POSITIONS})
    watching = statistics.median(timed(lambda: inspect(watch, state, state)) for _ in range(arguments.bursts))
    print(f"  the detector on a frame, in substeps {watching / usual * SUBSTEPS:.1f}")


if __name__ == "__main__":
    main()
