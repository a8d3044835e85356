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
from gasp_renderer.projection import FIELDS, SPANS, View, project
from gasp_renderer.rasteriser import NumbaRenderer, empty_picture, first_rays, tile_lists
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


def stages(splats, camera, walls, ellipses, spans, depths, boxes):
    """Seconds that each stage of one picture takes."""
    clock = Clock()
    inputs, walls = checked_inputs(splats), checked_occluders(walls, camera)
    spans = spans[: len(spans) * (len(walls) > 0)]
    check = clock()
    project(View.of(camera), *inputs, ellipses, spans, depths, boxes)
    projection = clock()
    order = front_to_back(depths)
    sort = clock()
    starts, lists = tile_lists(order, boxes, camera)
    binning = clock()
    picture = empty_picture(camera)
    blend(ellipses, spans, starts, lists, first_rays(camera), walls, picture.colour, picture.alpha, picture.depth)
    return check, projection, sort, binning, clock()


def floor(means, camera):
    """Depths of a floor that the lowest tenth of the splat is in; the files are y-down."""
    height, rays = np.percentile(means[:, 1], 90), camera.rays()
    falling = rays[..., 1]
    below = (height - camera.position[1]) / np.where(falling > 0, falling, 1.0)
    return np.where(falling > 0, below, np.inf).astype(np.float32)


def frame(renderer, splats, camera, walls):
    """Seconds that one picture takes."""
    clock = Clock()
    renderer.render(splats, camera, occluders=walls)
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
        scratch = (
            np.zeros((count, FIELDS), np.float32),
            np.zeros((count, SPANS), np.float32),
            np.zeros(count),
            np.zeros((count, 4), np.int16),
        )
        for walls in (None, floor(splats.means, camera)):
            frame(renderer, splats, camera, walls)
            whole, parts = [], []
            for _ in range(REPEATS):
                whole.append(frame(renderer, splats, camera, walls))
                parts.append(stages(splats, camera, walls, *scratch))
            took, what = 1e3 * np.median(whole), name if walls is None else "  on a floor"
            print(f"{what:<12} {f'{width}x{height}':>9} {splats.sh_degree:>2} {count:>9,} {took:>6.1f}", end="")
            print(f" {1e3 * min(whole):>6.1f} {1e6 * took / count:>7.0f}", end="")
            print("".join(f" {1e3 * part:>7.1f}" for part in np.median(parts, axis=0)), flush=True)


if __name__ == "__main__":
    main()
