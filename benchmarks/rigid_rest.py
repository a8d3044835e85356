"""Rigid captures that are dropped: how far the lowest point of their solid is from the floor as they rest.

    GASP_DATA=... python benchmarks/rigid_rest.py [--only angel ...] [--engines mujoco-flex blender]

Each is 0.4 m high, and is let go 5 cm above the floor ("upright"), or 30 cm above it and oblique ("thrown"), or 5 cm
above playbot's slab. "By points": the same without the surface of its solid, as points alone would have it. The lowest
point is looked for on the solid's own field, a third of a voxel apart; the gap is that after 4 s, and "deepest" the
least of all frames. "Creep" is how far its centre goes in the last second. On the slab the gap is the least distance
from the solid to the slab's surface, and the voxel the slab's.
"""

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import gasp_core as gasp
from gasp_core.contract import Collider, Field, HalfSpace, Rigid, SignedDistanceField
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.errors import EngineEnvironmentError
from gasp_core.scene.selection import place_object
from gasp_core.scene.solid_fields import field_of
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.body_shape import BodyShape, body_shapes
from gasp_core.stepping.convex_pieces import convex_pieces

DATA = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute() / "splats"
CAPTURES = {
    "angel": "statue-angel.sog",
    "massa": "statue-massa.sog",
    "peter": "statue-st-peter.sog",
    "skull": "skull.sog",
    "guitar": "guitar.compressed.ply",
}
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
ENDS, FRAME_RATE = 4.0, 25
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})


def problem_of(name, **placed):
    thing = gasp.SplatObject(name=name, splat=DATA / CAPTURES[name], height=0.4, material=Rigid(density=2000), **placed)
    assembly = prepare(gasp.Scene(duration=ENDS, frame_rate=FRAME_RATE, objects=(thing,), colliders=(FLOOR,))).assembly
    return assembly.problem, assembly.accuracy


def surface_of(field):
    """Places on it, a third of a spacing apart."""
    upper = np.asarray(field.origin) + field.spacing * (np.array(field.values.shape) - 1)
    fine = SignedDistanceField.sampled(field, field.origin, tuple(upper), field.spacing / 3)
    return np.concatenate(convex_pieces(fine, 1))


def moved(surface, rest, positions):
    """Places (S, 3) where the rigid motion from points at rest (N, 3) to `positions` takes them."""
    middle, now = rest.mean(axis=0), positions.mean(axis=0)
    u, _, vt = np.linalg.svd((rest - middle).T @ (positions - now))
    return (surface - middle) @ (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt) + now


def row(label, engine, problem, accuracy, surface, voxel, gap_of, precision):
    start = time.perf_counter()
    session = engine.open(
        problem, device="cpu", precision=precision, seed=0, accuracy=accuracy, options=None, restart=None
    )
    opened, spent, deepest, centres = time.perf_counter() - start, 0.0, np.inf, []
    with session:
        for frame in range(1, round(ENDS * FRAME_RATE) + 1):
            start = time.perf_counter()
            session.advance_to(frame / FRAME_RATE)
            spent += time.perf_counter() - start
            positions = session.read(MOVING).positions
            centres.append(positions.mean(axis=0))
            if frame % 4 == 0:
                gap = gap_of(moved(surface, problem.points.reference_positions, positions))
                deepest = min(deepest, gap)
    creep = np.linalg.norm(centres[-1] - centres[-1 - FRAME_RATE])
    frames = ENDS * FRAME_RATE
    print(f"{label:44}{1e3 * voxel:9.2f}{1e3 * gap:9.3f}{gap / voxel:9.3f}{1e3 * deepest:11.2f}{1e3 * creep:9.3f}"
          f"{opened:8.1f}{1e3 * spent / frames:10.1f}", flush=True)  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=list(CAPTURES), choices=list(CAPTURES))
    parser.add_argument("--engines", nargs="+", default=["mujoco-flex", "blender"])
    arguments = parser.parse_args()
    engines = {}
    for name in arguments.engines:
        offer = discover().offer(name)
        try:
            engines[name] = open_engine(offer), offer.descriptor.capabilities.precisions[0]
        except EngineEnvironmentError as error:
            print(f"{name}: not here ({error})")
    item = gasp.SplatObject(name="slab", splat=DATA / "playbot_lod3_inria_sh2.ply", height=0.6, static=True)
    slab = field_of(place_object(item, gasp.read_splat(item.splat)).solid(), "slab")
    print(f"{'capture, how, engine':44}{'voxel mm':>9}{'gap mm':>9}{'voxels':>9}{'deepest mm':>11}{'creep mm':>9}"
          f"{'open s':>8}{'frame ms':>10}")  # fmt: skip
    for name in arguments.only:
        ways = {
            "upright": {"position": (0, 0, 0.05)},
            "thrown": {"position": (0, 0, 0.3), "rotation": (25, 10, 0), "angular_velocity": (0, 2, 0)},
            "on the slab": {"position": (0.22, -0.25, 0.1)},
        }
        for way, placed in ways.items():
            problem, accuracy = problem_of(name, **placed)
            if not body_shapes(problem):
                print(f"{name}: no solid behind it")
                break
            field = body_shapes(problem)[0]
            surface, voxel, gap_of = surface_of(field), field.spacing, lowest
            if way == "on the slab":
                problem, surface = stood_on(problem, surface, slab)
                voxel, gap_of = slab.spacing, slab_gap(slab)
            for engine, (opened, precision) in engines.items():
                label = f"{name} {way}, {engine}"
                row(label, opened, problem, accuracy, surface, voxel, gap_of, precision)
                if way == "upright":
                    bare = replace(problem, hints=())
                    row(f"{label}, by points", opened, bare, accuracy, surface, voxel, gap_of, precision)


def lowest(places):
    return places[:, 2].min()


def slab_gap(slab):
    return lambda places: slab.signed_distance(places).min()


def stood_on(problem, surface, slab):
    """The problem with the slab for its collider, and the body 5 cm above that."""
    up = 0.05 - slab.signed_distance(surface).min()
    field = body_shapes(problem)[0]
    points = replace(problem.points, reference_positions=problem.points.reference_positions + [0, 0, up])
    lifted = replace(field, origin=(field.origin[0], field.origin[1], field.origin[2] + up))
    others = tuple(hint for hint in problem.hints if not isinstance(hint, BodyShape))
    colliders = (Collider(shape=slab, friction=0.4),)
    moved_up = replace(problem, points=points, colliders=colliders, hints=(*others, BodyShape(body=0, shape=lifted)))
    return moved_up, surface + [0, 0, up]


if __name__ == "__main__":
    main()
