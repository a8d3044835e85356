"""What comes back from a session, looked at: what an engine gets wrong of the contract, in the words of one sentence.

They are the same wherever it runs: `HeldSession` looks in this process, a worker in its own. So nothing is imported
here but NumPy and the contract.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Field, PointProblem, PointState, Status, StepReport

__all__ = ["ContractFault", "checked_checkpoint", "checked_report", "checked_state", "fault_told", "shapes_of"]

Array = NDArray[Any]

_SAME_TIME = 1e-9
"""Relative: how far the time of a state may be from the one asked for."""


class ContractFault(Exception):
    """What an engine does that no engine may; its words go on behind the engine's name."""


def fault_told(fault: object, doing: str) -> str:
    """The sentence behind an engine's name: its fault, and what it was doing."""
    return f"{fault}, while {doing}: this is a fault of the engine"


def shapes_of(problem: PointProblem, declared: Collection[Field]) -> dict[Field, tuple[int, ...]]:
    """Shapes of what can be read out of a session of a problem, by an engine that declares these fields."""
    count, tracers = len(problem.points.reference_positions), problem.points.tracer_positions
    shapes = {
        Field.POSITIONS: (count, 3),
        Field.VELOCITIES: (count, 3),
        Field.DEFORMATION_GRADIENTS: (count, 3, 3),
    }
    if tracers is not None:
        shapes[Field.TRACER_POSITIONS] = (len(tracers), 3)
    return {field: shape for field, shape in shapes.items() if field in declared or field is Field.POSITIONS}


def checked_report(report: object) -> StepReport:
    """What `advance_to` gave; ContractFault where that is no report."""
    if not isinstance(report, StepReport) or not isinstance(cast("object", report.status), Status):
        raise ContractFault(f"reports {report!r:.60}, which is no StepReport with a Status")
    if isinstance(cast("object", report.warnings), str):
        raise ContractFault("gives a text as warnings, which must be a tuple of them")
    return report


def checked_state(
    state: object, fields: Collection[Field], shapes: Mapping[Field, tuple[int, ...]], now: float
) -> PointState:
    """What `read` gave.

    Parameters
    ----------
    fields
        Those that were asked for; what more there is is looked at by nobody.
    shapes
        As `shapes_of` has them.
    now
        Time [s] that the session is at.

    Raises
    ------
    ContractFault
        Where it is no state of that time, or has not these fields in these shapes as real numbers.
    """
    if not isinstance(state, PointState):
        raise ContractFault(f"gives {state!r:.60}, which is no PointState")
    for field in {Field.POSITIONS, *fields} & shapes.keys():
        _look_at(getattr(state, field.value), field, shapes[field])
    if not math.isclose(state.time, now, rel_tol=_SAME_TIME, abs_tol=1e-12):
        raise ContractFault(f"gives a state of {state.time!r} s, where the session is at {now!r} s")
    return state


def checked_checkpoint(found: object) -> Mapping[str, Array]:
    """What `checkpoint` gave; ContractFault where these are no arrays by name."""
    if not isinstance(found, Mapping):
        raise ContractFault(f"gives {found!r:.60}, which is no mapping of arrays")
    for name, array in cast("Mapping[Any, Any]", found).items():
        if not isinstance(name, str) or np.asarray(array).dtype.hasobject:
            raise ContractFault(f"gives {array!r:.60} as {name!r:.60}, which is no array of numbers")
    return cast("Mapping[str, Array]", found)


def _look_at(values: object, field: Field, shape: tuple[int, ...]) -> None:
    if not isinstance(values, np.ndarray):
        raise ContractFault(f"gives {values!r:.60} as {field.value}, which is no array")
    array = cast("Array", values)
    # float16 has too few digits for places, and LAPACK none for it.
    if array.shape != shape or array.dtype.kind != "f" or array.itemsize < 4:
        raise ContractFault(
            f"gives {field.value} of shape {array.shape} and type {array.dtype}, expected {shape} of float64"
            " (float32 is converted)"
        )
