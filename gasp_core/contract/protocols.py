"""An engine and its sessions, as the core calls them."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Protocol, Self

from numpy.typing import NDArray

from gasp_core.contract.accuracy import EngineAccuracy
from gasp_core.contract.fields import Field, Precision
from gasp_core.contract.points import PointProblem, PointState
from gasp_core.contract.report import StepReport

__all__ = ["EngineSession", "PointEngine", "ViewingSession"]

Array = NDArray[Any]


class EngineSession(Protocol):
    """A running simulation. A context manager; owns its memory."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s]; the substeps are the engine's business.

        Advancing to the present does nothing, in no substeps.

        Raises
        ------
        ValueError
            Where `time` is before the session's, or not finite. The session stays as it is and can go on.
        """
        ...

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields: owned, read-only, C-contiguous float64 host arrays, in the order given.

        Runs convert float32 and another order on the way; the conformance suite does not let them pass.
        """
        ...

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything `open(..., restart=...)` needs to go on as if nothing had happened, where declared."""
        ...

    def close(self) -> None:
        """Release everything; may be called twice. Whatever is asked of a closed session then raises ValueError."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...


class ViewingSession(EngineSession, Protocol):
    """A session that hands out its state where it is, for engines that declare `EngineCapabilities.views`.

    One that runs in a process of its own has none to hand out: it can be read.
    """

    def view(self, field: Field) -> Any:
        """A field as an array on the session's device, of the engine's own precision, rows in the order given.

        Anything that can be asked for `__dlpack__` and `__dlpack_device__`: `numpy.from_dlpack`, `torch.from_dlpack`
        and their like take it without a copy. It is to be read only, and holds until the session next advances or is
        closed.
        """
        ...


class PointEngine(Protocol):
    """A black box that moves points."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any,
        restart: Mapping[str, Array] | None = None,
    ) -> EngineSession:
        """Set a problem up.

        Parameters
        ----------
        problem
            The scene as points; checked against the declared capabilities already.
        device
            One of `EngineCapabilities.devices`.
        precision
            One of `EngineCapabilities.precisions`.
        seed
            For whatever the engine draws at random.
        accuracy
            The common knobs.
        options
            An instance of the engine's own `EngineDescriptor.options`; None where it has none.
        restart
            A checkpoint of a session of the same problem. It comes out of a file: arrays that are missing, of another
            shape, of text or not finite, and numbers that no run has written, are refused before they are used.

        Raises
        ------
        SceneError
            Where the problem cannot be set up, e.g. a substep above the stable bound, or the checkpoint is none of it.
        """
        ...
