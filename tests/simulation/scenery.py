"""The scene of the runs that are killed; a module, so that test and child process have the very same."""

from __future__ import annotations

import numpy as np

from gasp_core import Elastic, EngineChoice, Gaussians, RecordingChoice, Scene, SplatObject

FRAMES = 12


def scene() -> Scene:
    rng = np.random.default_rng(3)
    count = 200
    splat = Gaussians(
        means=rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=np.exp(rng.uniform(-5, -2, size=(count, 3))),
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )
    material = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    return Scene(
        duration=(FRAMES - 1) / 25,
        frame_rate=25,
        objects=(SplatObject(name="thing", splat=splat, material=material),),
        engine=EngineChoice(name="ballistic", options={"spin": 3.0, "pause": 0.01}),
        recording=RecordingChoice(checkpoint_frames=3, velocities=True),
    )
