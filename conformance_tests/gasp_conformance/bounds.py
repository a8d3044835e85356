"""Error bounds that come from how numbers are stored and how steps are taken, for whatever engine."""

from __future__ import annotations

import numpy as np

from gasp_conformance.subject import Subject

__all__ = ["ROUNDINGS_A_SUBSTEP", "place_rounding", "rounding", "unit_roundoff"]

ROUNDINGS_A_SUBSTEP = 30
"""A substep makes a point's number out of some dozens of terms, once or twice."""
_ROUNDINGS_OF_A_PLACE = 4


def unit_roundoff(subject: Subject) -> float:
    """Largest relative error of one rounding in the subject's precision."""
    return float(np.finfo(np.float64 if subject.is_double else np.float32).eps) / 2


def rounding(subject: Subject, substeps: int) -> float:
    """Relative error that rounding alone may leave in a velocity after `substeps`, if all of it adds up."""
    return ROUNDINGS_A_SUBSTEP * (substeps + 1) * unit_roundoff(subject)


def place_rounding(subject: Subject, substeps: int, reach: float, travel: float) -> float:
    """Error [m] that rounding alone may leave in a place after `substeps`, if all of it adds up.

    Parameters
    ----------
    reach
        Largest coordinate [m]: it is moved, scaled or shifted, and stored, once each a substep.
    travel
        How far [m] its velocity has taken it, with the rounding that the velocity has by then.
    """
    stored = _ROUNDINGS_OF_A_PLACE * (substeps + 1) * unit_roundoff(subject) * reach
    return stored + rounding(subject, substeps) * travel
