"""Checks on the numbers and arrays that enter the contract."""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Iterable, Sequence
from enum import Enum
from typing import Any, SupportsIndex, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError

__all__ = [
    "finite", "finite_vector", "frozen_array", "instance", "member", "members", "positive", "unit_vector", "whole",
    "whole_number",
]  # fmt: skip

Vector = tuple[float, float, float]

_ROUNDED = 4 * sys.float_info.epsilon
"""Off 1 by no more, a length is one that was made so: three quotients, and the length that is taken anew."""

_LONGEST_SAID = 80
"""Letters of a value that is no such."""


def finite(owner: object, name: str, *, low: float = -math.inf, high: float = math.inf, open_low: bool = False) -> None:
    """Refuse a number of a dataclass outside [low, high] ((low, high] if `open_low`), naming class and field.

    NumPy's numbers become Python's own, which can be written down.
    """
    value = getattr(owner, name)
    where = f"{type(owner).__name__}.{name}"
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
        raise SceneError(f"{where} must be a number, found {value!r}")
    try:
        bounded = math.isfinite(value)
    except OverflowError:
        raise SceneError(f"{where} must be below 1e308, found a whole number that is longer") from None
    if not bounded:
        raise SceneError(f"{where} must be finite, found {value!r}")
    if value < low or value > high or (open_low and value == low):
        bounds = f"> {low:g}" if open_low else f">= {low:g}"
        if high != math.inf:
            bounds += f" and <= {high:g}"
        raise SceneError(f"{where} must be {bounds}, found {value!r}")
    if isinstance(value, np.generic):
        object.__setattr__(owner, name, value.item())


def member(owner: object, name: str, kind: type[Enum]) -> None:
    """Refuse what is no member of an enumeration; the value of one becomes it."""
    value = getattr(owner, name)
    try:
        object.__setattr__(owner, name, kind(value))
    except ValueError:
        known = ", ".join(f"{kind.__name__}.{one.name}" for one in kind)
        raise SceneError(f"{type(owner).__name__}.{name} must be one of {known}, found {value!r}") from None


def instance(owner: object, name: str, *kinds: type, hint: str = "") -> None:
    """Refuse what is of none of the kinds, naming them; `hint` says what to write instead."""
    value = getattr(owner, name)
    if not isinstance(value, kinds):
        raise SceneError(f"{type(owner).__name__}.{name} must be {_a(kinds)}, found {_short(value)}{hint}")


def members(owner: object, name: str, *kinds: type) -> None:
    """Replace a field by the tuple of its entries, or refuse it where one is of none of the kinds."""
    values = getattr(owner, name)
    where = f"{type(owner).__name__}.{name}"
    # What is one where several may stand is the commonest of mistakes.
    if isinstance(values, kinds) or not isinstance(values, Iterable):
        raise SceneError(f"{where} must be a tuple of {_names(kinds)}, found {_short(values)}")
    found: tuple[Any, ...] = tuple(cast("Iterable[Any]", values))
    for number, value in enumerate(found):
        if not isinstance(value, kinds):
            raise SceneError(f"{where}[{number}] must be {_a(kinds)}, found {_short(value)}")
    object.__setattr__(owner, name, found)


def _a(kinds: Sequence[type]) -> str:
    names = _names(kinds)
    return names if names[0] == "N" else f"{'an' if names[0] in 'AEIOU' else 'a'} {names}"


def _names(kinds: Sequence[type]) -> str:
    return " or ".join("None" if kind is type(None) else kind.__name__ for kind in kinds)


def _short(value: object) -> str:
    said = " ".join(repr(value).split())
    return said if len(said) <= _LONGEST_SAID else f"{said[:_LONGEST_SAID]}..."


def positive(owner: object, *names: str) -> None:
    """Refuse numbers that are not > 0."""
    for name in names:
        finite(owner, name, low=0.0, open_low=True)


def whole(value: object) -> int | None:
    """A whole number, NumPy's too, as Python's own; None where it is none, as 1.0 and True are."""
    if isinstance(value, bool) or not isinstance(value, SupportsIndex):
        return None
    try:
        return operator.index(value)
    except TypeError:
        # As arrays of NumPy and its True have it.
        return None


def whole_number(owner: object, name: str, *, low: float = -math.inf, high: float = math.inf) -> None:
    """Replace a field by Python's own whole number, or refuse a fraction and what is outside [low, high].

    24.0 is 24: numbers that were computed come so.
    """
    value = getattr(owner, name)
    number = int(value) if isinstance(value, (float, np.floating)) and float(value).is_integer() else whole(value)
    if number is None:
        raise SceneError(f"{type(owner).__name__}.{name} must be a whole number, found {value!r}")
    object.__setattr__(owner, name, number)
    finite(owner, name, low=low, high=high)


def finite_vector(owner: object, name: str) -> None:
    """Replace a field by a tuple of three finite floats, or refuse it."""
    value = getattr(owner, name)
    where = f"{type(owner).__name__}.{name}"
    try:
        vector = tuple(float(component) for component in value)
    except (TypeError, ValueError):
        raise SceneError(f"{where} must be three numbers, found {value!r}") from None
    except OverflowError:
        raise SceneError(f"{where} must be below 1e308, found a whole number that is longer") from None
    if len(vector) != 3 or not all(math.isfinite(component) for component in vector):
        raise SceneError(f"{where} must be three finite numbers, found {value!r}")
    object.__setattr__(owner, name, vector)


def unit_vector(owner: object, name: str) -> None:
    """Replace a field by its direction, or refuse a zero vector; what is of length 1 already stays to the last bit."""
    finite_vector(owner, name)
    vector: Vector = getattr(owner, name)
    if not any(vector):
        raise SceneError(f"{type(owner).__name__}.{name} must not be the zero vector")
    if abs(math.hypot(*vector) - 1) <= _ROUNDED:
        return
    # By a power of two, which rounds nothing: a length beyond 1e308 is none, one of 1e-320 has few digits.
    exponent = math.frexp(max(map(abs, vector)))[1]
    near = [math.ldexp(component, -exponent) for component in vector]
    length = math.hypot(*near)
    object.__setattr__(owner, name, tuple(component / length for component in near))


def frozen_array(
    owner: object, name: str, shape: tuple[int | None, ...], dtype: type[np.generic], *, what: str = "row"
) -> NDArray[Any]:
    """Replace a field by an owned, read-only, finite array of the given shape, or refuse it.

    `None` in `shape` is any length. The first offending rows are named, because that is what one searches for.
    """
    where = f"{type(owner).__name__}.{name}"
    array = np.array(getattr(owner, name), dtype=dtype, order="C")
    if len(array.shape) != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape)):
        wanted = "(" + ", ".join("N" if want is None else str(want) for want in shape) + ")"
        raise SceneError(f"{where} has shape {array.shape}, expected {wanted}")
    if np.issubdtype(dtype, np.floating):
        good = np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
        if not good.all():
            bad = np.flatnonzero(~good)
            first = ", ".join(str(index) for index in bad[:5])
            raise SceneError(f"{where} is not finite in {len(bad)} {what}(s), first {first}")
    array.flags.writeable = False
    object.__setattr__(owner, name, array)
    return array
