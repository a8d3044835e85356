"""A ball of water that flies apart as it spins: what has flowed, without an engine that knows water."""

from __future__ import annotations

from pathlib import Path

import flying_points
from splat_shells import SHAPES, shell

from gasp_core import EngineAccuracy, EngineChoice, Fluid, Recording, Reduction, Scene, SplatObject, simulate

__all__ = ["flown_water"]


def flown_water(out: Path, name: str = "water") -> Recording:
    """A recording of it, of eleven frames; in the first nothing has flowed yet."""
    ball = SplatObject(
        name=name,
        splat=shell(SHAPES["sphere"], count=600),
        reduction=Reduction(mode="volume"),
        material=Fluid(density=1000, bulk_modulus=1e5),
        angular_velocity=(1.0, 2.0, 3.0),
        velocity=(0.3, 0.0, 1.0),
        height=0.4,
    )
    scene = Scene(
        duration=0.4,
        frame_rate=25,
        objects=(ball,),
        engine=EngineChoice(name="ballistic"),
        accuracy=EngineAccuracy(resolution=8),
    )
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    return simulate(scene, engine=engine, out=out, progress=False)
