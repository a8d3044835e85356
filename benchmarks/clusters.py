"""Clusters for cores: ours, from a lattice, beside BIRCH, which the paper takes.

    python benchmarks/clusters.py [--fraction 0.03]

WIDTH: root of the mean square distance of a Gaussian from the mean of its cluster, over the diagonal. OFF: how far the
cores carry Gaussians from where a bend by 60 degrees takes them, root mean square and 99th percentile, when it moves
the cores' corners exactly. CPU: processors' time.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree
from sklearn.cluster import Birch

from gasp_core import read_splat
from gasp_core.reduction.clusters import cluster
from gasp_core.reduction.cores import Matter, corners_of
from gasp_core.reduction.transfer import Cores, LeastSquares

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).parents[1] / ".." / "shared" / "data") / "splats"
CAPTURES = {"plant": "plant.splat", "angel": "statue-angel.sog", "guitar": "guitar.compressed.ply"}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fraction", type=float, default=0.03)
    chosen = parser.parse_args()
    print(f"{'':8} {'':8} {'CLUSTERS':>8} {'CPU s':>6} {'WIDTH':>8} {'OFF, rms':>9} {'99 %':>9}")
    for name, file in CAPTURES.items():
        means = read_splat(DATA / file).means.astype(np.float64)
        means = (means - means.mean(axis=0)) / np.linalg.norm(np.ptp(means, axis=0))
        count = round(chosen.fraction * len(means))
        # What is imported at the first use is not what is measured.
        cluster(means[:1000], 30), birch(means[:1000], 30)
        rows = {}
        for method, clusters in (("BIRCH", birch), ("lattice", cluster)):
            start = time.process_time()
            labels = clusters(means, count)
            spent = time.process_time() - start
            rows[method] = spent, width(means, labels), *carried(means, labels)
            told = rows[method]
            print(
                f"{name:8} {method:8} {labels.max() + 1:8,} {told[0]:6.2f} {told[1]:8.5f} {told[2]:9.2e} {told[3]:9.2e}"
            )
        ratios = [one / other for one, other in zip(rows["lattice"], rows["BIRCH"])]
        print(f"{'':8} {'ratio':8} {'':8} {1 / ratios[0]:5.0f}x {ratios[1]:8.3f} {ratios[2]:9.3f} {ratios[3]:9.3f}")


def birch(positions, count):
    """As many or fewer; BIRCH is told a radius, which is corrected until it finds about so many."""
    radius = 0.4 * np.sqrt(1 / count)
    for _ in range(6):
        tree = Birch(threshold=radius, branching_factor=100, n_clusters=None, compute_labels=False).fit(positions)
        centres = tree.subcluster_centers_
        if 0.95 * count <= len(centres) <= count:
            break
        radius *= np.sqrt(len(centres) / (0.98 * count))
    return np.unique(KDTree(centres).query(positions, workers=-1)[1], return_inverse=True)[1]


def width(positions, labels):
    counts = np.bincount(labels)
    means = np.stack([np.bincount(labels, column) / counts for column in positions.T], axis=1)
    return np.sqrt(((positions - means[labels]) ** 2).sum(axis=1).mean())


def bend(points):
    """By 60 degrees over the length of the second axis."""
    angle = np.radians(60) * (points[..., 1] - points[..., 1].min()) / np.ptp(points[..., 1])
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z], axis=-1)


def carried(positions, labels):
    count = len(positions)
    matter = Matter(volumes=np.ones(count), means=positions, covariances=np.zeros((count, 3, 3))).clustered(labels)
    cores = Cores(points=corners_of(matter, 1e-4))
    angle_of = np.concatenate([positions, cores.points.reshape(-1, 3)])
    # One bend of all of it.
    moved = bend(angle_of)
    displacements = moved[count:].reshape(cores.points.shape) - cores.points
    found = LeastSquares.build(cores, positions, labels).carry(cores, positions[:, None], displacements)[:, 0]
    off = np.linalg.norm(found - moved[:count], axis=1)
    return np.sqrt((off**2).mean()), np.percentile(off, 99)


if __name__ == "__main__":
    main()
