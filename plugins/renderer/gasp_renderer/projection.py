# pyright: basic
# numba's decorators carry no types.
"""Gaussians of the world become ellipses in the picture, with a colour, a depth and a box of tiles.

An ellipse is kept whitened: with the Cholesky factor of its inverse covariance a pixel (x, y) has the coordinates

    e_x = across * x - slant * y - offset_x,    e_y = down * y - offset_y,    alpha = 2^(strength - e_x^2 - e_y^2),

base 2 because that is the exponential a processor has. In the usual form A dx^2 + B dx dy + C dy^2 the terms of a long
thin ellipse cancel: 1000 px long and 1 px wide, it would lose all digits of float32. Whitened, nothing cancels, nothing
overflows, and a row of pixels costs two multiplications each.

Geometry is computed in float64: it costs nothing next to the memory it reads, leaves scenes far from the origin exact,
and orders by depth without ties. Colours are float32.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import ALPHA_FLOOR, LOW_PASS
from gasp_renderer.inputs import FARTHEST

__all__ = ["FIELDS", "SPANS", "TILE", "View", "project"]

Array = NDArray[Any]

TILE = 16
"""Pixels along the side of a tile."""

ACROSS, SLANT, OFFSET_X, DOWN, OFFSET_Y, STRENGTH, RED, GREEN, BLUE, DEPTH, TOP, BOTTOM = range(12)
"""Columns of a drawn Gaussian; TOP and BOTTOM are its first row of pixels and the one behind its last."""
FIELDS = 12

W00, W10, W11, W20, W21, W22, M0, M1, M2, HALF = range(10)
"""Columns of how a drawn Gaussian lies along the rays: a triangular W that whitens it in the camera's frame (W^T W is
the inverse of its covariance), W times its mean, and how much nearer or deeper than its mean it is ever seen."""
SPANS = 10

_CHUNK = 512
"""Gaussians that share one scratch array; many chunks a thread even out what is drawn and what is not."""
_HALF_LOG2E = 0.5 * math.log2(math.e)
_FLOOR = math.log2(ALPHA_FLOOR)
_BRIGHTEST = 1e30
"""Colours end here, so that none becomes infinite and then, times a weight of zero, NaN."""

_DEEPEST = 5.0
"""Deviations of the depth beyond which nothing of a Gaussian is seen: in the picture alpha is below its floor from 3.33
on, along a ray 2e-4 of it are beyond 3.5, and the two add up as squares to 4.8."""

_function = numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
_strict = numba.njit(cache=True, error_model="numpy")
_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)


class View(NamedTuple):
    """A camera as the kernel reads it: arrays and bounds of x/z and y/z, beyond which the Jacobian is not followed."""

    rotation: Array
    translation: Array
    eye: Array
    width: int
    height: int
    focal_x: float
    focal_y: float
    center_x: float
    center_y: float
    near: float
    left: float
    right: float
    upper: float
    lower: float

    @classmethod
    def of(cls, camera: Camera) -> View:
        """The view of a camera, with the clamps 0.3 half-images beyond the edges."""
        width, height = int(camera.width), int(camera.height)
        return cls(
            rotation=np.ascontiguousarray(camera.rotation),
            translation=np.ascontiguousarray(camera.translation),
            eye=camera.position,
            width=width,
            height=height,
            focal_x=float(camera.focal_x),
            focal_y=float(camera.focal_y),
            center_x=float(camera.center_x),
            center_y=float(camera.center_y),
            near=float(camera.near),
            left=(-0.15 * width - camera.center_x) / camera.focal_x,
            right=(1.15 * width - camera.center_x) / camera.focal_x,
            upper=(-0.15 * height - camera.center_y) / camera.focal_y,
            lower=(1.15 * height - camera.center_y) / camera.focal_y,
        )


@_strict
def _along(rotation, translation, row, x, y, z):
    """One camera coordinate of a point. Without fused operations: equal to the last bit wherever it is computed so."""
    return rotation[row, 0] * x + rotation[row, 1] * y + rotation[row, 2] * z + translation[row]


@_function
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_function
def _gradient(rotation, row, scale, slope):
    """How a picture coordinate changes with the place in the world: one row of J R."""
    return (
        scale * (rotation[row, 0] - slope * rotation[2, 0]),
        scale * (rotation[row, 1] - slope * rotation[2, 1]),
        scale * (rotation[row, 2] - slope * rotation[2, 2]),
    )


@_function
def _axes(quaternion, scales, row):
    """A row of three times R S."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    w, x, y, z = np.float64(w), np.float64(x), np.float64(y), np.float64(z)
    squared = w * w + x * x + y * y + z * z
    # The quaternion's length is divided out here; one of length zero turns nothing.
    double = 2 / squared if squared > 0 else 0.0
    xx, yy, zz = double * x * x, double * y * y, double * z * z
    xy, xz, yz = double * x * y, double * x * z, double * y * z
    wx, wy, wz = double * w * x, double * w * y, double * w * z
    first, second, third = (
        (1 - yy - zz, xy + wz, xz - wy),
        (xy - wz, 1 - xx - zz, yz + wx),
        (xz + wy, yz - wx, 1 - xx - yy),
    )
    s0, s1, s2 = np.float64(scales[0]), np.float64(scales[1]), np.float64(scales[2])
    return s0 * _dot(row, first), s1 * _dot(row, second), s2 * _dot(row, third)


@_function
def _flat_axes(quaternion, scales, to_x, to_y):
    """xx, xy, yy and determinant of J R S S^T R^T J^T.

    Straight from the axes: products of them would lose the thin side of a needle, and the determinant as the squared
    area of the two rows of J R S is no difference of large numbers.
    """
    a, b = _axes(quaternion, scales, to_x), _axes(quaternion, scales, to_y)
    area = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return _dot(a, a), _dot(a, b), _dot(b, b), _dot(area, area)


@_function
def _flat_covariance(c, to_x, to_y):
    """xx, xy, yy and determinant of J Sigma J^T; what is no covariance by rounding is bounded to one."""
    a = (
        c[0] * to_x[0] + c[1] * to_x[1] + c[2] * to_x[2],
        c[1] * to_x[0] + c[3] * to_x[1] + c[4] * to_x[2],
        c[2] * to_x[0] + c[4] * to_x[1] + c[5] * to_x[2],
    )
    b = (
        c[0] * to_y[0] + c[1] * to_y[1] + c[2] * to_y[2],
        c[1] * to_y[0] + c[3] * to_y[1] + c[4] * to_y[2],
        c[2] * to_y[0] + c[4] * to_y[1] + c[5] * to_y[2],
    )
    xx, yy = max(_dot(a, to_x), 0.0), max(_dot(b, to_y), 0.0)
    largest = math.sqrt(xx * yy)
    xy = min(max(_dot(a, to_y), -largest), largest)
    return xx, xy, yy, max(xx * yy - xy * xy, 0.0)


@_function
def _turned_axes(quaternion, scales, rotation):
    """Covariance xx xy xz yy yz zz of a Gaussian in the camera's frame."""
    a = _axes(quaternion, scales, rotation[0])
    b = _axes(quaternion, scales, rotation[1])
    c = _axes(quaternion, scales, rotation[2])
    return _dot(a, a), _dot(a, b), _dot(a, c), _dot(b, b), _dot(b, c), _dot(c, c)


@_function
def _times(c, row):
    return (
        c[0] * row[0] + c[1] * row[1] + c[2] * row[2],
        c[1] * row[0] + c[3] * row[1] + c[4] * row[2],
        c[2] * row[0] + c[4] * row[1] + c[5] * row[2],
    )


@_function
def _turned_covariance(c, rotation):
    """The same of a covariance of the world."""
    a, b, z = _times(c, rotation[0]), _times(c, rotation[1]), _times(c, rotation[2])
    return (
        _dot(rotation[0], a),
        _dot(rotation[0], b),
        _dot(rotation[0], z),
        _dot(rotation[1], b),
        _dot(rotation[1], z),
        _dot(rotation[2], z),
    )


@_function
def _fill_span(span, c, x, y, z, pixel):
    """Whiten a Gaussian of the camera's frame by the Cholesky factor of its covariance, the low-pass added.

    Parameters
    ----------
    span : (SPANS,)
    c
        Covariance xx xy xz yy yz zz.
    x, y, z
        Mean.
    pixel
        Width of a pixel at the mean.
    """
    room = LOW_PASS * pixel * pixel
    l00 = math.sqrt(max(c[0], 0.0) + room)
    l10, l20 = c[1] / l00, c[2] / l00
    # What is no covariance by rounding is bounded to one.
    l11 = math.sqrt(max(c[3] + room - l10 * l10, 0.25 * room))
    l21 = (c[4] - l10 * l20) / l11
    l22 = math.sqrt(max(c[5] + room - l20 * l20 - l21 * l21, 0.25 * room))
    w00, w11, w22 = 1 / l00, 1 / l11, 1 / l22
    w10 = -l10 * w00 * w11
    w20, w21 = -(l20 * w00 + l21 * w10) * w22, -l21 * w11 * w22
    span[W00], span[W10], span[W11], span[W20], span[W21], span[W22] = w00, w10, w11, w20, w21, w22
    span[M0], span[M1], span[M2] = w00 * x, w10 * x + w11 * y, w20 * x + w21 * y + w22 * z
    span[HALF] = _DEEPEST * math.sqrt(max(c[5], 0.0) + room)


@_function
def _basis(values, degree, x, y, z):
    """`gasp_core.harmonics.basis` of one direction, in float32."""
    f = np.float32
    values[0] = f(0.28209479177387814)
    if degree >= 1:
        values[1] = f(-0.4886025119029199) * y
        values[2] = f(0.4886025119029199) * z
        values[3] = f(-0.4886025119029199) * x
    xx, yy, zz = x * x, y * y, z * z
    if degree >= 2:
        values[4] = f(1.0925484305920792) * x * y
        values[5] = f(-1.0925484305920792) * y * z
        values[6] = f(0.31539156525252005) * (f(2) * zz - xx - yy)
        values[7] = f(-1.0925484305920792) * x * z
        values[8] = f(0.5462742152960396) * (xx - yy)
    if degree >= 3:
        values[9] = f(-0.5900435899266435) * y * (f(3) * xx - yy)
        values[10] = f(2.890611442640554) * x * y * z
        values[11] = f(-0.4570457994644658) * y * (f(4) * zz - xx - yy)
        values[12] = f(0.3731763325901154) * z * (f(2) * zz - f(3) * xx - f(3) * yy)
        values[13] = f(-0.4570457994644658) * x * (f(4) * zz - xx - yy)
        values[14] = f(1.445305721320277) * z * (xx - yy)
        values[15] = f(-0.5900435899266435) * x * (xx - f(3) * yy)
    if degree >= 4:
        values[16] = f(2.5033429417967046) * x * y * (xx - yy)
        values[17] = f(-1.7701307697799304) * y * z * (f(3) * xx - yy)
        values[18] = f(0.9461746957575601) * x * y * (f(7) * zz - f(1))
        values[19] = f(-0.6690465435572892) * y * z * (f(7) * zz - f(3))
        values[20] = f(0.10578554691520431) * (zz * (f(35) * zz - f(30)) + f(3))
        values[21] = f(-0.6690465435572892) * x * z * (f(7) * zz - f(3))
        values[22] = f(0.47308734787878004) * (xx - yy) * (f(7) * zz - f(1))
        values[23] = f(-1.7701307697799304) * x * z * (xx - f(3) * yy)
        values[24] = f(0.6258357354491761) * (xx * (xx - f(3) * yy) - yy * (f(3) * xx - yy))


@_function
def _displayed(value):
    # Written so that NaN, the difference of two overflows, becomes 0.
    shifted = value + np.float32(0.5)
    return min(shifted, np.float32(_BRIGHTEST)) if shifted > 0 else np.float32(0)


@_function
def _colour(harmonics, turns, i, degree, values, x, y, z):
    """Red, green, blue of one Gaussian seen from the eye along (x, y, z)."""
    if len(turns) > 0:
        x, y, z = (
            turns[i, 0, 0] * x + turns[i, 1, 0] * y + turns[i, 2, 0] * z,
            turns[i, 0, 1] * x + turns[i, 1, 1] * y + turns[i, 2, 1] * z,
            turns[i, 0, 2] * x + turns[i, 1, 2] * y + turns[i, 2, 2] * z,
        )
    length = math.sqrt(x * x + y * y + z * z)
    _basis(values, degree, np.float32(x / length), np.float32(y / length), np.float32(z / length))
    red = green = blue = np.float32(0)
    for k in range((degree + 1) ** 2):
        red += values[k] * harmonics[i, k, 0]
        green += values[k] * harmonics[i, k, 1]
        blue += values[k] * harmonics[i, k, 2]
    return _displayed(red), _displayed(green), _displayed(blue)


@_function
def _whole(value, limit):
    """A pixel number as an integer, clamped before: a float out of range becomes any integer, in `math.ceil` too."""
    return np.int64(min(max(value, 0.0), limit))


@_parallel
def project(view, means, quaternions, scales, covariances, opacities, harmonics, turns, ellipses, spans, depths, boxes):
    """Fill `ellipses`, `spans`, `depths` and `boxes` for all Gaussians.

    Parameters
    ----------
    view : View
    means : (N, 3) float64
    quaternions : (N, 4) float32, scales : (N, 3) float32, covariances : (N, 6) float64
        Either the first two or the last; the others have no rows.
    opacities : (N,) float32
    harmonics : (N, (d + 1)^2, 3) float32
    turns : (N, 3, 3) float32, or no rows
    ellipses : (N, FIELDS) float32
    spans : (N, SPANS) float32, or no rows where nothing stands in the way
    depths : (N,) float64
        inf where a Gaussian is not in the picture; its other rows are then not written.
    boxes : (N, 4) int16
        Tiles it touches: first column, end, first row, end.

    Returns
    -------
    int
        Pairs of a Gaussian and a tile it touches.
    """
    degree = round(math.sqrt(harmonics.shape[1])) - 1
    rotation, translation = view.rotation, view.translation
    width, height = float(view.width), float(view.height)
    pairs = 0
    for chunk in numba.prange((len(means) + _CHUNK - 1) // _CHUNK):
        values = np.empty(25, np.float32)
        for i in range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(means))):
            depths[i] = np.inf
            px, py, pz = means[i, 0], means[i, 1], means[i, 2]
            depth = _along(rotation, translation, 2, px, py, pz)
            opacity = np.float64(opacities[i])
            if not (view.near <= depth <= FARTHEST and opacity >= ALPHA_FLOOR):
                continue
            slope_x = _along(rotation, translation, 0, px, py, pz) / depth
            slope_y = _along(rotation, translation, 1, px, py, pz) / depth
            u, v = view.focal_x * slope_x + view.center_x, view.focal_y * slope_y + view.center_y
            # Not so where a product has overflowed to NaN, which must not become a number of a pixel.
            if not (abs(u) <= FARTHEST and abs(v) <= FARTHEST):
                continue

            slope_x = min(max(slope_x, view.left), view.right)
            slope_y = min(max(slope_y, view.upper), view.lower)
            to_x = _gradient(rotation, 0, view.focal_x / depth, slope_x)
            to_y = _gradient(rotation, 1, view.focal_y / depth, slope_y)
            if len(covariances) > 0:
                xx, xy, yy, determinant = _flat_covariance(covariances[i], to_x, to_y)
            else:
                xx, xy, yy, determinant = _flat_axes(quaternions[i], scales[i], to_x, to_y)
            # det(S + c I) = det S + c tr S + c^2.
            determinant += LOW_PASS * (xx + yy) + LOW_PASS * LOW_PASS
            xx, yy = xx + LOW_PASS, yy + LOW_PASS
            if not determinant < np.inf:
                continue

            strength = math.log2(opacity)
            reach = math.sqrt(max(strength - _FLOOR, 0.0) / _HALF_LOG2E)
            reach_x, reach_y = reach * math.sqrt(xx), reach * math.sqrt(yy)
            first_x, end_x = _whole(np.ceil(u - reach_x - 0.5), width), _whole(np.floor(u + reach_x + 0.5), width)
            first_y, end_y = _whole(np.ceil(v - reach_y - 0.5), height), _whole(np.floor(v + reach_y + 0.5), height)
            if first_x >= end_x or first_y >= end_y:
                continue
            depths[i] = depth
            boxes[i, 0], boxes[i, 1] = first_x // TILE, (end_x + TILE - 1) // TILE
            boxes[i, 2], boxes[i, 3] = first_y // TILE, (end_y + TILE - 1) // TILE
            pairs += (boxes[i, 1] - boxes[i, 0]) * (boxes[i, 3] - boxes[i, 2])

            across, down = math.sqrt(_HALF_LOG2E * yy / determinant), math.sqrt(_HALF_LOG2E / yy)
            slant = across * xy / yy
            ellipses[i, ACROSS], ellipses[i, SLANT], ellipses[i, OFFSET_X] = across, slant, across * u - slant * v
            ellipses[i, DOWN], ellipses[i, OFFSET_Y], ellipses[i, STRENGTH] = down, down * v, strength
            ellipses[i, DEPTH], ellipses[i, TOP], ellipses[i, BOTTOM] = depth, first_y, end_y
            if len(spans) > 0:
                if len(covariances) > 0:
                    turned = _turned_covariance(covariances[i], rotation)
                else:
                    turned = _turned_axes(quaternions[i], scales[i], rotation)
                x, y = (u - view.center_x) * depth / view.focal_x, (v - view.center_y) * depth / view.focal_y
                _fill_span(spans[i], turned, x, y, depth, depth / min(view.focal_x, view.focal_y))
            red, green, blue = _colour(
                harmonics, turns, i, degree, values, px - view.eye[0], py - view.eye[1], pz - view.eye[2]
            )
            ellipses[i, RED], ellipses[i, GREEN], ellipses[i, BLUE] = red, green, blue
    return pairs
