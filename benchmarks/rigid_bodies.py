"""Rigid bodies against closed forms, and what they cost.

    python benchmarks/rigid_bodies.py [--engine warp-mpm] [--precision float64] [--only roll spin stack bounce float]

"roll": a ball and a cylinder go a metre down a slope; the way over that of the closed form, with the moment of inertia
of their points. "spin": a hundred turns of a tumbling block in 2e5 steps. "stack": three rigid cubes of four cells, and
a rigid one between soft ones, for 5 s. "bounce": the share of its speed with which a ball leaves a floor, and Newton's
cradle of three. "float": a cube of half the density of water in a tank of 16 and 32 cells: how deep it is in it at the
end of 0.6 s, over Archimedes', in water that gives way as the preset's does and five times as much. "cost": seconds a
second takes of 1, 4 and 16 rigid blocks on a floor, and how much longer a step of soft blocks takes beside a rigid one.
"""

import argparse
import itertools
import time

import numpy as np
from gasp_conformance import body_cases, rigid_cases
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject
from gasp_conformance.wall_cases import stiff_material

from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    Elastic,
    EngineAccuracy,
    Fluid,
    HalfSpace,
    PointProblem,
    Precision,
    Rigid,
    Side,
)

GROUND = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.5)


def roll(subject):
    print("rolling a metre: way / closed form")
    for shape in ("ball", "cylinder"):
        for slope, friction in ((0.1, 0.5), (0.3, 0.5), (0.6, 0.1)):
            found = rigid_cases.body_rolls(subject, shape, slope, friction)
            print(f"  {shape:9} slope {slope:.1f}  friction {friction:.1f}  {found.way:.4f}")


def spin(subject):
    change, energy, steps = rigid_cases.block_spins_on(subject, 100.0, 200_000)
    print(f"a hundred turns, {steps:,} steps: distances {change:.1e} of the size, energy {energy:.1e}")


def stack(subject):
    rigid, soft = Rigid(density=1000.0), stiff_material(subject)
    print("a stack of three, 5 s")
    for name, materials in {"rigid": [rigid] * 3, "soft, rigid, soft": [soft, rigid, soft]}.items():
        found = body_cases.blocks_stack(subject, 5.0, materials)
        print(
            f"  {name:18} creep {found.creep:.1e} of the size  sinking {found.sinking:.3f} cells"
            f"  kinetic energy, later / earlier {found.heating:.3f}"
        )


def bounce(subject):
    print("speed after / before")
    for restitution in (0.0, 0.5, 0.9, 1.0):
        print(f"  restitution {restitution:.1f}  {rigid_cases.body_bounces(subject, restitution).ratio:.4f}")
    found = rigid_cases.balls_hand_on(subject)
    print(f"  cradle: speeds {found.speeds.round(6).tolist()}, energy {found.energy:.6f}")


def floats(subject):
    print("a cube of half the density of water: how deep it is in it, over Archimedes'")
    side, width, depth, until = 0.2, 0.4, 0.25, 0.6
    for bulk_modulus, cells in itertools.product((2e5, 1e6), (16, 32)):
        spacing = width / cells
        middle = depth
        water = box_of_points((-width / 2, -width / 2, 0.0), (cells, cells, round(depth / spacing)), spacing)
        water = water[np.abs(water - [0, 0, middle]).max(axis=1) > side / 2]
        cube = box_of_points((-side / 2, -side / 2, middle - side / 2), (round(side / spacing),) * 3, spacing)
        tank = BoxShape(center=(0, 0, 0.5), half_extents=(width / 2, width / 2, 0.5))
        problem = PointProblem(
            points=cloud_of([water, cube], [(0, 0, 0)] * 2, spacing, range(2)),
            materials=(Fluid(density=1000, bulk_modulus=bulk_modulus, viscosity=1.0), Rigid(density=500)),
            colliders=(Collider(shape=tank, side=Side.INSIDE),),
            body_contact=BodyContact(),
        )
        *_, state = subject.states(problem, EngineAccuracy(spacing=spacing), np.linspace(0.1, until, 6))
        places, ids = state.positions, problem.points.body_ids
        bottom = places[ids == 1, 2].min() - spacing / 4
        aside = np.abs(places[:, :2]).max(axis=1) > side / 2 + 2 * spacing
        level = np.percentile(places[(ids == 0) & aside, 2], 99.5) + spacing / 4
        print(f"  {cells} cells, K = {bulk_modulus:.0e} Pa: {(level - bottom) / (side / 2):.3f}", flush=True)


def cost(subject):
    spacing = 0.05
    print("rigid blocks on a floor: seconds for one of theirs, and milliseconds a step")
    for count in (1, 4, 16):
        blocks = [box_of_points((0.3 * (n % 4), 0.3 * (n // 4), 0.0), (4, 4, 4), spacing) for n in range(count)]
        problem = PointProblem(
            points=cloud_of(blocks, [(0.5, 0, 0)] * count, spacing),
            materials=(Rigid(density=500),),
            colliders=(GROUND,),
        )
        begin, steps = time.perf_counter(), 0
        with subject.open(problem, EngineAccuracy(spacing=spacing), frozenset()) as session:
            session.advance_to(0.01)
            begin = time.perf_counter()
            steps = session.advance_to(1.01).substep_count
        spent = time.perf_counter() - begin
        print(f"  {count:2} blocks: {spent:.2f} s, {1e3 * spent / steps:.2f} ms")
    soft = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    below = box_of_points((0, 0, 0), (24, 24, 12), spacing)
    above = box_of_points((0.4, 0.4, 0.6), (8, 8, 8), spacing)
    print(f"a step of {len(below):,} soft points with a block of {len(above):,} on them: milliseconds")
    for name, materials in {"soft block": (soft, soft), "rigid block": (soft, Rigid(density=1000))}.items():
        cloud = cloud_of([below, above], [(0, 0, 0)] * 2, spacing, range(2))
        problem = PointProblem(points=cloud, materials=materials, colliders=(GROUND,))
        with subject.open(problem, EngineAccuracy(spacing=spacing), frozenset()) as session:
            session.advance_to(0.01)
            begin = time.perf_counter()
            steps = session.advance_to(0.11).substep_count
            print(f"  {name:12} {1e3 * (time.perf_counter() - begin) / steps:.2f}")


PARTS = {"roll": roll, "spin": spin, "stack": stack, "bounce": bounce, "float": floats, "cost": cost}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", choices=[one.value for one in Precision])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    chosen = parser.parse_args()
    engine = find_subject(chosen.engine, None if chosen.precision is None else Precision(chosen.precision), None)
    for part in chosen.only:
        PARTS[part](engine)
