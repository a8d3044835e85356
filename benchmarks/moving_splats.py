"""How large moving splats are, how near to what was recorded, and how a page plays them.

    python benchmarks/moving_splats.py [--seconds 10] [--only plant]

Captures of $GASP_DATA fall on a floor: three as jelly, the skull as sand. Every frame that was packed is held against
what was recorded. The page is opened by headless Chromium, whose graphics a program draws where there is no GPU: what
it takes to decode a frame is the processor's in any case. Pictures are compared with those of our own renderer.
"""

import argparse
import io
import os
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from gasp_core import Collider, Elastic, HalfSpace, MovingSplat, Sand, Scene, SplatObject, pack, simulate
from gasp_core.accuracy.images import psnr
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.player import camera_of
from gasp_core.rendering.renderers import open_renderer

DATA = Path(os.environ.get("GASP_DATA") or Path(__file__).parents[1] / ".." / "shared" / "data") / "splats"
JELLY = Elastic(density=400, youngs_modulus=5e4, poissons_ratio=0.3)
CAPTURES = {
    "plant": ("plant.splat", JELLY),
    "angel": ("statue-angel.sog", JELLY),
    "guitar": ("guitar.compressed.ply", JELLY),
    "sand pile": ("skull.sog", Sand(density=1600, youngs_modulus=1e5, poissons_ratio=0.3)),
}
HEAD = f"{'':10} {'GAUSSIANS':>9} {'POINTS':>7} {'FRAMES':>6}  {'kB/FRAME':>8} {'ERROR':>6}  {'SPLAT MB':>8} "
HEAD += f"{'PAGE MB':>7}  {'FIRST s':>7} {'HEAP MB':>7} {'DECODE ms':>9} {'PAINT ms':>8}  {'PSNR dB':>7}"
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.5)
WIDTH, HEIGHT, BAR = 640, 360, 44
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
FLAGS += ["--enable-precise-memory-info"]

DECODE = """(async () => {
  const { motion } = gasp;
  const { frames } = motion.header;
  await motion.decode(frames - 1);
  const start = performance.now();
  for (let k = 0; k < 10; k++) await motion.show(Math.floor((k * frames) / 10));
  return (performance.now() - start) / 10;
})()"""
PAINT = """(() => {
  const { painter, orbit } = gasp;
  const { canvas } = painter.gl;
  const start = performance.now();
  for (let k = 0; k < 3; k++) {
    painter.paint(orbit.frame(canvas.width, canvas.height));
    painter.gl.readPixels(0, 0, 1, 1, painter.gl.RGBA, painter.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  return (performance.now() - start) / 3;
})()"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--only", choices=CAPTURES)
    parser.add_argument("--keep", type=Path, help="keep pages and pictures in this folder")
    chosen = parser.parse_args()
    print(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        for name in [chosen.only] if chosen.only else CAPTURES:
            one(name, chosen.seconds, chosen.keep or Path(folder))


def one(name, seconds, folder):
    folder.mkdir(parents=True, exist_ok=True)
    file, material = CAPTURES[name]
    item = SplatObject(name="it", splat=DATA / file, material=material, height=0.5, position=(0, 0, 0.2))
    scene = Scene(duration=seconds, frame_rate=24, objects=(item,), colliders=(FLOOR,))
    stem = name.replace(" ", "_")
    recording = simulate(scene, out=folder / f"{stem}.gasp", overwrite=True, progress=False)
    camera = camera_of(recording)
    told = pack(recording, folder / f"{stem}.sog", camera=camera, colliders=scene.colliders)
    page = folder / f"{stem}.html"
    pack(recording, page, camera=camera)
    splat = MovingSplat.open(folder / f"{stem}.sog")
    error = told.largest_error / told.allowed_error * 1e-4
    print(f"{name:10} {len(recording.reference):9,} {len(recording.start_points):7,} {len(splat):6}  ", end="")
    print(
        f"{told.motion / told.frames / 1e3:8.1f} {error:6.0e}  {told.size / 1e6:8.1f} {page.stat().st_size / 1e6:7.1f}",
        end="",
        flush=True,
    )
    print(f"  {play(page, splat, folder / f'{stem}.png')}", flush=True)


def play(page_file, splat, kept):
    """Figures of the page."""
    chromium = os.environ.get("GASP_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from PIL import Image
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        return "no browser here"
    with sync_playwright() as machine:
        browser = machine.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT + BAR})
        start = time.perf_counter()
        page.goto(page_file.resolve().as_uri())
        page.wait_for_function("window.gasp && gasp.state.painted > 0", timeout=120_000)
        first = time.perf_counter() - start
        page.evaluate("gasp.play(false)")
        last = len(splat) - 1
        decoding = page.evaluate(DECODE)
        painting = page.evaluate(PAINT)
        heap = page.evaluate("performance.memory.usedJSHeapSize") / 1e6
        page.evaluate(f"gasp.seek({last // 2})")
        page.wait_for_function(f"gasp.state.shown === {last // 2} && !gasp.state.changed", timeout=120_000)
        shot = page.screenshot(clip={"x": 0, "y": 0, "width": WIDTH, "height": HEIGHT})
        browser.close()
    seen = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")) / 255.0
    told = splat.header.camera
    camera = look_at(told["position"], told["target"], width=WIDTH, height=HEIGHT, field_of_view=told["vertical_angle"])
    ours = np.clip(open_renderer().render(splat.drawn(last // 2), camera).over(np.ones(3)), 0, 1)
    both = (np.concatenate([seen, ours], axis=1) * 255).round().astype(np.uint8)
    Image.fromarray(both).save(kept)
    return f"{first:7.1f} {heap:7.0f} {decoding:9.1f} {painting:8.0f}  {psnr(ours, seen):7.1f}"


if __name__ == "__main__":
    main()
