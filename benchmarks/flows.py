"""Matter that flows: whether the step decides where it goes, and whether water keeps its volume.

    python benchmarks/flows.py [--engine warp-mpm] [--precision float32] [--only steps tank] [--cells 12 24]

"steps": a block of eight cells of each material that flows, let go on a floor, in substeps of 1, 1/2, 1/4 and 1/10 of
the stable bound: where its farthest percent is from the middle, its mean height, and the largest of the four over the
least. "tank": a column of water that breaks and sloshes in a closed tank of so many cells for 10 s, with each kind of
wall; of the last 2 s: the mean level over what it must be, and how much of that a swing as lively as this one may raise
it; then kinetic energy over what was set free, the emptiest and the fullest cell inside over the mean of all, and the
share of points more than a third of a cell behind a wall.
"""

import argparse

import numpy as np
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    EngineAccuracy,
    Field,
    Fluid,
    Foam,
    HalfSpace,
    Plasticine,
    PointProblem,
    Precision,
    Sand,
    Side,
    Snow,
)

ROUGH = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.6)
SMOOTH = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), contact=ContactCondition.SLIP)
FLOWING = {
    "sand": (Sand(density=1600, youngs_modulus=1e6, poissons_ratio=0.2), ROUGH, 0.0, 0.8),
    "water": (Fluid(density=1000, bulk_modulus=1e5), SMOOTH, 0.0, 0.3),
    "snow": (Snow(density=400, youngs_modulus=1.4e5, poissons_ratio=0.2), ROUGH, 0.1, 0.8),
    "plasticine": (
        Plasticine(density=1000, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=1e3),
        ROUGH,
        0.1,
        0.8,
    ),
    "foam": (
        Foam(density=1000, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=100, plastic_viscosity=50),
        ROUGH,
        0.1,
        0.8,
    ),
}
FRACTIONS = (1.0, 0.5, 0.25, 0.1)


def steps(subject):
    print(f"{'':11} fraction  {'  '.join(f'{each:5g}' for each in FRACTIONS)}  largest / least")
    spacing, cells = 0.04, 8
    for name, (material, floor, fall, until) in FLOWING.items():
        block = box_of_points((0.013, 0.021, fall), (cells,) * 3, spacing)
        problem = PointProblem(
            points=cloud_of([block], [(0, 0, 0)], spacing), materials=(material,), colliders=(floor,)
        )
        found = []
        for fraction in FRACTIONS:
            accuracy = EngineAccuracy(spacing=spacing, substep_fraction=fraction)
            (state,) = subject.states(problem, accuracy, [until])
            away = np.abs(state.positions[:, :2] - block[:, :2].mean(axis=0)).max(axis=1)
            found.append((np.quantile(away, 0.99), state.positions[:, 2].mean()))
        for what, values in zip(("front", "height"), np.array(found).T):
            shown = "  ".join(f"{each:.3f}" for each in values)
            print(f"{name:11} {what:8}  {shown}  {values.max() / values.min():.3f}", flush=True)


def walls(kind, width, depth, height):
    planes = [((0, 0, 0), (0, 0, 1)), ((0, 0, height), (0, 0, -1)), ((0, 0, 0), (1, 0, 0)), ((width, 0, 0), (-1, 0, 0))]
    planes += [((0, 0, 0), (0, 1, 0)), ((0, depth, 0), (0, -1, 0))]
    match kind:
        case "planes":
            return tuple(Collider(shape=HalfSpace(point=at, normal=normal)) for at, normal in planes)
        case "slip":
            contact = ContactCondition.SLIP
            return tuple(Collider(shape=HalfSpace(point=at, normal=way), contact=contact) for at, way in planes)
        case _:
            half = np.array([width, depth, height]) / 2
            return (Collider(shape=BoxShape(center=tuple(half), half_extents=tuple(half)), side=Side.INSIDE),)


def tank(subject, cells, kind, until=10.0):
    width, depth, level, top = 1.0, 0.25, 0.25, 1.0
    spacing = width / cells
    column = box_of_points((0, 0, 0), (cells // 2, cells // 4, cells // 2), spacing)
    problem = PointProblem(
        points=cloud_of([column], [(0, 0, 0)], spacing),
        materials=(Fluid(density=1000, bulk_modulus=1e6, viscosity=1.0),),
        colliders=walls(kind, width, depth, top),
    )
    times = np.linspace(until / 50, until, 50)
    states = list(subject.states(problem, EngineAccuracy(spacing=spacing), times, {Field.VELOCITIES}))
    height = np.mean([each.positions[:, 2].mean() for each in states[-10:]])
    swing = np.mean([(each.velocities**2).sum(axis=1).mean() for each in states[-10:]]) / (2 * 9.81)
    state = states[-1]
    places = state.positions
    edges = [np.linspace(0, extent, round(extent / spacing) + 1) for extent in (width, depth, level - 2 * spacing)]
    inside, _ = np.histogramdd(places, bins=edges)
    out = np.maximum(-places, places - [width, depth, top]).max(axis=1) > spacing / 3
    print(
        f"tank of {cells} cells, {kind:9}  level {2 * height / level:.3f}, swing {2 * swing / level:.3f}"
        f"  kinetic energy {swing / (column[:, 2].mean() - level / 2):.1e}"
        f"  cells {inside.min() / inside.mean():.2f} .. {inside.max() / inside.mean():.2f}  outside {out.mean():.4f}",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", default="float32", choices=[each.value for each in Precision])
    parser.add_argument("--only", nargs="*", default=["steps", "tank"], choices=["steps", "tank"])
    parser.add_argument("--cells", nargs="*", type=int, default=[12, 24], help="of the tank's width")
    arguments = parser.parse_args()
    subject = find_subject(arguments.engine, Precision(arguments.precision), "cpu")
    if "steps" in arguments.only:
        steps(subject)
    if "tank" in arguments.only:
        for cells in arguments.cells:
            for kind in ("planes", "container", "slip"):
                tank(subject, cells, kind)


if __name__ == "__main__":
    main()
