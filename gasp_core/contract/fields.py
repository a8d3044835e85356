"""What can be asked of an engine, and what it can promise."""

from __future__ import annotations

from enum import Enum
from typing import Any

from numpy.typing import NDArray

__all__ = ["Determinism", "Field", "Precision", "Quantity", "device_class", "device_index"]

Array = NDArray[Any]


class Field(Enum):
    """What a session can be asked for. Positions are never optional."""

    POSITIONS = "positions"
    """(N, 3) [m]"""
    VELOCITIES = "velocities"
    """(N, 3) [m/s]"""
    DEFORMATION_GRADIENTS = "deformation_gradients"
    """(N, 3, 3), total or, for plastic materials, elastic"""
    TRACER_POSITIONS = "tracer_positions"
    """(M, 3) [m]"""


class Precision(Enum):
    """Floating-point format of the engine's state."""

    FLOAT32 = "float32"
    FLOAT64 = "float64"


class Quantity(Enum):
    """What an engine conserves in the absence of anything that would change it."""

    MASS = "mass"
    LINEAR_MOMENTUM = "linear_momentum"
    ANGULAR_MOMENTUM = "angular_momentum"


class Determinism(Enum):
    """How far a second run with the same input agrees."""

    BITWISE = "bitwise"
    """On the same machine with the same number of threads."""
    TOLERANCE = "tolerance"
    """Up to rounding."""


def device_class(device: str) -> str:
    """The class of a device: "cuda" of "cuda" and of "cuda:1"."""
    return device.partition(":")[0]


def device_index(device: str) -> int | None:
    """Which of the devices of its class, from 0: 1 of "cuda:1"; None of "cuda", and of what names no device."""
    number = device.partition(":")[2]
    return int(number) if number.isascii() and number.isdecimal() else None
