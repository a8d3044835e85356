"""What Genesis would take without a word is refused before it sees it; none of this needs it."""

from __future__ import annotations

import importlib.util
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from gasp_genesis_mpm.engine import GenesisMpm
from gasp_genesis_mpm.plugin import ENVIRONMENT, gasp_point_engines

from gasp_core.engine.contract import EngineAccuracy, PointCloud, PointProblem, Precision
from gasp_core.engine.forcing import Collider
from gasp_core.engine.materials import Elastic, Fluid, Metal, NeoHookean, Sand, Snow
from gasp_core.engine.shapes import BoxShape, HalfSpace
from gasp_core.errors import EngineEnvironmentError, SceneError

FLOOR = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)


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
    return PointProblem(points=cloud(positions), materials=(SOFT,), **scene)


SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}
HERE = [[0.0, 0.0, 1.0]]

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
    "snow pressed to less than nothing": lambda: Snow(**SOLID, critical_compression=1.5),
    "snow that softens": lambda: Snow(**SOLID, hardening=-1.0),
    "metal without strength": lambda: Metal(**SOLID, yield_stress=0.0),
    "metal that softens": lambda: Metal(**SOLID, yield_stress=1e3, hardening=-1.0),
    "substep of nothing": lambda: EngineAccuracy(substep=0.0),
    "substep back in time": lambda: EngineAccuracy(substep=-1e-4),
    "substep that is no number": lambda: EngineAccuracy(substep=math.nan),
    "no spacing": lambda: EngineAccuracy(spacing=0.0),
    "gravity that is no number": lambda: problem(HERE, gravity=(0.0, 0.0, math.nan)),
    "place that is no number": lambda: problem([[0.0, math.nan, 1.0]]),
    "infinite place": lambda: problem([[0.0, 0.0, math.inf]]),
    "velocity that is no number": lambda: replace(problem(HERE).points, initial_velocities=[[0.0, 0.0, math.nan]]),
    "no volume": lambda: replace(problem(HERE).points, reference_volumes=[0.0]),
    "volume that is no number": lambda: replace(problem(HERE).points, reference_volumes=[math.nan]),
    "negative friction": lambda: Collider(shape=FLOOR.shape, friction=-0.1),
    "friction that is no number": lambda: Collider(shape=FLOOR.shape, friction=math.nan),
    "floor without a normal": lambda: HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 0.0)),
    "flat box": lambda: BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("attempt", NONSENSE.values(), ids=NONSENSE)
def test_numbers_that_mean_nothing_never_reach_genesis(attempt) -> None:
    with pytest.raises(SceneError) as refusal:
        attempt()
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("scene", "accuracy", "words"),
    [
        # Genesis' own advice, 0.02 dx, is 30 times too much for this.
        ({"materials": (Elastic(**SOLID | {"youngs_modulus": 1e9}),)}, {"substep": 2e-3}, "above the stable bound"),
        ({"points": cloud([[0.0, 0.0, 0.0], [90.0, -80.0, 100.0], [0.1, 0.0, 0.0]])}, {}, "farthest is point 1 at"),
    ],
)
def test_what_genesis_would_take_is_refused_before_it_is_started(
    monkeypatch: pytest.MonkeyPatch, scene, accuracy, words: str
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    monkeypatch.setitem(sys.modules, "genesis", None)
    with pytest.raises(SceneError, match=words):
        GenesisMpm().open(
            replace(problem(HERE), **scene),
            device="cpu",
            precision=Precision.FLOAT32,
            seed=0,
            accuracy=EngineAccuracy(spacing=0.1, **accuracy),
        )


def test_without_genesis_the_engine_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(EngineEnvironmentError, match="gasp engines install genesis-mpm"):
        GenesisMpm()


def test_the_descriptor_says_what_its_environment_needs() -> None:
    (descriptor,) = gasp_point_engines()
    assert descriptor.environment is ENVIRONMENT
    assert any(package.startswith("genesis-world==") for package in ENVIRONMENT.packages)
    # Without it, an installation brings gigabytes of another one.
    assert any(package.startswith("torch==") for package in ENVIRONMENT.packages)
