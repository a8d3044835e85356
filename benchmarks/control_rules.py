"""What the control rule does to triangles that are strained: ours, the paper's with a minimum, the paper's as printed.

    python benchmarks/control_rules.py

A capture's Gaussians as triangles, each strained by a gradient F = 1 + strain N of its own, N of independent standard
normal numbers. CLIPPED: of all triangles. LONGER: of the third edges that a rule sets, those it makes longer (as high
above the first edge as they are not). ERROR: of the covariance, |C - F S F^T| / |F S F^T|, over those that it clips.

"""

import os
from pathlib import Path

import numpy as np

from gasp_core import read_splat
from gasp_core.control import control
from gasp_core.games import flatten, from_simplices, to_simplices

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).parents[1] / ".." / "shared" / "data") / "splats"
RULES = {
    "exact, bounded": ("exact", "bounded"),
    "Gram-Schmidt, bounded": ("gram_schmidt", "bounded"),
    "Gram-Schmidt, as printed": ("gram_schmidt", "as_printed"),
}


def main():
    splat = read_splat(DATA / "plant.splat")
    rng = np.random.default_rng(0)
    flat = flatten(splat.select(rng.choice(len(splat), 20_000, replace=False))).gaussians
    flat = flat.with_(scales=flat.scales.astype(np.float64))
    rest = to_simplices(flat, 3)
    print(f"{'STRAIN':>6} {'ALPHA':>5}  {'RULE':24} {'CLIPPED':>7} {'LONGER':>7} {'ERROR, median':>13} {'95 %':>7}")
    for strain in (0.3, 0.6):
        gradients = np.eye(3) + strain * rng.normal(size=(len(rest), 3, 3))
        edges = np.einsum("nij,nkj->nki", gradients, rest[:, 1:] - rest[:, :1])
        moved = np.concatenate([rest[:, :1], rest[:, :1] + edges], axis=1)
        true = np.einsum("nki,nkj->nij", edges, edges)
        for alpha in (1.0, 1.5, 2.0):
            for name, (covariance, rule) in RULES.items():
                limited, clipped = control(moved, flat, alpha, covariance, rule=rule)
                before, after = height(moved), height(limited)
                changed = clipped & (np.abs(after - before) > 1e-9 * before)
                longer = (after[changed] > before[changed]).mean()
                found = from_simplices(limited, reference=flat, covariance=covariance).covariances()
                error = np.linalg.norm(found - true, axis=(1, 2)) / np.linalg.norm(true, axis=(1, 2))
                median, high = np.percentile(error[clipped], [50, 95])
                print(f"{strain:6} {alpha:5}  {name:24} {clipped.mean():7.0%} {longer:7.0%} {median:13.2f} {high:7.2f}")


def height(simplices):
    """Of the third vertex above the first edge."""
    first, second = simplices[:, 1] - simplices[:, 0], simplices[:, 2] - simplices[:, 0]
    return np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1)


if __name__ == "__main__":
    main()
