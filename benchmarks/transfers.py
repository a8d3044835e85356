"""How Gaussians follow their cores: ours beside the paper's rule and D-MiSo's, where the corners of cores move exactly.

    python benchmarks/transfers.py [--fraction 0.03]

A capture, flattened to triangles, is bent by 60 degrees over its length, or is stretched to 1.5 times its width.
Corners of cores go where that takes them. OFF: distance of a Gaussian from where it should be, over the diagonal, root
mean square and 99th percentile. COVARIANCE: |C - F S F^T| / |F S F^T|, F the gradient at the mean; median, 95 %.
FRAME: time to carry all Gaussians once. With more levels the engine has as many cores, and others stand in between.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

from gasp_core import Reduction, read_splat
from gasp_core.games import flatten
from gasp_core.reduction.all_vertices import block_of
from gasp_core.reduction.cores import sample_cores

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).parents[1] / ".." / "shared" / "data") / "splats"
CAPTURES = {"plant": "plant.splat", "angel": "statue-angel.sog"}
WAYS = {
    "least-squares": {},
    "its 2 levels": {"levels": 2},
    "its 3 levels": {"levels": 3},
    "frame": {"transfer": "frame"},
    "d-miso": {"transfer": "d-miso"},
}


def bent(points):
    """About y, along x, which is -1/2 .. 1/2 of the diagonal."""
    x, y, z = np.moveaxis(points, -1, 0)
    radius = 1 / np.radians(60)
    turn = x / radius
    return np.stack([(radius + z) * np.sin(turn), y, (radius + z) * np.cos(turn) - radius], axis=-1)


def stretched(points):
    return points * [1.5, 1.0, 1.0]


def gradients(move, points, step=1e-6):
    columns = [(move(points + step * axis) - move(points - step * axis)) / (2 * step) for axis in np.eye(3)]
    return np.stack(columns, axis=2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fraction", type=float, default=0.03)
    fraction = parser.parse_args().fraction
    heads = f"{'OFF, rms':>9} {'99 %':>9} {'COVARIANCE':>11} {'95 %':>6} {'POINTS':>8} {'FRAME':>9}"
    print(f"{'':8} {'':10} {'TRANSFER':14} {heads}")
    for name, file in CAPTURES.items():
        splat = flatten(read_splat(DATA / file)).gaussians
        size = np.linalg.norm(np.ptp(splat.means, axis=0))
        means = (splat.means - splat.means.mean(axis=0)) / size
        splat = splat.with_(means=means.astype(np.float64), scales=splat.scales.astype(np.float64) / size)
        block = block_of(splat, 3)
        for move in (bent, stretched):
            places, slopes = block.rest[:, 0] + block.centre, gradients(move, block.rest[:, 0] + block.centre)
            edges = np.einsum("nij,nkj->nki", slopes, block.rest[:, 1:] - block.rest[:, :1])
            expected = np.einsum("nki,nkj->nij", edges, edges)
            for way, choice in WAYS.items():
                sample = sample_cores(block, Reduction(mode="cores", fraction=fraction, **choice), 1e-4, 1 / 64)
                corners = sample.positions + block.centre
                moves = move(corners) - corners
                sample.carrier.carry(block.rest, moves)
                begun = time.perf_counter()
                found = sample.carrier.carry(block.rest, moves)
                spent = 1e3 * (time.perf_counter() - begun)
                off = np.linalg.norm(found[:, 0] + block.centre - move(places), axis=1)
                own = found[:, 1:] - found[:, :1]
                covariances = np.einsum("nki,nkj->nij", own, own)
                errors = np.linalg.norm(covariances - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))
                print(
                    f"{name:8} {move.__name__:10} {way:14} {np.sqrt(np.mean(off**2)):9.2e}"
                    f" {np.percentile(off, 99):9.2e} {np.median(errors):11.3f} {np.percentile(errors, 95):6.3f}"
                    f" {len(corners):8,} {spent:6.0f} ms",
                    flush=True,
                )


if __name__ == "__main__":
    main()
