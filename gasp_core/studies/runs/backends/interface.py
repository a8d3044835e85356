"""What a backend does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Protocol

from gasp_core.studies.runs.outcome import Limits, Outcome, Run

__all__ = ["Backend", "Ended"]

Ended = tuple[int, Outcome]
"""The number of a run, and what came of it."""


class Backend(Protocol):
    """Makes runs somewhere, each in a process of its own."""

    def made(self, runs: Sequence[Run], limits: Limits) -> AbstractContextManager[Iterator[Ended]]:
        """Outcomes as they come; a run may be missing where whoever watched over it is gone for good.

        No run begins before the first outcome is asked for. Left early, by an interrupt, it ends what is under way.

        Parameters
        ----------
        runs
            With absolute paths.
        limits
            Of each.

        Raises
        ------
        BackendError
            Where there is nobody who could make them.
        """
        ...
