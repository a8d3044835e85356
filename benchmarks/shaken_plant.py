"""A plant whose pot is shaken, by every way to carry Gaussians that goes with one engine: how far apart they are.

    GASP_DATA=... python benchmarks/shaken_plant.py [--resolution 32] [--engine warp-mpm] [--keep FOLDER]

Nobody knows what the plant should do, so that this says how far methods are from simplices of which every vertex is
simulated ("all"), and no more: MEAN over the plant's diagonal, root mean square of all Gaussians and frames; COVARIANCE
|C - C'| / |C'|, median and 95th percentile of the last frame; the same of LEAVES alone, what is above two thirds of the
height; PICTURE: PSNR of the last frame, on white. TIME: end to end, compiled before.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import gasp_core as gasp
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.renderers import open_renderer

HEIGHT, POT, SPEED, STROKE, STROKES = 0.4, 0.13, 0.6, 0.1, 4
METHODS = {
    "all": gasp.Reduction(mode="all"),
    "centres": gasp.Reduction(mode="centres"),
    "volume": gasp.Reduction(mode="volume"),
    "auto": gasp.Reduction(mode="auto"),
}


def scene_of(splat, reduction, resolution):
    pot = gasp.BoxShape(center=(0, 0, POT / 2 - 0.01), half_extents=(1, 1, POT / 2 + 0.01))
    strokes = [
        gasp.Driven(
            region=pot,
            velocity=(SPEED * (-1) ** k, 0, 0),
            center=(0, 0, 0),
            start=k * STROKE,
            end=(k + 1) * STROKE,
        )
        for k in range(STROKES)
    ]
    item = gasp.SplatObject(
        name="plant",
        splat=splat,
        up="-y",
        height=HEIGHT,
        position=(0, 0, 0),
        material=gasp.Elastic(density=300, youngs_modulus=1e5, poissons_ratio=0.3, mass_damping=1),
        reduction=reduction,
    )
    return gasp.Scene(
        objects=(item,),
        duration=STROKE * STROKES + 0.2,
        frame_rate=25,
        gravity=(0, 0, 0),
        accuracy=gasp.EngineAccuracy(resolution=resolution),
        drives=(*strokes, gasp.Pinned(region=pot, start=STROKE * STROKES)),
    )


def off(found, known):
    """|C - C'| / |C'| of Gaussians."""
    expected = known.covariances()
    return np.linalg.norm(found.covariances() - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--resolution", type=int, default=32)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--keep", type=Path, help="a folder for recordings (gasp render) and pictures of last frames")
    asked = parser.parse_args()
    splat = gasp.read_splat(Path(os.environ.get("GASP_DATA", "../shared/data")) / "splats" / "plant.splat")
    camera = look_at((0.2, -1.2, 0.4), (0, 0, 0.18), width=640, height=640, field_of_view=32)
    print("METHOD      POINTS   MEAN %  COVARIANCE   95 %  LEAVES   95 %   PICTURE      TIME")
    with tempfile.TemporaryDirectory() as passing:
        folder = passing if asked.keep is None else asked.keep
        reference, rest = None, None
        for name, reduction in METHODS.items():
            scene = scene_of(splat, reduction, asked.resolution)
            # Kernels are compiled by two frames of it.
            gasp.simulate(scene, asked.engine, Path(passing) / "first.gasp", frames=2, overwrite=True)
            begun = time.perf_counter()
            run = gasp.simulate(scene, asked.engine, Path(folder) / f"{name}.gasp", overwrite=True)
            spent, last = time.perf_counter() - begun, run.frame_count - 1
            found = [run.gaussians(frame) for frame in range(run.frame_count)]
            picture = np.clip(open_renderer().render(RenderInput.of(found[last]), camera).over(np.ones(3)), 0, 1)
            if reference is None:
                reference, rest, known = found, found[0].means, picture
            diagonal = np.linalg.norm(np.ptp(rest, axis=0))
            apart = [((one.means - other.means) ** 2).sum(axis=1).mean() for one, other in zip(found, reference)]
            errors = off(found[last], reference[last])
            leaves = errors[rest[:, 2] > 2 / 3 * HEIGHT]
            difference = np.mean((picture - known) ** 2)
            decibels = f"{-10 * np.log10(difference):6.1f} dB" if difference else "        -"
            print(
                f"{name:9} {len(run.start_points):8,} {100 * np.sqrt(np.mean(apart)) / diagonal:8.3f}"
                f" {np.median(errors):11.3f} {np.percentile(errors, 95):6.3f} {np.median(leaves):7.3f}"
                f" {np.percentile(leaves, 95):6.3f} {decibels} {spent:8.1f} s",
                flush=True,
            )
            if asked.keep:
                write(asked.keep, name, picture)


def write(folder, name, picture):
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray((255 * picture).astype(np.uint8)).save(folder / f"{name}.png")


if __name__ == "__main__":
    main()
