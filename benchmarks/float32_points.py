"""What float32 costs each real splat, with edges magnified as by default and without.

    GASP_DATA=... python benchmarks/float32_points.py

"cov" is the relative error of the covariance, "thin" that of the smallest scale alone; shares are of Gaussians.
"""

import os
from pathlib import Path

import numpy as np

from gasp_core import games
from gasp_core.io import read_splat

DATA = Path(os.environ.get("GASP_DATA", "../shared/data"))
RESOLUTION = 64


def errors(found, gaussians, covariances):
    smallest = np.sort(gaussians.scales.astype(np.float64), axis=1)[:, 0]
    whole = np.linalg.norm(found.covariances() - covariances, axis=(1, 2)) / np.linalg.norm(covariances, axis=(1, 2))
    thin = np.abs(np.sort(found.scales, axis=1)[:, 0] - smallest) / np.maximum(smallest, 1e-300)
    return whole, thin


def main():
    files = [path for path in sorted(DATA.glob("*/*")) if path.suffix in {".ply", ".splat", ".sog"}]
    files += sorted(DATA.glob("splats/playbot/*_0"))
    if not files:
        raise SystemExit(f"no splats under {DATA}: set GASP_DATA")
    print(f"spacing = size / {RESOLUTION}, floor = spacing / 4; magnified: largest error; bare: share above 1e-3")
    print(f"{'file':<32} {'Gaussians':>9} {'V':>2} {'cov max':>9} {'thin max':>9} {'bare cov':>9} {'bare thin':>9}")
    for path in files:
        gaussians = read_splat(path)
        vertices = games.choose_vertices(gaussians)
        simplices = games.to_simplices(gaussians, vertices)
        simplices -= simplices[:, :1].mean(axis=0)
        covariances = gaussians.covariances()
        floor = 0.25 * np.ptp(simplices.reshape(-1, 3), axis=0).max() / RESOLUTION
        magnified, factors = games.magnify(simplices, floor)
        carried = games.demagnify(magnified.astype(np.float32).astype(np.float64), factors)
        bare = simplices.astype(np.float32).astype(np.float64)
        whole, thin = errors(games.from_simplices(carried, reference=gaussians), gaussians, covariances)
        bare_whole, bare_thin = errors(games.from_simplices(bare, reference=gaussians), gaussians, covariances)
        print(
            f"{path.name:<32} {len(gaussians):>9,} {vertices:>2} {whole.max():>9.1e} {thin.max():>9.1e}"
            f" {(bare_whole > 1e-3).mean():>9.4f} {(bare_thin > 1e-3).mean():>9.4f}"
        )


if __name__ == "__main__":
    main()
