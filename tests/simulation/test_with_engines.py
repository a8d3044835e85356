"""Scenes through the engines that are installed, as the core sees them: by their contract only."""

from __future__ import annotations

import numpy as np
import pytest
from installed_engines import ready

from gasp_core import Collider, Elastic, EngineAccuracy, EngineChoice, HalfSpace, RecordingChoice, Scene, SplatObject
from gasp_core import simulate as run_scene
from gasp_core.contract import Determinism
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
