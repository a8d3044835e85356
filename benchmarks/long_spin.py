"""A rod that spins in its own plane: how its positions creep away from what its deformation gradients say.

    python benchmarks/long_spin.py [--engine warp-mpm] [--precision float64] [--turns 18] [--fractions 0.5 0.1]

nu = 0, so fast that it is to be longer by 1.3 %. Mean over the last turn: by how much the tip is farther out than in
the closed form for the speed that is left (rho w^2 L^2 / 12 E), the same for the mean stretch that F has, and the spin
over that at the start.
"""

import argparse

import numpy as np
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import find_subject

from gasp_core.contract import Elastic, EngineAccuracy, Field, PointProblem, Precision

LENGTH, DENSITY, MODULUS, STRAIN = 1.2, 1000.0, 1e5, 0.04 / 3
SIZES = ((12, 2, 2), (24, 2, 2), (24, 3, 3), (24, 1, 1))
LOOKS = 13
"""A turn, so that they fall together with none of the rod's periods."""


def spun(subject, cells, fraction, turns):
    spacing = LENGTH / cells[0]
    rod = box_of_points((0.37, 0.21, 0.11), cells, spacing)
    arms = rod - rod.mean(axis=0)
    rate = np.sqrt(12 * STRAIN * MODULUS / DENSITY) / LENGTH
    problem = PointProblem(
        points=cloud_of([rod], [np.cross([0.0, 0.0, rate], arms)], spacing),
        materials=(Elastic(density=DENSITY, youngs_modulus=MODULUS, poissons_ratio=0.0),),
        gravity=(0.0, 0.0, 0.0),
    )
    times = (turns - 1 + np.arange(1, LOOKS + 1) / LOOKS) * 2 * np.pi / rate
    accuracy = EngineAccuracy(spacing=spacing, substep_fraction=fraction, substep_limit=1_000_000)
    fields = {Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}
    seen = []
    for state in subject.states(problem, accuracy, times, fields):
        places = state.positions - state.positions.mean(axis=0)
        spin = np.cross(places, state.velocities)[:, 2].mean() / (places[:, :2] ** 2).sum(axis=1).mean()
        tip = np.linalg.norm(places[:, :2], axis=1).max() / np.linalg.norm(arms[:, :2], axis=1).max()
        stretch = np.linalg.svd(state.deformation_gradients, compute_uv=False)[:, 0].mean()
        seen.append((tip - 1, stretch - 1, spin / rate))
    tip, stretch, spin = np.mean(seen, axis=0)
    expected = STRAIN * spin**2
    return tip - expected, stretch - expected, spin


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--precision", default="float64", choices=[each.value for each in Precision])
    parser.add_argument("--turns", type=int, default=18)
    parser.add_argument("--fractions", nargs="*", type=float, default=[0.5, 0.1])
    arguments = parser.parse_args()
    subject = find_subject(arguments.engine, Precision(arguments.precision), "cpu")
    print(f"{'cells':12}{'step':>6}{'tip':>10}{'F':>10}{'spin':>8}")
    for cells in SIZES:
        for fraction in arguments.fractions:
            tip, stretch, spin = spun(subject, cells, fraction, arguments.turns)
            shown = " x ".join(map(str, cells))
            print(f"{shown:12}{fraction:6g}{tip:10.2%}{stretch:10.2%}{spin:8.3f}", flush=True)


if __name__ == "__main__":
    main()
