"""The mesh that an object's Gaussians lie on, in the world."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError, SplatFormatError
from gasp_core.io.format_errors import shown
from gasp_core.io.meshes import TriangleMesh, face_areas, read_mesh
from gasp_core.scene.file_digests import file_digest
from gasp_core.scene.placement import up_axis, upright
from gasp_core.scene.selection import PlacedObject

__all__ = ["PlacedMesh", "mesh_of", "welded"]

Array = NDArray[Any]

_ONE_PLACE = 1e-6
"""Of a mesh's diagonal, up to which vertices are one: single precision has seven digits."""
_HOLLOW = 1e-4
"""Of its size: a mesh whose volume is less deep than that, over its area, is a sheet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedMesh:
    """A mesh in the world.

    Parameters
    ----------
    vertices : (V, 3) [m]
        No two at one place.
    faces : (F, 3)
    open_edges
        How many edges are not between two faces.
    filled
        Whether what it encloses is matter too.
    """

    vertices: Array
    faces: Array
    open_edges: int
    filled: bool

    @property
    def is_sheet(self) -> bool:
        """Whether it is open, or encloses next to nothing."""
        return self.open_edges > 0 or self.encloses_nothing

    @property
    def encloses_nothing(self) -> bool:
        """Whether its volume is next to none."""
        return self.volume < _HOLLOW * self.area * float(np.ptp(self.vertices, axis=0).max())

    @property
    def area(self) -> float:
        """Of all faces [m^2]."""
        return float(face_areas(self.vertices, self.faces).sum())

    @property
    def volume(self) -> float:
        """What it encloses [m^3], wherever it has holes as seen from its middle."""
        corners = self.vertices[self.faces] - self.vertices.mean(axis=0)
        return abs(float(np.linalg.det(corners).sum())) / 6

    @property
    def longest_edge(self) -> float:
        """Of the faces [m]."""
        corners = self.vertices[self.faces]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def mesh_of(placed: PlacedObject) -> PlacedMesh:
    """The mesh of an object whose reduction names one.

    Raises
    ------
    SplatFormatError, SceneError
        Where it cannot be read, or is to be filled and encloses nothing.
    """
    reduction, placement = placed.item.reduction, placed.placement
    assert reduction.mesh is not None
    mesh, open_edges = _read(reduction.mesh, file_digest(reduction.mesh))
    turn = placement.rotation
    if reduction.mesh_up is not None:
        turn = turn @ upright(up_axis(placed.item)).T @ upright(reduction.mesh_up)
    found = PlacedMesh(
        vertices=placement.scale * mesh.vertices @ turn.T + placement.translation,
        faces=mesh.faces,
        open_edges=open_edges,
        filled=reduction.points == "filled" or (reduction.points is None and open_edges == 0),
    )
    if found.filled and found.encloses_nothing:
        if reduction.points == "filled":
            raise SceneError(
                f'object "{placed.item.name}": {shown(reduction.mesh)} encloses next to nothing: say'
                ' points = "vertices"'
            )
        return replace(found, filled=False)
    return found


def welded(vertices: Array, faces: Array) -> tuple[Array, Array]:
    """Vertices (V, 3) of which no two are at one place, to the rounding of files, and the faces (F, 3) of them.

    Textures want a vertex twice where their map has a seam: matter has none.
    """
    from scipy import sparse
    from scipy.sparse import csgraph
    from scipy.spatial import KDTree

    tree: Any = KDTree(vertices)
    pairs = tree.query_pairs(_ONE_PLACE * float(np.linalg.norm(np.ptp(vertices, axis=0))), output_type="ndarray")
    links = sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(len(vertices), len(vertices)))
    _, rows = csgraph.connected_components(links, directed=False)
    _, first = np.unique(rows, return_index=True)
    faces = rows[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[first[used]], faces.reshape(-1, 3)


@functools.lru_cache(maxsize=8)
def _read(file: Path, digest: str) -> tuple[TriangleMesh, int]:
    """The triangles of a file, once for each content, and how many of their edges are open."""
    mesh = read_mesh(file)
    vertices, faces = welded(mesh.vertices, mesh.faces)
    if not len(faces):
        raise SplatFormatError(
            f"{shown(file)}: all its triangles are smaller than a millionth of its size: is it whole?"
        )
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, counts = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_counts=True)
    return TriangleMesh(vertices=vertices, faces=faces), int((counts != 2).sum())
