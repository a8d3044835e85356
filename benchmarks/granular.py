"""Sand against what is published of it: columns that collapse, in a channel and in the round, and slopes.

    python benchmarks/granular.py [--engine warp-mpm] [--precision float32] [--only columns round slopes]
                                  [--cells 16 32] [--ratios 0.5 1 2 4]

"columns": a column of width L and height a L behind a wall, on a rough floor between smooth walls, let go; sand of 31
degrees of repose, as in the experiments. How far it has run beyond L, over L, beside 1.2 a up to a = 2.3 and
1.9 a^(2/3) above (Lube et al. 2005, Phys. Rev. E 72, 041301); how high it stands at the wall, over L, beside a up to
a = 0.7 and a^(1/3) above (Lajeunesse et al. 2005, 10.1063/1.2087459); and its slope between a fifth and four fifths of
its height. "round": a quarter of a cylinder of radius R, how far it has run over R beside 1.24 a up to a = 1.7 and
1.6 a^(1/2) above (Lube et al. 2004, 10.1017/S0022112004009036). The edge is where sand is deeper than L / 32, two
grains or so in the experiments; cells are those across L. "slopes": on which slope a layer two cells deep and 16 long
would stay, by how fast it flows down one half as steep again; its ends, which nothing holds, make it faster, by up to
H / (2 L) of its weight.
"""

import argparse
import math
import time

import numpy as np
from gasp_conformance import sand_cases
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject

from gasp_core.contract import (
    Collider,
    ContactCondition,
    EngineAccuracy,
    FrictionCone,
    HalfSpace,
    PointProblem,
    Precision,
    Sand,
)

REPOSE = 31.0
WIDTH = 0.1
EDGE = WIDTH / 32
THICK = 3


def plane(point, normal, contact):
    return Collider(shape=HalfSpace(point=point, normal=normal), contact=contact)


def at_rest(subject, block, spacing, walls, height):
    """Where the points of a block (N, 3) are when it has come to rest, and how fast they still move over a fall."""
    material = Sand(density=1600, youngs_modulus=1e6, poissons_ratio=0.2, friction_angle=REPOSE)
    floor = plane((0, 0, 0), (0, 0, 1), ContactCondition.STICK)
    sides = [plane(point, normal, ContactCondition.SLIP) for point, normal in walls]
    problem = PointProblem(
        points=cloud_of([block], [(0, 0, 0)], spacing), materials=(material,), colliders=(floor, *sides)
    )
    # It is over after 3.3 times sqrt(H / g) (Lube et al. 2005).
    end = 5 * math.sqrt(height / sand_cases.GRAVITY)
    before, after = subject.states(problem, EngineAccuracy(spacing=spacing), [0.9 * end, end])
    speed = np.linalg.norm(after.positions - before.positions, axis=1).mean() / (0.1 * end)
    return after.positions, float(speed / math.sqrt(2 * sand_cases.GRAVITY * height))


def depths(away, spacing, areas):
    """Depth [m] of a deposit over bins of `spacing` by the way (N,) from the middle; `areas` are the bins' [m^2]."""
    counts = np.bincount((away / spacing).astype(int), minlength=len(areas))
    return counts[: len(areas)] * spacing**3 / 8 / areas


def run_beyond(depth, spacing):
    """Way of the edge beyond where it stood, over that."""
    last = np.flatnonzero(depth > EDGE).max()
    behind, before = depth[last], depth[last + 1] if last + 1 < len(depth) else 0.0
    return (last + 0.5 + (behind - EDGE) / (behind - before)) * spacing / WIDTH - 1


def slope_of(depth, spacing):
    top = depth[: max(2, len(depth) // 20)].max()
    part = (depth > 0.2 * top) & (depth < 0.8 * top)
    middles = (np.arange(len(depth)) + 0.5) * spacing
    return math.degrees(math.atan(-np.polyfit(middles[part], depth[part], 1)[0]))


def column(subject, ratio, cells):
    spacing = WIDTH / cells
    block = box_of_points((0, 0, 0), (cells, THICK, round(ratio * cells)), spacing)
    walls = [((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0, 1, 0)), ((0, THICK * spacing, 0), (0, -1, 0))]
    places, speed = at_rest(subject, block, spacing, walls, ratio * WIDTH)
    count = int(places[:, 0].max() / spacing) + 1
    depth = depths(np.maximum(places[:, 0], 0), spacing, np.full(count, THICK * spacing**2))
    run = run_beyond(depth, spacing)
    law = 1.2 * ratio if ratio < 2.3 else 1.9 * ratio ** (2 / 3)
    high = ratio if ratio < 0.7 else ratio ** (1 / 3)
    return (
        f"runs {run:.2f}, {law:.2f} by experiment: {run / law - 1:+.0%}   stands {depth[:3].max() / WIDTH:.2f},"
        f" {high:.2f}: {depth[:3].max() / WIDTH / high - 1:+.0%}   slope {slope_of(depth, spacing):.0f} degrees,"
        f" speed / fall {speed:.4f}"
    )


def cylinder(subject, ratio, cells):
    spacing = WIDTH / cells
    block = box_of_points((0, 0, 0), (cells, cells, round(ratio * cells)), spacing)
    block = block[np.hypot(block[:, 0], block[:, 1]) < WIDTH]
    places, speed = at_rest(subject, block, spacing, [((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0, 1, 0))], ratio * WIDTH)
    away = np.hypot(places[:, 0], places[:, 1])
    count = int(away.max() / spacing) + 1
    depth = depths(away, spacing, np.pi / 4 * np.diff((np.arange(count + 1) * spacing) ** 2))
    run = run_beyond(depth, spacing)
    law = 1.24 * ratio if ratio < 1.7 else 1.6 * ratio**0.5
    return (
        f"runs {run:.2f}, {law:.2f} by experiment: {run / law - 1:+.0%}   slope {slope_of(depth, spacing):.0f} degrees,"
        f" speed / fall {speed:.4f}"
    )


def flows_as(subject, cone, angle):
    """The slope [degrees] on which a layer would stay, by how it flows down one half as steep again."""
    material = Sand(density=1600, youngs_modulus=3e5, poissons_ratio=0.2, friction_angle=angle, cone=cone)
    friction = material.friction_slope / math.sqrt(3)
    slope = math.degrees(math.atan(1.5 * friction))
    share = sand_cases.layer_on_slope(subject, material, slope)
    return math.degrees(math.atan(1.5 * friction * (1 - share))), math.degrees(math.atan(friction))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", default="float32", choices=[each.value for each in Precision])
    parser.add_argument("--only", nargs="+", default=["columns", "round", "slopes"])
    parser.add_argument("--cells", nargs="+", type=int, default=[16, 32])
    parser.add_argument("--ratios", nargs="+", type=float, default=[0.5, 1, 2, 4])
    given = parser.parse_args()
    subject = find_subject(given.engine, Precision(given.precision), None)
    for name, run in (("columns", column), ("round", cylinder)):
        for ratio in given.ratios if name in given.only else []:
            for cells in given.cells if name == "columns" else [count // 2 for count in given.cells]:
                began = time.perf_counter()
                told = run(subject, ratio, cells)
                print(f"{name:7} a {ratio:3g} {cells:3} cells  {told}, {time.perf_counter() - began:.0f} s", flush=True)
    if "slopes" in given.only:
        for cone in FrictionCone:
            for angle in (15.0, 31.0, 45.0):
                found, expected = flows_as(subject, cone, angle)
                print(
                    f"{cone.value:20} {angle:g} degrees  flows as if a slope of {found:.1f} degrees held it,"
                    f" {expected:.1f} by its cone",
                    flush=True,
                )


if __name__ == "__main__":
    main()
