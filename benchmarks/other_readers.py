"""What other programs read of the files that leave: positions and covariances, against the Gaussians that were written.

    python benchmarks/other_readers.py [--splat-transform PATH]

plyfile, gsply, trimesh and USD itself are Python packages; splat-transform is PlayCanvas' own converter, of npm: `npm
install @playcanvas/splat-transform`, then PATH is node_modules/.bin/splat-transform. Positions are in the file's unit,
covariances a share of the largest entry of each; where a format rounds, its step is printed beside them.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import plyfile

from gasp_core import read_splat, write_splat
from gasp_core.gaussians import Gaussians
from gasp_core.io.sog_writing import position_step

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).parents[1] / ".." / "shared" / "data") / "splats"
TURNED = np.array([1.0, -1.0, -1.0])
"""Files whose y is up, beside ordinary ones."""


def by_plyfile(path):
    rows = plyfile.PlyData.read(path)["vertex"]

    def columns(*names):
        return np.stack([np.asarray(rows[name], dtype=np.float64) for name in names], axis=1)

    return (
        columns("x", "y", "z"),
        columns(*(f"rot_{k}" for k in range(4))),
        np.exp(columns(*(f"scale_{k}" for k in range(3)))),
    )


def by_gsply(path):
    import gsply

    found = gsply.sogread(str(path))
    return found.means, found.quats, np.exp(found.scales)


def by_trimesh(path):
    import trimesh

    (points,) = trimesh.load(path).geometry.values()
    return np.asarray(points.vertices) * TURNED, None, None


def by_usd(path):
    from pxr import Usd, UsdVol

    stage = Usd.Stage.Open(str(path))
    (prim,) = (one for one in stage.Traverse() if one.GetTypeName() == "ParticleField3DGaussianSplat")
    field = UsdVol.ParticleField3DGaussianSplat(prim)
    turns = np.array([(q.GetReal(), *q.GetImaginary()) for q in field.GetOrientationsAttr().Get()])
    means = np.array(field.GetPositionsAttr().Get())
    return means * TURNED, turns * [1, 1, -1, -1], np.array(field.GetScalesAttr().Get())


def by_splat_transform(program):
    def read(path):
        turned = path.with_name("theirs.ply")
        subprocess.run([program, "-w", path, turned], check=True, capture_output=True)
        return by_plyfile(turned)

    return read


def covariances(quaternions, scales):
    count = len(scales)
    flat = np.zeros((count, 1, 3), dtype=np.float32)
    arrays = {"means": np.zeros((count, 3)), "opacities": np.ones(count), "harmonics": flat}
    return Gaussians(quaternions=np.asarray(quaternions), scales=np.asarray(scales), **arrays).covariances()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--splat-transform", type=Path, metavar="PATH")
    chosen = parser.parse_args()
    theirs = [("splat-transform", by_splat_transform(chosen.splat_transform))] if chosen.splat_transform else []
    readers = {
        ".ply": [("plyfile", by_plyfile), *theirs],
        ".sog": [("gsply", by_gsply), *theirs],
        ".spz": theirs,
        ".splat": theirs,
        ".glb": [("trimesh", by_trimesh)],
        ".usdc": [("usd-core", by_usd)],
    }
    print(f"{'FILE':28} {'FORMAT':7} {'READER':16} {'POSITIONS':>10} {'COVARIANCES':>12}")
    for name in ("train-1000.ply", "skull.sog", "guitar.compressed.ply"):
        gaussians = read_splat(DATA / name)
        wanted = gaussians.covariances()
        size = np.abs(wanted).max(axis=(1, 2))
        with tempfile.TemporaryDirectory() as folder:
            for suffix, known in readers.items():
                path = Path(folder) / f"ours{suffix}"
                write_splat(path, gaussians)
                for reader, read in known:
                    means, quaternions, scales = read(path)
                    off = np.abs(means - gaussians.means).max()
                    shape = "-"
                    if scales is not None:
                        shape = (
                            f"{(np.abs(covariances(quaternions, scales) - wanted).max(axis=(1, 2)) / size).max():.1e}"
                        )
                    step = f"   step {position_step(gaussians.means):.1e}" if suffix == ".sog" else ""
                    print(f"{name:28} {suffix:7} {reader:16} {off:10.1e} {shape:>12}{step}", flush=True)


if __name__ == "__main__":
    main()
