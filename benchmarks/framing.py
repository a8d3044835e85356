"""Whether films lose what they are of: captures that are dropped, thrown, toppled and poured, and the examples.

    python benchmarks/framing.py [--only captures|examples] [--examples NAME,..] [--frames N] [--sheets FOLDER]

Every scene is run once and filmed while it runs; then it is filmed from its recording. For each frame the silhouette of
what is to be in the picture is drawn with a field of view twice as wide as the film's. OUTSIDE is the largest share, in
any frame, of its alpha outside of the middle nine tenths of the film's picture; LOST how many frames have more than
.5 % there; FILLED how much of the picture's width or height, whichever is more, all frames together take, HIGH how
much of its height. ANEW: whether the film that was made while it ran was made once more at its end.
"""

import argparse
import dataclasses
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import gasp_core as gasp
from gasp_core.recording import Recording
from gasp_core.rendering.filming import render
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import motion_of
from gasp_core.rendering.live import LiveFilm
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.silhouettes import SAFE, extent_of, outline
from gasp_core.rendering.viewpoints import cameras_for

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("GASP_DATA", ROOT.parent / "shared" / "data"))
SIZE = (640, 360)
ALLOWED = 0.005
CAPTURES = {
    "plant": ("splats/plant.splat", "-y"),
    "skull": ("splats/skull.sog", "-y"),
    "guitar": ("splats/guitar.compressed.ply", "-y"),
    "peter": ("splats/statue-st-peter.sog", "-y"),
    "angel": ("splats/statue-angel.sog", "-y"),
    "massa": ("splats/statue-massa.sog", "-y"),
    "playbot": ("splats/playbot/3_0", "-y"),
    "letters": ("splats/fruit_drops_minimal.ply", "-y"),
    "spot": ("meshlike/spot_10k.splat", "-y"),
}
RUBBER = gasp.Elastic(density=500, youngs_modulus=1e5, poissons_ratio=0.3)
WATER = gasp.Fluid(density=1000, bulk_modulus=1e5, viscosity=0.5)
FLOOR = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.5)
MOTIONS = {
    "dropped": ({"position": (0, 0, 0.4), "material": RUBBER}, FLOOR),
    "thrown": ({"position": (0, 0, 0.2), "material": RUBBER, "velocity": (2.0, 1.0, 1.5)}, FLOOR),
    "toppled": ({"position": (0, 0, 0.0), "material": RUBBER, "angular_velocity": (0, 4.0, 0)}, FLOOR),
    "poured": ({"position": (0, 0, 0.05), "material": WATER}, dataclasses.replace(FLOOR, friction=0.0)),
}
EXAMPLES = (
    "soft_drop",
    "sand",
    "water",
    "two_toys",
    "wind_and_handle",
    "sand_castle",
    "vibrating_bar",
    "potted_plant",
    "swaying_plant",
    "dancer",
    "shaken_pot",
    "tumbling_pot",
)


def judged(footage, cameras, renderer):
    """Of cameras for all frames: largest share outside, frames that have more than is allowed, extent of all frames."""
    worst, lost, whole = 0.0, 0, None
    for frame, camera in enumerate(cameras):
        wide = dataclasses.replace(
            camera.resized(SIZE[0] // 2, SIZE[1] // 2),
            focal_x=camera.focal_x / 4,
            focal_y=camera.focal_y / 4,
        )
        alpha = renderer.render(outline(footage.subject(frame)), wide).alpha
        rows, columns = (np.abs(2 * (np.arange(n) + 0.5) / n - 1) * 2 <= SAFE for n in alpha.shape)
        total = float(alpha.sum())
        outside = 1 - float(alpha[np.ix_(rows, columns)].sum()) / total if total > 0 else 1.0
        worst, lost = max(worst, outside), lost + (outside > ALLOWED)
        extent = extent_of(alpha, 2.0)
        if extent is not None:
            whole = extent if whole is None else whole.joined(extent)
    return worst, lost, whole


def line(name, how, found, anew=""):
    worst, lost, whole = found
    filled, high = (0.0, 0.0) if whole is None else (whole.filled, (whole.lower - whole.upper) / 2)
    print(f"{name:26} {how:8} {100 * worst:8.2f} {lost:6} {filled:8.2f} {high:6.2f}  {anew}", flush=True)


def filmed(name, scene, folder, sheets):
    """Run and film a scene; print how it was framed both times."""
    run = folder / f"{name}.gasp"
    film = LiveFilm(run, scene, [folder / f"{name}-running.png"], width=SIZE[0], height=SIZE[1])
    with film:
        gasp.simulate(scene, out=run, progress=False, recorded=film.recorded, overwrite=True, trust_code=True)
    footage, renderer = RecordedFootage(Recording.open(run)), open_renderer()
    if film.problem:
        print(f"{name}: not filmed: {film.problem}")
        return
    line(name, "running", judged(footage, film.cameras, renderer), "anew" if film.anew else "")
    numbers = range(footage.frame_count)
    cameras = cameras_for(
        footage,
        footage.camera or gasp.CameraChoice(),
        motion=motion_of(footage, numbers),
        subject=footage.subject,
        numbers=numbers,
        renderer=renderer,
        width=SIZE[0],
        height=SIZE[1],
    )
    line(name, "after", judged(footage, cameras, renderer))
    if sheets is not None:
        render(run, sheets / f"{name}.png", size=SIZE, progress=False)
        (folder / f"{name}-running.png").replace(sheets / f"{name}-running.png")


def captures(names, motions, frames):
    for name in names:
        file, up = CAPTURES[name]
        for motion in motions:
            options, floor = MOTIONS[motion]
            item = gasp.SplatObject(name=name, splat=DATA / file, up=up, height=0.4, **options)
            scene = gasp.Scene(
                duration=frames / 20,
                frame_rate=20,
                objects=(item,),
                colliders=(floor,),
                accuracy=gasp.EngineAccuracy(resolution=12),
            )
            yield f"{name} {motion}".replace(" ", "-"), scene


def examples(folder, names):
    """The scenes of examples/, coarse."""
    beside = folder / "examples"
    shutil.copytree(ROOT / "examples", beside, ignore=shutil.ignore_patterns("*.gasp", "__pycache__"))
    for maker in (*sorted(beside.glob("make_*.py")), beside / "vibrating_bar.py"):
        subprocess.run([sys.executable, maker], check=True, stdout=subprocess.DEVNULL)
    for name in names:
        yield name, gasp.load_scene(beside / f"{name}.toml")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("captures", "examples"))
    parser.add_argument("--examples", default=",".join(EXAMPLES))
    parser.add_argument("--captures", default=",".join(CAPTURES))
    parser.add_argument("--motions", default=",".join(MOTIONS))
    parser.add_argument("--frames", type=int, default=16, help="Of each capture's run, at 20 a second.")
    parser.add_argument("--sheets", type=Path, help="Keep key frames here, to be looked at.")
    chosen = parser.parse_args()
    if chosen.sheets is not None:
        chosen.sheets.mkdir(parents=True, exist_ok=True)
    print(f"{'SCENE':26} {'FILMED':8} {'OUTSIDE%':>8} {'LOST':>6} {'FILLED':>8} {'HIGH':>6}")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        if chosen.only != "captures":
            for name, scene in examples(folder, chosen.examples.split(",")):
                filmed(name, scene, folder, chosen.sheets)
        if chosen.only != "examples":
            for name, scene in captures(chosen.captures.split(","), chosen.motions.split(","), chosen.frames):
                filmed(name, scene, folder, chosen.sheets)


if __name__ == "__main__":
    main()
