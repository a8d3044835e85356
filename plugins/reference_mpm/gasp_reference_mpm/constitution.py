"""Constitutive laws: from deformation to stress, as pure functions over arrays.

tau is the Kirchhoff stress J sigma [Pa]. Laws are isotropic, so tau depends on the deformation gradient F through its
principal stretches and axes alone. F and everything like it is (N, 3, 3); moduli are numbers [Pa].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "drucker_prager_projection",
    "fixed_corotated_stress",
    "fluid_deformation",
    "fluid_stress",
    "hencky_stress",
    "log_volume_ratio",
    "neo_hookean_stress",
    "polar_rotation",
]

Array = NDArray[Any]

_IDENTITY = np.eye(3)
_SMALLEST_VOLUME_RATIO = 0.05
"""Below it ln J is held, so that a point pressed flat or turned inside out is pushed back by a finite force."""
_SMALLEST_STRETCH = 1e-4
"""Floor of a principal stretch under a logarithm."""
_FLUID_VOLUME_RATIOS = (0.1, 10.0)


def _transposed(matrices: Array) -> Array:
    return matrices.transpose(0, 2, 1)


def polar_rotation(deformation: Array) -> Array:
    """The rotation R, det +1, that is nearest to F.

    Where F is inverted the smallest principal stretch takes the sign (Irving et al. 2004, 10.1145/1028523.1028541):
    R stays a rotation, and the stress pushes back through the flattest direction.
    """
    left, _, right = np.linalg.svd(deformation)
    left[:, :, 2] *= np.where(np.linalg.det(left) * np.linalg.det(right) < 0, -1.0, 1.0)[:, None]
    return left @ right


def fixed_corotated_stress(deformation: Array, mu: float, lame: float) -> Array:
    """tau = 2 mu (F - R) F^T + lambda (J - 1) J I of Psi = mu |F - R|^2 + lambda/2 (J - 1)^2.

    Stomakhin et al. 2012, "Energetically consistent invertible elasticity", eq. (9).
    """
    volume_ratio = np.linalg.det(deformation)
    pressure = lame * (volume_ratio - 1) * volume_ratio
    shear = (deformation - polar_rotation(deformation)) @ _transposed(deformation)
    return 2 * mu * shear + pressure[:, None, None] * _IDENTITY


def log_volume_ratio(deformation: Array) -> Array:
    """ln J (N,), held where a point is pressed flat or turned inside out."""
    return np.log(np.maximum(np.linalg.det(deformation), _SMALLEST_VOLUME_RATIO))


def neo_hookean_stress(deformation: Array, mu: float, lame: float) -> Array:
    """tau = mu (F F^T - I) + lambda ln(J) I of Psi = mu/2 (|F|^2 - 3) - mu ln J + lambda/2 (ln J)^2.

    Bonet and Wood 2008, "Nonlinear continuum mechanics for finite element analysis", eq. (6.28)-(6.29).
    """
    log_ratio = log_volume_ratio(deformation)
    shear = deformation @ _transposed(deformation) - _IDENTITY
    return mu * shear + (lame * log_ratio)[:, None, None] * _IDENTITY


def hencky_stress(deformation: Array, mu: float, lame: float) -> Array:
    """tau = U (2 mu e + lambda tr(e) I) U^T, e the logarithms of the principal stretches, F = U exp(e) V^T.

    Of Psi = mu |e|^2 + lambda/2 tr(e)^2 (Klar et al. 2016, 10.1145/2897824.2925906, section 6.1).
    """
    left, stretches, _ = np.linalg.svd(deformation)
    strains = np.log(np.maximum(stretches, _SMALLEST_STRETCH))
    principal = 2 * mu * strains + lame * strains.sum(axis=1, keepdims=True)
    return (left * principal[:, None, :]) @ _transposed(left)


def drucker_prager_projection(
    deformation: Array, volume_gain: Array, mu: float, lame: float, friction_angle: float
) -> tuple[Array, Array]:
    """Bring elastic deformation back into the Drucker-Prager cone: sand slides, and bears no tension.

    Klar et al. 2016 (10.1145/2897824.2925906), section 7.3, with the volume that sand gained while it was loose given
    back before it presses again (Tampubolon et al. 2017, 10.1145/3072959.3073651, section 4.3.4).

    Parameters
    ----------
    deformation : (N, 3, 3)
        Elastic F after a trial step.
    volume_gain : (N,)
        Logarithm of the volume ratio lost to projection so far.
    friction_angle : float
        [degrees]

    Returns
    -------
    Projected F (N, 3, 3), volume gain (N,).
    """
    left, stretches, right = np.linalg.svd(deformation)
    strains = np.log(np.maximum(stretches, _SMALLEST_STRETCH))
    trace = strains.sum(axis=1) + volume_gain
    loose = trace >= 0

    strains = strains + volume_gain[:, None] / 3
    deviator = strains - trace[:, None] / 3
    norm = np.linalg.norm(deviator, axis=1)
    sine = math.sin(math.radians(friction_angle))
    slope = math.sqrt(2 / 3) * 2 * sine / (3 - sine)
    slip = np.maximum(0.0, norm + (3 * lame + 2 * mu) / (2 * mu) * trace * slope)
    direction = deviator / np.where(norm > 0, norm, 1.0)[:, None]
    strains = np.where(loose[:, None], 0.0, strains - slip[:, None] * direction)

    projected = (left * np.exp(strains)[:, None, :]) @ right
    return projected, np.where(loose, trace, 0.0)


def fluid_deformation(deformation: Array, dilation: Array) -> Array:
    """A fluid remembers its volume and no shape: F = J^(1/3) I with J grown by the factor 1 + dt tr L.

    Parameters
    ----------
    deformation : (N, 3, 3)
        Of the form J^(1/3) I.
    dilation : (N,)
        dt tr L.
    """
    volume_ratio = deformation[:, 0, 0] ** 3 * (1 + dilation)
    return np.cbrt(np.clip(volume_ratio, *_FLUID_VOLUME_RATIOS))[:, None, None] * _IDENTITY


def fluid_stress(deformation: Array, velocity_gradient: Array, bulk_modulus: float, viscosity: float) -> Array:
    """tau = -J p I + J eta (L + L^T - 2/3 tr L I) with p = max(0, K/7 (J^-7 - 1)).

    The equation of state is Cole's (1948) with the exponent usual for weakly compressible water (Becker and Teschner
    2007, eq. (7)); held at zero in tension, because a free surface tears rather than pulls. eta is in [Pa s].
    """
    volume_ratio = deformation[:, 0, 0] ** 3
    pressure = np.maximum(0.0, bulk_modulus / 7 * (volume_ratio**-7 - 1))
    rate = velocity_gradient + _transposed(velocity_gradient)
    dilation_rate = np.trace(velocity_gradient, axis1=1, axis2=2)
    shear = rate - 2 / 3 * dilation_rate[:, None, None] * _IDENTITY
    return volume_ratio[:, None, None] * (viscosity * shear - pressure[:, None, None] * _IDENTITY)
