"""A statue put on the ground that was captured around a robot, thrown along it: does it rest there, how far does it go?

    GASP_DATA=... python benchmarks/on_a_slab.py [--engines warp-mpm ...]

The robot stands still and is a collider, with a friction of .4. The statue, .25 m high, soft in the MPM engines and
rigid in mujoco-flex, begins just above the ground at .5 m/s. "Deepest": how far the deepest of its points ever is in
the collider, in cells of the engine; "at end" after .6 s. A block on a flat floor would go v^2 / 2 mu g = 31.9 mm; the
ground is uneven, and the statue nods.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from gasp_core import Elastic, EngineAccuracy, EngineChoice, Rigid, Scene, SplatObject, simulate
from gasp_core.scene.body_contacts import BodyContact
from gasp_core.simulation.splat_sources import prepare

DATA = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute() / "splats"
CELLS = {"warp-mpm": 24, "taichi-mpm": 24, "reference-mpm": 10, "mujoco-flex": 16}
FRICTION, SPEED, HIGH = 0.4, 0.5, 0.2


def scene_of(engine, height):
    soft = Elastic(density=400, youngs_modulus=1e5 if engine == "reference-mpm" else 2e5, poissons_ratio=0.3)
    robot = SplatObject(
        name="robot",
        splat=DATA / "playbot" / "2_0",
        metres_per_unit=0.3,
        position=(0, 0, 0),
        static=True,
        collider=BodyContact(friction=FRICTION),
    )
    statue = SplatObject(
        name="statue",
        splat=DATA / "statue-angel.sog",
        height=0.25,
        position=(0.15, -0.2, height),
        velocity=(SPEED, 0, 0),
        material=Rigid(density=400) if engine == "mujoco-flex" else soft,
    )
    accuracy = EngineAccuracy(resolution=CELLS[engine])
    return Scene(
        duration=0.6, frame_rate=50, objects=(robot, statue), engine=EngineChoice(name=engine), accuracy=accuracy
    )


def just_above(assembly):
    """The height at which the first of its points touches the collider, a millimetre fine, on its way down."""
    field, points = assembly.problem.colliders[0].shape, assembly.problem.points.reference_positions
    for height in np.arange(HIGH, 0.0, -1e-3):
        if field.signed_distance(points - [0, 0, HIGH - height]).min() <= 0:
            return height + 1e-3
    raise SystemExit("there is nothing below the statue")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engines", nargs="*", choices=CELLS, default=list(CELLS))
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    print(f"{'engine':15}{'cells':>7}{'cell mm':>9}{'deepest':>9}{'at end':>8}{'way mm':>8}{'run s':>7}")
    for engine in arguments.engines:
        assembly = prepare(scene_of(engine, HIGH)).assembly
        field = assembly.problem.colliders[0].shape
        scene = scene_of(engine, just_above(assembly))
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            run = simulate(scene, out=Path(folder) / "run.gasp", progress=False)
            frames = [run.points(frame) for frame in range(run.frame_count)]
        seconds = time.perf_counter() - begin
        depths = [-field.signed_distance(frame).min() / assembly.spacing for frame in frames]
        way = np.linalg.norm((frames[-1].mean(axis=0) - frames[0].mean(axis=0))[:2])
        print(f"{engine:15}{CELLS[engine]:7}{1e3 * assembly.spacing:9.1f}{max(depths):9.2f}{depths[-1]:8.2f}"
              f"{1e3 * way:8.1f}{seconds:7.0f}", flush=True)  # fmt: skip
    print(f"(v^2 / 2 mu g: {1e3 * SPEED**2 / (2 * FRICTION * 9.81):.1f} mm)")


if __name__ == "__main__":
    main()
