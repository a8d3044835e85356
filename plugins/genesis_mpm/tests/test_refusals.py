"""What Genesis would take without a word is refused before it sees it; none of this needs it.

Numbers that mean nothing to any engine are the contract's business: `tests/test_impossible_numbers.py` of the core.
What Genesis does in silence with what it was rightly given is met in `test_session.py`: points that leave its grid, and
numbers that are lost anywhere but in a position.
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace

import numpy as np
import pytest
from gasp_genesis_mpm.engine import GenesisMpm
from gasp_genesis_mpm.plugin import ENVIRONMENT, gasp_point_engines

from gasp_core.contract import Elastic, EngineAccuracy, PointCloud, PointProblem, Precision
from gasp_core.errors import EngineEnvironmentError, SceneError

SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}
HERE = [[0.0, 0.0, 1.0]]


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
