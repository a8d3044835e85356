"""What can be asked of an engine, and what it can promise."""

from __future__ import annotations

from enum import Enum
from typing import Any

from numpy.typing import NDArray

__all__ = ["Determinism", "Field", "Precision", "Quantity", "device_class", "device_index"]

Array = NDArray[Any]


class Field(Enum):
    """What a session can be asked for. Positions are never optional.

    Attributes
    ----------
    POSITIONS
        Of the points, (N, 3) [m].
    VELOCITIES
        Of the points, (N, 3) [m/s].
    DEFORMATION_GRADIENTS
        Of the points, (N, 3, 3): total or, for plastic materials, elastic.
    TRACER_POSITIONS
        Of the massless points that matter takes along, (M, 3) [m].
    """

    POSITIONS = "positions"
    VELOCITIES = "velocities"
    DEFORMATION_GRADIENTS = "deformation_gradients"
    TRACER_POSITIONS = "tracer_positions"


class Precision(Enum):
    """Floating-point format of the engine's state.

    Attributes
    ----------
    FLOAT32
        Single: 24 binary digits, about 7 decimal ones.
    FLOAT64
        Double: 53 binary digits, about 16 decimal ones.
    """

    FLOAT32 = "float32"
    FLOAT64 = "float64"


class Quantity(Enum):
    """What an engine conserves in the absence of anything that would change it.

    Attributes
    ----------
    MASS
        No point is lost, and each keeps its own.
    LINEAR_MOMENTUM
        Sum of m v [kg m/s], whatever bodies do to each other.
    ANGULAR_MOMENTUM
        Sum of x cross m v [kg m^2/s], from the first substep on.
    """

    MASS = "mass"
    LINEAR_MOMENTUM = "linear_momentum"
    ANGULAR_MOMENTUM = "angular_momentum"


class Determinism(Enum):
    """How far a second run with the same input agrees.

    Attributes
    ----------
    BITWISE
        To the last bit, on the same machine with the same number of threads.
    TOLERANCE
        Up to rounding.
    """

    BITWISE = "bitwise"
    TOLERANCE = "tolerance"


def device_class(device: str) -> str:
    """The class of a device: "cuda" of "cuda" and of "cuda:1"."""
    return device.partition(":")[0]


def device_index(device: str) -> int | None:
    """Which of the devices of its class, from 0: 1 of "cuda:1"; None of "cuda", and of what names no device."""
    number = device.partition(":")[2]
    return int(number) if number.isascii() and number.isdecimal() else None
