from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gasp_mujoco_flex.engine import MujocoFlex
from gasp_mujoco_flex.plugin import MujocoOptions
from gasp_mujoco_flex.session import MujocoSession

from gasp_core.contract import EngineAccuracy, Material, PointCloud, PointProblem


def lattice(counts: tuple[int, int, int], distance: float, corner: tuple[float, float, float]) -> np.ndarray:
    """Middles of the cells of a box."""
    axes = [(np.arange(count) + 0.5) * distance for count in counts]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + corner


@pytest.fixture
def block() -> Callable[..., PointProblem]:
    """A box of points, `distance` apart."""

    def make(
        material: Material,
        counts: tuple[int, int, int] = (8, 8, 8),
        distance: float = 0.05,
        corner: tuple[float, float, float] = (0.0, 0.0, 0.0),
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        **scene: Any,
    ) -> PointProblem:
        places = lattice(counts, distance, corner)
        count = len(places)
        return PointProblem(
            points=PointCloud(
                reference_positions=places,
                initial_velocities=np.tile(velocity, (count, 1)),
                reference_volumes=np.full(count, distance**3),
                material_ids=np.zeros(count),
                body_ids=np.zeros(count),
            ),
            materials=(material,),
            **scene,
        )

    return make


@pytest.fixture
def opened() -> Callable[..., MujocoSession]:
    """A session with the engine's defaults, but for what is given."""

    def start(problem: PointProblem, spacing: float = 0.1, *, restart: Any = None, **options: Any) -> MujocoSession:
        return MujocoFlex().open(
            problem, accuracy=EngineAccuracy(spacing=spacing), options=MujocoOptions(**options), restart=restart
        )

    return start
