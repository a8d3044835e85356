"""What backends take without a word, and answer with nonsense: no engine is ever given it.

Scenes, problems and accuracies are dataclasses that refuse it as they are made. That MuJoCo, Genesis and Blender accept
it in silence was found by trying them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gasp_core.contract import (
    BoxShape,
    Collider,
    Driven,
    Elastic,
    EngineAccuracy,
    Fluid,
    Foam,
    HalfSpace,
    Impulse,
    Metal,
    NeoHookean,
    Plasticine,
    PointCloud,
    PointProblem,
    Rigid,
    Sand,
    Snow,
    SphereShape,
    Wind,
)
from gasp_core.errors import SceneError

SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}
HERE = [[0.0, 0.0, 1.0]]
FLOOR = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))


def cloud(positions) -> PointCloud:
    count = len(positions)
    return PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, 1e-3),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )


def problem(positions, **scene) -> PointProblem:
    return PointProblem(points=cloud(positions), materials=(Elastic(**SOLID),), **scene)


NONSENSE = {
    "no stiffness": lambda: Elastic(**SOLID | {"youngs_modulus": 0.0}),
    "negative stiffness": lambda: NeoHookean(**SOLID | {"youngs_modulus": -1e5}),
    "stiffness that is no number": lambda: Elastic(**SOLID | {"youngs_modulus": math.nan}),
    "infinite stiffness": lambda: Elastic(**SOLID | {"youngs_modulus": math.inf}),
    "negative density": lambda: Elastic(**SOLID | {"density": -1.0}),
    "density that is no number": lambda: Sand(**SOLID | {"density": math.nan}),
    "incompressible solid": lambda: Elastic(**SOLID | {"poissons_ratio": 0.5}),
    "negative bulk modulus": lambda: Fluid(density=1000.0, bulk_modulus=-1e5),
    "negative viscosity": lambda: Fluid(density=1000.0, bulk_modulus=1e5, viscosity=-1.0),
    "viscosity that is no number": lambda: Fluid(density=1000.0, bulk_modulus=1e5, viscosity=math.nan),
    "sand without friction": lambda: Sand(**SOLID, friction_angle=0.0),
    "sand that cannot slide": lambda: Sand(**SOLID, friction_angle=90.0),
    "sand as steep in simple shear as nothing is": lambda: Sand(**SOLID, friction_angle=60.0),
    "sand with a cone of another name": lambda: Sand(**SOLID, cone="plane-strain"),
    "sand that pulls grains together": lambda: Sand(**SOLID, cohesion=-1.0),
    "sand that holds more than its springs": lambda: Sand(**SOLID, cohesion=1e5),
    "snow pressed to less than nothing": lambda: Snow(**SOLID, critical_compression=1.5),
    "snow that softens": lambda: Snow(**SOLID, hardening=-1.0),
    "metal without strength": lambda: Metal(**SOLID, yield_stress=0.0),
    "metal that softens": lambda: Metal(**SOLID, yield_stress=1e3, hardening=-1.0),
    "plasticine that hardens": lambda: Plasticine(**SOLID, yield_stress=1e3, softening=-1.0),
    "foam that flows back": lambda: Foam(**SOLID, yield_stress=1e3, plastic_viscosity=-1.0),
    "body without mass": lambda: Rigid(density=0.0),
    "substep of nothing": lambda: EngineAccuracy(substep=0.0),
    "substep back in time": lambda: EngineAccuracy(substep=-1e-4),
    "substep that is no number": lambda: EngineAccuracy(substep=math.nan),
    "no spacing": lambda: EngineAccuracy(spacing=0.0),
    "gravity that is no number": lambda: problem(HERE, gravity=(0.0, 0.0, math.nan)),
    "no point": lambda: cloud(np.zeros((0, 3))),
    "material that is not there": lambda: PointProblem(points=cloud(HERE), materials=()),
    "place that is no number": lambda: problem([[0.0, math.nan, 1.0]]),
    "infinite place": lambda: problem([[0.0, 0.0, math.inf]]),
    "velocity that is no number": lambda: replace(cloud(HERE), initial_velocities=[[0.0, 0.0, math.nan]]),
    "no volume": lambda: replace(cloud(HERE), reference_volumes=[0.0]),
    "volume that is no number": lambda: replace(cloud(HERE), reference_volumes=[math.nan]),
    "negative friction": lambda: Collider(shape=FLOOR, friction=-0.1),
    "friction that is no number": lambda: Collider(shape=FLOOR, friction=math.nan),
    "floor without a normal": lambda: HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 0.0)),
    "ball without a size": lambda: SphereShape(center=(0.0, 0.0, 0.0), radius=0.0),
    "wind that is no number": lambda: Wind(velocity=(math.nan, 0.0, 0.0), drag=1.0),
    "wind that speeds up what outruns it": lambda: Wind(velocity=(1.0, 0.0, 0.0), drag=-1.0),
    "drive that is no number": lambda: Driven(region=FLOOR, velocity=(0.0, math.inf, 0.0)),
    "impulse that is no number": lambda: Impulse(region=FLOOR, impulse=(0.0, 0.0, math.nan)),
    "flat box": lambda: BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("attempt", NONSENSE.values(), ids=NONSENSE)
def test_numbers_that_mean_nothing_reach_no_engine(attempt) -> None:
    with pytest.raises(SceneError) as refusal:
        attempt()
    assert "\n" not in str(refusal.value)
