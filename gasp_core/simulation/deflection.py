"""How far a body gives way under its own weight and when it is stopped, and how stiff it must be to seem rigid.

A body of length L is taken for the worst that its matter allows: a beam as thick as its volume over its two longest
sides, t, held at one end. With density rho, sound at c = sqrt(E/rho) and gravity g, its tip goes, over L:

    under its weight           3/2 (L/t)^2 rho g L / E    (rho g t L^4 / (8 E I / b), I = b t^3 / 12),
    stopped at a speed v       sqrt(3) (L/t) v / c        (all modes of the beam at once; the first alone has 1.54).

What stands is below both: a column under its weight is shortened by rho g L^2 / (2 E), and its foot by the share
rho g L / E; the wave in a bar that is stopped strains it by v / c. In a beam that is stopped the stress is some
sqrt(3) rho c v (Hunt 1960, J. Acoust. Soc. Am. 32, 1123), in one that hangs 3 (L/t) rho g L.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Driven, Fluid, Impulse, Material, PointProblem, Sand, Side, Snow, Wind
from gasp_core.stepping.session import impulse_change

__all__ = ["UNSEEN", "Load", "drop_height", "load_of", "meeting_speed", "softened"]

Array = NDArray[Any]

UNSEEN = 1e-3
"""Of its size: a body that gives way by less seems rigid."""
_SOUND_OVER_SPEED = 10.0
"""Of a fluid whose density changes by 1 % (Monaghan 1994, 10.1006/jcph.1994.1034)."""
_SAMPLE = 500
"""Points of a body that are asked how far they may fall."""
_MARCHES = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What a body has to bear.

    Parameters
    ----------
    length
        Longest side [m].
    thickness
        Of the plate that its matter would be over its two longest sides [m], at most `length`.
    gravity
        [m/s^2].
    speed
        At which it may be stopped [m/s].
    """

    length: float
    thickness: float
    gravity: float
    speed: float = 0.0

    @property
    def slenderness(self) -> float:
        """Length over thickness, at least 1."""
        return max(self.length / self.thickness, 1.0) if self.thickness > 0 else 1.0

    def sag(self, density: float, youngs_modulus: float) -> float:
        """Deflection under its own weight, over its length."""
        return 1.5 * self.slenderness**2 * density * self.gravity * self.length / youngs_modulus

    def recoil(self, density: float, youngs_modulus: float) -> float:
        """Deflection when it is stopped, over its length."""
        return math.sqrt(3 * density / youngs_modulus) * self.slenderness * self.speed

    def least_modulus(self, density: float, share: float = UNSEEN) -> float:
        """Young's modulus [Pa] from which on neither deflection is more than this share of its length."""
        weight = self.sag(density, 1.0) / share
        return max(weight, (self.recoil(density, 1.0) / share) ** 2)

    def stress(self, density: float, youngs_modulus: float) -> float:
        """Largest stress [Pa] of both loads."""
        hanging = 3 * self.slenderness * density * self.gravity * self.length
        return max(hanging, math.sqrt(3 * density * youngs_modulus) * self.speed)


def load_of(problem: PointProblem, body: int, speed: float) -> Load:
    """The load of a body of a problem that may be stopped at a speed [m/s]."""
    own = problem.points.body_ids == body
    length, width, _ = sorted(np.ptp(problem.points.reference_positions[own], axis=0).tolist(), reverse=True)
    volume = float(problem.points.reference_volumes[own].sum())
    thickness = min(volume / (length * width), length) if width > 0 else length
    return Load(length=length, thickness=thickness, gravity=math.hypot(*problem.gravity), speed=speed)


def softened(material: Material, load: Load) -> Material | None:
    """The same with the least modulus, to two digits, that keeps its deflection unseen; None where that is not lower.

    Of what yields under this load, no more than the share `UNSEEN` of it springs back. A fluid's density changes by no
    more than 1 %. Snow has none: its strength goes with its stiffness.
    """
    if isinstance(material, Fluid):
        speed = math.hypot(load.speed, math.sqrt(2 * load.gravity * load.length))
        return _lowered(material, "bulk_modulus", material.density * (_SOUND_OVER_SPEED * speed) ** 2)
    own: float | None = getattr(material, "youngs_modulus", None)
    if own is None or isinstance(material, Snow):
        return None
    if isinstance(material, Sand):
        # Heaps do not bend.
        load = dataclasses.replace(load, thickness=load.length)
    modulus = load.least_modulus(material.density)
    if isinstance(material, Sand):
        modulus = max(modulus, material.tension_limit / UNSEEN)
    yields_at: float = getattr(material, "yield_stress", math.inf)
    if load.stress(material.density, own) > yields_at:
        modulus = max(modulus, yields_at / UNSEEN)
    return _lowered(material, "youngs_modulus", modulus)


def _lowered(material: Material, name: str, modulus: float) -> Material | None:
    if not modulus > 0:
        return None
    unit = 10.0 ** (math.floor(math.log10(modulus)) - 1)
    # A hair of tolerance: what has two digits already stays what it is.
    modulus = float(f"{math.ceil(modulus / unit * (1 - 1e-9)) * unit:.1e}")
    changes: dict[str, Any] = {name: modulus}
    return dataclasses.replace(material, **changes) if modulus < getattr(material, name) else None


def meeting_speed(problem: PointProblem, duration: float) -> float:
    """About how fast [m/s] matter may be when it is stopped; 0 where nothing is there to stop it.

    Its speed at the start, or that of drives and winds, and what it gains as it falls: to the first collider below it,
    as long as the scene lasts at most.
    """
    points = problem.points
    bodies = np.unique(points.body_ids)
    if not (problem.colliders or problem.drives or problem.trajectories is not None or len(bodies) > 1):
        return 0.0
    start = float(np.linalg.norm(points.initial_velocities, axis=1).max())
    blow = 0.0
    for acting in (*problem.drives, *problem.force_fields):
        if isinstance(acting, Driven):
            start = max(start, math.hypot(*acting.velocity) + math.hypot(*acting.angular_velocity) * points.size)
        elif isinstance(acting, Wind):
            start = max(start, math.hypot(*acting.velocity))
        elif isinstance(acting, Impulse):
            given = impulse_change(acting, points.reference_positions, problem.masses)
            blow += float(np.linalg.norm(given[1])) if given is not None else 0.0
    gravity = math.hypot(*problem.gravity)
    height = max(drop_height(problem, int(body)) for body in bodies)
    return min(math.hypot(start + blow, math.sqrt(2 * gravity * height)), start + blow + gravity * duration)


def drop_height(problem: PointProblem, body: int) -> float:
    """How far [m] a body may fall before it touches a collider; inf where none is below it, or nothing falls.

    Points march along gravity, each by its distance to the nearest collider, which none of them can pass by that way.
    """
    gravity = np.asarray(problem.gravity)
    if not gravity.any():
        return 0.0
    if not problem.colliders:
        return math.inf
    own = np.flatnonzero(problem.points.body_ids == body)
    places = problem.points.reference_positions[own]
    touches = UNSEEN * float(np.ptp(places, axis=0).max())
    # The lowest and some of all: a floor is met by the former, an edge or a ball by any.
    lowest = np.argsort(-(places @ gravity), kind="stable")
    some = np.concatenate([lowest[:_SAMPLE], lowest[:: max(1, len(lowest) // _SAMPLE)]])
    # A point is in the middle of its matter, which is what touches.
    places, radii = places[some], np.cbrt(problem.points.reference_volumes[own[some]]) / 2
    direction = gravity / np.linalg.norm(gravity)
    fallen, away = np.zeros(len(places)), _distances(problem, places) - radii
    for _ in range(_MARCHES):
        fallen += np.where(away > touches, away, 0.0)
        away = _distances(problem, places + fallen[:, None] * direction) - radii
    return float(fallen[away <= touches].min(initial=math.inf))


def _distances(problem: PointProblem, places: Array) -> Array:
    """From places (N, 3) [m] to what the nearest collider keeps them out of, (N,) [m]; not above 0 within it."""
    distances = [
        collider.shape.signed_distance(places) * (1.0 if collider.side is Side.OUTSIDE else -1.0)
        for collider in problem.colliders
    ]
    return np.min(distances, axis=0)
