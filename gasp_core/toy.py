"""A toy made of Gaussians in code, for a first run without data: a bear whose flat Gaussians lie on its surface.

The surface is the zero of a smooth union of ellipsoids. Points are spread over it evenly, each becomes a disc in the
tangent plane, and the discs are coloured by the part they lie on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians, rotation_quaternions

__all__ = ["make_toy"]

Array = NDArray[Any]
Triple = tuple[float, float, float]

# Constants of the real spherical harmonics of degree 0 and 1, as 3DGS files use them.
_SH0 = 0.28209479177387814
_SH1 = 0.4886025119029199

_BLEND = 0.05
"""Width of the smooth union's fillets, in units of the toy's height."""
_RELAXATIONS = 20
_NEIGHBOURS = 8
_REACH = 1.6
"""Range of the repulsion that spreads points evenly, in spacings."""


@dataclass(frozen=True, slots=True)
class _Part:
    """An ellipsoid and its colour; height 1, feet at z = 0, face towards -y."""

    center: Triple
    radii: Triple
    color: Triple


_FUR: Triple = (0.62, 0.40, 0.22)
_PALE: Triple = (0.90, 0.76, 0.56)
_DARK: Triple = (0.10, 0.07, 0.06)
_RED: Triple = (0.78, 0.13, 0.14)
_CREAM: Triple = (0.96, 0.93, 0.85)
_BLUE: Triple = (0.16, 0.33, 0.62)

_PARTS = (
    _Part((0.0, 0.0, 0.36), (0.205, 0.17, 0.235), _FUR),  # trunk
    _Part((0.0, -0.01, 0.73), (0.18, 0.165, 0.165), _FUR),  # head
    _Part((-0.135, 0.0, 0.90), (0.07, 0.045, 0.075), _FUR),  # ears
    _Part((0.135, 0.0, 0.90), (0.07, 0.045, 0.075), _FUR),
    _Part((0.0, -0.16, 0.69), (0.075, 0.06, 0.06), _PALE),  # muzzle
    _Part((-0.25, -0.04, 0.43), (0.12, 0.075, 0.075), _FUR),  # arms
    _Part((0.25, -0.04, 0.43), (0.12, 0.075, 0.075), _FUR),
    _Part((-0.115, -0.05, 0.11), (0.09, 0.115, 0.11), _FUR),  # legs
    _Part((0.115, -0.05, 0.11), (0.09, 0.115, 0.11), _FUR),
)


def make_toy(count: int = 10_000, seed: int = 0) -> Gaussians:
    """A bear of `count` flat Gaussians.

    It stands on z = 0, about 1 high and as wide as its arms, +z up, face towards -y. The thin axis of every Gaussian,
    its third, is the surface normal; harmonics are of degree 1, a soft rim that turns with the toy.

    Parameters
    ----------
    count
        Number of Gaussians, >= 16.
    seed
        The same seed gives the same toy.

    Returns
    -------
    Gaussians
        float32 arrays.
    """
    if count < 2 * _NEIGHBOURS:
        raise ValueError(f"make_toy: count must be >= {2 * _NEIGHBOURS}, found {count}")
    generator = np.random.default_rng(seed)
    points, spacing = _spread(generator, count)
    normals = _normals(points)
    frames = _tangent_frames(normals, generator)
    # Discs of standard deviation 0.65 of the spacing leave no hole between them; a tenth of it as thickness is flat.
    scales = np.tile([0.65 * spacing, 0.65 * spacing, 0.065 * spacing], (count, 1))
    colors = _colors(points)
    harmonics = np.zeros((count, 4, 3))
    harmonics[:, 0] = (colors - 0.5) / _SH0
    # Colour grows by -rim (n . d) with the view direction d: bright where one looks straight at the surface.
    rim = 0.12 * colors / _SH1
    harmonics[:, 1] = rim * normals[:, 1:2]
    harmonics[:, 2] = -rim * normals[:, 2:3]
    harmonics[:, 3] = rim * normals[:, 0:1]
    return Gaussians(
        means=points.astype(np.float32),
        quaternions=rotation_quaternions(frames).astype(np.float32),
        scales=scales.astype(np.float32),
        opacities=np.full(count, 0.95, dtype=np.float32),
        harmonics=harmonics.astype(np.float32),
    )


def _distances(points: Array) -> tuple[Array, Array]:
    """About the distance to each part's surface, (N, parts), negative inside, and its gradient, (N, parts, 3).

    k (k - 1) / |grad k| with k = 1 the surface (Quilez, "ellipsoid distance", 2008); both exact to first order there.
    """
    offset = points[:, None, :] - np.array([part.center for part in _PARTS])
    radii = np.array([part.radii for part in _PARTS])
    scaled = np.linalg.norm(offset / radii, axis=2)
    gradient = offset / radii**2
    length = np.maximum(np.linalg.norm(gradient, axis=2), 1e-12)
    return scaled * (scaled - 1) / length, gradient / length[:, :, None]


def _union(points: Array) -> tuple[Array, Array]:
    """The smooth union, (N,), and about its gradient, (N, 3).

    A soft minimum over the parts, exponential so that their order does not matter.
    """
    distances, gradients = _distances(points)
    scaled = -distances / (_BLEND / 2)
    largest = scaled.max(axis=1, keepdims=True)
    weights = np.exp(scaled - largest)
    total = weights.sum(axis=1)
    level = -(_BLEND / 2) * (largest[:, 0] + np.log(total))
    return level, np.einsum("np,npi->ni", weights, gradients) / total[:, None]


def _normals(points: Array) -> Array:
    """Outward normals by central differences of the union itself, (N, 3)."""
    step = 1e-4
    columns = [(_union(points + step * axis)[0] - _union(points - step * axis)[0]) / (2 * step) for axis in np.eye(3)]
    gradients = np.stack(columns, axis=1)
    return gradients / np.maximum(np.linalg.norm(gradients, axis=1, keepdims=True), 1e-12)


def _projected(points: Array, iterations: int) -> Array:
    """The points moved to the surface by Newton's method along the gradient."""
    for _ in range(iterations):
        level, gradient = _union(points)
        squared = np.maximum(np.einsum("ni,ni->n", gradient, gradient), 1e-2)
        points = points - (level / squared)[:, None] * gradient
    return points


def _spread(generator: np.random.Generator, count: int) -> tuple[Array, float]:
    """`count` points spread evenly over the surface, (N, 3), and the distance between neighbours."""
    import scipy.spatial  # slow to import

    lower, upper = np.array([-0.42, -0.28, -0.05]), np.array([0.42, 0.28, 1.05])
    shell = 0.01
    found = np.empty((0, 3))
    while len(found) < count:
        tried = generator.uniform(lower, upper, (4 * count, 3))
        level, gradient = _union(tried)
        # A shell of even thickness holds the same number of points for the same area, however the level is scaled.
        found = np.concatenate([found, tried[np.abs(level) < shell * np.linalg.norm(gradient, axis=1)]])
    points = _projected(found[:count], 6)
    spacing = 0.0
    for _ in range(_RELAXATIONS):
        distances, neighbours = scipy.spatial.KDTree(points).query(points, k=_NEIGHBOURS + 1)
        distances, neighbours = np.asarray(distances)[:, 1:], np.asarray(neighbours)[:, 1:]
        spacing = float(np.median(distances[:, : _NEIGHBOURS - 2].mean(axis=1)))
        away = points[:, None, :] - points[neighbours]
        push = np.maximum(_REACH - distances / spacing, 0.0) / np.maximum(distances, 1e-12)
        points = _projected(points + 0.15 * spacing * (push[:, :, None] * away).sum(axis=1), 1)
    return _projected(points, 6), spacing


def _tangent_frames(normals: Array, generator: np.random.Generator) -> Array:
    """Rotations whose third axis is the normal, (N, 3, 3); the discs are round, so the other two are drawn."""
    drawn = generator.normal(size=normals.shape)
    first = drawn - np.einsum("ni,ni->n", drawn, normals)[:, None] * normals
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    return np.stack([first, np.cross(normals, first), normals], axis=2)


def _colors(points: Array) -> Array:
    """Colour of each point, (N, 3) in 0..1: its part's, and what is painted on it."""
    colors = np.array([part.color for part in _PARTS])[np.argmin(_distances(points)[0], axis=1)]
    x, y, z = points.T
    front = y < 0
    belly = front & ((x / 0.12) ** 2 + ((z - 0.38) / 0.13) ** 2 < 1) & (np.abs(x) < 0.13)
    colors[belly] = _PALE
    soles = (z < 0.035) | ((np.abs(np.abs(x) - 0.115) < 0.05) & (y < -0.135) & (z < 0.15))
    colors[soles] = _PALE
    colors[front & ((np.abs(x) - 0.135) ** 2 + (z - 0.90) ** 2 < 0.042**2)] = _PALE
    # A scarf of red and cream stripes, and checked trousers: texture in which one sees the surface deform.
    stripes = np.floor(np.arctan2(y, x) / (2 * math.pi) * 16) % 2 == 0
    scarf = (np.abs(z - 0.575) < 0.035) & (np.hypot(x, y) < 0.21)
    colors[scarf & stripes] = _RED
    colors[scarf & ~stripes] = _CREAM
    checks = (np.floor(x / 0.07) + np.floor(y / 0.07) + np.floor(z / 0.07)) % 2 == 0
    trousers = (z > 0.06) & (z < 0.25) & (np.abs(x) < 0.22) & ~soles & ~belly
    colors[trousers & checks] = _BLUE
    colors[trousers & ~checks] = _CREAM
    eyes = front & ((np.abs(x) - 0.065) ** 2 + (z - 0.775) ** 2 < 0.02**2)
    nose = (y < -0.19) & ((x / 0.03) ** 2 + ((z - 0.715) / 0.02) ** 2 < 1)
    colors[eyes | nose] = _DARK
    return colors
