from __future__ import annotations

import math

import pytest
from gasp_mujoco_flex.time_step import step_size

from gasp_core.contract import EngineAccuracy


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("span", [0.01, 10.0])
@pytest.mark.parametrize("sound", [0.0, 3.0, 1000.0])
def test_what_is_larger_takes_steps_as_its_time_goes(scale, span, sound):
    # L -> s L and E -> s E at one density and gravity: times and speeds go with the root of s.
    root = math.sqrt(scale)

    def step(size: float, time: float, speed: float) -> float:
        return step_size(
            EngineAccuracy(),
            span=span * time,
            size=size,
            side=0.1 * size,
            sound=sound * speed,
            speed=0.7 * speed,
            acceleration=9.81,
        )

    assert step(scale, root, root) == pytest.approx(root * step(1.0, 1.0, 1.0), rel=1e-12)
