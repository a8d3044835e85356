"""How stiff the springs along the edges of a net of triangles make it, as a sheet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["sheet_stiffness"]

Array = NDArray[Any]

_ISOTROPIC = 9 / 8
"""Stress over strain of a sheet of Poisson's ratio 1/3 that is stretched along one axis and held along the other, in
Young's moduli: 1 / (1 - nu^2)."""
_FLOPPY = 1e-9
"""Stiffness, over that of a spring, of vertices that none holds."""


def sheet_stiffness(places: Array, faces: Array, edges: Array) -> float:
    """Young's modulus times thickness [N/m] of a net whose edges are springs of 1 N/m, if its Poisson's ratio is 1/3.

    It is stretched along each axis in turn, as far as it extends along it, and held at its rim; vertices go along, and
    from there to where they are pulled, within the sheet. In a regular net that is nowhere; in an irregular one they
    find a place of less energy, down to three quarters.

    Parameters
    ----------
    places : (V, 3) [m]
    faces : (F, 3)
    edges : (E, 2)
        Their sides, each once.
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    ways = places[edges[:, 1]] - places[edges[:, 0]]
    lengths = np.linalg.norm(ways, axis=1)
    along = ways / np.where(lengths > 0, lengths, 1.0)[:, None]
    normals, areas = _normals(places, faces)
    tangents = _tangents(places, faces, normals * areas[:, None])
    free = np.setdiff1d(np.arange(len(places)), _rim(faces))
    # What springs are lengthened by (E,) where vertices go by so much along their two tangents (V, 2).
    values = np.einsum("ej,evkj->evk", along, tangents[edges]) * [[[-1.0], [1.0]]]
    columns = 2 * edges[:, :, None] + [0, 1]
    rows = np.repeat(np.arange(len(edges)), 4)
    shape = (len(edges), 2 * len(places))
    pulls = sparse.csc_array((values.ravel(), (rows, columns.ravel())), shape=shape)
    pulls = pulls[:, (2 * free[:, None] + [0, 1]).ravel()]
    solver = splu(sparse.csc_array(pulls.T @ pulls + _FLOPPY * sparse.eye_array(pulls.shape[1])))
    energy, isotropic = 0.0, 0.0
    for axis in range(3):
        stretch = lengths * along[:, axis] ** 2
        left = stretch - pulls @ solver.solve(pulls.T @ stretch)
        energy += float(left @ left)
        isotropic += _ISOTROPIC * float(areas @ (1 - normals[:, axis] ** 2) ** 2)
    return energy / isotropic


def _normals(places: Array, faces: Array) -> tuple[Array, Array]:
    """Of faces, (F, 3), and their areas (F,) [m^2]."""
    one, other = (places[faces[:, k]] - places[faces[:, 0]] for k in (1, 2))
    doubled = np.cross(one, other)
    sizes = np.linalg.norm(doubled, axis=1)
    return doubled / np.where(sizes > 0, sizes, 1.0)[:, None], sizes / 2


def _tangents(places: Array, faces: Array, normals: Array) -> Array:
    """Two axes across the mean normal of each vertex, (V, 2, 3)."""
    mean = np.zeros_like(places)
    for corner in faces.T:
        np.add.at(mean, corner, normals)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    first = np.cross(mean, np.eye(3)[np.argmin(np.abs(mean), axis=1)])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return np.stack([first, np.cross(mean, first)], axis=1)


def _rim(faces: Array) -> Array:
    """Vertices of sides that belong to one face alone."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    found, counts = np.unique(sides, axis=0, return_counts=True)
    return np.unique(found[counts == 1])
