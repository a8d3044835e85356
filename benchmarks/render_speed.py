"""Time of a picture by the renderer "numba", on two threads, and where it goes.

    GASP_DATA=... python benchmarks/render_speed.py

Medians of repeated frames after the first, which compiles. "check" is reading and checking the splats.
"""

import os
import time
from pathlib import Path

import numba
import numpy as np
from gasp_renderer.blending import blend
from gasp_renderer.inputs import checked_inputs, checked_occluders
from gasp_renderer.projection import FIELDS, View, project
from gasp_renderer.rasteriser import NumbaRenderer, empty_picture, tile_lists
from gasp_renderer.sorting import front_to_back

from gasp_core.io import read_splat
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at

DATA = Path(os.environ.get("GASP_DATA", "../shared/data"))
CASES = [
    ("plant.splat", 512, 512),
    ("plant.splat", 1280, 720),
    ("skull.sog", 512, 512),
    ("playbot/3_0", 512, 512),
    ("playbot/2_0", 512, 512),
    ("playbot/1_0", 512, 512),
    ("playbot/0_0", 512, 512),
]
REPEATS = 15


def framed(means, width, height):
    """A camera from the front and a little above that the object just fits into; the files are y-down."""
    low, high = np.percentile(means, [2, 98], axis=0)
    center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    direction = np.array([0.6, -0.35, 0.72])
    distance = 0.8 * radius / np.sin(np.radians(20))
    eye = center + direction / np.linalg.norm(direction) * distance
    return look_at(eye, center, width=width, height=height, up=(0, -1, 0), field_of_view=40)


class Clock:
    """Seconds since it was last asked."""

    def __init__(self):
        self.last = time.perf_counter()

    def __call__(self):
        before, self.last = self.last, time.perf_counter()
        return self.last - before


def stages(splats, camera, ellipses, depths, boxes):
    """Seconds that each stage of one picture takes."""
    clock = Clock()
    inputs, walls = checked_inputs(splats), checked_occluders(None, camera)
    check = clock()
    project(View.of(camera), *inputs, ellipses, depths, boxes)
    projection = clock()
    order = front_to_back(depths)
    sort = clock()
    starts, lists = tile_lists(order, boxes, camera)
    binning = clock()
    picture = empty_picture(camera)
    blend(ellipses, starts, lists, walls, picture.colour, picture.alpha, picture.depth)
    return check, projection, sort, binning, clock()


def frame(renderer, splats, camera):
    """Seconds that one picture takes."""
    clock = Clock()
    renderer.render(splats, camera)
    return clock()


def main():
    if not DATA.is_dir():
        raise SystemExit(f"no splats at {DATA}: set GASP_DATA")
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    print(f"{numba.get_num_threads()} threads, median of {REPEATS} pictures; stages in ms")
    names = ("check", "project", "sort", "bin", "blend")
    print(f"{'splat':<12} {'picture':>9} {'SH':>2} {'Gaussians':>9} {'ms':>6} {'least':>6} {'ns each':>7}", end="")
    print("".join(f" {name:>7}" for name in names))
    for name, width, height in CASES:
        splats = RenderInput.of(read_splat(DATA / "splats" / name))
        camera, count = framed(splats.means, width, height), len(splats)
        renderer = NumbaRenderer()
        scratch = np.zeros((count, FIELDS), np.float32), np.zeros(count), np.zeros((count, 4), np.int16)
        frame(renderer, splats, camera)
        whole, parts = [], []
        for _ in range(REPEATS):
            whole.append(frame(renderer, splats, camera))
            parts.append(stages(splats, camera, *scratch))
        took = 1e3 * np.median(whole)
        print(f"{name:<12} {f'{width}x{height}':>9} {splats.sh_degree:>2} {count:>9,} {took:>6.1f}", end="")
        print(f" {1e3 * min(whole):>6.1f} {1e6 * took / count:>7.0f}", end="")
        print("".join(f" {1e3 * part:>7.1f}" for part in np.median(parts, axis=0)), flush=True)


if __name__ == "__main__":
    main()
