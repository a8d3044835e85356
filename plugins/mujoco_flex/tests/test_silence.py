"""MuJoCo answers numbers that are lost by a silent start from the beginning, and by a file in the working folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gasp_core.contract import Elastic, Material, PointProblem, Rigid, Status

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
RIGID = Rigid(density=1000.0)


# MuJoCo takes more than 1e10 for lost; what is not finite is refused before it gets there.
@pytest.mark.parametrize("lost", [2e10, 1e30])
@pytest.mark.parametrize("material", [SOFT, RIGID], ids=lambda one: one.kind)
def test_nothing_begins_anew_where_a_number_is_lost(
    block: Callable[..., PointProblem],
    opened: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    material: Material,
    lost: float,
) -> None:
    monkeypatch.chdir(tmp_path)
    problem = block(material, (4, 4, 4))
    with opened(problem) as session:
        session.advance_to(0.1)
        state = {name: array.copy() for name, array in session.checkpoint().items()}
    # MuJoCo's own row: the time, then places.
    state["state"][1] = lost
    with opened(problem, restart=state) as session:
        report = session.advance_to(0.2)
        assert report.status is not Status.OK or np.isfinite(lost)
        # From the beginning, nothing would be lost, and all of it near where it started.
        positions = session.read(frozenset()).positions
    assert not (np.isfinite(positions).all() and np.abs(positions).max() < 1)
    assert not list(tmp_path.iterdir())
