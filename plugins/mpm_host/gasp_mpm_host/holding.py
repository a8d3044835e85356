"""What drives hold: which bodies, and which points count more for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, PointProblem
from gasp_core.stepping.forcing import bodies_held
from gasp_core.stepping.held_matter import firmness
from gasp_core.stepping.rigid.side import RigidSide

__all__ = ["Holding", "WeighedCloud"]

Array = NDArray[Any]


class WeighedCloud(Protocol):
    """Points whose masses can be told."""

    def positions(self) -> Array:
        """(N, 3) [m], in the given order."""
        ...

    def weigh(self, masses: Array) -> None:
        """Have points count with these masses (N,) [kg] from now on; with a point's mass goes its stress."""
        ...


class Holding:
    """What the drives of a problem hold, looked at as they begin to act, and anew in every advance.

    Parameters
    ----------
    problem
        What the cloud is of.
    rigid
        Bodies beside those of the problem; None without any.
    spacing
        Of the grid [m].
    """

    def __init__(self, problem: PointProblem, rigid: RigidSide | None, spacing: float) -> None:
        self._problem, self._rigid, self._spacing = problem, rigid, spacing
        self._count = int(problem.points.body_ids.max()) + 1
        self._acting: list[int] | None = None
        self._firmness: Array | None = None

    def begin_advance(self) -> None:
        """Look anew before the next step."""
        self._acting = None

    def bodies(self, drives: Sequence[Drive], time: float, cloud: WeighedCloud) -> Array:
        """Which bodies each of the drives at a time [s] holds, (K, B); what they hold of the cloud counts more then."""
        if not self._problem.drives and self._problem.trajectories is None:
            return np.ones((0, self._count))
        acting = list(map(id, drives))
        held = np.ones((len(drives), self._count))
        known = not drives or (self._count == 1 and self._rigid is None)
        if self._acting == acting and known:
            # Where points are is a copy of them all, and from a GPU a long way.
            return held
        places = cloud.positions()
        if drives and self._rigid is not None:
            held = self._rigid.bodies_held(drives, time, places, self._spacing)
        elif drives and self._count > 1:
            held = bodies_held(drives, time, places, self._problem.points.body_ids, self._count, self._spacing)
        if self._acting != acting:
            self._acting = acting
            self._weigh(firmness(self._problem, drives, time, places, held, self._spacing), cloud)
        return held

    def _weigh(self, counted: Array, cloud: WeighedCloud) -> None:
        # At first it is not known how they count: a checkpoint may have been of another moment.
        if self._firmness is None or not np.array_equal(counted, self._firmness):
            cloud.weigh(counted * self._problem.masses)
            self._firmness = counted
