"""What an advance did, and the verdict on it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from numpy.typing import NDArray

__all__ = ["Status", "StepReport"]

Array = NDArray[Any]


class Status(Enum):
    """Verdict on an advance. Anything but OK ends the run, and the frames up to there are kept.

    Attributes
    ----------
    OK
        The time that was asked for is reached. Warnings may still tell of what is odd.
    NON_FINITE
        A point's state is no longer a finite number.
    ENERGY_GREW
        Matter has more energy than anything could have given it; GASP watches for that itself.
    OUT_OF_DOMAIN
        A point left a domain with `DomainPolicy.STOP`, or has gone further than the engine can follow.
    NOT_CONVERGED
        A solve has not come to its tolerance within its iterations.
    CRUSHED
        Elastic matter was pressed flat or turned inside out, and has no shape left to come back to.
    SUBSTEP_LIMIT
        The advance would take more substeps than `EngineAccuracy.substep_limit` allows.
    """

    OK = "ok"
    NON_FINITE = "non_finite"
    ENERGY_GREW = "energy_grew"
    OUT_OF_DOMAIN = "out_of_domain"
    NOT_CONVERGED = "not_converged"
    CRUSHED = "crushed"
    SUBSTEP_LIMIT = "substep_limit"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReport:
    """What an advance did.

    Parameters
    ----------
    status
        Verdict.
    substep_count, smallest_substep, largest_substep
        Number and sizes [s] of the steps taken.
    warnings
        One sentence each, for the user; also the reason where `status` is not OK.
    solver_iterations
        Of all solves of an engine that iterates, in sum.
    solver_residual
        The largest, relative, that a solve ended with; None where the engine does not iterate or does not tell.
    """

    status: Status
    substep_count: int
    smallest_substep: float
    largest_substep: float
    warnings: tuple[str, ...] = ()
    solver_iterations: int = 0
    solver_residual: float | None = None
