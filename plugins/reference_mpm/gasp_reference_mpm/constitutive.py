"""Constitutive laws: from deformation to stress, as pure functions over arrays.

tau is the Kirchhoff stress J sigma [Pa]. Laws are isotropic, so tau depends on the deformation gradient F through its
principal stretches and axes alone. F and everything like it is (N, 3, 3); moduli are numbers [Pa].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.flow import FLUID_VOLUME_RATIOS

__all__ = [
    "drucker_prager_projection",
    "fixed_corotated_stress",
    "fluid_deformation",
    "fluid_stress",
    "hencky_stress",
    "log_volume_ratio",
    "logarithmic_strains",
    "neo_hookean_stress",
    "polar_rotation",
    "snow_hardening",
    "snow_projection",
    "viscoplastic_projection",
    "viscous_stress",
    "von_mises_projection",
]

Array = NDArray[Any]

_IDENTITY = np.eye(3)
_SMALLEST_VOLUME_RATIO = 0.05
"""Below it ln J is held, so that a point pressed flat or turned inside out is pushed back by a finite force."""
_SMALLEST_STRETCH = 1e-4
"""Floor of a principal stretch under a logarithm."""


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


def viscous_stress(velocity_gradient: Array, mu: float, lame: float, damping: float) -> Array:
    """Kelvin's and Voigt's, tau = b (2 mu D + lambda tr(D) I): D is the symmetric part of L (N, 3, 3) [1/s], b [s]."""
    rate = velocity_gradient + _transposed(velocity_gradient)
    dilation_rate = np.trace(velocity_gradient, axis1=1, axis2=2)
    return damping * (mu * rate + lame * dilation_rate[:, None, None] * _IDENTITY)


def hencky_stress(deformation: Array, mu: float, lame: float) -> Array:
    """tau = U (2 mu e + lambda tr(e) I) U^T, e the logarithms of the principal stretches, F = U exp(e) V^T.

    Of Psi = mu |e|^2 + lambda/2 tr(e)^2 (Klar et al. 2016, 10.1145/2897824.2925906, section 6.1).
    """
    left, stretches, _ = np.linalg.svd(deformation)
    strains = np.log(np.maximum(stretches, _SMALLEST_STRETCH))
    principal = 2 * mu * strains + lame * strains.sum(axis=1, keepdims=True)
    return (left * principal[:, None, :]) @ _transposed(left)


def drucker_prager_projection(
    deformation: Array, volume_gain: Array, mu: float, lame: float, friction_slope: float, loosest_strain: float
) -> tuple[Array, Array]:
    """Bring elastic deformation back into the Drucker-Prager cone: sand slides, and bears what tension cohesion does.

    Klar et al. 2016 (10.1145/2897824.2925906), section 7.3, with the tip where cohesion puts it, and with the volume
    that sand gained while it was loose given back before it presses again (Tampubolon et al. 2017,
    10.1145/3072959.3073651, section 4.3.4).

    Parameters
    ----------
    deformation : (N, 3, 3)
        Elastic F after a trial step.
    volume_gain : (N,)
        Logarithm of the volume ratio lost to projection so far.
    friction_slope : float
        M of q = M (p + p_t).
    loosest_strain : float
        ln J at the tip of the cone, where the pressure is -p_t.

    Returns
    -------
    Projected F (N, 3, 3), volume gain (N,).
    """
    left, stretches, right = np.linalg.svd(deformation)
    strains = np.log(np.maximum(stretches, _SMALLEST_STRETCH)) + volume_gain[:, None] / 3
    mean = strains.mean(axis=1, keepdims=True)
    beyond = 3 * mean[:, 0] - loosest_strain
    loose = beyond >= 0

    deviator = strains - mean
    norm = np.linalg.norm(deviator, axis=1)
    slope = math.sqrt(2 / 3) * friction_slope / 3
    slip = np.maximum(0.0, norm + (3 * lame + 2 * mu) / (2 * mu) * beyond * slope)
    direction = deviator / np.where(norm > 0, norm, 1.0)[:, None]
    strains = np.where(loose[:, None], loosest_strain / 3, strains - slip[:, None] * direction)

    projected = (left * np.exp(strains)[:, None, :]) @ right
    return projected, np.where(loose, beyond, 0.0)


def _upright(deformation: Array) -> tuple[Array, Array, Array]:
    """U, stretches and V^T of F = U diag V^T with det U V^T = +1, where no stretch is below the floor.

    What was turned inside out has its smallest stretch on the floor: put together again, it is upright.
    """
    left, stretches, right = np.linalg.svd(deformation)
    inverted = np.linalg.det(left) * np.linalg.det(right) < 0
    left[:, :, 2] *= np.where(inverted, -1.0, 1.0)[:, None]
    stretches[:, 2] *= np.where(inverted, -1.0, 1.0)
    return left, np.maximum(stretches, _SMALLEST_STRETCH), right


def logarithmic_strains(deformation: Array) -> Array:
    """e (N, 3), the logarithms of the principal stretches, largest first."""
    return np.log(_upright(deformation)[1])


def _deviator(strains: Array) -> tuple[Array, Array]:
    """dev e (N, 3) and its length (N,)."""
    deviator = strains - strains.mean(axis=1, keepdims=True)
    return deviator, np.linalg.norm(deviator, axis=1)


def _after_flow(deformation: Array, slip: Callable[[Array], Array]) -> tuple[Array, Array]:
    """F and what it slipped, dev e being shorter by slip(|dev e|) (N,); tr e stays, and F where nothing slips."""
    left, stretches, right = _upright(deformation)
    strains = np.log(stretches)
    deviator, norm = _deviator(strains)
    slipped = slip(norm)
    strains = strains - (slipped / np.where(norm > 0, norm, 1.0))[:, None] * deviator
    flowed = (left * np.exp(strains)[:, None, :]) @ right
    moved = (slipped > 0) | (stretches[:, 2] <= _SMALLEST_STRETCH)
    return np.where(moved[:, None, None], flowed, deformation), slipped


def von_mises_projection(
    deformation: Array,
    plastic_strain: Array,
    mu: float,
    yield_stress: float,
    hardening: float,
    residual_stress: float,
) -> tuple[Array, Array]:
    """Bring elastic deformation back to the von Mises cylinder whose radius goes with the plastic strain p.

    sqrt(3/2) |2 mu dev e| <= max(Y + H p, R). Radial return in logarithmic strain, exact for either line: with
    dp = sqrt(2/3) s for a slip s of dev e, 2 mu (|dev e| - s) = sqrt(2/3) (Y + H (p + sqrt(2/3) s)), or sqrt(2/3) R
    (Simo 1992, 10.1016/0045-7825(92)90123-2, box 2; Simo and Hughes 1998, "Computational inelasticity", 3.3.1). Where
    matter softens faster than its springs unload, 2 mu + 2/3 H <= 0, it drops to R at once.

    Parameters
    ----------
    deformation : (N, 3, 3)
        Elastic F after a trial step.
    plastic_strain : (N,)
        p so far.
    yield_stress, hardening, residual_stress : float [Pa]
        Y, H (below 0 for what softens) and R <= Y.

    Returns
    -------
    Projected F (N, 3, 3), plastic strain (N,).
    """
    root = math.sqrt(2 / 3)

    def slip(norm: Array) -> Array:
        above_line = 2 * mu * norm - root * (yield_stress + hardening * plastic_strain)
        above_residual = 2 * mu * norm - root * residual_stress
        slope = 2 * mu + 2 / 3 * hardening
        to_line = above_line / slope if slope > 0 else np.full_like(norm, np.inf)
        outside = (above_line > 0) & (above_residual > 0)
        return np.where(outside, np.minimum(to_line, above_residual / (2 * mu)), 0.0)

    flowed, slipped = _after_flow(deformation, slip)
    return flowed, plastic_strain + root * slipped


def viscoplastic_projection(deformation: Array, mu: float, yield_stress: float, viscosity: float, step: float) -> Array:
    """Let what is above the yield stress flow off for `step` [s]: |d dev e / dt| = (|2 mu dev e| - sqrt(2/3) Y) / eta.

    Yue et al. 2015 (10.1145/2751541), section 3 with h = 1, by the implicit Euler rule, of which the excess is left
    that comes of (1 + 2 mu dt / eta)^-1. `viscosity` is eta [Pa s].
    """

    def slip(norm: Array) -> Array:
        excess = np.maximum(0.0, norm - math.sqrt(2 / 3) * yield_stress / (2 * mu))
        return excess * (step / (step + viscosity / (2 * mu)))

    return _after_flow(deformation, slip)[0]


def snow_projection(
    deformation: Array, log_volume_ratio: Array, critical_compression: float, critical_stretch: float
) -> tuple[Array, Array]:
    """Bring the stretches of snow back into their box, and give what is beyond to the volume of F_P.

    Stomakhin et al. 2013 (10.1145/2461912.2461948), section 5.

    Parameters
    ----------
    deformation : (N, 3, 3)
        Elastic F after a trial step.
    log_volume_ratio : (N,)
        ln J_P so far.

    Returns
    -------
    Projected F (N, 3, 3), ln J_P (N,).
    """
    left, stretches, right = _upright(deformation)
    least = max(1 - critical_compression, _SMALLEST_STRETCH)
    kept = np.clip(stretches, least, 1 + critical_stretch)
    moved = (kept != stretches).any(axis=1) | (stretches[:, 2] <= _SMALLEST_STRETCH)
    projected = np.where(moved[:, None, None], (left * kept[:, None, :]) @ right, deformation)
    return projected, log_volume_ratio + np.log(stretches / kept).sum(axis=1)


def snow_hardening(log_volume_ratio: Array, hardening: float) -> Array:
    """exp(xi (1 - J_P)) (N,), the factor on both of Lame's parameters; `hardening` is xi."""
    # Beyond e^50 times its volume snow is gone, and J_P must not overflow: 0 times infinity is no number.
    return np.exp(-hardening * np.expm1(np.minimum(log_volume_ratio, 50.0)))


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
    return np.cbrt(np.clip(volume_ratio, *FLUID_VOLUME_RATIOS))[:, None, None] * _IDENTITY


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
