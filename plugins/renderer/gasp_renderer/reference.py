"""The renderer "reference": the image model written down in float64, one Gaussian after the other; slow and obvious.

What other renderers are measured against. No tiles, no early stop, no approximation; the only economy is that a
Gaussian is computed in the box around the pixels where its alpha reaches the floor, outside of which it is 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis, material_directions
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import ALPHA_FLOOR, ALPHA_LIMIT, LOW_PASS, Picture
from gasp_renderer.inputs import FARTHEST, Inputs, checked_inputs, checked_occluders

__all__ = ["ReferenceRenderer"]

Array = NDArray[Any]


class ReferenceRenderer:
    """Draws splats by brute force in float64."""

    def render(self, splats: RenderInput, camera: Camera, *, occluders: Array | None = None) -> Picture:
        """Draw splats on a transparent ground; see `SplatRenderer.render`."""
        walls = checked_occluders(occluders, camera, np.float64)
        inputs = checked_inputs(splats, narrow=np.float64)
        seen = _in_camera(inputs.means, camera)
        near_enough = (seen[:, 2] >= camera.near) & (seen[:, 2] <= FARTHEST)
        drawn = np.flatnonzero(near_enough & (inputs.opacities >= ALPHA_FLOOR))
        drawn = drawn[np.argsort(seen[drawn, 2], kind="stable")]
        inputs = Inputs(*(array[drawn] if len(array) else array for array in inputs))
        seen = seen[drawn]
        centers, _ = camera.project(inputs.means)
        shapes = _projected(inputs, seen, camera)
        inverses = _inverses(inputs, seen, camera) if len(walls) else np.empty((len(seen), 0))
        rays = np.stack(np.broadcast_arrays(*camera.slopes(), 1.0), axis=2)
        colours = _colours(inputs, camera)

        light = np.ones((camera.height, camera.width))
        colour = np.zeros((camera.height, camera.width, 3))
        depth = np.zeros((camera.height, camera.width))
        x, y = np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5
        for (u, v), (xx, xy, yy, determinant), inverse, opacity, tint, mean in zip(
            centers, shapes, inverses, inputs.opacities, colours, seen
        ):
            if not (np.isfinite(determinant) and abs(u) <= FARTHEST and abs(v) <= FARTHEST):
                continue
            # d^2 at which alpha is at its floor; the box that holds this ellipse is as wide as its deviations.
            reach = np.sqrt(2 * np.log(opacity / ALPHA_FLOOR))
            columns = slice(*np.searchsorted(x, (u - reach * np.sqrt(xx), u + reach * np.sqrt(xx))))
            rows = slice(*np.searchsorted(y, (v - reach * np.sqrt(yy), v + reach * np.sqrt(yy))))
            dx, dy = x[columns] - u, (y[rows] - v)[:, None]
            # (dx, dy) times the inverse covariance times (dx, dy), as a sum of squares: nothing cancels.
            squared = (dx - xy / yy * dy) ** 2 * (yy / determinant) + dy * dy / yy
            alpha = np.minimum(ALPHA_LIMIT, opacity * np.exp(-0.5 * squared))
            alpha[alpha < ALPHA_FLOOR] = 0
            if len(walls):
                ray = rays[rows, columns]
                squared = np.einsum("hwi,ij,hwj->hw", ray, inverse, ray)
                deepest = np.einsum("hwi,ij,j->hw", ray, inverse, mean) / squared
                alpha = 1 - (1 - alpha) ** ndtr((walls[rows, columns] - deepest) * np.sqrt(squared))
            weight = light[rows, columns] * alpha
            light[rows, columns] -= weight
            colour[rows, columns] += weight[:, :, None] * tint
            depth[rows, columns] += weight * mean[2]

        alpha = 1 - light
        mean_depth = np.full_like(depth, np.inf)
        np.divide(depth, alpha, out=mean_depth, where=alpha > 0)
        return Picture(
            colour=colour.astype(np.float32), alpha=alpha.astype(np.float32), depth=mean_depth.astype(np.float32)
        )


def _in_camera(means: Array, camera: Camera) -> Array:
    """Means (N, 3) in the camera's frame.

    Sums in the order of the rasteriser's, so that Gaussians of equal depth are equally deep to both.
    """
    x, y, z = means.T
    rows = zip(camera.rotation, camera.translation)
    return np.stack([r[0] * x + r[1] * y + r[2] * z + offset for r, offset in rows], axis=1)


def _projected(inputs: Inputs, seen: Array, camera: Camera) -> Array:
    """xx xy yy and determinant (N, 4) [px^2, px^4] of the ellipses in the picture, the low-pass added.

    What is no covariance by rounding is bounded to one.
    """
    x, y, z = seen.T
    margin_x, margin_y = 0.15 * camera.width, 0.15 * camera.height
    slope_x = np.clip(
        x / z,
        (-margin_x - camera.center_x) / camera.focal_x,
        (camera.width + margin_x - camera.center_x) / camera.focal_x,
    )
    slope_y = np.clip(
        y / z,
        (-margin_y - camera.center_y) / camera.focal_y,
        (camera.height + margin_y - camera.center_y) / camera.focal_y,
    )
    jacobian = np.zeros((len(seen), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 2] = camera.focal_x / z, -camera.focal_x * slope_x / z
    jacobian[:, 1, 1], jacobian[:, 1, 2] = camera.focal_y / z, -camera.focal_y * slope_y / z
    onto = jacobian @ camera.rotation
    with np.errstate(over="ignore", invalid="ignore"):
        if len(inputs.covariances):
            full = inputs.covariances[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
            flat = onto @ full @ onto.transpose(0, 2, 1)
            xx, yy = np.maximum(flat[:, 0, 0], 0), np.maximum(flat[:, 1, 1], 0)
            xy = np.clip(flat[:, 0, 1], -np.sqrt(xx * yy), np.sqrt(xx * yy))
            determinant = np.maximum(xx * yy - xy * xy, 0)
        else:
            # det A A^T, as the squared area of A's two rows: for a needle it is no difference of large numbers.
            axes = onto @ (rotation_matrices(inputs.quaternions) * inputs.scales[:, None, :])
            flat = axes @ axes.transpose(0, 2, 1)
            xx, xy, yy = flat[:, 0, 0], flat[:, 0, 1], flat[:, 1, 1]
            determinant = (np.cross(axes[:, 0], axes[:, 1]) ** 2).sum(axis=1)
        # det(S + c I) = det S + c tr S + c^2.
        determinant = determinant + LOW_PASS * (xx + yy) + LOW_PASS**2
    return np.stack([xx + LOW_PASS, xy, yy + LOW_PASS, determinant], axis=1)


def _inverses(inputs: Inputs, seen: Array, camera: Camera) -> Array:
    """Inverses (N, 3, 3) of the covariances in the camera's frame, the low-pass added."""
    if len(inputs.covariances):
        turned = camera.rotation @ inputs.covariances[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]] @ camera.rotation.T
    else:
        axes = camera.rotation @ (rotation_matrices(inputs.quaternions) * inputs.scales[:, None, :])
        turned = axes @ axes.transpose(0, 2, 1)
    pixels = seen[:, 2] / min(camera.focal_x, camera.focal_y)
    return np.linalg.inv(turned + (LOW_PASS * pixels**2)[:, None, None] * np.eye(3))


def _colours(inputs: Inputs, camera: Camera) -> Array:
    """(N, 3), as seen from the eye."""
    directions = inputs.means - camera.position
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if len(inputs.turns):
        directions = material_directions(directions, inputs.turns)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    degree = round(inputs.harmonics.shape[1] ** 0.5) - 1
    return np.maximum(0, 0.5 + np.einsum("nk,nkc->nc", basis(directions, degree), inputs.harmonics))
