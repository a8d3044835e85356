"""Meshes with their colours: .obj, .glb, .stl, .ply with textures, colours of vertices or of faces (extra `meshes`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.meshes import (
    MESH_SUFFIXES,
    face_areas,
    from_scene,
    is_splat_in_gltf,
    no_triangles,
    whole_faces,
)

__all__ = ["PaintedMesh", "is_mesh", "read_painted_mesh"]

Array = NDArray[Any]

_GREY = 0.7
_FEWEST_TEXELS = 4.0
"""That a Gaussian covers before a texture is made coarser."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaintedMesh:
    """Triangles and what is painted on them.

    Parameters
    ----------
    vertices : (V, 3)
        In the file's unit and frame.
    faces : (F, 3)
        Rows of the vertices.
    corner_colours : (F, 3, 3)
        Red, green and blue in 0..1 of each corner; times the texture where there is one.
    textures
        Pictures (H, W, 3) in 0..1, the first row at the top.
    texture_of : (F,)
        Which one a face has; -1: none.
    places : (F, 3, 2)
        Of the corners in the texture, 0..1 from its lower left; beyond, it is repeated.
    notes
        Sentences on what could not be read.
    """

    vertices: Array
    faces: Array
    corner_colours: Array
    textures: tuple[Array, ...]
    texture_of: Array
    places: Array
    notes: tuple[str, ...] = ()

    @property
    def areas(self) -> Array:
        """Of the faces, (F,)."""
        return face_areas(self.vertices, self.faces)

    def colours(self, rows: Array, weights: Array, area: float) -> Array:
        """What is seen at places on faces, (M, 3) in 0..1.

        Parameters
        ----------
        rows : (M,)
            Of the faces.
        weights : (M, 3)
            Barycentric.
        area
            Of what is to have one colour: textures are averaged over about so much.
        """
        colours = np.einsum("mk,mkc->mc", weights, self.corner_colours[rows])
        for number, texture in enumerate(self.textures):
            own = np.flatnonzero(self.texture_of[rows] == number)
            if len(own):
                places = np.einsum("mk,mkd->md", weights[own], self.places[rows[own]])
                texels = area * self._density(number)
                colours[own] *= _sampled(_coarser(texture, texels), places)
        return np.clip(colours, 0.0, 1.0)

    def _density(self, number: int) -> float:
        """Texels of a texture for each unit of area of the faces that have it."""
        own = self.texture_of == number
        first, second = (self.places[own, corner] - self.places[own, 0] for corner in (1, 2))
        covered = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum() / 2
        height, width, _ = self.textures[number].shape
        total = float(self.areas[own].sum())
        return float(covered) * height * width / total if total > 0 else 0.0


def is_mesh(path: Path) -> bool:
    """Whether a file is one that `read_painted_mesh` reads, and no splat; of a .ply or .glb its header says so."""
    suffix = path.suffix.lower()
    if suffix != ".ply":
        return suffix in MESH_SUFFIXES and not is_splat_in_gltf(path)
    try:
        with path.open("rb") as stream:
            head = stream.read(1 << 16).partition(b"end_header")[0]
    except OSError:
        return False
    return b"element face" in head and b"f_dc_0" not in head and b"packed_position" not in head


def read_painted_mesh(path: Path) -> PaintedMesh:
    """The triangles of a file, those of all its parts where they stand in its scene, and their colours.

    Textures and materials are looked for beside the file and below, nowhere else. Triangles without an area are left
    out.

    Raises
    ------
    SplatFormatError
        Where it cannot be read, a vertex is not finite, or no triangle is left.
    """

    def parts(scene: Any) -> list[_Part]:
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
        found = [_part(transform, scene.geometry[geometry]) for transform, geometry in placed]
        return [part for part in found if part is not None]

    return _joined(from_scene(path, parts, painted=True), path)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Of a mesh: one geometry where it stands."""

    vertices: Array
    faces: Array
    corner_colours: Array
    texture: Array | None
    places: Array
    note: str


def _part(placed: Any, geometry: Any) -> _Part | None:
    if not hasattr(geometry, "faces"):
        return None
    faces = np.asarray(geometry.faces, dtype=np.int64).reshape(-1, 3)
    vertices = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError("its triangles name vertices that are not there")
    transform = np.asarray(placed, dtype=np.float64)
    texture, note = None, ""
    places = np.zeros((len(faces), 3, 2))
    visual = geometry.visual
    colours = np.full((len(faces), 3, 3), _GREY)
    uv, material = getattr(visual, "uv", None), getattr(visual, "material", None)
    if material is not None:
        colours[:] = _factor(material)
        texture = _picture(getattr(material, "baseColorTexture", None) or getattr(material, "image", None))
        if texture is not None and uv is not None and len(uv) == len(vertices):
            places = np.asarray(uv, dtype=np.float64)[faces]
        elif texture is not None:
            texture, note = None, "has a texture, but does not say where it is on its triangles"
    elif getattr(visual, "kind", None) == "vertex":
        colours = np.asarray(visual.vertex_colors, dtype=np.float64)[faces][:, :, :3] / 255
    elif getattr(visual, "kind", None) == "face":
        colours = np.repeat(np.asarray(visual.face_colors, dtype=np.float64)[:, None, :3], 3, axis=1) / 255
    else:
        note = "has no colours: it is grey"
    if not np.isfinite(places).all():
        places = np.nan_to_num(places, posinf=0.0, neginf=0.0)
    return _Part(
        vertices=vertices @ transform[:3, :3].T + transform[:3, 3],
        faces=faces,
        corner_colours=colours,
        texture=texture,
        places=places,
        note=note,
    )


def _factor(material: Any) -> Array:
    """What a material's texture is multiplied by, or its colour; (3,)."""
    factor = getattr(material, "baseColorFactor", None)
    if factor is None and getattr(material, "image", None) is None:
        factor = getattr(material, "diffuse", None)
    if factor is None:
        return np.ones(3)
    given = np.asarray(factor)
    scale = 255.0 if given.dtype.kind in "iu" else 1.0
    found = given.astype(np.float64).reshape(-1)[:3] / scale
    return found if len(found) == 3 and np.isfinite(found).all() else np.ones(3)


def _picture(image: Any) -> Array | None:
    if image is None:
        return None
    return np.asarray(image.convert("RGB"), dtype=np.float32) / 255


def _joined(parts: Sequence[_Part], path: Path) -> PaintedMesh:
    if not parts or not sum(len(part.faces) for part in parts):
        raise no_triangles(path)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    textures = [part.texture for part in parts if part.texture is not None]
    numbers = np.cumsum([part.texture is not None for part in parts]) - 1
    joined = PaintedMesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts)]),
        corner_colours=np.concatenate([part.corner_colours for part in parts]),
        textures=tuple(textures),
        texture_of=np.concatenate(
            [np.full(len(p.faces), n if p.texture is not None else -1) for p, n in zip(parts, numbers)]
        ),
        places=np.concatenate([part.places for part in parts]),
        notes=tuple(dict.fromkeys(part.note for part in parts if part.note)),
    )
    kept = whole_faces(joined.vertices, joined.faces, path)
    return PaintedMesh(
        vertices=joined.vertices,
        faces=joined.faces[kept],
        corner_colours=joined.corner_colours[kept],
        textures=joined.textures,
        texture_of=joined.texture_of[kept],
        places=joined.places[kept],
        notes=joined.notes,
    )


def _coarser(texture: Array, texels: float) -> Array:
    """A texture in which what covered so many texels covers about one."""
    factor = int(np.sqrt(texels / _FEWEST_TEXELS)) if texels > _FEWEST_TEXELS else 1
    factor = min(factor, *texture.shape[:2])
    if factor < 2:
        return texture
    height, width = (length // factor * factor for length in texture.shape[:2])
    cut = texture[:height, :width]
    return cut.reshape(height // factor, factor, width // factor, factor, 3).mean(axis=(1, 3))


def _sampled(texture: Array, places: Array) -> Array:
    """Bilinear between the middles of texels, repeated beyond the edges; (M, 3)."""
    height, width, _ = texture.shape
    x, y = places[:, 0] * width - 0.5, (1 - places[:, 1]) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    across, down = (x - left)[:, None], (y - top)[:, None]
    columns = [(left + step).astype(np.int64) % width for step in (0, 1)]
    rows = [(top + step).astype(np.int64) % height for step in (0, 1)]
    upper = (1 - across) * texture[rows[0], columns[0]] + across * texture[rows[0], columns[1]]
    lower = (1 - across) * texture[rows[1], columns[0]] + across * texture[rows[1], columns[1]]
    return (1 - down) * upper + down * lower
