"""The engine behind the descriptor: opens sessions."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from gasp_mpm_host.session import MpmSession, opened
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, PointProblem, Precision, device_class
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.threads import ThreadOptions
from gasp_core.stepping.time_step import refuse_unstable_substep
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud

__all__ = ["WarpMpm"]


class WarpMpm:
    """MLS-MPM in NVIDIA Warp; see `gasp_core.contract.PointEngine`."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str = "cpu",
        precision: Precision = Precision.FLOAT32,
        seed: int = 0,
        accuracy: EngineAccuracy | None = None,
        options: ThreadOptions | None = None,
        restart: Mapping[str, NDArray[Any]] | None = None,
    ) -> MpmSession | RigidSession:
        """Open a session; nothing here is random, so `seed` changes nothing.

        Raises
        ------
        SceneError
            For a substep above the stable bound, a grid beyond the limit, or a checkpoint of something else.
        EngineEnvironmentError
            For a GPU that is not there.
        """
        accuracy = EngineAccuracy() if accuracy is None else accuracy
        refuse_unstable_substep(problem, accuracy.spacing_for(problem.points.size), accuracy)
        on_gpu = device_class(device) == "cuda"
        build = partial(
            Cloud,
            device=runtime.device_for(device),
            double=precision is Precision.FLOAT64,
            atomic=on_gpu,
            native=not on_gpu,
        )
        return opened(problem, engine="warp-mpm", accuracy=accuracy, build=build, options=options, restart=restart)
