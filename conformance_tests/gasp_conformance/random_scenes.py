"""Scenes nobody would build, from a seeded generator: a number and what an engine declares make one scene."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gasp_conformance.random_violence import VIOLENCE, Victim
from gasp_conformance.specimens import specimen
from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Drive,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineCapabilities,
    Fluid,
    Foam,
    ForceField,
    FrictionCone,
    HalfSpace,
    Impulse,
    Material,
    Metal,
    NeoHookean,
    Pinned,
    Plasticine,
    PointCloud,
    PointProblem,
    Rigid,
    Sand,
    Side,
    Snow,
    SphereShape,
    Vector,
    Wind,
)
from gasp_core.stepping.time_step import rest_bound

__all__ = ["CLOUDS", "SEED", "RandomScene", "describe", "random_scene"]

Array = NDArray[Any]
Item = TypeVar("Item")

SEED = 20_041
"""Of the generator, beside the number of the scene. A new one is a new set of scenes."""

_SUBSTEP_LIMIT = 500
"""For one frame: what a scene may cost at most, however the engine reads its stiffness."""
_FRAMES = 8
"""Matter that was crushed flies apart faster, for a moment, than frames far apart would show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomScene:
    """One scene.

    Parameters
    ----------
    number
        The generator's, with `SEED`.
    cloud
        Name of the cloud's shape in `CLOUDS`.
    violence
        What is done to it on purpose, by its name in `VIOLENCE`; "" where nothing is.
    problem, accuracy
        What is run.
    times
        Ends of the frames [s].
    """

    number: int
    cloud: str
    violence: str
    problem: PointProblem
    accuracy: EngineAccuracy
    times: tuple[float, ...]


def random_scene(number: int, capabilities: EngineCapabilities) -> RandomScene:
    """Scene `number` for an engine with these capabilities: it asks for nothing that is not declared."""
    rng = np.random.default_rng([SEED, number])
    size = _log_uniform(rng, 1e-3, 1e3)
    # Sorted, because the order of a frozenset changes from process to process.
    kinds = sorted(capabilities.materials, key=lambda kind: kind.kind)
    drawn = [kinds[index] for index in rng.integers(0, len(kinds), rng.integers(1, 3))]
    materials = tuple(_MATERIALS[kind](rng) if kind in _MATERIALS else specimen(kind) for kind in drawn)
    cloud, positions, bodies = _cloud(rng, size)
    count = len(positions)
    per_body = rng.random() < 0.7
    ids = bodies % len(materials) if per_body else rng.integers(0, len(materials), count)
    used = [materials[index] for index in np.unique(ids)]

    # Either a resolution, as a user asks for it, or a spacing so small or large that points are alone or all together.
    spacing = float(size * _log_uniform(rng, 0.02, 2.0)) if rng.random() < 0.4 else None
    resolution = int(rng.integers(2, 33))
    rough = spacing or size / resolution
    bound = min(rest_bound(material, rough) for material in used)
    wave = rough / bound if math.isfinite(bound) else math.sqrt(9.81 * size)
    bound = rough / wave

    velocities = _velocities(rng, positions, size, wave)
    middle = positions.mean(axis=0)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=velocities,
        reference_volumes=size**3 / count * 10 ** rng.uniform(-1, 1) * rng.lognormal(0, rng.choice([0, 1]), count),
        material_ids=ids,
        body_ids=bodies,
    )
    accuracy = EngineAccuracy(
        resolution=resolution,
        spacing=spacing,
        substep_fraction=1 - float(rng.random()),
        substep=_fixed_substep(rng, used, rough),
        substep_limit=3 if rng.random() < 0.05 else _SUBSTEP_LIMIT,
    )
    gravity = _gravity(rng)
    # From a few substeps to some hundred, if nothing but the stiffness at rest bounds them; and not so long that the
    # cloud is all over the place: an engine with a grid over all of it would do nothing but clear its nodes.
    end = min(
        accuracy.substep_fraction * bound * _log_uniform(rng, 5, 300),
        2 * size / max(wave, float(np.linalg.norm(velocities, axis=1).max())),
        math.sqrt(8 * size / max(math.hypot(*gravity), 1e-9)),
    )
    frames = np.cumsum(rng.uniform(0.5, 1.5, _FRAMES))
    problem = PointProblem(
        points=points,
        materials=materials,
        colliders=_colliders(rng, capabilities, middle, size),
        drives=_drives(rng, capabilities, middle, size, wave, end, points, materials),
        force_fields=_winds(rng, capabilities, middle, size, wave, end),
        gravity=_vector(gravity),
        domain=_domain(rng, capabilities, positions, size),
        rigid_parts=_rigid_parts(capabilities, points, materials),
    )
    times = tuple(float(time) for time in end * frames / frames[-1])
    materials = tuple(_rarer(rng, material, capabilities) for material in materials)
    violence, problem = _violence(rng, capabilities, replace(problem, materials=materials), wave, end)
    return RandomScene(number=number, cloud=cloud, violence=violence, problem=problem, accuracy=accuracy, times=times)


def describe(scene: RandomScene) -> str:
    """The scene in a line, for whoever has to find out what it did to an engine."""
    problem, accuracy = scene.problem, scene.accuracy
    points = problem.points
    place = ", ".join(f"{value:.4g}" for value in points.reference_positions.mean(axis=0))
    speed = float(np.linalg.norm(points.initial_velocities, axis=1).max())
    grid = f"spacing {accuracy.spacing:.3g} m" if accuracy.spacing else f"resolution {accuracy.resolution}"
    step = f"substep {accuracy.substep:.3g} s" if accuracy.substep else f"fraction {accuracy.substep_fraction:.2g}"
    done = ", ".join(filter(None, (scene.cloud, scene.violence)))
    parts = [
        f"{len(points)} points in {int(points.body_ids.max()) + 1} bodies ({done}) of {points.size:.3g} m"
        f" at ({place}) m, up to {speed:.3g} m/s",
        *(_terse(material) for material in problem.materials),
        f"gravity {math.hypot(*problem.gravity):.3g}",
        *(
            f"{_terse(one.shape)} {one.side.value} {one.contact.value} friction {one.friction:g}"
            for one in problem.colliders
        ),
        *(_terse(one) for one in (*problem.drives, *problem.force_fields)),
        *(f"body {part} is a part of body {host}" for part, host in problem.rigid_parts.items()),
        "no domain" if problem.domain is None else f"domain {problem.domain.policy.value}",
        f"{grid}, {step}, at most {accuracy.substep_limit} substeps, {scene.times[-1]:.3g} s",
    ]
    return f"scene {scene.number} (seed {SEED}): " + "; ".join(parts)


def _terse(item: Material | Drive | ForceField | HalfSpace | BoxShape | SphereShape) -> str:
    """Kind and numbers, e.g. "elastic(density=1e+03, youngs_modulus=5.2e+06, poissons_ratio=0.49)"."""
    shown: list[str] = []
    for field in dataclasses.fields(item):
        name, value = field.name, getattr(item, field.name)
        if isinstance(value, (HalfSpace, BoxShape, SphereShape)):
            shown.append(_terse(value))
        elif isinstance(value, tuple):
            shown.append(f"{name}=({', '.join(f'{float(part):.3g}' for part in value)})")
        elif isinstance(value, Enum):
            shown.append(f"{name}={value.value}")
        elif value is not None and not isinstance(value, str):
            shown.append(f"{name}={float(value):.4g}")
    return f"{item.kind}({', '.join(shown)})"


def _rigid_parts(capabilities: EngineCapabilities, points: PointCloud, materials: Sequence[Material]) -> dict[int, int]:
    """Of a rigid body and one that deforms, where there are both, the first are one piece."""
    if not capabilities.rigid_parts:
        return {}
    rigid = np.array([isinstance(material, Rigid) for material in materials])[points.material_ids]
    share = np.bincount(points.body_ids, rigid) / np.bincount(points.body_ids)
    parts, hosts = np.flatnonzero(share == 1), np.flatnonzero(share == 0)
    return {int(parts[0]): int(hosts[0])} if len(parts) and len(hosts) else {}


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.random())


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _direction(rng: np.random.Generator) -> Array:
    """Any, or that of an axis: surfaces then lie along the grid."""
    if rng.random() < 0.5:
        return rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
    drawn = rng.normal(size=3)
    return drawn / np.linalg.norm(drawn)


def _pick(rng: np.random.Generator, items: Iterable[Item], name: Callable[[Item], str]) -> Item | None:
    ordered = sorted(items, key=name)
    return ordered[rng.integers(len(ordered))] if ordered else None


# Materials ------------------------------------------------------------------------------------------------------------


def _solid(rng: np.random.Generator) -> dict[str, float]:
    # Poisson's ratio near its ends more often than a uniform draw would have it.
    ratio = rng.choice([0.0, 0.49, 0.499, rng.uniform(0, 0.45), rng.uniform(0, 0.45)])
    return {
        "density": _log_uniform(rng, 1e-2, 1e5),
        "youngs_modulus": _log_uniform(rng, 1e2, 1e9),
        "poissons_ratio": float(ratio),
    }


def _yielding(rng: np.random.Generator) -> dict[str, float]:
    solid = _solid(rng)
    return {**solid, "yield_stress": solid["youngs_modulus"] * _log_uniform(rng, 1e-4, 1.0)}


def _fluid(rng: np.random.Generator) -> Fluid:
    viscosity = 0.0 if rng.random() < 0.5 else _log_uniform(rng, 1e-3, 1e3)
    return Fluid(density=_log_uniform(rng, 1e-2, 1e5), bulk_modulus=_log_uniform(rng, 1e2, 1e9), viscosity=viscosity)


def _sand(rng: np.random.Generator) -> Sand:
    cone = list(FrictionCone)[rng.integers(len(FrictionCone))]
    steepest = 59 if cone is FrictionCone.SIMPLE_SHEAR else 80
    return Sand(**_solid(rng), friction_angle=float(rng.uniform(1, steepest)), cone=cone)


_MATERIALS: Mapping[type[Material], Callable[[np.random.Generator], Material]] = MappingProxyType(
    {
        Elastic: lambda rng: Elastic(**_solid(rng)),
        NeoHookean: lambda rng: NeoHookean(**_solid(rng)),
        Sand: _sand,
        Fluid: _fluid,
        Snow: lambda rng: Snow(**_solid(rng), hardening=float(rng.uniform(0, 20))),
        Metal: lambda rng: Metal(**_yielding(rng)),
        Plasticine: lambda rng: Plasticine(**_yielding(rng)),
        Foam: lambda rng: Foam(**_yielding(rng), plastic_viscosity=_log_uniform(rng, 1e-3, 1e6)),
        Rigid: lambda rng: Rigid(density=_log_uniform(rng, 1e-2, 1e5)),
    }
)


def _rarer(rng: np.random.Generator, material: Material, can: EngineCapabilities) -> Material:
    """The material with what few scenes ask for, where the engine declares it."""
    often = rng.random() < 0.5
    if isinstance(material, Elastic | NeoHookean) and can.material_damping and often:
        sound = math.sqrt(material.youngs_modulus / material.density)
        return replace(material, mass_damping=_log_uniform(rng, 1e-3, 1e1) * sound)
    if isinstance(material, Sand) and can.cohesion and often:
        bulk_modulus = material.lame_lambda + 2 / 3 * material.shear_modulus
        borne = bulk_modulus * math.tan(math.radians(material.friction_angle))
        return replace(material, cohesion=_log_uniform(rng, 1e-6, 0.09) * borne)
    return material


def _violence(
    rng: np.random.Generator, can: EngineCapabilities, problem: PointProblem, wave: float, end: float
) -> tuple[str, PointProblem]:
    """To half of all scenes something is done on purpose."""
    if rng.random() < 0.5:
        return "", problem
    name = list(VIOLENCE)[rng.integers(len(VIOLENCE))]
    victim = Victim(problem=problem, direction=_direction(rng), wave=wave, end=end)
    changed = VIOLENCE[name](rng, can, victim)
    return ("", problem) if changed is None else (name, changed)


# Clouds: (N, 3) within a unit cube or so ------------------------------------------------------------------------------


def _lattice(rng: np.random.Generator, count: int) -> Array:
    """Part of a regular block: points on the faces and corners of cells."""
    side = math.ceil(count ** (1 / 3))
    block = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return block[:count] / max(side - 1, 1)


def _with_a_far_point(rng: np.random.Generator, count: int) -> Array:
    points = rng.random((count, 3)) * 0.01
    points[-1] = rng.random(3)
    return points


CLOUDS: Mapping[str, Callable[[np.random.Generator, int], Array]] = MappingProxyType(
    {
        "lattice": _lattice,
        "at random": lambda rng, count: rng.random((count, 3)),
        "line": lambda rng, count: rng.random((count, 1)) * rng.random(3),
        "line along an axis": lambda rng, count: rng.random((count, 1)) * np.eye(3)[rng.integers(3)],
        "plane": lambda rng, count: rng.random((count, 2)) @ rng.random((2, 3)),
        "needle": lambda rng, count: rng.random((count, 3)) * [1.0, 1e-3, 1e-3],
        "one place": lambda rng, count: np.tile(rng.random(3), (count, 1)),
        "pairs": lambda rng, count: np.repeat(rng.random((count, 3)), 2, axis=0)[:count],
        "far point": _with_a_far_point,
    }
)


def _cloud(rng: np.random.Generator, size: float) -> tuple[str, Array, Array]:
    """Name, positions (N, 3) [m] and bodies (N,) of 1 to 60 points, up to 10 km from the origin."""
    name = list(CLOUDS)[rng.integers(len(CLOUDS))]
    count = int(rng.choice([1, 2, 3, rng.integers(4, 61), rng.integers(4, 61), rng.integers(4, 61)]))
    positions = size * CLOUDS[name](rng, count)
    bodies = np.zeros(count, dtype=np.int32)
    if count > 3 and rng.random() < 0.4:
        bodies[count // 2 :] = 1
        # Apart, or one inside the other.
        positions[count // 2 :] += size * rng.uniform(-1.5, 1.5, 3)
    offset = rng.choice([0.0, 1.0]) * rng.choice([-1, 1], 3) * 10 ** rng.uniform(0, 4, 3)
    return name, positions + offset, bodies


def _velocities(rng: np.random.Generator, positions: Array, size: float, wave: float) -> Array:
    """Up to ten times the speed of sound `wave` [m/s]: of the whole, of its turning and stretching, of each point."""
    speed = wave * _log_uniform(rng, 1e-3, 10.0)
    uniform, gradient, noise = rng.choice([0.0, 1.0], 3)
    arms = (positions - positions.mean(axis=0)) / size
    drawn = (
        uniform * rng.normal(size=3)
        + gradient * arms @ rng.normal(size=(3, 3))
        + 0.1 * noise * rng.normal(size=positions.shape)
    )
    largest = float(np.linalg.norm(drawn, axis=1).max())
    return speed * drawn / largest if largest > 0 else np.zeros_like(positions)


def _fixed_substep(rng: np.random.Generator, used: list[Material], spacing: float) -> float | None:
    """Mostly none; else near the bound of the stiffest material, on either side of it."""
    bound = min(rest_bound(material, spacing) for material in used)
    if rng.random() < 0.85 or not math.isfinite(bound):
        return None
    return float(bound * rng.uniform(0.2, 1.1))


def _gravity(rng: np.random.Generator) -> Array:
    strength = 0.0 if rng.random() < 0.2 else _log_uniform(rng, 1e-2, 1e3)
    return strength * _direction(rng)


# What acts on the points: near them, through them, around them --------------------------------------------------------


def _shape(
    rng: np.random.Generator, kinds: Iterable[type], middle: Array, size: float
) -> HalfSpace | BoxShape | SphereShape | None:
    kind = _pick(rng, [one for one in kinds if one in (HalfSpace, BoxShape, SphereShape)], lambda one: one.__name__)
    center = _vector(middle + size * rng.normal(0, 0.6, 3))
    if kind is HalfSpace:
        return HalfSpace(point=center, normal=_vector(_direction(rng)))
    if kind is BoxShape:
        return BoxShape(center=center, half_extents=_vector(size * 10 ** rng.uniform(-1.5, 0.5, 3)))
    return SphereShape(center=center, radius=size * _log_uniform(rng, 0.03, 3.0)) if kind is SphereShape else None


def _region(rng: np.random.Generator, middle: Array, size: float) -> HalfSpace | BoxShape | SphereShape:
    region = _shape(rng, (HalfSpace, BoxShape, SphereShape), middle, size)
    assert region is not None
    return region


def _colliders(
    rng: np.random.Generator, capabilities: EngineCapabilities, middle: Array, size: float
) -> tuple[Collider, ...]:
    drawn: list[Collider] = []
    for _ in range(rng.integers(0, 4)):
        shape = _shape(rng, capabilities.collider_shapes, middle, size)
        contact = _pick(rng, capabilities.contact_conditions, lambda one: one.value)
        side = Side.OUTSIDE if rng.random() < 0.5 else Side.INSIDE
        if shape is None or contact is None:
            continue
        friction = float(rng.choice([0.0, 0.4, 10.0])) if contact is ContactCondition.SEPARATE else 0.0
        drawn.append(Collider(shape=shape, contact=contact, friction=friction, side=side))
    return tuple(drawn)


def _window(rng: np.random.Generator, end: float) -> dict[str, float]:
    """From the first substep on, or for a while that no frame begins or ends with."""
    if rng.random() < 0.5:
        return {}
    start = end * rng.random()
    return {"start": start, "end": start + end * rng.random() + 1e-3 * end}


def _drives(
    rng: np.random.Generator,
    capabilities: EngineCapabilities,
    middle: Array,
    size: float,
    wave: float,
    end: float,
    points: PointCloud,
    materials: tuple[Material, ...],
) -> tuple[Drive, ...]:
    drawn: list[Drive] = []
    masses = np.array([material.density for material in materials])[points.material_ids] * points.reference_volumes
    for _ in range(rng.choice([0, 0, 1, 2])):
        kind = _pick(rng, capabilities.drives & {Pinned, Driven, Impulse}, lambda one: one.kind)
        region = _region(rng, middle, size)
        speed = wave * _log_uniform(rng, 1e-3, 3.0)
        window = _window(rng, end)
        if kind is Pinned:
            drawn.append(Pinned(region=region, **window))
        elif kind is Driven:
            drawn.append(
                Driven(
                    region=region,
                    velocity=_vector(speed * rng.normal(size=3)),
                    angular_velocity=_vector(rng.choice([0.0, speed / size]) * rng.normal(size=3)),
                    center=_vector(middle),
                    **window,
                )
            )
        elif kind is Impulse:
            struck = masses[region.signed_distance(points.reference_positions) <= 0]
            push = _vector(float(struck.sum()) * speed * _direction(rng))
            drawn.append(Impulse(region=region, impulse=push, start=window.get("start", 0.0)))
    return tuple(drawn)


def _winds(
    rng: np.random.Generator, capabilities: EngineCapabilities, middle: Array, size: float, wave: float, end: float
) -> tuple[ForceField, ...]:
    if Wind not in capabilities.force_fields or rng.random() < 0.7:
        return ()
    region = None if rng.random() < 0.5 else _region(rng, middle, size)
    return (
        Wind(
            region=region,
            velocity=_vector(wave * _log_uniform(rng, 1e-3, 10.0) * _direction(rng)),
            drag=_log_uniform(rng, 1e-2, 1e2) / end,
            **_window(rng, end),
        ),
    )


def _domain(rng: np.random.Generator, capabilities: EngineCapabilities, positions: Array, size: float) -> Domain | None:
    policy = _pick(rng, capabilities.domain_policies, lambda one: one.value)
    if policy is None or rng.random() < 0.4:
        return None
    # With one that stops the run, some points may be outside from the start; one that clamps holds all of them.
    room = size * (0.05 if policy is DomainPolicy.CLAMP else -0.05) + size * rng.random()
    lower, upper = positions.min(axis=0) - room, positions.max(axis=0) + room
    # A box turned inside out by a cloud flatter than what was taken off.
    lower, upper = np.minimum(lower, upper), np.maximum(lower, upper) + 1e-3 * size
    return Domain(lower=_vector(lower), upper=_vector(upper), policy=policy)
