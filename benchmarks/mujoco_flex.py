"""What the engine mujoco-flex costs, and how true it is: embedded points, a cantilever, contact, rigid statues.

GASP_DATA=... python benchmarks/mujoco_flex.py [--points 1000000]
"""

import argparse
import math
import os
import time
from pathlib import Path

import numpy as np
from gasp_mujoco_flex.elements import CORNERS, cell_stiffness, elasticity
from gasp_mujoco_flex.engine import MujocoFlex
from gasp_mujoco_flex.plugin import MujocoOptions
from scipy import sparse
from scipy.sparse.linalg import cg

import gasp_core as gasp
from gasp_core.contract import (
    Collider,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Pinned,
    PointCloud,
    PointProblem,
    Rigid,
)
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.convex_pieces import convex_pieces

DATA = Path(os.environ.get("GASP_DATA", "../shared/data"))
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})


def problem_of(places, volume, material, **scene):
    count = len(places)
    cloud = PointCloud(
        reference_positions=places,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, volume),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=cloud, materials=(material,), **scene)


def lattice(counts, distance, corner=(0.0, 0.0, 0.0)):
    axes = [(np.arange(count) + 0.5) * distance for count in counts]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + corner


def milliseconds(work, repeats=15):
    work()
    taken = []
    begun = time.process_time()
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        taken.append(1e3 * (time.perf_counter() - start))
    cpu = 1e3 * (time.process_time() - begun) / repeats
    return f"{np.median(taken):.1f} ms (best {min(taken):.1f}), {cpu:.1f} ms of all processors"


def embedded_points(count):
    places = np.random.default_rng(0).random((count, 3)) + [0, 0, 0.5]
    soft = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    start = time.perf_counter()
    with MujocoFlex().open(problem_of(places, 1 / count, soft), options=MujocoOptions(cells=8)) as session:
        print(f"{count:,} points in 8 cells a side, opened in {time.perf_counter() - start:.1f} s")
        session.advance_to(0.01)
        print("  positions               ", milliseconds(lambda: session.read(frozenset())))
        print("  positions and velocities", milliseconds(lambda: session.read(MOVING)))


def cantilever(ratio, cells):
    """Tip under its own weight over Timoshenko's, of a beam 1 x 0.2 x 0.2."""
    side, modulus, density = 0.2 / cells, 1e6, 100
    beam = Elastic(density=density, youngs_modulus=modulus, poissons_ratio=ratio)
    pin = Pinned(region=HalfSpace(point=(0, 0, 0), normal=(1, 0, 0)))
    gravity = 0.5
    places = lattice((10 * cells, 2 * cells, 2 * cells), side / 2)
    scene = problem_of(places, (side / 2) ** 3, beam, drives=(pin,), gravity=(0, 0, -gravity))
    # Strong damping and steps of 20 ms: only where it comes to rest counts.
    with MujocoFlex().open(
        scene, accuracy=EngineAccuracy(spacing=side, substep=0.02), options=MujocoOptions(damping=0.1)
    ) as session:
        session.advance_to(2.0)
        moved = places - session.read(frozenset()).positions
    x = places[:, 0]
    tip = moved[x == x.max(), 2].mean() / sag(float(x.max()), ratio, density * gravity / modulus)
    # The same cells, four times as fine, in one linear solve: a clamp that lets no cross section shrink is stiffer than
    # theory, the more so the nearer the ratio is to 1/2.
    print(
        f"  nu {ratio}, {5 * cells} x {cells} x {cells} cells: {tip:.3f} of theory;"
        f" of a solid clamped at its end {tip / solid(ratio, 4 * cells):.3f}"
    )


def sag(x, ratio, load):
    """Timoshenko's of the beam's axis under a weight of `load` [1/m] over the modulus, in place of both."""
    bending = load * 0.04 * x**2 * (6 - 4 * x + x**2) / (24 * 0.2**4 / 12)
    return bending + load * (x - x**2 / 2) / (5 / 6 / (2 * (1 + ratio)))


def solid(ratio, cells):
    """Mean drop of the beam's end face over Timoshenko's, of so many cells across, for a small load."""
    shape = np.array([5 * cells, cells, cells])
    corners = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 1, 3) + CORNERS
    nodes = np.ravel_multi_index(tuple(np.moveaxis(corners, -1, 0)), tuple(shape + 1))
    rows = (3 * nodes[:, :, None] + np.arange(3)).reshape(-1, 24)
    cell = cell_stiffness(np.full(3, 0.2 / cells), elasticity(1.0, ratio)).ravel()
    entries = (np.tile(cell, len(rows)), (np.repeat(rows, 24, axis=1).ravel(), np.tile(rows, 24).ravel()))
    # The nodes of the clamped face come first.
    held = 3 * (cells + 1) ** 2
    stiffness = sparse.csr_array(entries)[held:, held:]
    load = np.zeros(3 * int((shape + 1).prod()))
    np.add.at(load, rows[:, 2::3], (0.2 / cells) ** 3 / 8)
    jacobi = sparse.diags_array(1 / stiffness.diagonal())
    moved, _ = cg(stiffness, load[held:], rtol=1e-8, M=jacobi)
    face = moved.reshape(-1, cells + 1, cells + 1, 3)[-1, :, :, 2]
    weights = np.outer(*[np.r_[0.5, np.ones(cells - 1), 0.5]] * 2)
    return float(np.average(face, weights=weights)) / sag(1.0, ratio, 1.0)


def drop(elements):
    soft = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    distance, height, step = 0.01, 0.5, 0.004
    # Points close to the surface, looked at after each step: how deep the surface goes, and not what is in it.
    scene = problem_of(lattice((48, 48, 48), distance, (0, 0, height)), distance**3, soft, colliders=(FLOOR,))
    deepest = spent = 0.0
    with MujocoFlex().open(
        scene, accuracy=EngineAccuracy(spacing=0.08, substep=step), options=MujocoOptions(elements=elements)
    ) as session:
        for number in range(1, 376):
            start = time.process_time()
            session.advance_to(number * step)
            spent += time.process_time() - start
            depth = distance / 2 - float(session.read(frozenset()).positions[:, 2].min())
            deepest = max(deepest, depth)
    fallen = math.sqrt(2 * 9.81 * height) * step
    print(
        f"  {elements}: penetration {1e3 * deepest:.1f} mm at worst (v dt + 1 mm = {1e3 * fallen + 1:.1f} mm),"
        f" {1e3 * depth:.1f} mm at the end; {1e3 * spent / 375:.2f} ms of processor a step"
    )


def statue(name):
    thing = gasp.SplatObject(
        name=name,
        splat=DATA / "splats" / f"{name}.sog",
        height=0.3,
        position=(0, 0, 0.3),
        rotation=(25, 10, 0),
        angular_velocity=(0, 2, 0),
        material=Rigid(density=2000),
        floaters=gasp.Floaters("drop"),
        vertices=3,
        reduction=gasp.Reduction(mode="all"),
    )
    accuracy = gasp.EngineAccuracy(resolution=64)
    scene = gasp.Scene(duration=1.0, frame_rate=25, objects=(thing,), colliders=(FLOOR,), accuracy=accuracy)
    assembly = prepare(scene).assembly
    rest = assembly.problem.points.reference_positions
    middle = rest.mean(axis=0)
    surface = convex_pieces(body_shapes(assembly.problem)[0], 1)[0] - middle
    start = time.perf_counter()
    with MujocoFlex().open(assembly.problem, accuracy=EngineAccuracy(spacing=assembly.spacing)) as session:
        opened, spent, steps, heights = time.perf_counter() - start, 0.0, 0, []
        for frame in range(1, 101):
            start = time.process_time()
            steps += session.advance_to(frame / 25).substep_count
            spent += time.process_time() - start
            state = session.read(MOVING)
            now = state.positions.mean(axis=0)
            u, _, vt = np.linalg.svd((rest - middle).T @ (state.positions - now))
            turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
            heights.append(float((surface @ turn + now)[:, 2].min()))
        off = float(np.abs((rest - middle) @ turn + now - state.positions).max())
    degrees = math.degrees(math.acos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    speed = float(np.linalg.norm(state.velocities, axis=1).max())
    print(
        f"  {name}: {len(rest):,} points, opened in {opened:.1f} s, {1e3 * spent / steps:.3f} ms of processor a step;"
        f" lowest place of its surface {1e3 * min(heights):+.2f} mm, {1e3 * heights[-1]:+.2f} mm at the end;"
        f" turned {degrees:.0f} degrees, {speed:.3f} m/s left; {off:.1e} m from rigid"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1_000_000)
    arguments = parser.parse_args()
    embedded_points(arguments.points)
    print("cantilever 1 x 0.2 x 0.2, tip / theory")
    for ratio in (0.0, 0.3, 0.49):
        cantilever(ratio, 4)
    print("a cube of 0.48 m dropped from 0.5 m")
    for elements in ("hexahedra", "tetrahedra"):
        drop(elements)
    if DATA.is_dir():
        print("rigid statues")
        for name in ("skull", "statue-angel"):
            statue(name)
    else:
        print(f"no data at {DATA}: set GASP_DATA for the statues")


if __name__ == "__main__":
    main()
