"""Gaussians that lie on a mesh, and go with it: GaMeS (Waczynska et al. 2024, section 3).

A Gaussian is bound to a face by the coefficients of its simplex: each of the simplex's vertices is a combination of the
face's corners, and of a fourth point above it where the Gaussian does not lie in its plane. Whatever moves the mesh's
vertices moves the simplex, which T^-1 makes a Gaussian of. That is exact for every motion that is affine on a face.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.games import choose_vertices, from_simplices, to_simplices
from gasp_core.gaussians import Gaussians, rotation_quaternions
from gasp_core.io.activations import colour_to_dc
from gasp_core.io.meshes import face_areas
from gasp_core.io.painted_meshes import PaintedMesh

__all__ = ["Binding", "bind_to_mesh", "face_frames", "face_of_each", "in_face_frames", "splat_of_mesh"]

Array = NDArray[Any]

_WIDTH = 1.9
"""Standard deviation over that of the piece of a face that a Gaussian has to itself: no hole is left between them."""
_SIDE = 0.65
"""The same, over the side of a square."""
_THINNEST = 1e-4
_LEAST = 1e-6
"""Of the mean area of faces."""
_OPACITY = 0.98
_SLIVER = 1e-4
"""Height over length below which a face is none to go with."""
FAR_OFF = 0.02
"""Of the mesh's diagonal: where half of the Gaussians are farther off, a user should look; it is another thing's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binding:
    """How Gaussians go with a mesh.

    Parameters
    ----------
    gaussians
        N of them, at rest.
    corners : (N, 3)
        Rows of the mesh's vertices: the face of each.
    coefficients : (N, V, 3)
        Each vertex of the simplex is so far from the first corner in the face's frame, see `face_frames`.
    off
        How far half of them are from what the mesh encloses, at the least, over its diagonal.
    """

    gaussians: Gaussians
    corners: Array
    coefficients: Array
    off: float = 0.0

    def moved(self, vertices: Array) -> Gaussians:
        """The Gaussians where the mesh's vertices are (V, 3).

        Raises
        ------
        SplatFormatError
            Where there are too few of them, or some are not finite.
        """
        vertices = np.asarray(vertices, dtype=np.float64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) <= self.corners.max():
            raise SplatFormatError(
                f"vertices have shape {vertices.shape}, expected ({self.corners.max() + 1}, 3) at least"
            )
        if not np.isfinite(vertices).all():
            raise SplatFormatError("vertices of the mesh are not finite")
        corners = vertices[self.corners]
        return from_simplices(corners[:, :1] + self.coefficients @ face_frames(corners), reference=self.gaussians)


def splat_of_mesh(mesh: PaintedMesh, count: int) -> Binding:
    """Flat Gaussians that cover a mesh, with its colours.

    Parameters
    ----------
    mesh
        With textures or without.
    count
        About how many, by area; one for each face at least where these are fewer.

    Raises
    ------
    SplatFormatError
        Where count is not > 0.
    """
    if count < 1:
        raise SplatFormatError(f"a mesh needs a number of Gaussians > 0, found {count}")
    areas = mesh.areas
    wanted = np.cumsum(areas) * (count / areas.sum())
    counts = np.diff(np.floor(wanted + 0.5), prepend=0.0).astype(np.int64)
    fine = len(areas) <= count
    if fine:
        # What has next to no area has no direction either, and is not seen.
        counts = np.maximum(counts, areas > _LEAST * areas.sum() / len(areas))
    rows, pieces = _divided(mesh.vertices[mesh.faces], counts)
    corners = pieces @ mesh.vertices[mesh.faces[rows]]
    weights = pieces.mean(axis=1)
    # Of fewer Gaussians than faces each stands for those around it too.
    axes, scales = _discs(corners, None if fine else areas.sum() / len(rows))
    dc = colour_to_dc(mesh.colours(rows, weights, float(areas.sum() / len(rows))))
    gaussians = Gaussians(
        means=corners.mean(axis=1),
        quaternions=rotation_quaternions(axes),
        scales=scales,
        opacities=np.full(len(rows), _OPACITY),
        harmonics=dc[:, None].astype(np.float64),
    )
    return _bound(gaussians, mesh.vertices, mesh.faces[rows], 3)


def _divided(corners: Array, counts: Array) -> tuple[Array, Array]:
    """Triangles cut into so many pieces of one area, across the longest edge each time.

    Returns
    -------
    rows : (N,)
        Of the triangles (F, 3, 3).
    pieces : (N, 3, 3)
        Barycentric coordinates of the corners of each piece.
    """
    rows = np.flatnonzero(counts)
    left = counts[rows]
    pieces = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
    while (left > 1).any():
        cut = np.flatnonzero(left > 1)
        whole = pieces[cut]
        places = whole @ corners[rows[cut]]
        lengths = np.linalg.norm(np.roll(places, -1, axis=1) - places, axis=2)
        turns = (np.argmax(lengths, axis=1)[:, None] + np.arange(3)) % 3
        start, end, other = np.take_along_axis(whole, turns[:, :, None], axis=1).transpose(1, 0, 2)
        near = left[cut] // 2
        share = (near / left[cut])[:, None]
        middle = (1 - share) * start + share * end
        kept = np.flatnonzero(left <= 1)
        pieces = np.concatenate(
            [pieces[kept], np.stack([start, middle, other], axis=1), np.stack([middle, end, other], axis=1)]
        )
        rows = np.concatenate([rows[kept], rows[cut], rows[cut]])
        left = np.concatenate([left[kept], near, left[cut] - near])
    return rows, pieces


def bind_to_mesh(gaussians: Gaussians, vertices: Array, faces: Array) -> Binding:
    """Bind a splat to a mesh: each Gaussian to the face that is nearest to its mean.

    Parameters
    ----------
    gaussians
        N, in the frame and unit of the mesh.
    vertices : (V, 3)
    faces : (F, 3)

    Raises
    ------
    SplatFormatError
        Where libigl is not installed, or something is not finite.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    corners, distances = face_of_each(gaussians, vertices, faces)
    bound = _bound(gaussians, vertices, corners, choose_vertices(gaussians))
    return replace(bound, off=share_off(gaussians, distances, vertices, faces))


def share_off(gaussians: Gaussians, distances: Array, vertices: Array, faces: Array) -> float:
    """How far half of the Gaussians are from what a mesh encloses, at the least, over its diagonal.

    Parameters
    ----------
    gaussians
        N, in the frame and unit of the mesh.
    distances : (N,)
        Of their means from its faces.
    vertices : (V, 3)
    faces : (F, 3)
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if (off := float(np.median(distances)) / diagonal) <= FAR_OFF:
        # On its faces, or next to them: nobody need know on which side.
        return off
    import igl

    finding: Any = igl
    turns = finding.fast_winding_number(vertices, faces, gaussians.means.astype(np.float64))
    outside = np.where(np.abs(turns) < 0.5, distances, 0.0)
    return float(np.median(outside)) / diagonal


def face_of_each(gaussians: Gaussians, vertices: Array, faces: Array) -> tuple[Array, Array]:
    """Corners (N, 3) of the face, of (F, 3), that is nearest to the mean of each Gaussian, and how far it is (N,).

    Raises
    ------
    SplatFormatError
        Where libigl is not installed, or something is not finite.
    """
    try:
        import igl
    except ImportError:
        raise SplatFormatError("the nearest faces are found by libigl: pip install 'gasp-core[meshes]'") from None
    means = gaussians.means.astype(np.float64)
    if not (np.isfinite(means).all() and np.isfinite(vertices).all()):
        raise SplatFormatError("a splat that is not finite, or a mesh, cannot be bound: drop what is not")
    finding: Any = igl
    faces = _not_slivers(vertices, faces)
    squares, nearest, _ = finding.point_mesh_squared_distance(means, vertices, faces)
    return faces[np.asarray(nearest).reshape(-1)], np.sqrt(np.asarray(squares).reshape(-1))


def _not_slivers(vertices: Array, faces: Array) -> Array:
    """Those that have a frame which a small motion of their corners does not turn over; all, where none has."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    kept = 2 * face_areas(vertices, faces) > _SLIVER * longest**2
    return faces[kept] if kept.any() else faces


def _bound(gaussians: Gaussians, vertices: Array, corners: Array, count: int) -> Binding:
    simplices = to_simplices(gaussians, 4 if count == 4 else 3)
    return Binding(gaussians=gaussians, corners=corners, coefficients=in_face_frames(simplices, vertices[corners]))


def in_face_frames(simplices: Array, corners: Array) -> Array:
    """Coefficients (N, V, 3): where the vertices (N, V, 3) of simplices are from the first of the corners (N, 3, 3) of
    their faces, x - v1 = c @ frame."""
    return (simplices - corners[:, :1]) @ np.linalg.inv(face_frames(corners))


def face_frames(corners: Array) -> Array:
    """Of faces with corners (N, 3, 3): rows (N, 3, 3), two edges and what stands on them, as long as the root of twice
    the face's area."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.stack([first, second, normals / np.sqrt(np.where(lengths > 0, lengths, 1.0))], axis=1)


def _discs(corners: Array, room: float | None) -> tuple[Array, Array]:
    """Axes (N, 3, 3), the normal last, and scales (N, 3) of Gaussians that cover triangles (N, 3, 3).

    As wide as these along both of their axes; round, each for as much `room`, where that is given.
    """
    offsets = corners - corners.mean(axis=1, keepdims=True)
    # Of a triangle that is filled evenly.
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets) / 12)
    deviations = np.sqrt(np.maximum(values, 0.0))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    longer = vectors[:, :, 2]
    longer = longer - np.einsum("ni,ni->n", longer, normals)[:, None] * normals
    longer /= np.linalg.norm(longer, axis=1, keepdims=True)
    if room is None:
        wide, narrow = _WIDTH * deviations[:, 2], _WIDTH * deviations[:, 1]
    else:
        wide = narrow = np.full(len(corners), _SIDE * np.sqrt(room))
    scales = np.stack([wide, narrow, _THINNEST * narrow], axis=1)
    return np.stack([longer, np.cross(normals, longer), normals], axis=2), scales
