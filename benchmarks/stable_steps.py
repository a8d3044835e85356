"""How far the stable bound of explicit MPM is from where steps do become unstable.

    python benchmarks/stable_steps.py [--ratios 0,0.3]

The bound (`gasp_core.stepping.time_step`) is that of an isolated point, the stiffest oscillator there is. Here the
reference engine takes steps of more than it, of elastic matter at rest but for noise in its velocities, which the
transfers damp: what grows instead is unstable. STABLE is the largest step over the bound with which it dies, UNSTABLE
the next one that was tried. The default takes `EngineAccuracy().substep_fraction` of the bound.
"""

import argparse
import itertools
from unittest import mock

import gasp_reference_mpm.session
import numpy as np
from gasp_reference_mpm.engine import ReferenceMpm

from gasp_core import GaspError
from gasp_core.contract import Elastic, EngineAccuracy, Field, PointCloud, PointProblem, Precision
from gasp_core.stepping.time_step import rest_bound

CELL, NOISE, STEPS = 0.05, 1e-4, 150
TRIED = (1.0, 1.1, 1.2, 1.3, 1.4, 1.5)
LATTICE = (np.stack(np.meshgrid(*(np.arange(12),) * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) / 2
SHAPES = {
    "block": LATTICE,
    "jittered block": LATTICE + np.random.default_rng(1).uniform(-0.125, 0.125, LATTICE.shape),
    "ball": LATTICE[np.linalg.norm(LATTICE - 3, axis=1) < 2.7],
    "sheet": LATTICE[LATTICE[:, 2] < 0.5],
    "rod": LATTICE[(LATTICE[:, 1:] < 0.5).all(axis=1)],
}
"""Points, in cells, eight of which fill one."""


def dies(points, material, share):
    """Whether the noise does, with steps of `share` of the bound."""
    count, rng = len(points), np.random.default_rng(0)
    cloud = PointCloud(
        reference_positions=CELL * points,
        reference_volumes=np.full(count, CELL**3 / 8),
        initial_velocities=NOISE * rng.normal(size=(count, 3)),
        body_ids=np.zeros(count, dtype=int),
        material_ids=np.zeros(count, dtype=int),
    )
    problem = PointProblem(points=cloud, materials=(material,), gravity=(0, 0, 0))
    accuracy, step = EngineAccuracy(spacing=CELL, substep_fraction=1.0), share * rest_bound(material, CELL)
    with mock.patch.object(gasp_reference_mpm.session, "stable_step", lambda *others: step):
        session = ReferenceMpm().open(
            problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=accuracy, options=None
        )
        try:
            session.advance_to(STEPS * step)
        except GaspError:
            return False
        return bool(np.abs(session.read(frozenset({Field.VELOCITIES})).velocities).max() < NOISE)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--ratios", default="0,0.3", help="Poisson's")
    ratios = [float(ratio) for ratio in parser.parse_args().ratios.split(",")]
    print(f"{'SHAPE':16} {'POISSON':>8} {'STABLE':>8} {'UNSTABLE':>9}")
    for (name, points), ratio in itertools.product(SHAPES.items(), ratios):
        material = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=ratio)
        stable = list(itertools.takewhile(lambda share: dies(points, material, share), TRIED))  # noqa: B023
        beyond = f"{TRIED[len(stable)]:9}" if len(stable) < len(TRIED) else f"{'-':>9}"
        print(f"{name:16} {ratio:8} {stable[-1] if stable else '-':>8} {beyond}", flush=True)


if __name__ == "__main__":
    main()
