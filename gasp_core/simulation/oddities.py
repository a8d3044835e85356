"""What of a scene is possible and probably not what was meant: told before it runs, and not refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    Elastic,
    EngineDescriptor,
    KeyframedMotion,
    Material,
    NeoHookean,
    PointProblem,
    Side,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.gaussians import Gaussians
from gasp_core.reduction.assembly import Assembly
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import Swing, Wave
from gasp_core.scene.objects import laws_of
from gasp_core.scene.placement import up_axis
from gasp_core.scene.selection import PlacedObject
from gasp_core.scene.standing import guess_up
from gasp_core.simulation.idle_acts import idle_acts

__all__ = ["oddities", "own_contact"]

Array = NDArray[Any]

_LIGHTEST, _HEAVIEST = 5.0, 25_000.0
"""[kg/m^3]: of the lightest foam, and beyond osmium."""
_SMALLEST, _LARGEST = 1e-3, 20.0
"""[m]: of what one captures and lets fall."""
_FASTEST = 300.0
"""[m/s]: of an airliner. What is thrown, dropped or shot from a bow is slower."""
_LONGEST_COLLIDER = 100.0
"""[m]: a terrain is long, a table in millimetres is longer."""
_SOFTEST = 1.0
"""Density times gravity times size over Young's modulus, from which on nothing keeps its shape under its own weight."""
_FRAMES_A_SWING = 8
"""At the least, by which a swing is led within 1 % of its amplitude."""
_AWAY = 1e-3
"""[m]: what a hand measures."""
_HAIR = 0.01
"""Of a frame: less is rounding of who wrote the duration, and nobody misses it."""
_LEANING = 0.5
"""Cosine of the angle between gravity and down below which it is no tilt any more."""


def oddities(scene: Scene, objects: Sequence[PlacedObject], assembly: Assembly) -> Iterator[str]:
    """A sentence for each.

    Parameters
    ----------
    scene
        All of it, even where only its first moments are run.
    objects
        All of the scene, placed.
    assembly
        What an engine is given.
    """
    yield from _of_duration(scene)
    problem = assembly.problem
    gravity = np.asarray(problem.gravity, dtype=np.float64)
    strength = float(np.linalg.norm(gravity))
    if strength > 0 and -gravity[2] < _LEANING * strength:
        aside = "up" if gravity[2] > _LEANING * strength else "sideways"
        yield f"gravity = [{', '.join(f'{part:g}' for part in gravity)}] pulls {aside}: in a scene down is -z"
    for placed in objects:
        yield from (
            f'object "{placed.item.name}": {sentence}' for sentence in _of_object(placed, strength, scene.frame_rate)
        )
    for name, collider in zip(assembly.colliders, problem.colliders):
        yield from _of_collider(name, collider, assembly.spacing)
    yield from idle_acts(assembly, scene.time_of(scene.frame_count - 1))


def own_contact(problem: PointProblem, engine: EngineDescriptor) -> list[str]:
    """A sentence where there are several bodies and the engine does not say how they meet, or says that they do not."""
    if not problem.points.body_ids.any() or engine.capabilities.body_contacts:
        return []
    if not engine.capabilities.bodies_meet:
        return [
            f"objects pass through each other: {engine.name} declares that bodies do not meet; those in which they do"
            " stand under [[contact]] in docs/scene.md"
        ]
    return [
        f"objects that touch do what {engine.name} makes of it, for it declares no contact between bodies: what that is"
        " stands under [[contact]] in docs/scene.md, and which engines declare one"
    ]


def _of_duration(scene: Scene) -> Iterator[str]:
    """A sentence where the last frame comes before the end."""
    last = scene.frame_count - 1
    rest = scene.duration - scene.time_of(last)
    if last == 0:
        yield (
            f"duration = {scene.duration:g} is less than a frame, which is {1 / scene.frame_rate:g} s at"
            f" {scene.frame_rate:g} frames a second: nothing is simulated, the start alone is kept"
        )
    elif rest * scene.frame_rate > _HAIR:
        yield (
            f"duration = {scene.duration:g} is no whole number of frames at {scene.frame_rate:g} a second: the last one"
            f" is at {scene.time_of(last):g} s, and the {rest:.3g} s after it are left out"
        )


def _of_collider(name: str, collider: Collider, spacing: float) -> Iterator[str]:
    """A sentence where a body of a file is in another unit, and where it is thinner than what an engine's grid sees."""
    shape, motion = collider.shape, collider.motion
    if isinstance(motion, KeyframedMotion) and isinstance(shape, BoxShape | SphereShape) and motion.places:
        first, own = motion.places[0], shape.center
        if motion.center == own and math.dist(first, own) > _AWAY:
            places = " and not ".join(f"[{', '.join(f'{value:g}' for value in place)}]" for place in (first, own))
            yield f"{name}: its motion has its middle at {places} from the start on: what moves is where that says"
    if not isinstance(shape, SignedDistanceField):
        return
    longest = shape.spacing * (max(shape.values.shape) - 1)
    if longest > _LONGEST_COLLIDER:
        yield f"{name}: it is about {longest:.3g} m long: say its height, or metres_per_unit = 0.001 if it is in mm"
    if collider.side is Side.OUTSIDE:
        thickness = -2 * float(shape.values.min())
        if thickness < spacing:
            yield (
                f"{name}: is nowhere thicker than {thickness:.3g} m, less than a cell of {spacing:.3g} m:"
                " matter may pass through it, raise the resolution"
            )


def _of_object(placed: PlacedObject, gravity: float, frame_rate: float) -> Iterator[str]:
    if placed.item.static and placed.item.collider is None:
        yield "is drawn only, nothing collides with it (collider = true: everything that moves does)"
    means = placed.gaussians.means[~placed.floating]
    for density in dict.fromkeys(_densities(placed)):
        if not _LIGHTEST <= density <= _HEAVIEST:
            what = "less than any solid's or liquid's" if density < _LIGHTEST else "more than any metal's"
            yield f"its density of {density:g} kg/m^3 is {what}: water has 1000"
    size = float(np.ptp(means, axis=0).max()) if len(means) > 1 else 0.0
    if size > _LARGEST or 0 < size < _SMALLEST:
        said = placed.item.height is not None or placed.item.metres_per_unit is not None
        advice = "lengths are in metres" if said else "say its height; a unit of the file is a metre otherwise"
        yield f"it is {size:.3g} m long: {advice}"
    speed = math.hypot(*placed.item.velocity)
    if speed > _FASTEST:
        yield f"it starts at {speed:,.0f} m/s, faster than an airliner: velocity is in m/s"
    soft: dict[float, None] = {}
    for index, law in enumerate(laws_of(placed.item)):
        if isinstance(law, (Elastic, NeoHookean)):
            densities, moduli = (_values(placed, index, law, name) for name in ("density", "youngs_modulus"))
            if len(moduli) and len(densities) and np.median(densities * gravity * size / moduli) > _SOFTEST:
                soft[float(np.median(moduli))] = None
    for modulus in soft:
        yield (
            f"with youngs_modulus = {modulus:g} it sinks into a heap under its own weight: it is in Pa,"
            " rubber has 2e6; gasp materials lists more"
        )
    yield from _of_its_motion(placed, frame_rate)
    yield from _of_its_stand(placed)


def _of_its_motion(placed: PlacedObject, frame_rate: float) -> Iterator[str]:
    """A sentence where frames are too far apart to lead matter by: where a motion goes is asked for at frames alone."""
    motion = placed.item.motion
    if not isinstance(motion, Swing | Wave) or motion.composition != "driven":
        return
    fastest = motion.frequency * abs(motion.rate)
    if motion.schedule is not None:
        rates = [abs((end - begin) / (after - before)) for (before, begin), (after, end) in pairwise(motion.schedule)]
        fastest = motion.frequency * max(rates, default=0.0)
    if fastest * _FRAMES_A_SWING > frame_rate:
        yield (
            f"its driven parts swing {fastest:g} times a second, and are led by where they are at {frame_rate:g} frames"
            f" a second: what is between is lost; say frame_rate = {math.ceil(_FRAMES_A_SWING * fastest)}"
        )


def _of_its_stand(placed: PlacedObject) -> Iterator[str]:
    """A sentence where what is turned as its file says stands on a narrow end of it, and another one is wide."""
    item = placed.item
    if item.rotation is not None or item.motion is not None or isinstance(item.splat, Gaussians):
        return
    said = up_axis(item)
    found, sure = guess_up(placed.gaussians.select(~placed.floating), said)
    if sure and found != said:
        yield (
            f'up = "{said}" stands it on a narrow end: its widest would be down with up = "{found}"'
            " (gasp render FILE --up shows it)"
        )


def _densities(placed: PlacedObject) -> Iterator[float]:
    """Those that it, or a part of it, has; the least and the greatest where it varies."""
    for index, law in enumerate(laws_of(placed.item)):
        own = _values(placed, index, law, "density")
        yield from (float(own.min()), float(own.max())) if len(own) else ()


def _values(placed: PlacedObject, index: int, law: Material, name: str) -> Array:
    """What a number of one of its `laws_of` is, (1,), or in each Gaussian that it is the law of."""
    column = placed.fields[index].get(name)
    if column is None:
        return np.array([getattr(law, name)], dtype=np.float64)
    return column[placed.moving & (placed.part_numbers == index - 1)]
