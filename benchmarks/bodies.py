"""Bodies that touch: friction, parting, a stack, and what contact costs.

    python benchmarks/bodies.py [--engine warp-mpm] [--precision float64] [--only sliding parting stack speed]

"sliding": a block started at 1 m/s on a slab that lies fast on the ground, of 8 and 16 cells, along the grid and at 24
degrees to it, and of points that are jittered by half their distance. The deceleration is that of the straight line
through its speed over the first 85 % of the closed form's way to rest, over mu g; the way to rest is over v^2/(2 mu g).
"parting": blocks that leave each other at 0.5 m/s, and that pass each other at 1 m/s with a gap.
"stack": three cubes for 5 s. "speed": point-substeps a second, all in one process and in turns: two blocks as one body,
far apart, and on each other, where about 6 % of their nodes are nodes of both.
"""

import argparse
import math
import time
from dataclasses import replace

import numpy as np
from gasp_conformance.clouds import box_of_points, cloud_of

from gasp_core.contract import (
    BodyContact,
    Collider,
    ContactCondition,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    PointProblem,
    Precision,
)
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine

GRAVITY, SPEED, STIFF = 9.81, 1.0, 2e6
GROUND = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
FIELDS = frozenset({Field.VELOCITIES})


def material(stiffness=STIFF):
    return Elastic(density=1000, youngs_modulus=stiffness, poissons_ratio=0.3)


class Engine:
    def __init__(self, name, precision):
        offer = discover().offer(name)
        self.engine, self.precision = open_engine(offer), Precision(precision)
        self.options = offer.descriptor.options() if offer.descriptor.options else None

    def session(self, problem, spacing, **accuracy):
        accuracy = EngineAccuracy(spacing=spacing, substep_limit=10**7, **accuracy)
        choices = {"device": "cpu", "precision": self.precision, "seed": 0, "options": self.options}
        return self.engine.open(problem, accuracy=accuracy, **choices)

    def states(self, problem, spacing, times):
        with self.session(problem, spacing) as session:
            for moment in times:
                session.advance_to(moment)
                yield session.read(FIELDS)


def on_a_slab(cells, friction, offset, degrees, jitter):
    """A block of 0.3 m on a slab, and the frame (3, 3) in which the slab lies along x."""
    spacing, angle = 0.3 / cells, math.radians(degrees)
    deep = max(3, cells // 2)
    slab = box_of_points((0, 0, 0), (cells * 5 // 2, 8, deep), spacing)
    block = box_of_points(
        ((cells // 2 + offset) * spacing, 2 * spacing, deep * spacing), (cells, 4, cells // 2), spacing
    )
    points = cloud_of([slab, block], [(0, 0, 0), (SPEED, 0, 0)], spacing)
    frame = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    places = (
        points.reference_positions + np.random.default_rng(0).uniform(-1, 1, (len(points), 3)) * jitter * spacing / 2
    )
    up = frame[:, 2]
    problem = PointProblem(
        points=replace(
            points, reference_positions=places @ frame.T, initial_velocities=points.initial_velocities @ frame.T
        ),
        materials=(material(),),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=tuple(up)), contact=ContactCondition.STICK),),
        body_contact=BodyContact(friction=friction),
        gravity=tuple(-GRAVITY * up),
    )
    return problem, spacing, frame


def sliding(engine):
    print("| cells | mu | | deceleration / mu g | way to rest / closed form |\n|---|---|---|---|---|")
    cases = [(cells, friction, 0.0, 0, 0.0) for cells in (8, 16) for friction in (0.3, 0.5)]
    cases += [(8, 0.5, 0.37, 0, 0.0), (8, 0.5, 0.1, 24, 0.0), (16, 0.5, 0.1, 24, 0.0), (16, 0.3, 0.1, 0, 0.5)]
    for cells, friction, offset, degrees, jitter in cases:
        problem, spacing, frame = on_a_slab(cells, friction, offset, degrees, jitter)
        own, stop = problem.points.body_ids == 1, SPEED / (friction * GRAVITY)
        start = problem.points.reference_positions[own].mean(axis=0)
        times = np.linspace(0, 2 * stop, 21)[1:]
        states = list(engine.states(problem, spacing, times))
        speeds = np.array([(state.velocities[own].mean(axis=0) @ frame)[0] for state in states])
        ways = np.array([((state.positions[own].mean(axis=0) - start) @ frame)[0] for state in states])
        early = times < 0.85 * stop
        slope = np.polyfit([0.0, *times[early]], [SPEED, *speeds[early]], 1)[0]
        what = f"{degrees} degrees, {offset:g} cells off, jitter {jitter:g}"
        rest = ways[len(ways) // 2 :].mean() / (SPEED * stop / 2)
        print(f"| {cells} | {friction} | {what} | {-slope / (friction * GRAVITY):.4f} | {rest:.4f} |", flush=True)


def parting(engine):
    print("| gap [cells] | velocity [m/s] | speed after / before | of the other |\n|---|---|---|---|")
    spacing = 0.05
    for gap, velocity in ((0, (0, 0, 0.5)), (0.25, (1, 0, 0)), (0.5, (1, 0, 0)), (1, (1, 0, 0)), (2, (1, 0, 0))):
        lower = box_of_points((0, 0, 0), (6, 6, 4), spacing)
        upper = box_of_points((0.018, 0, (4 + gap) * spacing), (6, 6, 4), spacing)
        points = cloud_of([lower, upper], [(0, 0, 0), velocity], spacing)
        problem = PointProblem(
            points=points, materials=(material(),), body_contact=BodyContact(friction=0.5), gravity=(0, 0, 0)
        )
        (state,) = engine.states(problem, spacing, [0.1])
        own, size = points.body_ids == 1, float(np.linalg.norm(velocity))
        after = state.velocities[own].mean(axis=0) @ velocity / size**2
        other = np.linalg.norm(state.velocities[~own].mean(axis=0)) / size
        print(f"| {gap:g} | {velocity} | {after:.6f} | {other:.1e} |", flush=True)


def stack(engine):
    print("| time [s] | creep / size | lowest surface [cells] | kinetic energy [J] |\n|---|---|---|---|")
    cells, side = 8, 0.1
    spacing = side / cells
    points = cloud_of(
        [box_of_points((0, 0, number * side), (cells,) * 3, spacing) for number in range(3)], [(0, 0, 0)] * 3, spacing
    )
    problem = PointProblem(
        points=points,
        materials=(material(),),
        colliders=(Collider(shape=GROUND, friction=0.5),),
        body_contact=BodyContact(friction=0.5),
    )
    for state in engine.states(problem, spacing, np.linspace(0, 5, 11)[1:]):
        moved = state.positions - points.reference_positions
        creep = max(np.linalg.norm(moved[points.body_ids == body, :2].mean(axis=0)) for body in range(3)) / side
        energy = problem.masses @ np.sum(state.velocities**2, axis=1) / 2
        lowest = state.positions[:, 2].min() / spacing - 0.25
        print(f"| {state.time:.1f} | {creep:.1e} | {lowest:.4f} | {energy:.1e} |", flush=True)


def blocks(cells, kind):
    spacing = 1 / cells
    gap = 8 * spacing if kind == "apart" else 0.0
    bodies = [box_of_points((0, 0, number * (1 + gap)), (cells,) * 3, spacing) for number in range(2)]
    points = cloud_of(bodies, [(0, 0, 0)] * 2, spacing)
    if kind == "one body":
        points = replace(points, body_ids=np.zeros(len(points)))
    colliders = (Collider(shape=GROUND),)
    contact = BodyContact(friction=0.5)
    return PointProblem(points=points, materials=(material(1e6),), colliders=colliders, body_contact=contact)


def speed(engine, cells, steps=40, rounds=8):
    step = 0.2 / cells / 40
    sessions = {}
    for kind in ("one body", "apart", "in contact"):
        problem = blocks(cells, kind)
        session = engine.session(problem, 1 / cells, substep=step)
        session.advance_to(5 * step)
        sessions[kind] = (session, len(problem.points))
    taken = {kind: [] for kind in sessions}
    for number in range(rounds):
        for kind, (session, _) in sessions.items():
            begin = time.perf_counter()
            session.advance_to((5 + steps * (number + 1)) * step)
            taken[kind].append(time.perf_counter() - begin)
    print("| two blocks | points | million point-substeps a second | over one body |\n|---|---|---|---|")
    rates = {kind: count * steps / min(taken[kind]) / 1e6 for kind, (_, count) in sessions.items()}
    for kind, (session, count) in sessions.items():
        print(f"| {kind} | {count} | {rates[kind]:.2f} | {rates[kind] / rates['one body']:.3f} |")
        session.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", default="float64")
    parser.add_argument("--cells", type=int, default=20, help="along a block, for speed")
    parser.add_argument("--only", nargs="+", default=["sliding", "parting", "stack", "speed"])
    chosen = parser.parse_args()
    engine = Engine(chosen.engine, chosen.precision)
    print(f"{chosen.engine}, {chosen.precision}")
    for name in chosen.only:
        print(f"\n{name}\n")
        if name == "speed":
            speed(engine, chosen.cells)
        else:
            {"sliding": sliding, "parting": parting, "stack": stack}[name](engine)


if __name__ == "__main__":
    main()
