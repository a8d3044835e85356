"""A mesh that Gaussians are bound to, and where other programs have moved its vertices to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.columns import map_npy
from gasp_core.io.format_errors import malformed
from gasp_core.io.meshes import TriangleMesh, from_scene, whole_faces

__all__ = ["read_mesh_as_it_is", "read_moved_vertices"]

Array = NDArray[Any]


def read_mesh_as_it_is(path: Path) -> TriangleMesh:
    """The triangles of a file, its vertices in the order in which trimesh reads them; those that no triangle has too.

    Of an .obj with texture coordinates that is not the order of the file: along the seams of its map a vertex is two.

    Triangles without an area are left out.

    Raises
    ------
    SplatFormatError
        Where it cannot be read, or no triangle is left.
    """
    mesh = from_scene(path, _joined, painted=False)
    return TriangleMesh(vertices=mesh.vertices, faces=mesh.faces[whole_faces(mesh.vertices, mesh.faces, path)])


def read_moved_vertices(path: Path, mesh: TriangleMesh) -> Array:
    """Where a mesh's vertices have gone, (T, V, 3) of T frames.

    Parameters
    ----------
    path
        Another mesh of as many vertices, in the same order; or a .npy of NumPy, (V, 3) or (T, V, 3).
    mesh
        As it was.

    Raises
    ------
    SplatFormatError
        Where the file is neither, or vertices are missing, too many, or not finite.
    """
    count = len(mesh.vertices)
    if path.suffix.lower() == ".npy":
        found = map_npy(path, "write it with numpy.save, places of all vertices in the order of the mesh")
        if found.ndim not in (2, 3) or found.shape[-2:] != (count, 3) or found.dtype.kind not in "fiu":
            raise malformed(
                path,
                f"is of shape {found.shape} of {found.dtype}, not ({count}, 3) or (frames, {count}, 3) of numbers",
                "the vertices are those of the mesh, in their order",
            )
        found = found.reshape(-1, count, 3)
        if not len(found):
            raise malformed(path, "has no frame", "write one at least")
    else:
        found = from_scene(path, _joined, painted=False).vertices[None]
        if found.shape[1] != count:
            raise malformed(
                path,
                f"has {found.shape[1]:,} vertices, the mesh has {count:,}",
                "write both with the same settings, so that vertices keep their number and order",
            )
    bad = ~np.isfinite(found).all(axis=2)
    if bad.any():
        frame, row = np.argwhere(bad)[0]
        where = f" of frame {frame}" if len(found) > 1 else ""
        raise malformed(path, f"{int(bad.sum()):,} vertices are not finite, the first is {row:,}{where}", "look there")
    return found


def _joined(scene: Any) -> TriangleMesh:
    mesh = scene.to_mesh()
    return TriangleMesh(
        vertices=np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3),
        faces=np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3),
    )
