"""The engine behind the descriptor: opens sessions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, PointProblem, Precision
from gasp_core.engine.stability import refuse_unstable_substep
from gasp_taichi_mpm import runtime
from gasp_taichi_mpm.options import TaichiOptions
from gasp_taichi_mpm.session import TaichiSession

__all__ = ["TaichiMpm"]

_ENOUGH_POINTS = 20_000
"""Below this, handing loops to a pool of threads costs more than it gains."""


class TaichiMpm:
    """MLS-MPM in Taichi; see `gasp_core.engine.contract.PointEngine`."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str = "cpu",
        precision: Precision = Precision.FLOAT32,
        seed: int = 0,
        accuracy: EngineAccuracy | None = None,
        options: TaichiOptions | None = None,
        restart: Mapping[str, NDArray[Any]] | None = None,
    ) -> TaichiSession:
        """Open a session; nothing here is random, so `seed` changes nothing.

        Raises
        ------
        SceneError
            For a substep above the stable bound, a grid beyond the limit, or a checkpoint of something else.
        EngineEnvironmentError
            For a GPU that is not there.
        """
        accuracy = EngineAccuracy() if accuracy is None else accuracy
        options = TaichiOptions() if options is None else options
        refuse_unstable_substep(problem, accuracy.spacing_for(problem.points), accuracy)
        available = runtime.processors()
        threads = options.threads or (available if len(problem.points) >= _ENOUGH_POINTS else 1)
        runtime.acquire(device)
        try:
            return TaichiSession(
                problem,
                accuracy=accuracy,
                double=precision is Precision.FLOAT64,
                threads=min(threads, available),
                on_gpu=device == "cuda",
                restart=restart,
            )
        except BaseException:
            runtime.release()
            raise
