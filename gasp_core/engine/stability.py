"""How large a step explicit MLS-MPM bears, in one place for every engine that steps explicitly.

The linear bound is that of an isolated point under quadratic B-splines: the point's own affine velocity C and its own
stress form the stiffest oscillator there is (neighbours only soften it). A step takes C to C - k tau and the strain by
dt (C - k S tau), where k = 4 dt / (rho dx^2) and S = sum_i a_i^2 / (4 w_i) of the kernel a of `gasp_core.engine.mpm`:
S = 1 for moving least squares, and up to 1 + s^2/2 with a share s of the gradient, for a point between two nodes. The
2x2 matrix of one mode of stiffness M has determinant 1 - q (S - 1) and trace 2 - q S, q = dt k M, and so a spectral
radius of at most 1 as long as q (2 S - 1) <= 4:

    dt = dx sqrt(rho / (max(2 mu, 2 mu + 3 lambda) (1 + s^2))),

which for a solid with nu >= 0 is dx sqrt(rho (1 - 2 nu) / (E (1 + s^2))).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, PointProblem
from gasp_core.engine.forcing import Drive, Driven, ForceField, Impulse
from gasp_core.engine.materials import Fluid, Material
from gasp_core.engine.mpm import GRADIENT_SHARE
from gasp_core.engine.shapes import BoxShape, Shape, SphereShape
from gasp_core.errors import SceneError

__all__ = [
    "MotionLimits",
    "driven_speed",
    "event_times",
    "refuse_unstable_substep",
    "rest_bound",
    "stiffening",
    "substep_size",
    "substeps_to",
]

Array = NDArray[Any]

_ADVECTION = 0.5
"""|v| dt + g dt^2 <= 0.5 dx."""
_DISTORTION = 0.2
"""|grad v| dt <= 0.2 (after Sun et al. 2020, 10.1111/cgf.14101)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """What bounds the next step.

    Parameters
    ----------
    stress
        Smallest stable step over all points at their present stretch [s].
    speed
        Largest |v| [m/s], of the points and of what drives make of them (`driven_speed`).
    velocity_gradient
        Largest Frobenius norm of the points' affine velocity C [1/s].
    acceleration
        Of gravity [m/s^2]: what is at rest now is not so at the end of a long step.
    """

    stress: float
    speed: float
    velocity_gradient: float
    acceleration: float = 0.0

    def flight(self, distance: float) -> float:
        """Longest time t [s] in which no point goes further than `distance` [m]: |v| t + a t^2 at most.

        Twice the fall of a t^2 / 2, because a step of symplectic Euler moves with the velocity at its end.
        """
        rate = self.speed + math.sqrt(self.speed**2 + 4 * self.acceleration * distance)
        return 2 * distance / rate if rate > 0 else math.inf


def rest_bound(material: Material, spacing: float) -> float:
    """Largest stable step [s] of an isolated, undeformed point; inf for a material without stiffness.

    For a fluid mu = 0 and lambda = K, and the viscous force alone would bear rho dx^2 / (4 eta (1 + s^2)): both rates
    add.
    """
    # D of the quadratic B-spline, and what the kernel's share of the gradient leaves of it.
    inertia = spacing * spacing / (4 * (1 + GRADIENT_SHARE**2))
    mu = getattr(material, "shear_modulus", 0.0)
    lame = material.bulk_modulus if isinstance(material, Fluid) else getattr(material, "lame_lambda", 0.0)
    stiffness = max(2 * mu, 2 * mu + 3 * lame)
    if stiffness <= 0:
        return math.inf
    bound = 2 * math.sqrt(inertia * material.density / stiffness)
    viscosity = getattr(material, "viscosity", 0.0)
    if viscosity > 0:
        bound = 1 / (1 / bound + viscosity / (inertia * material.density))
    return bound


def stiffening(deformation_gradients: Array) -> Array:
    """Factor >= 1, (N,), by which points (N, 3, 3) are stiffer than at rest; a step shrinks by its square root.

    Fixed-corotated stress stiffens as 2 s^2 - s in the largest stretch s, and as 2 J^2 - J in volume. No decomposition
    is needed for a bound on s: the other two stretches have the product |J|/s, so their squares add up to 2 |J|/s at
    least, and s is at most the largest root of s^3 - |F|^2 s + 2 |J| = 0 (Viete's form; exact where the two are equal).
    """
    volume_ratio = np.abs(np.linalg.det(deformation_gradients))
    third = np.einsum("nij,nij->n", deformation_gradients, deformation_gradients) / 3
    # What was crushed to nothing has no scale; that of the floor is still there when it is cubed.
    scale = np.sqrt(np.maximum(third, 1e-200))
    # The mean of three squares is never below the geometric one; rounding may say so.
    angle = np.arccos(-np.minimum(volume_ratio / scale**3, 1.0)) / 3
    stretch = np.maximum(np.maximum(2 * scale * np.cos(angle), volume_ratio), 1.0)
    return 2 * stretch**2 - stretch


def refuse_unstable_substep(problem: PointProblem, spacing: float, accuracy: EngineAccuracy) -> None:
    """Refuse an explicit `accuracy.substep` above the bound of any material that is used.

    Raises
    ------
    SceneError
        Naming the bound and the material that sets it.
    """
    if accuracy.substep is None:
        return
    used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
    bound, material = min(((rest_bound(each, spacing), each) for each in used), key=itemgetter(0))
    if accuracy.substep > bound:
        raise SceneError(
            f"substep {accuracy.substep:.3g} s is above the stable bound {bound:.3g} s"
            f' ({material.kind}, grid spacing {spacing:.3g} m): leave "substep" out, or stay below the bound'
        )


def substep_size(limits: MotionLimits, spacing: float, accuracy: EngineAccuracy) -> float:
    """The step [s] the scene bears now: the override, or the smallest of what stress and motion allow."""
    if accuracy.substep is not None:
        return accuracy.substep
    step = accuracy.substep_fraction * limits.stress
    step = min(step, limits.flight(_ADVECTION * spacing))
    if limits.velocity_gradient > 0:
        step = min(step, _DISTORTION / limits.velocity_gradient)
    return step


def driven_speed(drives: Sequence[Drive], time: float, low: Array, high: Array) -> float:
    """Bound on the speed [m/s] that drives prescribe at `time` [s] to matter between corners low and high (3,) [m].

    Matter that a drive takes hold of has that speed within a step, whatever it had before.
    """
    speed = 0.0
    for drive in drives:
        if not (isinstance(drive, Driven) and drive.start <= time < drive.end):
            continue
        center = np.asarray(drive.center) + np.asarray(drive.velocity) * (time - drive.start)
        nearest = np.linalg.norm(np.maximum(np.maximum(low - center, center - high), 0.0))
        farthest = np.linalg.norm(np.maximum(np.abs(low - center), np.abs(high - center)))
        reach = _reach(drive.region, np.asarray(drive.center))
        if nearest <= reach:
            arm = min(float(farthest), reach)
            speed = max(speed, math.hypot(*drive.velocity) + math.hypot(*drive.angular_velocity) * arm)
    return speed


def _reach(region: Shape, center: Array) -> float:
    """Largest distance [m] of a place in the region from `center` (3,) [m], about which it may be turned."""
    match region:
        case BoxShape():
            return float(np.linalg.norm(np.abs(np.asarray(region.center) - center) + region.half_extents))
        case SphereShape():
            return float(np.linalg.norm(np.asarray(region.center) - center)) + region.radius
        case _:
            return math.inf


def substeps_to(remaining: float, step: float) -> tuple[int, float]:
    """Number and size [s] of equal steps, none above `step`, that land on the end of `remaining` [s]."""
    # A hair of tolerance: 0.04 / 0.0004 must not become 101 steps.
    count = max(1, math.ceil(remaining / step * (1 - 1e-9)))
    return count, remaining / count


def event_times(drives: Sequence[Drive], force_fields: Sequence[ForceField]) -> Array:
    """Sorted times [s] at which something starts or ends; steps land on each, so that no window is cut short."""
    times: set[float] = set()
    for event in [*drives, *force_fields]:
        times.add(event.start)
        if not isinstance(event, Impulse) and math.isfinite(event.end):
            times.add(event.end)
    return np.array(sorted(times))
