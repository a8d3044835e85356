"""Colliders as shaded geometry, by casting a ray through every pixel: what splats stand on, in front of and behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side, SignedDistanceField, SphereShape
from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import Picture
from gasp_core.rendering.field_rays import field_distances
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["LIGHT", "Hit", "Scenery", "draw_scenery", "nearest_hits"]

Array = NDArray[Any]

LIGHT = np.array([0.35, -0.5, 1.6])
"""Direction to the lamp."""
_AMBIENT = 0.55
"""Of the light, that is no lamp's: as bright is what lies in a shadow."""
_BEFORE = 2e-3
"""Of the size of what happens, that something has to be nearer to the lamp to shade a place: not what it touches."""
_GROUND = np.array([0.80, 0.80, 0.79])
_SOLID = np.array([0.72, 0.66, 0.58])
_LINE = 0.86
"""Brightness of the grid's lines."""
_LINE_SHARE = 0.03
"""Width of a line over the distance between two."""
_EDGE = 0.04
"""Difference of neighbouring pixels from which several rays are cast."""
_SAMPLES = ((0.25, 0.125), (-0.125, 0.25), (-0.25, -0.125), (0.125, -0.25))
"""Rays of a pixel, off its centre: rotated grid, so that level and upright edges are smooth too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """Where rays first meet a collider.

    Parameters
    ----------
    depth : (...)
        Along the axis of view; inf where nothing is met.
    collider : (...)
        Its number.
    """

    depth: Array
    collider: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenery(Picture):
    """Colliders as a picture.

    Parameters
    ----------
    lamplight : (H, W) float32
        Share of each pixel's colour that is the lamp's, 0..1: so much a shadow takes. 0 where it is in one already.
    """

    lamplight: Array


def nearest_hits(colliders: Sequence[Collider], origin: Array, rays: Array, time: float = 0.0) -> Hit:
    """The first surface that each ray origin + depth * ray meets from the side on which matter may be, at `time` [s].

    A surface seen from behind is not there: one looks into a container through its near wall, and from below a floor
    at what lies on it.
    """
    depth = np.full(rays.shape[:-1], np.inf)
    number = np.full(rays.shape[:-1], -1)
    for index, collider in enumerate(colliders):
        # What moves is met in its own frame.
        pose = None if collider.motion is None else pose_of(collider.motion, time)
        if pose is None:
            found = _distances(collider, origin, rays)
        else:
            found = _distances(collider, pose.before(origin), rays @ pose.rotation)
        nearer = found < depth
        depth[nearer] = found[nearer]
        number[nearer] = index
    return Hit(depth=depth, collider=number)


def draw_scenery(
    colliders: Sequence[Collider],
    camera: Camera,
    *,
    centre: Array,
    reach: float,
    time: float = 0.0,
    lamp: Array | None = None,
) -> Scenery:
    """The colliders from a camera, on a transparent ground.

    Parameters
    ----------
    colliders
        Any number.
    camera
        From where.
    centre : (3,), reach
        Middle and size of what happens [m]: planes have a grid that fits it and fade out beyond it.
    time
        [s], for colliders that move.
    lamp : (3,)
        Where it is [m]: colliders, but for planes, cast shadows on each other; None: none of them does.
    """
    shape = (camera.height, camera.width)
    if not colliders:
        nothing = np.zeros((*shape, 3), np.float32)
        depth = np.full(shape, np.inf, np.float32)
        return Scenery(colour=nothing, alpha=nothing[:, :, 0], depth=depth, lamplight=nothing[:, :, 0])
    look = _Look(
        colliders=colliders,
        eye=camera.position,
        pixel=1 / min(camera.focal_x, camera.focal_y),
        centre=np.asarray(centre),
        reach=reach,
        time=time,
        lamp=lamp,
    )
    empty = {name: np.empty(shape, np.float32) for name in ("alpha", "depth", "lamplight")}
    picture = Scenery(colour=np.empty((*shape, 3), np.float32), **empty)
    for rows in camera.bands():
        colour, alpha, depth, lamplight = _shaded(look, camera.rays(rows).reshape(-1, 3))
        picture.colour[rows] = colour.reshape(-1, camera.width, 3)
        picture.alpha[rows] = alpha.reshape(-1, camera.width)
        picture.depth[rows] = depth.reshape(-1, camera.width)
        picture.lamplight[rows] = lamplight.reshape(-1, camera.width)
    rough = _edges(picture.colour, picture.alpha)
    for rows in camera.bands():
        here = rough[rows]
        smooth = _smoothed(look, camera.rays(rows)[here], camera)
        picture.colour[rows][here], picture.alpha[rows][here], picture.lamplight[rows][here] = smooth
    return picture


@dataclass(frozen=True, slots=True, kw_only=True)
class _Look:
    """What rays meet, and how it is to look."""

    colliders: Sequence[Collider]
    eye: Array
    pixel: float
    """Width of a pixel at depth 1."""
    centre: Array
    reach: float
    time: float
    lamp: Array | None


def _edges(colour: Array, alpha: Array) -> Array:
    """Mask (H, W) of the pixels that differ from a neighbour by more than shading does."""
    rough = np.zeros(alpha.shape, dtype=bool)
    for values in (*np.moveaxis(colour, 2, 0), alpha):
        for axis in (0, 1):
            step = np.abs(np.diff(values, axis=axis)) > _EDGE
            rough |= np.pad(step, [(int(axis == k), 0) for k in (0, 1)])
            rough |= np.pad(step, [(0, int(axis == k)) for k in (0, 1)])
    return rough


def _smoothed(look: _Look, rays: Array, camera: Camera) -> tuple[Array, Array, Array]:
    """Mean premultiplied colours (N, 3), weights and shares of lamplight (N,) of several rays through each pixel."""
    colour, alpha, lamplight = np.zeros((len(rays), 3)), np.zeros(len(rays)), np.zeros(len(rays))
    for across, down in _SAMPLES:
        aside = across / camera.focal_x * camera.rotation[0] + down / camera.focal_y * camera.rotation[1]
        shade, weight, _, lit = _shaded(look, rays + aside)
        colour += shade / len(_SAMPLES)
        alpha += weight / len(_SAMPLES)
        lamplight += lit / len(_SAMPLES)
    return colour, alpha, lamplight


def _distances(collider: Collider, origin: Array, rays: Array) -> Array:
    shape, inside = collider.shape, collider.side is Side.INSIDE
    if isinstance(shape, HalfSpace):
        return _plane(shape, origin, rays, sign=-1.0 if inside else 1.0)
    if isinstance(shape, SignedDistanceField):
        return field_distances(shape, origin, rays, inside=inside)
    if isinstance(shape, BoxShape):
        entry, leave = _box(shape, origin, rays)
    elif isinstance(shape, SphereShape):
        entry, leave = _sphere(shape, origin, rays)
    else:
        raise RenderingError(
            f"a collider of kind {shape.kind} cannot be drawn: this GASP draws planes, boxes, spheres and fields"
        )
    # Matter outside sees the surface where rays go in, matter inside where they go out.
    chosen = leave if inside else entry
    return np.where((entry <= leave) & (chosen > 0), chosen, np.inf)


def _plane(shape: HalfSpace, origin: Array, rays: Array, *, sign: float) -> Array:
    normal = sign * np.asarray(shape.normal)
    height = float((origin - np.asarray(shape.point)) @ normal)
    if height <= 0:
        return np.full(rays.shape[:-1], np.inf)
    falling = -(rays @ normal)
    return np.where(falling > 0, height / np.where(falling > 0, falling, 1.0), np.inf)


def _box(shape: BoxShape, origin: Array, rays: Array) -> tuple[Array, Array]:
    """Slabs: the ray is inside while it is between all three pairs of planes."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        low = (np.asarray(shape.center) - np.asarray(shape.half_extents) - origin) / rays
        high = (np.asarray(shape.center) + np.asarray(shape.half_extents) - origin) / rays
    # 0 / 0: along a face, which does not bound the ray.
    entry = np.nan_to_num(np.minimum(low, high), nan=-np.inf, posinf=np.inf, neginf=-np.inf).max(axis=-1)
    leave = np.nan_to_num(np.maximum(low, high), nan=np.inf, posinf=np.inf, neginf=-np.inf).min(axis=-1)
    return entry, leave


def _sphere(shape: SphereShape, origin: Array, rays: Array) -> tuple[Array, Array]:
    offset = origin - np.asarray(shape.center)
    a = np.einsum("...i,...i->...", rays, rays)
    b = rays @ offset
    discriminant = b * b - a * (offset @ offset - shape.radius**2)
    root = np.sqrt(np.maximum(discriminant, 0.0))
    missed = discriminant < 0
    return np.where(missed, np.inf, (-b - root) / a), np.where(missed, -np.inf, (-b + root) / a)


def _shaded(look: _Look, rays: Array) -> tuple[Array, Array, Array, Array]:
    """Premultiplied colours (N, 3), weights, depths, shares of lamplight (N,) of what rays (N, 3) from the eye meet."""
    hit = nearest_hits(look.colliders, look.eye, rays, look.time)
    colour, weight, lamplight = np.zeros(rays.shape), np.zeros(len(rays)), np.zeros(len(rays))
    for index, collider in enumerate(look.colliders):
        met = np.flatnonzero(hit.collider == index)
        if len(met) == 0:
            continue
        position = look.eye + hit.depth[met][:, None] * rays[met]
        shape, rotation = collider.shape, np.eye(3)
        local = position
        if collider.motion is not None:
            pose = pose_of(collider.motion, look.time)
            local, rotation = pose.before(position), pose.rotation
        if isinstance(shape, HalfSpace):
            normal = rotation @ np.asarray(shape.normal)
            away = np.linalg.norm(position - look.centre, axis=1) / look.reach
            weight[met] = _smoothstep(4.5, 1.5, away)
            slant = np.abs(rays[met] @ normal) / np.linalg.norm(rays[met], axis=1)
            blur = hit.depth[met] * look.pixel / slant
            brightness = _grid(local, np.asarray(shape.normal), look.reach, blur)
            colour[met] = _GROUND * (weight[met] * brightness)[:, None]
            lamplight[met] = np.where(weight[met] > 0, 1 - _AMBIENT, 0.0)
        else:
            normals = shape.outward_normal(local) @ rotation.T * (-1.0 if collider.side is Side.INSIDE else 1.0)
            light = _AMBIENT + (1 - _AMBIENT) * np.maximum(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0)
            weight[met] = 1.0
            colour[met] = _SOLID * light[:, None]
            lamplight[met] = 1 - _AMBIENT / light
        if look.lamp is not None:
            others = [*look.colliders[:index], *look.colliders[index + 1 :]]
            lit = lamplight[met] > 0
            shaded = met[lit][_shadowed(others, look, look.lamp, position[lit])]
            colour[shaded] *= 1 - lamplight[shaded][:, None]
            lamplight[shaded] = 0.0
    return colour, weight, hit.depth, lamplight


def _shadowed(colliders: Sequence[Collider], look: _Look, lamp: Array, positions: Array) -> Array:
    """Mask (N,) of the places (N, 3) that one of some colliders is before, seen from the lamp."""
    shaded = np.zeros(len(positions), dtype=bool)
    balls = [(collider, _ball_around(collider, look.time)) for collider in colliders]
    if all(ball is None for _, ball in balls):
        return shaded
    # Squares of the distances from the lamp.
    far = np.einsum("ij,ij->i", positions, positions) - 2 * (positions @ lamp) + lamp @ lamp
    for collider, ball in balls:
        if ball is None:
            continue
        # Most rays pass it by: those whose line comes no nearer to its middle than it is large.
        middle, radius = ball[0] - lamp, ball[1]
        ahead = positions @ middle - lamp @ middle
        near = np.flatnonzero(~shaded & (ahead**2 > (middle @ middle - radius**2) * far))
        depth = nearest_hits([collider], lamp, positions[near] - lamp, look.time).depth
        shaded[near] = depth < 1 - _BEFORE * look.reach / np.sqrt(far[near])
    return shaded


def _ball_around(collider: Collider, time: float) -> tuple[Array, float] | None:
    """Middle (3,) and radius of a ball that a collider is in; None of what casts no shadow: planes, and what has matter
    inside, as one looks into it through its wall.
    """
    shape = collider.shape
    if collider.side is Side.INSIDE or isinstance(shape, HalfSpace):
        return None
    if isinstance(shape, SphereShape):
        middle, radius = np.asarray(shape.center), shape.radius
    elif isinstance(shape, BoxShape):
        middle, radius = np.asarray(shape.center), float(np.linalg.norm(shape.half_extents))
    elif isinstance(shape, SignedDistanceField):
        half = shape.spacing * (np.array(shape.values.shape) - 1) / 2
        middle, radius = np.asarray(shape.origin) + half, float(np.linalg.norm(half))
    else:
        return None
    if collider.motion is None:
        return middle, radius
    pose = pose_of(collider.motion, time)
    return pose.place + pose.rotation @ (middle - pose.center), radius


def _grid(position: Array, normal: Array, reach: float, blur: Array) -> Array:
    """Brightness of a plane with lines a round number of metres apart, smoothed over `blur` metres."""
    spacing = _round_length(reach / 4)
    # Along the two axes that the plane is least turned away from.
    axes = np.argsort(np.abs(normal))[:2]
    brightness = np.ones(len(position))
    for axis in axes:
        cell = position[:, axis] / spacing
        width = np.maximum(blur / spacing, 1e-9)
        line = 0.5 * _LINE_SHARE
        distance = np.abs(cell - np.round(cell))
        covered = np.clip((line + 0.5 * width - distance) / width, 0.0, np.minimum(1.0, 2 * line / width))
        # Lines closer than pixels are a uniform grey.
        brightness *= 1 - (1 - _LINE) * np.where(width > 0.5, _LINE_SHARE, covered)
    return brightness


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-12))


def _smoothstep(start: float, end: float, value: Array) -> Array:
    t = np.clip((value - start) / (end - start), 0.0, 1.0)
    return t * t * (3 - 2 * t)
