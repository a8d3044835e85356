"""Deprecated: `gasp_core.stepping.session`, whose extension points have public names."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

from gasp_core.contract import Impulse
from gasp_core.stepping import session
from gasp_core.stepping.session import StoppedError

__all__ = ["SteppedSession", "StoppedError", "kick"]

Held = TypeVar("Held")

kick = session.impulse_change


class SteppedSession(session.SteppedSession[Held], Generic[Held]):
    """The base with the names its extension points had before: `_approach`, `_strike`, `_look` and the rest."""

    def __init_subclass__(cls, **others: Any) -> None:
        super().__init_subclass__(**others)
        warnings.warn(
            "gasp_core.engine.stepped.SteppedSession is gasp_core.stepping.session.SteppedSession now, with step_toward"
            " for _approach, apply_impulse for _strike, check_state for _look; the old names go with gasp-core 0.3",
            DeprecationWarning,
            stacklevel=2,
        )

    def step_toward(self, landing: float, end: float) -> None:
        """`_approach`."""
        self._approach(landing, end)

    def apply_impulse(self, impulse: Impulse) -> None:
        """`_strike`."""
        self._strike(impulse)

    def begin_advance(self, end: float) -> None:
        """`_begin`."""
        self._begin(end)

    def check_state(self, step: float) -> None:
        """`_look`."""
        self._look(step)

    def warnings(self) -> Sequence[str]:
        """`_remarks`."""
        return self._remarks()

    def release(self, held: Held) -> None:
        """`_release`."""
        self._release(held)

    def _approach(self, landing: float, end: float) -> None:
        raise NotImplementedError(f"{type(self).__name__} has no _approach")

    def _strike(self, impulse: Impulse) -> None:
        raise NotImplementedError(f"{type(self).__name__} has no _strike")

    def _begin(self, end: float) -> None:
        super().begin_advance(end)

    def _look(self, step: float) -> None:
        super().check_state(step)

    def _remarks(self) -> Sequence[str]:
        return super().warnings()

    def _release(self, held: Held) -> None:
        super().release(held)

    def _took(self, count: int, step: float, now: float) -> None:
        self.record_steps(count, step, now)

    def _living(self) -> Held:
        return self.held()

    def _refuse_too_many(self, step: float, end: float) -> None:
        self.refuse_too_many(step, end)

    def _refuse_lost(self, step: float, *rows: NDArray[Any]) -> None:
        self.refuse_lost(step, *rows)

    def _refuse_outside(self, positions: NDArray[Any]) -> None:
        self.refuse_outside(positions)
