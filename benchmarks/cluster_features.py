"""Clusters for cores by position alone, and by position and what else there is to a Gaussian.

    python benchmarks/cluster_features.py [--fraction 0.03]

A Gaussian's place over the diagonal is joined by its normal (n n^T, times 0.02), colour (0.01 of a standard deviation)
or size (0.01 of a standard deviation of its logarithm), and clusters by position go on from there, a few passes of
Lloyd's. WIDTH: root mean square distance from the mean of the cluster, over the diagonal. OFF: how far cores carry
Gaussians from where a bend by 60 degrees takes them, root mean square, by the fit to neighbours and by the frame of the
own core.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

sys.path.insert(0, str(Path(__file__).parent))

from transfers import CAPTURES, DATA, bent

from gasp_core import read_splat
from gasp_core.games import flatten
from gasp_core.gaussians import rotation_matrices
from gasp_core.reduction.clusters import cluster, scatter
from gasp_core.reduction.cores import Matter, corners_of
from gasp_core.reduction.transfer import Cores, LeastSquares, OneFrame

PASSES = 6


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fraction", type=float, default=0.03)
    fraction = parser.parse_args().fraction
    print(f"{'':8} {'AND':10} {'WIDTH':>8} {'OFF, fit':>9} {'frame':>9}")
    for name, file in CAPTURES.items():
        splat = flatten(read_splat(DATA / file)).gaussians
        size = np.linalg.norm(np.ptp(splat.means, axis=0))
        means = (splat.means - splat.means.mean(axis=0)).astype(np.float64) / size
        begun = cluster(means, round(fraction * len(means)))
        for what, columns in features(splat).items():
            labels = begun if columns is None else settled(np.c_[means, columns], begun)
            volumes, middles, covariances = scatter(means, labels, np.ones(len(means)))
            cores = Cores(points=corners_of(Matter(volumes=volumes, means=middles, covariances=covariances), 1e-4))
            off = []
            for transfer in (LeastSquares.build(cores, means, labels), OneFrame(labels=labels)):
                found = transfer.carry(cores, means[:, None], bent(cores.points) - cores.points)[:, 0]
                off.append(np.sqrt(((found - bent(means)) ** 2).sum(axis=1).mean()))
            width = np.sqrt(((means - middles[labels]) ** 2).sum(axis=1).mean())
            print(f"{name:8} {what:10} {width:8.5f} {off[0]:9.2e} {off[1]:9.2e}", flush=True)


def features(splat):
    thin = np.argmin(splat.scales, axis=1)
    normals = rotation_matrices(splat.quaternions)[np.arange(len(splat)), :, thin]
    planes = np.einsum("ni,nj->nij", normals, normals).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
    sizes = np.log(splat.scales.max(axis=1))[:, None]
    colours = splat.harmonics[:, 0]
    return {"nothing": None, "normal": 0.02 * planes, "colour": 0.01 * unit(colours), "size": 0.01 * unit(sizes)}


def unit(values):
    return (values - values.mean(axis=0)) / values.std()


def settled(rows, labels):
    for _ in range(PASSES):
        counts = np.bincount(labels)
        means = np.stack([np.bincount(labels, column) / counts for column in rows.T], axis=1)
        labels = np.unique(KDTree(means).query(rows, workers=-1)[1], return_inverse=True)[1].reshape(-1)
    return labels


if __name__ == "__main__":
    main()
