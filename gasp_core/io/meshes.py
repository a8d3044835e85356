"""Triangle meshes: .obj, .glb, .stl, .ply, read by trimesh (the extra `meshes`)."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.io.format_errors import shown

__all__ = [
    "MESH_SUFFIXES",
    "TriangleMesh",
    "face_areas",
    "from_scene",
    "is_splat_in_gltf",
    "no_triangles",
    "read_mesh",
    "whole_faces",
]

Array = NDArray[Any]
Read = TypeVar("Read")

MESH_SUFFIXES = (".obj", ".glb", ".stl", ".ply")
_LONGEST = 1 << 30
_SPLAT_IN_GLTF = (b'"KHR_gaussian_splatting"', b'"KHR_spz_gaussian_splats_compression"')
_LOOKED_AT = 1 << 20
"""Bytes: what a .glb says of itself comes first."""
_MOST_FACES = 20_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TriangleMesh:
    """Triangles.

    Parameters
    ----------
    vertices : (V, 3)
        In the file's unit and frame.
    faces : (F, 3)
        Rows of the vertices.
    """

    vertices: Array
    faces: Array


def read_mesh(path: Path) -> TriangleMesh:
    """The triangles of a file, those of all its parts where they stand in its scene.

    Nothing else that the file names is opened: no materials, textures or buffers of other files. Triangles without
    an area are left out.

    Raises
    ------
    SplatFormatError
        Where it cannot be read, a vertex is not finite, or no triangle is left.
    """

    def joined(scene: Any) -> TriangleMesh:
        mesh = scene.to_mesh()
        return TriangleMesh(
            vertices=np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3),
            faces=np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3),
        )

    mesh = from_scene(path, joined, painted=False)
    faces = mesh.faces[whole_faces(mesh.vertices, mesh.faces, path)]
    used, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices=mesh.vertices[used], faces=faces.reshape(-1, 3))


def from_scene(path: Path, read: Callable[[Any], Read], *, painted: bool) -> Read:
    """What `read` makes of the scene that trimesh finds in a file.

    Parameters
    ----------
    path
        Of the file.
    read
        Is given the scene; whatever it stumbles over is told as damage.
    painted
        Whether materials and textures are looked for, beside the file and below.

    Raises
    ------
    SplatFormatError
        Where it cannot be read.
    """
    name = shown(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise SplatFormatError(f"{name}: is no mesh that is read here: {', '.join(MESH_SUFFIXES)}")
    try:
        import trimesh
    except ImportError:
        raise SplatFormatError(f"{name}: meshes are read by trimesh: pip install 'gasp-core[meshes]'") from None
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    loading: Any = trimesh
    try:
        if path.exists() and not path.is_file():
            raise SplatFormatError(f"{name}: is no ordinary file")
        if path.stat().st_size > _LONGEST:
            raise SplatFormatError(f"{name}: is longer than 1 GiB: decimate the mesh")
        resolver = loading.resolvers.FilePathResolver(str(path.resolve())) if painted else None
        with path.open("rb") as stream:
            return read(
                loading.load_scene(
                    stream, file_type=suffix[1:], process=False, skip_materials=not painted, resolver=resolver
                )
            )
    except SplatFormatError:
        raise
    except OSError as error:
        raise SplatFormatError(f"{name}: cannot be read: {error.strerror or error}") from None
    except Exception as error:
        # A damaged file ends trimesh in whatever it stumbles over.
        raise SplatFormatError(
            f"{name}: is no whole {suffix} mesh ({type(error).__name__}: {shown(str(error))[:100]})"
        ) from None


def whole_faces(vertices: Array, faces: Array, path: Path) -> Array:
    """Which faces (F,) have an area.

    Raises
    ------
    SplatFormatError
        Where there are too many, none is whole, or one names a vertex that is not there or not finite.
    """
    name = shown(path)
    if len(faces) > _MOST_FACES:
        raise SplatFormatError(f"{name}: has {len(faces):,} triangles: decimate it to {_MOST_FACES:,} at most")
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise SplatFormatError(f"{name}: its triangles name vertices that are not there: the file is damaged")
    used = np.unique(faces)
    bad = used[~np.isfinite(vertices[used]).all(axis=1)]
    if len(bad):
        # Left out, they would leave holes that nobody made.
        what = "vertex is" if len(bad) == 1 else "vertices are"
        raise SplatFormatError(f"{name}: {len(bad):,} {what} not finite, the first is {bad[0]:,}: mend the mesh")
    with np.errstate(over="ignore", invalid="ignore"):
        areas = face_areas(vertices, faces)
    whole = np.isfinite(areas) & (areas > 0)
    if not whole.any():
        raise no_triangles(path)
    return whole


def no_triangles(path: Path) -> SplatFormatError:
    """The error of a file that holds none."""
    why = ", but a splat: name it where a splat belongs" if is_splat_in_gltf(path) else ""
    return SplatFormatError(f"{shown(path)}: has no triangle with an area{why}")


def is_splat_in_gltf(path: Path) -> bool:
    """Whether a file is a .glb that says of itself, within its first megabyte, that it holds Gaussians."""
    if path.suffix.lower() != ".glb":
        return False
    try:
        with path.open("rb") as stream:
            head = stream.read(_LOOKED_AT)
    except OSError:
        return False
    return any(name in head for name in _SPLAT_IN_GLTF)


def face_areas(vertices: Array, faces: Array) -> Array:
    """Areas (F,) of faces."""
    corners = vertices[faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
