"""A block that meets a floor at its own speed of sound and faster: what becomes of it, and of its energy.

    python benchmarks/impacts.py [--engine warp-mpm] [--precision float32] [--cells 6] [--mach 1 3 10]

A cube of 0.3 m, E = 0.1 MPa, 1000 kg/m^3, is thrown at a floor that lets go. A row has how the run ended, or how flat
the cube was at its flattest and how high it is after six passages of sound, over its height at the start; the least
volume ratio of any point; and its kinetic energy at the end, over that of the throw.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject

from gasp_core.contract import (
    Collider,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Metal,
    NeoHookean,
    PointProblem,
    Precision,
    Status,
)

SIDE = 0.3
FRAMES = 48
PLAIN = {"density": 1000.0, "youngs_modulus": 1e5}
MATERIALS = {
    "elastic, nu 0.3": Elastic(**PLAIN, poissons_ratio=0.3),
    "elastic, nu 0": Elastic(**PLAIN, poissons_ratio=0.0),
    "neo-Hookean, nu 0.45": NeoHookean(**PLAIN, poissons_ratio=0.45),
    "metal": Metal(**PLAIN, poissons_ratio=0.3, yield_stress=2e3, hardening=1e4),
}


def outcome(subject, material, cells, mach):
    """The columns of a row."""
    spacing = SIDE / cells
    sound = math.sqrt(material.youngs_modulus / material.density)
    block = box_of_points((0.011, 0.007, 2 * spacing), (cells,) * 3, spacing)
    problem = PointProblem(
        points=cloud_of([block], [np.array([0.0, 0.0, -mach * sound])], spacing),
        materials=(material,),
        colliders=(Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))),),
        gravity=(0.0, 0.0, -9.81),
    )
    duration = 2 * spacing / (mach * sound) + 6 * SIDE / sound
    fields = frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS})
    heights, volumes = [], []
    with subject.engine.open(
        problem,
        accuracy=EngineAccuracy(spacing=spacing, substep_limit=1_000_000),
        device=subject.device,
        precision=subject.precision,
        seed=0,
    ) as session:
        for frame in range(1, FRAMES + 1):
            report = session.advance_to(duration * frame / FRAMES)
            if report.status is not Status.OK:
                return f"{report.status.value} at {session.time / duration:.0%} of the time"
            state = session.read(fields)
            heights.append(np.ptp(state.positions[:, 2]) / np.ptp(block[:, 2]))
            volumes.append(np.linalg.det(state.deformation_gradients).min())
    energy = (state.velocities**2).sum(axis=1).mean() / (mach * sound) ** 2
    return f"{min(heights):10.3f}{heights[-1]:10.3f}{min(volumes):10.4f}{energy:10.3f}"


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", choices=[each.value for each in Precision])
    parser.add_argument("--cells", type=int, default=6)
    parser.add_argument("--mach", type=float, nargs="*", default=[1.0, 3.0, 10.0])
    arguments = parser.parse_args()
    precision = None if arguments.precision is None else Precision(arguments.precision)
    subject = find_subject(arguments.engine, precision, None)
    print(f"{subject.name}, {subject.precision.value}, {arguments.cells} cells")
    print(f"{'':28}{'flattest':>10}{'at end':>10}{'least J':>10}{'energy':>10}")
    for name, material in MATERIALS.items():
        for mach in arguments.mach:
            print(f"{name + f' at {mach:g} c':28}{outcome(subject, material, arguments.cells, mach)}", flush=True)


if __name__ == "__main__":
    main()
