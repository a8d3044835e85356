"""What a worker answers, checked before anything is done with it.

A worker is a program of its own, perhaps with another version of this package, and what its backend prints may get
between its lines: an answer is JSON of whatever shape. Every function here returns what it says, or raises ValueError.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from gasp_core import errors
from gasp_core.contract import Status, StepReport
from gasp_core.engines.contract_faults import ContractFault
from gasp_core.engines.worker.shared_memory import Layout
from gasp_core.errors import EngineDivergedError, GaspError
from gasp_core.io.format_errors import shown

__all__ = ["any_layout", "expected_layout", "failure", "nothing", "report", "time"]

_FIELDS = {
    "status",
    "substep_count",
    "smallest_substep",
    "largest_substep",
    "warnings",
    "solver_iterations",
    "solver_residual",
}
_MOST_AXES = 32
_TYPE = re.compile(r"[<>|=]?[biufcSU][1-9][0-9]{0,8}")
"""As NumPy writes those that are numbers or text in the memory itself: an object would be an address."""


def failure(told: Any) -> Exception | str:
    """The error that an engine met, to be raised; or the words of one that is none of ours."""
    entries = _mapping(told, "a failure")
    kind, words = entries.get("kind"), shown(_text(entries.get("words"), "the words of a failure"))
    if kind is None:
        return words
    if kind == ContractFault.__name__:
        return ContractFault(words)
    if kind == "ValueError":
        return ValueError(words)
    if kind == EngineDivergedError.__name__:
        return EngineDivergedError(words, report(entries.get("report")))
    known = getattr(errors, kind) if isinstance(kind, str) and kind in errors.__all__ else None
    _expect(isinstance(known, type) and issubclass(known, GaspError), "a failure is of no kind that there is")
    return cast("type[GaspError]", known)(words)


def nothing(done: Any) -> None:
    """Of what answers nothing but that it is done."""
    _expect(done is None, "more than that it is done")


def time(done: Any) -> float:
    """Simulated time [s] that a session is at."""
    return _number(_mapping(done, "an answer").get("time"), "the time")


def report(plain: Any) -> StepReport:
    """What an advance did, as `gasp_core.engines.worker.serialization.to_plain` has it."""
    fields = _mapping(_mapping(plain, "a report").get("fields"), "a report")
    # A version that does not know of a field yet says nothing of it.
    _expect(fields.keys() <= _FIELDS, "the report has fields that this version does not know")
    status = _text(_mapping(fields.get("status"), "the status").get("name"), "the status")
    _expect(status in Status.__members__, "the status is none")
    warnings = _list(_mapping(fields.get("warnings", {"items": []}), "warnings").get("items"), "warnings")
    residual = fields.get("solver_residual")
    substeps = _count(fields.get("substep_count"), "substep_count")
    # Of what failed, or of no steps at all, sizes may be whatever the engine's sums began with.
    size = _number if substeps and Status[status] is Status.OK else _real
    return StepReport(
        status=Status[status],
        substep_count=substeps,
        smallest_substep=size(fields.get("smallest_substep"), "smallest_substep"),
        largest_substep=size(fields.get("largest_substep"), "largest_substep"),
        warnings=tuple(shown(_text(warning, "a warning")) for warning in warnings),
        solver_iterations=_count(fields.get("solver_iterations", 0), "solver_iterations"),
        solver_residual=None if residual is None else _real(residual, "solver_residual"),
    )


def any_layout(done: Any) -> Layout:
    """Where arrays of whatever names and shapes lie in the shared memory."""
    layout: Layout = {}
    for name, entry in _mapping(_mapping(done, "an answer").get("layout"), "the layout").items():
        told = _list(entry, f"the place of {shown(name)}")
        _expect(len(told) == 3, f"{shown(name)} lies nowhere")
        kind, shape, offset = told
        _expect(_TYPE.fullmatch(_text(kind, "a type")) is not None, f"{shown(name)} is of no type that is sent")
        try:
            dtype = np.dtype(kind)
        except TypeError:
            raise ValueError(f"{shown(name)} is of no type") from None
        lengths = [
            _count(length, f"a length of {shown(name)}") for length in _list(shape, f"the shape of {shown(name)}")
        ]
        _expect(len(lengths) <= _MOST_AXES, f"{shown(name)} has too many axes")
        layout[name] = (dtype.str, lengths, _count(offset, f"the place of {shown(name)}"))
    return layout


def expected_layout(done: Any, shapes: Mapping[str, tuple[int, ...]]) -> Layout:
    """Where arrays of these names and shapes lie in the shared memory; what more there is, is passed over."""
    found = any_layout(done)
    _expect(shapes.keys() <= found.keys(), f"other arrays than {', '.join(sorted(shapes))}")
    layout: Layout = {name: found[name] for name in shapes}
    for name, (kind, shape, _) in layout.items():
        dtype = np.dtype(kind)
        fits = tuple(shape) == shapes[name] and dtype.kind == "f"
        _expect(fits, f"{name} of shape {tuple(shape)} and type {dtype}, expected {shapes[name]} of real numbers")
    return layout


def _mapping(value: Any, what: str) -> dict[str, Any]:
    _expect(isinstance(value, dict), f"{what} is none")
    return value


def _list(value: Any, what: str) -> list[Any]:
    _expect(isinstance(value, list), f"{what} is none")
    return value


def _text(value: Any, what: str) -> str:
    _expect(isinstance(value, str), f"{what} is no text")
    return value


def _number(value: Any, what: str) -> float:
    number = _real(value, what)
    _expect(math.isfinite(number), f"{what} is no number")
    return number


def _real(value: Any, what: str) -> float:
    """A number, perhaps infinite or NaN."""
    fine = type(value) is float or (type(value) is int and abs(value) <= sys.float_info.max)
    _expect(fine, f"{what} is no number")
    return float(value)


def _count(value: Any, what: str) -> int:
    _expect(type(value) is int and 0 <= value < 1 << 62, f"{what} is no whole number")
    return value


def _expect(fine: bool, fault: str) -> None:
    if not fine:
        raise ValueError(fault)
