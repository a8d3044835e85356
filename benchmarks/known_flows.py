"""Flows with known answers: viscous ones between plates, a still tank, a breaking dam.

    python benchmarks/known_flows.py [--engine warp-mpm] [--precision float32] [--cells 4 8 16]
                                     [--only couette poiseuille still dam]

"couette": a slab of fluid between two plates, one of which glides; the velocity across the gap at its middle, root
mean square off the straight line, over the plate's. "poiseuille": the same slab under a force along the plates, off
the parabola, over its peak. Both after a time H^2 / nu, in which the slab is sheared by a third of the gap. "still": a
tank, its pressure off rho g depth over that at the bottom, cell by cell, and how far its points creep in as long a time
as it had to settle, over its depth. Cells are those of the gap or the depth; orders are between successive ones.

"dam": a column of water twice as high as wide, let go on a floor: its front over its width, beside what Martin and
Moyce 1952 measured (10.1098/rsta.1952.0006, tables 2 and 6: n^2 = 2, a = 2.25 in), at 8, 16, 32 cells of its width.
"""

import argparse

import numpy as np
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject

from gasp_core.contract import (
    Collider,
    ContactCondition,
    EngineAccuracy,
    Field,
    Fluid,
    HalfSpace,
    PointProblem,
    Precision,
    SteadyMotion,
    Wind,
)

GAP, DENSITY, VISCOSITY = 0.1, 1000.0, 1.0
SHEARED = 0.3
SOUNDS = (60, 400)
"""In the fluid, over the fastest flow: what is stiffer than it need be loses more to the grid."""
TIMES = [0.41, 0.84, 1.19, 1.43, 1.63, 1.83, 1.98, 2.20, 2.32, 2.51, 2.65, 2.83, 2.98, 3.11, 3.33]
FRONTS = [1.11, 1.22, 1.44, 1.67, 1.89, 2.11, 2.33, 2.56, 2.78, 3.00, 3.22, 3.44, 3.67, 3.89, 4.11]


def plane(point, normal, contact=ContactCondition.SLIP, velocity=None):
    motion = None if velocity is None else SteadyMotion(velocity=velocity)
    return Collider(shape=HalfSpace(point=point, normal=normal), contact=contact, motion=motion)


def between_plates(subject, cells, speed, force, sound):
    """Heights and velocities of the points in the middle of a slab, and the exact profile at them."""
    spacing, length, depth = GAP / cells, 4 * GAP, 2
    slab = box_of_points((0.0, 0.0, 0.0), (4 * cells, depth, cells), spacing)
    stick = ContactCondition.STICK
    problem = PointProblem(
        points=cloud_of([slab], [np.zeros(3)], spacing),
        materials=(Fluid(density=DENSITY, bulk_modulus=DENSITY * sound**2, viscosity=VISCOSITY),),
        colliders=(
            plane((0, 0, 0), (0, 0, 1), stick),
            plane((0, 0, GAP), (0, 0, -1), stick, (speed, 0.0, 0.0) if speed else None),
            plane((0, 0, 0), (0, 1, 0)),
            plane((0, depth * spacing, 0), (0, -1, 0)),
        ),
        gravity=(force, 0.0, 0.0),
    )
    duration = GAP**2 * DENSITY / VISCOSITY
    accuracy = EngineAccuracy(spacing=spacing, substep_limit=1_000_000)
    (state,) = subject.states(problem, accuracy, [duration], {Field.VELOCITIES})
    middle = np.abs(state.positions[:, 0] - state.positions[:, 0].mean()) < length / 8
    z = state.positions[middle, 2]
    exact = speed * z / GAP + force * DENSITY / (2 * VISCOSITY) * z * (GAP - z)
    return state.velocities[middle, 0], exact


def plates(subject, cells, name):
    fastest = SHEARED * VISCOSITY / DENSITY / GAP
    speed = fastest if name == "couette" else 0.0
    force = 0.0 if name == "couette" else 8 * fastest * VISCOSITY / DENSITY / GAP**2
    for ratio in SOUNDS:
        errors = []
        for count in cells:
            found, exact = between_plates(subject, count, speed, force, ratio * fastest)
            errors.append(np.sqrt(np.mean((found - exact) ** 2)) / np.abs(exact).max())
        shown = "  ".join(f"{count}: {error:.4f}" for count, error in zip(cells, errors))
        print(f"{name:11} sound {ratio:3} times as fast  {shown}  orders {orders(cells, errors)}", flush=True)


def orders(cells, errors):
    rates = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(np.array(cells[1:]) / cells[:-1])
    return " ".join(f"{rate:.1f}" for rate in rates)


def still(subject, cells):
    depth = 0.25
    profiles, creeps = [], []
    for count in cells:
        spacing = depth / count
        water = box_of_points((0.0, 0.0, 0.0), (count, 4, count), spacing)
        material = Fluid(density=DENSITY, bulk_modulus=2e5, viscosity=1.0)
        problem = PointProblem(
            points=cloud_of([water], [np.zeros(3)], spacing),
            materials=(material,),
            colliders=(
                plane((0, 0, 0), (0, 0, 1)),
                plane((0, 0, 0), (1, 0, 0)),
                plane((depth, 0, 0), (-1, 0, 0)),
                plane((0, 0, 0), (0, 1, 0)),
                plane((0, 4 * spacing, 0), (0, -1, 0)),
            ),
            gravity=(0.0, 0.0, -9.81),
            # Set down at once it would ring for a minute; thick air takes that away, and ends.
            force_fields=(Wind(drag=10.0, end=4.0),),
        )
        times = np.concatenate([[5.0], np.linspace(9.0, 10.0, 11)])
        fields = {Field.DEFORMATION_GRADIENTS}
        first, *last = subject.states(problem, EngineAccuracy(spacing=spacing), times, fields)
        heights = np.concatenate([state.positions[:, 2] for state in last])
        ratios = np.concatenate([np.linalg.det(state.deformation_gradients) for state in last])
        pressure = np.maximum(0.0, material.bulk_modulus / 7 * (ratios**-7 - 1))
        edges = np.linspace(0, depth, count + 1)[:-1]
        cell = np.digitize(heights, edges) - 1
        means = np.array([pressure[cell == number].mean() for number in range(count)])
        places = np.array([heights[cell == number].mean() for number in range(count)])
        top = 2 * last[-1].positions[:, 2].mean()
        profiles.append(np.sqrt(np.mean((means / (DENSITY * 9.81 * depth) - (top - places) / depth) ** 2)))
        moved = last[-1].positions - first.positions
        creeps.append(np.sqrt((moved**2).sum(axis=1).mean()) / depth)
    rows = zip(cells, profiles, creeps)
    shown = "  ".join(f"{count}: {error:.4f}, creep {creep:.4f}" for count, error, creep in rows)
    print(f"still       {shown}", flush=True)


def dam(subject, cells):
    width = 2.25 * 0.0254
    spacing = width / cells
    column = box_of_points((0.0, 0.0, 0.0), (cells, 4, 2 * cells), spacing)
    problem = PointProblem(
        points=cloud_of([column], [np.zeros(3)], spacing),
        materials=(Fluid(density=DENSITY, bulk_modulus=3e5, viscosity=1e-3),),
        colliders=(
            plane((0, 0, 0), (0, 0, 1)),
            plane((0, 0, 0), (1, 0, 0)),
            plane((0, 0, 0), (0, 1, 0)),
            plane((0, 4 * spacing, 0), (0, -1, 0)),
        ),
        gravity=(0.0, 0.0, -9.81),
    )
    times = np.array(TIMES) * np.sqrt(width / (2 * 9.81))
    accuracy = EngineAccuracy(spacing=spacing, substep_limit=100_000)
    fronts = [np.quantile(state.positions[:, 0], 0.995) / width for state in subject.states(problem, accuracy, times)]
    off = np.abs(np.array(fronts) - FRONTS)
    allowed = 0.1 * np.array(FRONTS) + 2 / cells
    shown = " ".join(f"{front:.2f}" for front in fronts[1::2])
    print(
        f"dam {cells:3}     {shown}   worst {(off / FRONTS).max():.3f}, of what 10 % + 2 cells allow"
        f" {(off / allowed).max():.2f}",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = ["couette", "poiseuille", "still", "dam"]
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", default="float32", choices=[each.value for each in Precision])
    parser.add_argument("--only", nargs="*", default=parts, choices=parts)
    parser.add_argument("--cells", nargs="*", type=int, default=[4, 8, 16])
    arguments = parser.parse_args()
    subject = find_subject(arguments.engine, Precision(arguments.precision), "cpu")
    for name in parts[:2]:
        if name in arguments.only:
            plates(subject, arguments.cells, name)
    if "still" in arguments.only:
        still(subject, arguments.cells)
    if "dam" in arguments.only:
        print(f"dam         {' '.join(f'{front:.2f}' for front in FRONTS[1::2])}   measured")
        for cells in (8, 16, 32):
            dam(subject, cells)


if __name__ == "__main__":
    main()
