"""Scenes through the engines that are installed, as the core sees them: by their contract only."""

from __future__ import annotations

import numpy as np
import pytest
from gasp_conformance.subject import find_subject
from installed_engines import ready

from gasp_core import Collider, Elastic, EngineAccuracy, EngineChoice, HalfSpace, RecordingChoice, Scene, SplatObject
from gasp_core import simulate as run_scene
from gasp_core.contract import BodyContact, BoxShape, Determinism, Pinned, PointCloud, PointProblem, Precision
from gasp_core.discovery.registry import discover


@pytest.fixture
def drop(cloud):
    def make(engine, **options):
        item = SplatObject(
            name="toy",
            splat=cloud(60),
            material=Elastic(density=300, youngs_modulus=2e4, poissons_ratio=0.3),
            height=0.3,
            position=(0, 0, 0.05),
            velocity=(0, 0, -1),
        )
        return Scene(
            duration=0.24,
            frame_rate=25,
            objects=(item,),
            colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),),
            engine=EngineChoice(name=engine),
            accuracy=EngineAccuracy(resolution=8),
            recording=RecordingChoice(checkpoint_frames=2),
            **options,
        )

    return make


@pytest.mark.parametrize("engine", ["reference-mpm", "taichi-mpm", "warp-mpm"])
def test_a_toy_falls_and_a_stopped_run_goes_on_to_the_same(engine, drop, tmp_path):
    ready(engine)
    whole = run_scene(drop(engine), out=tmp_path / "whole.gasp")
    assert (whole.status, whole.frame_count) == ("complete", 7)
    spacing = whole.header.spacing
    for frame in range(7):
        # MLS-MPM knows a surface to about a cell.
        assert whole.points(frame)[:, 2].min() > -spacing
        energy = whole.diagnostics(frame)
        start = whole.diagnostics(0)["kinetic_energy"]
        assert energy["kinetic_energy"] <= 1.05 * (start - energy["potential_energy"]) + 1e-3 * start
    assert np.isfinite(whole.gaussians(6).covariances()).all()
    run_scene(drop(engine), out=tmp_path / "a.gasp", frames=4)
    rest = run_scene(drop(engine), out=tmp_path / "a.gasp", resume=True)
    assert rest.status == "complete"
    if discover().descriptor(engine).capabilities.determinism is Determinism.BITWISE:
        for frame in range(7):
            assert np.array_equal(whole.points(frame), rest.points(frame))


def block(corner, cells, spacing):
    """Points of a block of whole cells, eight in each."""
    axes = [begin + (np.arange(2 * count) + 0.5) * spacing / 2 for begin, count in zip(corner, cells)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize(
    "engine", ["reference-mpm", pytest.param("taichi-mpm", marks=pytest.mark.thorough), "warp-mpm"]
)
def test_what_glides_on_a_pinned_block_is_not_held(engine):
    """The region of the pin ends where the block does, and nodes of the one that glides are in it all the same."""
    ready(engine)
    spacing = 0.05
    slab, glider = block((-0.2, -0.2, -0.1), (16, 8, 2), spacing), block((-0.1, -0.1, 0.0), (2, 4, 2), spacing)
    points = np.concatenate([slab, glider])
    moving = np.arange(len(points)) >= len(slab)
    problem = PointProblem(
        points=PointCloud(
            reference_positions=points,
            initial_velocities=moving[:, None] * [1.0, 0.0, 0.0],
            reference_volumes=np.full(len(points), (spacing / 2) ** 3),
            material_ids=np.zeros(len(points)),
            body_ids=moving.astype(np.int64),
        ),
        materials=(Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3),),
        body_contact=BodyContact(),
        drives=(Pinned(region=BoxShape(center=(0.2, 0.0, -0.05), half_extents=(0.4, 0.2, 0.05))),),
    )
    subject = find_subject(engine, Precision.FLOAT64, None)
    *_, end = subject.states(problem, EngineAccuracy(spacing=spacing), [0.1, 0.2], ())
    places = end.positions
    way = (places[moving] - glider).mean(axis=0)[0]
    # It bounces by its own settling, a two-hundredth of the height, and meets nothing along its way.
    assert way == pytest.approx(0.2, abs=0.002)
    # Nodes just outside the region are free, and give way to what weighs on them.
    assert np.abs(places[~moving] - slab).max() < 0.01 * spacing
