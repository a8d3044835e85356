"""A film against the pictures it was made of, and what both cost.

    python benchmarks/film_fidelity.py [RUN.gasp] [--size 1280x720]

Without RUN a toy is dropped first (ten seconds or so). Every frame is painted twice, once for the film and once for
the pictures; the decoded film is compared with the pictures, frame by frame.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import av
import numpy as np
from PIL import Image

import gasp_core as gasp
from gasp_core.accuracy.images import psnr
from gasp_core.toy import make_toy


def a_run(folder):
    toy = gasp.SplatObject(
        name="toy",
        splat=make_toy(4_000),
        height=0.3,
        position=(0, 0, 0.15),
        material=gasp.Elastic(density=200, youngs_modulus=4e4, poissons_ratio=0.3),
        reduction=gasp.Reduction(mode="all"),
    )
    floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
    accuracy = gasp.EngineAccuracy(resolution=16)
    scene = gasp.Scene(duration=0.8, frame_rate=25, objects=(toy,), colliders=(floor,), accuracy=accuracy)
    return gasp.simulate(scene, out=folder / "toy.gasp").path


def decoded(path):
    with av.open(str(path)) as container:
        for frame in container.decode(container.streams.video[0]):
            yield frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()


def timed(*arguments, **options):
    start = time.perf_counter()
    gasp.render(*arguments, **options)
    return time.perf_counter() - start


def first_picture(run, out, size):
    """Seconds of a process that paints one picture; the first of several may have to compile."""
    # As users have it: Python keeps the modules it compiled.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    start = time.perf_counter()
    command = [sys.executable, "-m", "gasp_core.cli.main", "render", run, "--frame", "0", "--size", size, "-o", out]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", nargs="?", type=Path)
    parser.add_argument("--size", default="1280x720")
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = gasp.Recording.open(arguments.run or a_run(folder))
        first = min(first_picture(run.path, folder / "first.png", arguments.size) for _ in range(3))
        film = timed(run, folder / "film.mp4", size=(width, height), progress=True)
        pictures = timed(run, folder / "frames", size=(width, height), progress=True)
        found = [
            psnr(np.asarray(Image.open(path)) / 255, frame / 255)
            for path, frame in zip(sorted((folder / "frames").iterdir()), decoded(folder / "film.mp4"), strict=True)
        ]
        count = len(found)
        size = (folder / "film.mp4").stat().st_size
    print(f"{run.path.name}: {count} frames of {len(run.reference):,} Gaussians, {width}x{height}")
    print(f"decoded film against pictures   least {min(found):.1f} dB, mean {np.mean(found):.1f} dB")
    print(f"size of the film                {size / 1e6:.2f} MB, {8 * size / count / 1e3:.0f} kbit a frame")
    print(
        f"gasp render --frame 0           {first:.2f} s, a process of its own, kernels compiled before; least of three"
    )
    print(f"film                            {1e3 * film / count:.0f} ms a frame")
    print(f"pictures                        {1e3 * pictures / count:.0f} ms a frame")


if __name__ == "__main__":
    main()
