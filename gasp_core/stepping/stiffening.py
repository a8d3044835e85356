"""How much stiffer matter is than at rest, as it is deformed: a stable step shrinks by the root of that."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["fluid_stiffening", "hencky_stiffening", "snow_stiffening", "stiffening"]

Array = NDArray[Any]

_GREATEST_EXPONENT = 200.0
"""Of a growth of stiffness: e^100 times as many steps are too many, whatever the limit, and can still be counted."""


def stiffening(deformation_gradients: Array) -> Array:
    """Factor >= 1, (N,), by which points (N, 3, 3) are stiffer than at rest; a step shrinks by its square root.

    Fixed-corotated stress stiffens as 2 s^2 - s in the largest stretch s, and as 2 J^2 - J in volume. No decomposition
    is needed for a bound on s: the other two stretches have the product |J|/s, so their squares add up to 2 |J|/s at
    least, and s is at most the largest root of s^3 - |F|^2 s + 2 |J| = 0 (Viete's form; exact where the two are equal).
    """
    stretch, volume_ratio = _largest_stretch(deformation_gradients)
    stretch = np.maximum(np.maximum(stretch, volume_ratio), 1.0)
    return 2 * stretch**2 - stretch


def _largest_stretch(deformation_gradients: Array) -> tuple[Array, Array]:
    """Bound on the largest stretch, and |J|, each (N,); see `stiffening`."""
    volume_ratio = np.abs(np.linalg.det(deformation_gradients))
    third = np.einsum("nij,nij->n", deformation_gradients, deformation_gradients) / 3
    # What was crushed to nothing has no scale; that of the floor is still there when it is cubed.
    scale = np.sqrt(np.maximum(third, 1e-200))
    # The mean of three squares is never below the geometric one; rounding may say so.
    angle = np.arccos(-np.minimum(volume_ratio / scale**3, 1.0)) / 3
    return 2 * scale * np.cos(angle), volume_ratio


def hencky_stiffening(deformation_gradients: Array) -> Array:
    """As `stiffening`, for laws that are linear in the logarithm of the elastic stretches, (N, 3, 3) to (N,).

    tau_i = 2 mu e_i + lambda tr e is as stiff in pressure however far it is stretched. In shear between the axes i and
    j, d tau_ij = (tau_j - tau_i) (b_j L_ij + b_i L_ji) / (b_j - b_i), b = exp(2 e): on L_ij + L_ji its eigenvalue is
    2 mu x coth x, x = e_j - e_i (Ogden 1984, "Non-linear elastic deformations", section 6.1.4). With s a bound on the
    largest stretch, x <= ln(s^3 / |J|).
    """
    stretch, volume_ratio = _largest_stretch(deformation_gradients)
    apart = np.maximum(3 * np.log(stretch) - np.log(np.maximum(volume_ratio, 1e-200)), 1e-9)
    return apart / np.tanh(apart)


def snow_stiffening(log_volume_ratios: Array, hardening: float) -> Array:
    """Factor >= 1, (N,), by which snow is stiffer than at rest, of ln J_P (N,): exp(xi (1 - J_P))."""
    return np.exp(np.clip(-hardening * np.expm1(np.minimum(log_volume_ratios, 1.0)), 0.0, _GREATEST_EXPONENT))


def fluid_stiffening(volume_ratios: Array, viscous_share: float) -> Array:
    """Factor, (N,), by which points of a fluid are stiffer than at rest, of J (N,).

    Cole's pressure stiffens with J^-6 where it is pressed, to which a power each way leaves room for a cycle. Where it
    is not, it pulls at nothing, and counts as at rest, since it may come together again. Viscous stress goes with J.
    Rates of both add up; `viscous_share` is the viscosity's at rest (`time_step.viscous_share`).
    """
    pressed = np.maximum(1.0, np.maximum(volume_ratios, 1e-30) ** -4.0)
    return ((1 - viscous_share) * pressed + viscous_share * volume_ratios) ** 2
