"""Splats of bodies with known answers: flat Gaussians on a surface, with holes and noise as captures have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from gasp_core.gaussians import Gaussians, rotation_quaternions

__all__ = ["SHAPES", "Shape", "discs", "shell", "trained_shell"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A body standing on z = 0.

    Parameters
    ----------
    surface
        (count, rng) -> points (N, 3) spread evenly over its surface, and outward normals (N, 3).
    area, volume
    size
        Its longest side.
    centre : (3,)
    inertia : (3,)
        Principal moments of density one over the volume, about the axes.
    distance
        Signed distance of points (N, 3).
    """

    surface: Callable
    area: float
    volume: float
    size: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float]
    distance: Callable


def _sphere(radius: float) -> Shape:
    def surface(count, rng):
        normals = _unit(rng.normal(size=(count, 3)))
        return normals * radius + [0, 0, radius], normals

    return Shape(
        surface=surface,
        area=4 * np.pi * radius**2,
        volume=4 / 3 * np.pi * radius**3,
        size=2 * radius,
        centre=(0, 0, radius),
        inertia=(0.4 * radius**2,) * 3,
        distance=lambda points: np.linalg.norm(points - [0, 0, radius], axis=1) - radius,
    )


def _box(x: float, y: float, z: float) -> Shape:
    half = np.array([x, y, z]) / 2

    def surface(count, rng):
        areas = np.array([y * z, x * z, x * y, y * z, x * z, x * y])
        faces = rng.choice(6, count, p=areas / areas.sum())
        points, normals = rng.uniform(-1, 1, (count, 3)) * half, np.zeros((count, 3))
        rows, axes, signs = np.arange(count), faces % 3, np.where(faces < 3, 1.0, -1.0)
        points[rows, axes], normals[rows, axes] = signs * half[axes], signs
        return points + [0, 0, half[2]], normals

    def distance(points):
        beyond = np.abs(points - [0, 0, half[2]]) - half
        return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)

    return Shape(
        surface=surface,
        area=2 * (x * y + y * z + z * x),
        volume=x * y * z,
        size=max(x, y, z),
        centre=(0, 0, half[2]),
        inertia=((y**2 + z**2) / 12, (x**2 + z**2) / 12, (x**2 + y**2) / 12),
        distance=distance,
    )


def _torus(ring: float, tube: float) -> Shape:
    def surface(count, rng):
        around, across = rng.uniform(0, 2 * np.pi, (2, 4 * count))
        # The outside of the ring is longer.
        kept = rng.uniform(0, ring + tube, 4 * count) < ring + tube * np.cos(across)
        around, across = around[kept][:count], across[kept][:count]
        normals = np.stack([np.cos(across) * np.cos(around), np.cos(across) * np.sin(around), np.sin(across)], axis=1)
        spine = ring * np.stack([np.cos(around), np.sin(around), np.zeros(count)], axis=1)
        return spine + tube * normals + [0, 0, tube], normals

    wide, high = ring**2 / 2 + 5 / 8 * tube**2, ring**2 + 3 / 4 * tube**2
    return Shape(
        surface=surface,
        area=4 * np.pi**2 * ring * tube,
        volume=2 * np.pi**2 * ring * tube**2,
        size=2 * (ring + tube),
        centre=(0, 0, tube),
        inertia=(wide, wide, high),
        distance=lambda points: np.hypot(np.hypot(points[:, 0], points[:, 1]) - ring, points[:, 2] - tube) - tube,
    )


def _dome(radius: float) -> Shape:
    """Half a sphere on the floor, open below."""

    def surface(count, rng):
        normals = _unit(rng.normal(size=(count, 3)))
        normals[:, 2] = np.abs(normals[:, 2])
        return normals * radius, normals

    def distance(points):
        out = np.linalg.norm(points, axis=1) - radius
        rim = np.hypot(points[:, 0], points[:, 1]) - radius
        below = np.where(rim < 0, -points[:, 2], np.hypot(rim, points[:, 2]))
        return np.where(points[:, 2] < 0, below, np.maximum(out, -points[:, 2]))

    wide = (2 / 5 - 9 / 64) * radius**2
    return Shape(
        surface=surface,
        area=2 * np.pi * radius**2,
        volume=2 / 3 * np.pi * radius**3,
        size=2 * radius,
        centre=(0, 0, 3 / 8 * radius),
        inertia=(wide, wide, 0.4 * radius**2),
        distance=distance,
    )


SHAPES = {
    "sphere": _sphere(0.5),
    "cube": _box(1.0, 1.0, 1.0),
    "torus": _torus(0.35, 0.15),
    "thin box": _box(1.0, 1.0, 0.12),
    "open dome": _dome(0.5),
}


def shell(shape: Shape, *, count: int = 20_000, holes: float = 0.0, noise: float = 0.0, seed: int = 0) -> Gaussians:
    """A splat of a body.

    Parameters
    ----------
    shape
        Of which.
    count
        Gaussians, before there are holes.
    holes
        Share of them that lie in round holes, of radii .02 to .05 of the size.
    noise
        Standard deviation across the surface, in units of length.
    """
    rng = np.random.default_rng(seed)
    points, normals = shape.surface(count, rng)
    kept = np.ones(count, dtype=bool)
    while 1 - kept.mean() < holes:
        hole = points[rng.integers(count)]
        kept &= np.linalg.norm(points - hole, axis=1) > rng.uniform(0.02, 0.05) * shape.size
    side = np.sqrt(shape.area / count)
    scales = side * rng.uniform(0.5, 1.5, (count, 2))
    points = points + normals * rng.normal(size=(count, 1)) * noise
    opacities = rng.uniform(0.5, 1.0, count)
    return discs(points[kept], normals[kept], scales[kept], opacities[kept], rng)


def trained_shell(shape: Shape, *, count: int = 20_000, depth: float = 0.06, seed: int = 0) -> Gaussians:
    """A splat of a body as training leaves them: behind what one sees as many Gaussians that nobody ever saw.

    They face anywhere, are as opaque as it happens, and lie up to `depth` of the size behind the surface.
    """
    rng = np.random.default_rng(seed)
    seen = shell(shape, count=count, seed=seed)
    points, normals = shape.surface(count, rng)
    points = points - normals * rng.uniform(0.0, depth * shape.size, (count, 1))
    scales = np.sqrt(shape.area / count) * rng.uniform(0.5, 1.5, (count, 2))
    hidden = discs(points, _unit(rng.normal(size=(count, 3))), scales, rng.uniform(0.05, 1.0, count), rng)
    both = (seen, hidden)
    return Gaussians(
        **{field.name: np.concatenate([getattr(each, field.name) for each in both]) for field in fields(seen)}
    )


def discs(points, normals, scales, opacities, rng) -> Gaussians:
    """Flat Gaussians with these normals (N, 3), in-plane scales (N, 2) and opacities (N,), turned at random."""
    first = rng.normal(size=points.shape)
    first = _unit(first - np.einsum("ni,ni->n", first, normals)[:, None] * normals)
    axes = np.stack([normals, first, np.cross(normals, first)], axis=2)
    thin = 0.05 * scales.min(axis=1, keepdims=True)
    return Gaussians(
        means=points,
        quaternions=rotation_quaternions(axes),
        scales=np.concatenate([thin, scales], axis=1),
        opacities=opacities,
        harmonics=np.zeros((len(points), 1, 3)),
    )


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
