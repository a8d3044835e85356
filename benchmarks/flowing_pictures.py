"""Whether pictures of what has flowed have holes: with the Gaussians of the splat alone, and with grains.

    python benchmarks/flowing_pictures.py [--captures NAME,..] [--sheets FOLDER]

The examples sand and water, and captures poured on a floor; each at its last frame, from above and from the side. Where
material points lie close enough to hide what is behind them, the picture has to be opaque. BARE is the share of these
pixels whose alpha is below .8, GRAINS the same with grains; MORE how many Gaussians there are more then; TIME how long
a picture takes then, over one of the splat's own Gaussians, median of five.
"""

import argparse
import dataclasses
import tempfile
import time
from pathlib import Path

import numpy as np
from framing import CAPTURES, captures, examples
from PIL import Image

import gasp_core as gasp
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import motion_of
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.viewpoints import cameras_for
from gasp_core.scene.settings import CameraChoice

SIZE = (640, 400)
HIDDEN = 0.98
SEEN = 0.8


def matter(footage, frame):
    """Opaque Gaussians at all points, two of which at their distance at rest hide what is behind."""
    recording = footage.recording
    points = recording.points(frame)
    count = len(points)
    return RenderInput(
        means=points,
        opacities=np.full(count, 0.9),
        harmonics=np.zeros((count, 1, 3)),
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), 0.3 * recording.bodies[0].carrier.spacing),
    )


def timed(renderer, splats, camera):
    taken = []
    for _ in range(5):
        start = time.perf_counter()
        picture = renderer.render(splats, camera)
        taken.append(time.perf_counter() - start)
    return picture, float(np.median(taken))


def looked_at(name, scene, folder, renderer, sheets):
    run = gasp.simulate(scene, out=folder / f"{name}.gasp", progress=False, overwrite=True)
    footage, last = RecordedFootage(run), run.frame_count - 1
    for view in ("top", "right"):
        (camera,) = cameras_for(
            footage,
            CameraChoice(view=view),
            motion=motion_of(footage, [last]),
            subject=footage.subject,
            numbers=[last],
            renderer=renderer,
            width=SIZE[0],
            height=SIZE[1],
        )
        hidden = renderer.render(matter(footage, last), camera).alpha > HIDDEN
        before, took = timed(renderer, footage.splats(last), camera)
        after, takes = timed(renderer, footage.drawn(last), camera)
        bare = [100 * float((picture.alpha[hidden] < SEEN).mean()) for picture in (before, after)]
        more = len(footage.drawn(last)) - len(footage.splats(last))
        print(f"{name:16} {view:6} {bare[0]:8.2f} {bare[1]:8.2f} {more:9,} {takes / took:6.2f}", flush=True)
        if sheets is not None:
            pair = [1 - one.alpha[:, :, None] + one.colour for one in (before, after)]
            shown = (np.clip(np.concatenate(pair, axis=1), 0, 1) * 255).astype(np.uint8)
            Image.fromarray(shown).save(sheets / f"{name}-{view}.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", default=",".join(CAPTURES))
    parser.add_argument(
        "--sheets", type=Path, help="Keep the pictures here, to be looked at: without grains, with them."
    )
    chosen = parser.parse_args()
    if chosen.sheets is not None:
        chosen.sheets.mkdir(parents=True, exist_ok=True)
    renderer = open_renderer()
    print(f"{'SCENE':16} {'FROM':6} {'BARE%':>8} {'GRAINS':>8} {'MORE':>9} {'TIME':>6}")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        scenes = [*examples(folder, ["sand", "water"]), *captures(chosen.captures.split(","), ["poured"], 16)]
        for name, scene in scenes:
            fine = dataclasses.replace(scene.accuracy, resolution=24)
            looked_at(name, dataclasses.replace(scene, accuracy=fine), folder, renderer, chosen.sheets)


if __name__ == "__main__":
    main()
