"""The engine: opens sessions."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, PointProblem, Precision
from gasp_core.errors import EngineEnvironmentError
from gasp_core.stepping.time_step import refuse_unstable_substep
from gasp_genesis_mpm.rest_step import rest_step
from gasp_genesis_mpm.session import GenesisSession

__all__ = ["GenesisMpm"]

Array = NDArray[Any]


class GenesisMpm:
    """Genesis' material point method; see `gasp_core.contract.PointEngine`.

    Raises
    ------
    EngineEnvironmentError
        Where Genesis is not installed.
    """

    def __init__(self) -> None:
        if importlib.util.find_spec("genesis") is None:
            raise EngineEnvironmentError(
                "genesis-mpm needs Genesis, which is not installed here: gasp engines install genesis-mpm"
            )

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any = None,
        restart: Mapping[str, Array] | None = None,
    ) -> GenesisSession:
        """Set a problem up, or go on from a checkpoint of it.

        Nothing is drawn at random, there is one device and one precision, and no options of its own. Genesis itself is
        started here.

        Raises
        ------
        SceneError
            Where a fixed substep is above the stable bound, points are too far apart for one grid, or the checkpoint is
            of another problem.
        """
        spacing = accuracy.spacing_for(problem.points.size)
        refuse_unstable_substep(problem, spacing, accuracy, stable_step=rest_step)
        return GenesisSession(problem, spacing, accuracy, restart)
