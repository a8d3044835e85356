"""One scene file through several engines, changing the name alone: films side by side, and what each run took.

    python benchmarks/one_scene.py [--engines taichi-mpm mujoco-flex genesis-mpm blender] [--out one_scene]

Three trained splats stand above a floor as soft bodies, by cores; one of them is pushed at its neighbour. Needs the
real splats (GASP_DATA). In the folder: scene.toml, a recording of each engine, side_by_side.mp4 and a sheet of its key
frames. What is there already is not run again. Genesis and Blender want their environments:

    gasp engines install genesis-mpm && gasp engines install blender
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import gasp_core as gasp
from gasp_core.rendering.contact_sheet import Sheet, key_frames
from gasp_core.rendering.video import FilmFile

SCENE = """\
# Three trained splats above a floor as soft bodies; the bust is pushed at the angel.
[scene]
duration = {duration}
frame_rate = 25

[[object]]
name = "angel"
splat = "{splats}/statue-angel.sog"
up = "-y"
height = 0.5
position = [0, 0, 0.1]
reduction = {{ mode = "cores", fraction = {fraction} }}
material = {{ model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }}

[[object]]
name = "robot"
splat = "{splats}/playbot/4_0"
up = "-y"
height = 0.25
position = [0.5, 0, 0.15]
reduction = {{ mode = "cores", fraction = {fraction} }}
material = {{ model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }}

[[object]]
name = "bust"
splat = "{splats}/statue-massa.sog"
up = "-y"
height = 0.4
position = [-0.45, 0, 0.1]
velocity = [1.5, 0, 0]
reduction = {{ mode = "cores", fraction = {fraction} }}
material = {{ model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }}

[[collider]]
shape = "plane"
height = 0.0
friction = 0.5

[accuracy]
resolution = {resolution}

[camera]
position = [0.55, -1.1, 0.5]
target = [0.03, 0, 0.22]
"""


def ran(engine, scene, out):
    """Run the scene unless its recording is whole; seconds it took, and what it said if it failed."""
    command = [sys.executable, "-m", "gasp_core.cli.main", "run", str(scene), "--engine", engine]
    if out.exists():
        if gasp.Recording.open(out).status == "complete":
            return None, ""
        command.append("--overwrite")
    start = time.perf_counter()
    done = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True)
    seconds = time.perf_counter() - start
    return seconds, "" if done.returncode == 0 else done.stderr.strip().splitlines()[-1]


def pictures(recording, folder, size):
    """Every frame of a recording, painted."""
    gasp.render(recording, folder, size=size)
    return sorted(folder.glob("*.png"))


def labelled(path, text):
    image = Image.open(path).convert("RGB")
    font = ImageFont.load_default(size=image.height // 16)
    ImageDraw.Draw(image).text((image.height // 40, image.height // 60), text, fill=(40, 40, 40), font=font)
    return np.asarray(image)


def side_by_side(recordings, out, size):
    """A film and a sheet of all recordings next to each other, two in a row; frames that one lacks show its last."""
    columns = {name: pictures(run, out / f"{name}-frames", size) for name, run in recordings.items()}
    longest = max(map(len, columns.values()))
    rate = next(iter(recordings.values())).header.frame_rate
    sheet = Sheet(out / "side_by_side.png", "one scene", key_frames(longest), cell=960)
    with FilmFile(out / "side_by_side.mp4", rate) as film, sheet:
        for frame in range(longest):
            tiles = [labelled(paths[min(frame, len(paths) - 1)], name) for name, paths in columns.items()]
            if len(tiles) % 2:
                tiles.append(np.full_like(tiles[0], 255))
            picture = np.concatenate([np.concatenate(tiles[k : k + 2], axis=1) for k in range(0, len(tiles), 2)])
            film.take(picture, frame / rate)
            if sheet.wants(frame):
                sheet.take(picture, frame / rate)


def centres(recording, frame):
    """Mean places of the bodies' points (B, 3) [m]."""
    points = recording.points(frame)
    return np.array([points[body.first : body.last].mean(axis=0) for body in recording.header.bodies])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["taichi-mpm", "mujoco-flex", "genesis-mpm", "blender"])
    parser.add_argument("--out", type=Path, default=Path("one_scene"))
    parser.add_argument("--duration", type=float, default=1.0, help="[s]")
    parser.add_argument("--resolution", type=int, default=20)
    parser.add_argument(
        "--fraction", type=float, default=0.05, help="cores, as a share of the Gaussians; 1: all of them"
    )
    parser.add_argument("--size", default="640x360", help="of a film, in pixels")
    chosen = parser.parse_args()
    data = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute()
    if not data.is_dir():
        sys.exit(f"{data}: no such folder: set GASP_DATA to where the real splats are")
    chosen.out.mkdir(parents=True, exist_ok=True)
    scene = chosen.out / "scene.toml"
    wanted = {"duration": chosen.duration, "resolution": chosen.resolution, "fraction": chosen.fraction}
    scene.write_text(SCENE.format(splats=data / "splats", **wanted), encoding="utf-8")
    found = {}
    print(f"{'engine':14}{'seconds':>9}{'substeps':>10}  places of the angel, the robot, the bust at the end [m]")
    for engine in chosen.engines:
        run = chosen.out / f"{engine}.gasp"
        seconds, trouble = ran(engine, scene, run)
        if trouble:
            print(f"{engine:14}{seconds:9.1f}  {trouble}")
            continue
        found[engine] = recording = gasp.Recording.open(run)
        substeps = sum(step["substeps"] for step in recording.diagnostics())
        ends = "  ".join(
            "({:+.3f}, {:+.3f}, {:+.3f})".format(*place) for place in centres(recording, -1 + len(recording.times))
        )
        print(f"{engine:14}{'kept' if seconds is None else f'{seconds:.1f}':>9}{substeps:10}  {ends}", flush=True)
    if found:
        side_by_side(found, chosen.out, tuple(map(int, chosen.size.split("x"))))
        print(f"films side by side: {chosen.out / 'side_by_side.mp4'}; key frames: {chosen.out / 'side_by_side.png'}")


if __name__ == "__main__":
    main()
