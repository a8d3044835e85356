"""How large a step explicit MLS-MPM bears, in one place for every engine that steps explicitly.

The linear bound is that of an isolated point under quadratic B-splines: the point's own affine velocity C and its own
stress form the stiffest oscillator there is (neighbours only soften it). A step takes C to C - k tau and the strain by
dt (C - k S tau), where k = 4 dt / (rho dx^2) and S = sum_i a_i^2 / (4 w_i) of the kernel a of `gasp_core.stepping.mpm`:
S = 1 for moving least squares, and up to 1 + s^2/2 with a share s of the gradient, for a point between two nodes. The
2x2 matrix of one mode of stiffness M has determinant 1 - q (S - 1) and trace 2 - q S, q = dt k M, and so a spectral
radius of at most 1 as long as q (2 S - 1) <= 4:

    dt = dx sqrt(rho / (max(2 mu, 2 mu + 3 lambda) (1 + s^2))),

which for a solid with nu >= 0 is dx sqrt(rho (1 - 2 nu) / (E (1 + s^2))).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    Drive,
    Driven,
    EngineAccuracy,
    Fluid,
    ForceField,
    Impulse,
    Material,
    PointCloud,
    PointProblem,
    Shape,
    Side,
    SignedDistanceField,
    Snow,
    SphereShape,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.mpm import GRADIENT_SHARE, LOOK_TRAVEL
from gasp_core.stepping.rigid_motion import abrupt_times, pose_of

__all__ = [
    "Gust",
    "MotionLimits",
    "driven_speed",
    "collider_times",
    "event_times",
    "gust_of",
    "hardening_of",
    "inviscid_bound",
    "limits_of",
    "refuse_unstable_substep",
    "rest_bound",
    "substep_size",
    "substeps_to",
    "viscous_share",
    "wall_speed",
]

Array = NDArray[Any]

_ADVECTION = 0.5
"""|v| dt + g dt^2 <= 0.5 dx."""
_DISTORTION = 0.2
"""|grad v| dt <= 0.2 (after Sun et al. 2020, 10.1111/cgf.14101)."""
_HARDENED = 0.5
"""xi |grad v| t <= 0.5: no snow becomes stiffer than by a factor e^0.9 within t, tr grad v <= sqrt(3) |grad v|."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gust:
    """What winds do at a time: their drag in all [1/s], and the fastest of the air [m/s]."""

    drag: float = 0.0
    speed: float = 0.0


def gust_of(force_fields: Sequence[ForceField], time: float) -> Gust:
    """Of those that blow at a time [s], wherever that is."""
    winds = [each for each in force_fields if isinstance(each, Wind) and each.start <= time < each.end]
    return Gust(
        drag=sum(wind.drag for wind in winds),
        speed=max((math.hypot(*wind.velocity) for wind in winds if wind.drag > 0), default=0.0),
    )


def _flight(speed: float, acceleration: float, distance: float) -> float:
    """Time [s] in which |v| t + a t^2 is so much [m]."""
    rate = speed + math.sqrt(speed**2 + 4 * acceleration * distance)
    return 2 * distance / rate if rate > 0 else math.inf


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
    hardening
        Largest growth of the logarithm of a stiffness per unit of compression (`hardening_of`).
    gust
        Of what winds do, `gust_of`.
    """

    stress: float
    speed: float
    velocity_gradient: float
    acceleration: float = 0.0
    hardening: float = 0.0
    gust: Gust = Gust()

    def flight(self, distance: float) -> float:
        """Longest time t [s] in which no point goes further than `distance` [m]: |v| t + a t^2 at most.

        Twice the fall of a t^2 / 2, because a step of symplectic Euler moves with the velocity at its end. A wind pulls
        by no more than its drag times the air's speed relative to matter, and makes nothing faster than the air.
        """
        pull = self.gust.drag * (self.gust.speed + self.speed)
        return max(
            _flight(self.speed, self.acceleration + pull, distance),
            _flight(max(self.speed, self.gust.speed), self.acceleration, distance),
        )

    def lasting(self, distance: float) -> float:
        """How long [s] these limits may be relied on: until a point has gone `distance` [m], or snow has hardened."""
        return min(self.flight(distance), self.hardening_time)

    def steps_between_looks(self, spacing: float, step: float) -> int:
        """How many steps [s] on a grid of `spacing` [m] may pass until bodies are looked at again for contact."""
        steps = self.flight(LOOK_TRAVEL * spacing) / step
        # Engines that agree but for rounding agree about a whole number, too.
        return int(min(max(1.0, steps * (1 + 1e-4)), 1e6))

    @property
    def hardening_time(self) -> float:
        """How long [s] snow takes to become noticeably stiffer, pressed as fast as anything is."""
        growth = self.hardening * self.velocity_gradient
        return _HARDENED / growth if growth > 0 else math.inf


def rest_bound(material: Material, spacing: float, *, gradient_share: float = GRADIENT_SHARE) -> float:
    """Largest stable step [s] of an isolated, undeformed point; inf for a material without stiffness.

    `gradient_share` is that of the stress which acts by the splines' own gradient, see `gasp_core.stepping.mpm`.

    For a fluid mu = 0 and lambda = K, and the viscous force alone would bear rho dx^2 / (4 eta (1 + s^2)): both rates
    add. For a solid with stiffness-proportional damping b a bound h becomes h^2 / (b + sqrt(h^2 + b^2)).
    """
    # D of the quadratic B-spline, and what the kernel's share of the gradient leaves of it.
    inertia = spacing * spacing / (4 * (1 + gradient_share**2))
    mu = getattr(material, "shear_modulus", 0.0)
    lame = material.bulk_modulus if isinstance(material, Fluid) else getattr(material, "lame_lambda", 0.0)
    stiffness = max(2 * mu, 2 * mu + 3 * lame)
    if stiffness <= 0:
        return math.inf
    bound = 2 * math.sqrt(inertia * material.density / stiffness)
    viscosity = getattr(material, "viscosity", 0.0)
    if viscosity > 0:
        bound = 1 / (1 / bound + viscosity / (inertia * material.density))
    damping = getattr(material, "stiffness_damping", 0.0)
    # With dt k M (dt + 2 b) <= 4 in place of dt k M dt <= 4, since the rate of strain is that of the step before.
    return bound**2 / (damping + math.hypot(bound, damping)) if damping > 0 else bound


def hardening_of(problem: PointProblem) -> float:
    """Largest xi of the snow in a problem, 0 without any: d ln(stiffness) = -xi dJ_P, and -dJ_P <= compression."""
    used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
    return max((material.hardening for material in used if isinstance(material, Snow)), default=0.0)


def inviscid_bound(fluid: Fluid, spacing: float) -> float:
    """The stable step [s] at rest that a fluid's pressure alone would bear."""
    return rest_bound(replace(fluid, viscosity=0.0), spacing)


def viscous_share(fluid: Fluid, spacing: float) -> float:
    """What of the rate 1 / `rest_bound` of a fluid at rest is its viscosity's, 0..1."""
    return 1 - rest_bound(fluid, spacing) / inviscid_bound(fluid, spacing)


def refuse_unstable_substep(
    problem: PointProblem,
    spacing: float,
    accuracy: EngineAccuracy,
    *,
    stable_step: Callable[[Material, float], float] = rest_bound,
) -> None:
    """Refuse an explicit `accuracy.substep` above the bound, `stable_step`, of any material that is used.

    Raises
    ------
    SceneError
        Naming the bound and the material that sets it.
    """
    if accuracy.substep is None:
        return
    used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
    bound, material = min(((stable_step(each, spacing), each) for each in used), key=itemgetter(0))
    if accuracy.substep > bound:
        raise SceneError(
            f"substep under [accuracy], {accuracy.substep:.3g} s, is above the stable bound {bound:.3g} s"
            f" ({material.kind}, grid spacing {spacing:.3g} m): leave it out, or stay below the bound"
        )


def substep_size(limits: MotionLimits, spacing: float, accuracy: EngineAccuracy) -> float:
    """The step [s] the scene bears now: the override, or the smallest of what stress and motion allow."""
    if accuracy.substep is not None:
        return accuracy.substep
    step = accuracy.substep_fraction * limits.stress
    step = min(step, limits.flight(_ADVECTION * spacing))
    if limits.velocity_gradient > 0:
        step = min(step, _DISTORTION / limits.velocity_gradient)
    return min(step, limits.hardening_time)


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


def wall_speed(colliders: Sequence[Collider], time: float, low: Array, high: Array, spacing: float) -> float:
    """Bound on the speed [m/s] of colliders at `time` [s] where they may meet matter between corners low and high.

    One that is farther off than half a cell of `spacing` [m] bounds a step by when it could be there.
    """
    speed = 0.0
    corners = np.stack(np.meshgrid(*zip(low, high), indexing="ij"), axis=-1).reshape(-1, 3)
    for collider in colliders:
        if collider.motion is None:
            continue
        pose = pose_of(collider.motion, time)
        # Linear in the place, so nowhere between the corners is it faster,
        fastest = float(np.linalg.norm(pose.velocities(corners), axis=1).max())
        reach = _reach(collider.shape, pose.center) if collider.side is Side.OUTSIDE else math.inf
        # and no part of it is farther from its place than it reaches.
        if math.isfinite(reach):
            fastest = min(fastest, math.hypot(*pose.velocity) + math.hypot(*pose.angular_velocity) * reach)
        away = np.linalg.norm(np.maximum(np.maximum(low - pose.place, pose.place - high), 0.0))
        near = _ADVECTION * spacing
        speed = max(speed, fastest * near / max(near, float(away) - reach))
    return speed


def limits_of(
    problem: PointProblem,
    time: float,
    low: Array,
    high: Array,
    spacing: float,
    *,
    stress: float,
    speed: float,
    velocity_gradient: float,
    hardening: float,
) -> MotionLimits:
    """What bounds the next step of a problem at `time` [s], whose matter lies between corners low and high (3,) [m].

    Parameters
    ----------
    spacing
        Of the grid [m].
    stress, velocity_gradient, hardening
        As of `MotionLimits`.
    speed
        Of what moves already [m/s]; what drives and colliders make of it comes to that.
    """
    return MotionLimits(
        stress=stress,
        speed=max(
            speed,
            driven_speed(problem.drives, time, low, high),
            wall_speed(problem.colliders, time, low, high, spacing),
        ),
        velocity_gradient=velocity_gradient,
        acceleration=math.hypot(*problem.gravity),
        hardening=hardening,
        gust=gust_of(problem.force_fields, time),
    )


def _reach(region: Shape, center: Array) -> float:
    """Largest distance [m] of a place in the region from `center` (3,) [m], about which it may be turned."""
    match region:
        case BoxShape():
            return float(np.linalg.norm(np.abs(np.asarray(region.center) - center) + region.half_extents))
        case SphereShape():
            return float(np.linalg.norm(np.asarray(region.center) - center)) + region.radius
        case SignedDistanceField():
            half = region.spacing * (np.array(region.values.shape) - 1) / 2
            return float(np.linalg.norm(np.abs(np.asarray(region.origin) + half - center) + half))
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


def collider_times(colliders: Sequence[Collider], points: PointCloud, spacing: float) -> list[float]:
    """Times [s] that steps land on, because a collider goes far at once: what leaps within a step meets nothing.

    As far as a quarter of a cell of `spacing` [m], where matter does not see it as a leap.
    """
    times: list[float] = []
    for collider in colliders:
        if collider.motion is not None:
            arms = np.linalg.norm(points.reference_positions - np.asarray(collider.motion.center), axis=1)
            times += abrupt_times(collider.motion, 0.25 * spacing, float(arms.max()))
    return times
