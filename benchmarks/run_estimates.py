"""How far off `gasp run --dry-run` is: what it says beforehand, and what the run then takes, film included.

    GASP_DATA=... python benchmarks/run_estimates.py [--only NAME ...]

Every command is a process of its own, as a user's is. The figures of the README are of one such table.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gasp_core import Recording

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("GASP_DATA", ROOT / "../shared/data")).absolute()
GASP = str(Path(sys.executable).parent / "gasp")
FLOOR = 'collider = [{ shape = "plane", height = 0.0, friction = 0.4 }]\n'


def falling(file, height, youngs_modulus, duration, more=""):
    return f"""{FLOOR}
[scene]
duration = {duration}
frame_rate = 25
[[object]]
name = "thing"
splat = "{DATA / file}"
height = 0.4
position = [0, 0, {height}]
material = {{ model = "elastic", density = 400, youngs_modulus = {youngs_modulus}, poissons_ratio = 0.3 }}
{more}
"""


SCENES = {
    "first scene": falling("splats/plant.splat", 0.3, 5e4, 2.0),
    "angel": falling("splats/statue-angel.sog", 0.02, 2e5, 1.0),
    "skull": falling("splats/skull.sog", 0.3, 1e5, 1.0),
    "massa, 48 cells": falling("splats/statue-massa.sog", 0.3, 1e5, 1.0, "[accuracy]\nresolution = 48\n"),
    "angel, all": falling("splats/statue-angel.sog", 0.1, 1e5, 0.4, 'reduction = { mode = "all" }\n'),
    "sand": "examples/sand.toml",
    "water": "examples/water.toml",
    "two toys": "examples/two_toys.toml",
}


def text_of(scene):
    text = (ROOT / scene).read_text() if scene.endswith(".toml") else scene
    return text.replace('splat = "toy.ply"', f'splat = "{ROOT / "examples" / "toy.ply"}"')


def timed(command, folder):
    begin = time.perf_counter()
    finished = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise SystemExit(f"{' '.join(command)}: {finished.stderr[-500:]}")
    return finished.stdout, time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", help="Names of scenes.")
    chosen = parser.parse_args().only or list(SCENES)
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    if not (ROOT / "examples/toy.ply").exists():
        subprocess.run([sys.executable, "make_toy.py"], cwd=ROOT / "examples", check=True)
    print(f"{'scene':18}{'points':>9}{'said s':>9}{'took s':>9}{'ratio':>7}{'substeps':>10}{'ratio':>7}"
          f"{'grew':>6}{'memory':>8}{'disk':>7}{'dry run s':>11}")  # fmt: skip
    for name in chosen:
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "scene.toml").write_text(text_of(SCENES[name]))
            command = [GASP, "run", "scene.toml", "--render", "film.mp4"]
            text, dry = timed([*command, "--dry-run", "--json"], folder)
            said = json.loads(text)
            _, took = timed(command, folder)
            memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
            recording = Recording.open(Path(folder) / "scene.gasp")
            substeps = sum(recording.diagnostics(frame)["substeps"] for frame in range(recording.frame_count))
            disk = sum(file.stat().st_size for file in recording.path.rglob("*") if file.is_file())
            print(f"{name:18}{said['points']:9,}{said['seconds']:9.1f}{took:9.1f}{said['seconds'] / took:7.2f}"
                  f"{substeps:10,}{said['substeps'] / substeps:7.2f}{2 * substeps / said['substeps']:6.2f}"
                  f"{said['memory'] / memory:8.2f}{said['disk'] / disk:7.2f}{dry:11.1f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
