"""An engine whose motion a test writes down: it says where points are at a time, and steps nothing."""

from __future__ import annotations

from typing import Any

from gasp_core.contract import PointProblem, PointState, Status, StepReport


class Scripted:
    """Engine and session in one; a test's own says what is read, in `read`."""

    problem: PointProblem
    time: float

    def open(self, problem: PointProblem, **others: Any) -> Scripted:
        self.time, self.problem = 0.0, problem
        return self

    def __enter__(self) -> Scripted:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def close(self) -> None:
        pass

    def advance_to(self, time: float) -> StepReport:
        self.time = time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=time, largest_substep=time)

    def read(self, fields: Any) -> PointState:
        raise NotImplementedError

    def checkpoint(self) -> dict[str, Any]:
        return {}
