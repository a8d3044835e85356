"""Bodies that are filled, through every engine that is installed, of every material, held and struck."""

from __future__ import annotations

import numpy as np
import pytest
from installed_engines import ready
from scipy.spatial import KDTree
from splat_shells import SHAPES, shell

from gasp_core import (
    Collider,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Fluid,
    Foam,
    HalfSpace,
    Impulse,
    Metal,
    NeoHookean,
    Pinned,
    Plasticine,
    Reduction,
    Rigid,
    Sand,
    Scene,
    Snow,
    SphereShape,
    SplatObject,
    Wind,
    simulate,
)

JELLY = Elastic(density=400, youngs_modulus=4e4, poissons_ratio=0.3)
SOLID = {"density": 400, "youngs_modulus": 4e4, "poissons_ratio": 0.3}
MATERIALS = {
    "elastic": JELLY,
    "neo-hookean": NeoHookean(**SOLID),
    "sand": Sand(**SOLID),
    "fluid": Fluid(density=400, bulk_modulus=4e4),
    "snow": Snow(**SOLID),
    "metal": Metal(**SOLID, yield_stress=2e3),
    "plasticine": Plasticine(**SOLID, yield_stress=2e3),
    "foam": Foam(**SOLID, yield_stress=2e3),
}
SIZE = 0.3
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)


@pytest.fixture(scope="module")
def ball():
    return shell(SHAPES["sphere"], count=3_000)


def drop(splat, engine, material, *, duration=0.16, height=0.0, **others):
    item = SplatObject(
        name="ball",
        splat=splat,
        material=material,
        height=SIZE,
        position=(0, 0, height),
        velocity=(0, 0, -1),
        reduction=Reduction(mode="volume"),
    )
    return Scene(
        duration=duration,
        frame_rate=25,
        objects=(item,),
        colliders=(FLOOR,),
        engine=EngineChoice(name=engine),
        accuracy=EngineAccuracy(resolution=8),
        **others,
    )


def centre(run, frame):
    return run.points(frame).mean(axis=0)


@pytest.mark.thorough
@pytest.mark.parametrize("engine", ["reference-mpm", "taichi-mpm", "warp-mpm", "mujoco-flex", "genesis-mpm", "blender"])
def test_a_ball_lands_on_the_floor_and_stays_whole(engine, ball, tmp_path):
    ready(engine)
    run = simulate(drop(ball, engine, JELLY, height=0.05), out=tmp_path / "a.gasp", progress=False)
    assert run.status == "complete"
    last = run.gaussians(run.frame_count - 1)
    spacing = run.header.spacing
    # A surface is known to about a cell, and Gaussians lie on it.
    assert last.means[:, 2].min() > -1.5 * spacing
    assert np.ptp(last.means, axis=0).max() < 1.3 * SIZE
    assert np.isfinite(last.covariances()).all()
    # It may have bounced since.
    assert min(centre(run, frame)[2] for frame in range(run.frame_count)) < centre(run, 0)[2] - 0.02


@pytest.mark.parametrize("name", MATERIALS)
def test_every_material_fills_a_body_and_carries_its_gaussians(name, ball, tmp_path):
    run = simulate(drop(ball, "warp-mpm", MATERIALS[name], duration=0.3), out=tmp_path / "a.gasp", progress=False)
    assert run.status == "complete"
    last = run.frame_count - 1
    points, gaussians = run.points(last), run.gaussians(last)
    spacing = run.header.spacing
    # Whatever it has become, Gaussians are where matter is.
    distances = KDTree(points).query(gaussians.means)[0]
    assert np.quantile(distances, 0.99) < 1.5 * spacing
    assert np.isfinite(gaussians.covariances()).all()
    longest = gaussians.scales.max(axis=1) / run.gaussians(0).scales.max(axis=1)
    assert longest.max() < 2.0 * 1.01, "the control rule bounds what is torn"


def test_a_rigid_body_turns_as_a_whole(ball, tmp_path):
    ready("mujoco-flex")
    run = simulate(drop(ball, "mujoco-flex", Rigid(density=400)), out=tmp_path / "a.gasp", progress=False)
    first, last = run.gaussians(0).means, run.gaussians(run.frame_count - 1).means
    rows = np.random.default_rng(0).choice(len(first), (200, 2))
    lengths = [np.linalg.norm(means[rows[:, 0]] - means[rows[:, 1]], axis=1) for means in (first, last)]
    # Positions are recorded in single precision, to 1e-7 of a metre; a frame's fit magnifies that some ten times.
    assert lengths[1] == pytest.approx(lengths[0], abs=1e-5)


def test_what_is_pinned_stays_what_is_driven_goes_and_what_is_struck_flies(ball, tmp_path):
    top = SphereShape(center=(0, 0, 2 * SIZE), radius=0.1)

    def moved(*drives, **others):
        scene = drop(ball, "warp-mpm", JELLY, duration=0.12, height=SIZE, drives=drives, gravity=(0, 0, 0), **others)
        run = simulate(scene, out=tmp_path / f"{len(list(tmp_path.iterdir()))}.gasp", progress=False)
        start, end = run.gaussians(0).means, run.gaussians(run.frame_count - 1).means
        held = top.signed_distance(start) < -0.02
        assert held.any()
        return end[held] - start[held], end - start

    # What is held follows the points within, and those at its edge.
    assert np.abs(moved(Pinned(region=top))[0]).max() < 0.01
    up, _ = moved(Driven(region=top, velocity=(0, 0, 0.5), center=top.center))
    assert up.mean(axis=0) == pytest.approx([0, 0, 0.06], abs=0.01)
    everywhere = SphereShape(center=(0, 0, 0), radius=9)
    mass = 400 * np.pi / 6 * SIZE**3
    _, free = moved()
    _, struck = moved(Impulse(region=everywhere, impulse=(mass * 1.0, 0, 0)))
    assert (struck - free).mean(axis=0)[0] == pytest.approx(0.12, rel=0.05)
    _, blown = moved(force_fields=(Wind(velocity=(20, 0, 0), drag=2.0),))
    assert (blown - free).mean(axis=0)[0] > 0.01
