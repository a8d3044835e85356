"""Reading .glb: the clouds of Gaussians of a glTF 2.0, where its nodes put them.

After KHR_gaussian_splatting as the Khronos has it from 2026 on: scales linear, opacities 0..1, quaternions x y z w,
harmonics in the order and with the signs of 3DGS, y up. Drafts before it had other names (`_SCALE`), the constant
harmonic as COLOR_0, and for a while logarithms for scales, as what was exported until the middle of 2026 has: these are
known by a negative one, which no scale is. What is packed as .spz (KHR_gaussian_splatting_compression_spz_2, a draft)
is taken as it lies in the .spz, as CesiumJS and cesium-native do; the draft turns it by half a turn about y.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians, rotation_matrices
from gasp_core.io.activations import colour_to_dc, exponential
from gasp_core.io.affine import flattens, moved
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.gltf import Gltf, optional_integer
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.sog_meta import Meta
from gasp_core.io.spz import read_spz, turned
from gasp_core.io.stacked import in_unit_range, stacked

__all__ = ["read_glb"]

Array = NDArray[Any]

_SPLATS = "KHR_gaussian_splatting"
_SPZ_ALONE = "KHR_spz_gaussian_splats_compression"
_SPZ = ("KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz")
_PREFIXES = (f"{_SPLATS}:", "_")
_POINTS = 0
_HIGHEST_DEGREE = 3
_KNOWN = {"kernel": (None, "ellipse"), "colorSpace": (None, "srgb_rec709_display", "BT.709-sRGB")}
_NO_SPLAT = "is no splat"
_OF_A_MESH = "of a mesh `gasp convert` makes one, and a collider takes the mesh itself"


def read_glb(data: bytes, path: Path) -> tuple[Gaussians, str]:
    """Gaussians of all clouds in the scene of a .glb, and what is said of the format.

    Animations are not played. Of a file with triangles too, these are left out.

    Raises
    ------
    SplatFormatError
        Where it holds no Gaussians, is damaged, or has what is not read here, which is named.
    """
    document = Gltf(data, path)
    placed = list(_placed(document))
    clouds = {mesh: _clouds(document, mesh) for mesh in dict.fromkeys(mesh for _, mesh, _ in placed)}
    if not any(clouds.values()):
        if any(_clouds(document, mesh) for mesh in range(len(document.listed("meshes")))):
            raise malformed(path, "its scene does not show the splat that it holds", "export it anew")
        raise malformed(path, _NO_SPLAT, _OF_A_MESH)
    taken, logarithms = 0, False
    read: dict[int, list[tuple[Gaussians, bool]]] = {}
    for mesh, primitives in clouds.items():
        read[mesh] = []
        for primitive, extension in primitives:
            gaussians, plain = _cloud(document, primitive, extension, taken)
            taken += len(gaussians)
            refuse_too_large(path, len(data), taken, gaussians.harmonics.shape[1])
            logarithms |= plain and bool(np.any(gaussians.scales < 0))
            read[mesh].append((gaussians, plain))
    whole = sum(len(gaussians) for _, mesh, _ in placed for gaussians, _ in read[mesh])
    bases = max(gaussians.harmonics.shape[1] for pieces in read.values() for gaussians, _ in pieces)
    refuse_too_large(path, len(data), whole, bases)
    pieces: list[Gaussians] = []
    for matrix, mesh, node in placed:
        if read[mesh] and flattens(matrix):
            raise malformed(
                path, f"nodes[{node}] squeezes the splat to nothing, or beyond all bounds", "mend its scale"
            )
        for gaussians, plain in read[mesh]:
            if logarithms and plain:
                gaussians = gaussians.with_(scales=exponential(gaussians.scales))
            pieces.append(moved(gaussians, matrix))
    packed = not all(plain for pieces in read.values() for _, plain in pieces)
    kind = "glb" + ", packed as spz" * packed + ", with logarithms for scales" * logarithms
    return turned(stacked(pieces)), kind


def _placed(document: Gltf) -> Iterable[tuple[Array, int, int]]:
    """Nodes with a mesh, in the scene: where they are (4, 4), number of the mesh, their own."""
    nodes = document.listed("nodes")
    if document.listed("scenes"):
        roots = document.entry("scenes", optional_integer(document.document, "scene") or 0)
        waiting = [(number, np.eye(4)) for number in _numbers(roots, "nodes")]
    else:
        below = {child for node in nodes for child in _numbers(node, "children")}
        waiting = [(number, np.eye(4)) for number in range(len(nodes)) if number not in below]
    seen: set[int] = set()
    waiting.reverse()
    while waiting:
        number, above = waiting.pop()
        node = document.entry("nodes", number)
        if number in seen:
            raise malformed(document.path, f"nodes[{number}] hangs below two others, or itself")
        seen.add(number)
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = (
                above @ _local(node) if {"matrix", "translation", "rotation", "scale"} & set(node.entries) else above
            )
        mesh = optional_integer(node, "mesh")
        if mesh is not None:
            extensions = node.entries.get("extensions")
            if isinstance(extensions, dict) and "EXT_mesh_gpu_instancing" in extensions:
                raise malformed(
                    document.path,
                    f"nodes[{number}] is many at once, by EXT_mesh_gpu_instancing, which is not read",
                    "export a node for each",
                )
            yield matrix, mesh, number
        waiting += [(child, matrix) for child in reversed(_numbers(node, "children"))]


def _numbers(meta: Meta, name: str) -> list[int]:
    """A list of numbers of other objects; empty where there is none."""
    if name not in meta.entries:
        return []
    found = meta.array(name)
    if not all(type(entry) is int and entry >= 0 for entry in found):
        raise meta.wrong(name, "a list of whole numbers")
    return cast("list[int]", found)


def _local(node: Meta) -> Array:
    """Map (4, 4) of a node: a matrix by columns, or a translation, a quaternion x y z w and a scale."""
    matrix = np.eye(4)
    if "matrix" in node.entries:
        matrix = np.array(node.numbers("matrix", 16)).reshape(4, 4).T
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise node.wrong("matrix", "an affine map")
        return matrix
    if "rotation" in node.entries:
        matrix[:3, :3] = rotation_matrices([np.roll(node.numbers("rotation", 4), 1)])[0]
    if "scale" in node.entries:
        matrix[:3, :3] *= node.numbers("scale", 3)
    if "translation" in node.entries:
        matrix[:3, 3] = node.numbers("translation", 3)
    return matrix


def _clouds(document: Gltf, mesh: int) -> list[tuple[Meta, Meta]]:
    """Primitives of a mesh that are Gaussians, each with what the extension says of it."""
    found: list[tuple[Meta, Meta]] = []
    for primitive in document.entry("meshes", mesh).objects("primitives"):
        extensions = primitive.entries.get("extensions")
        if isinstance(extensions, dict) and not {_SPLATS, _SPZ_ALONE}.isdisjoint(cast("dict[str, Any]", extensions)):
            inner = primitive.inner("extensions")
            found.append((primitive, inner.inner(_SPLATS) if _SPLATS in inner.entries else inner))
    return found


def _cloud(document: Gltf, primitive: Meta, extension: Meta, taken: int) -> tuple[Gaussians, bool]:
    """Gaussians of a primitive, in its own frame, and whether their scales are as they stand there.

    Raises
    ------
    SplatFormatError
        Where so many, with the `taken` ones before, do not fit into memory.
    """
    for name, known in _KNOWN.items():
        if extension.entries.get(name) not in known:
            found = quoted(extension.entries[name])
            raise malformed(
                document.path,
                f"its splat has the {name} {found}, which is not read",
                f"export it with {quoted(known[1])}",
            )
    packed = _packed(document, primitive, extension)
    if packed is not None:
        content, _ = document.view(packed)
        return turned(read_spz(bytes(content), document.path)), False
    if optional_integer(primitive, "mode") != _POINTS:
        raise malformed(document.path, "its splat is no cloud of points (mode 0)")
    attributes = primitive.inner("attributes")

    def number(name: str) -> int | None:
        """Of the accessor of an attribute, by its name of today or of a draft."""
        for prefix in _PREFIXES:
            if f"{prefix}{name}" in attributes.entries:
                return attributes.integer(f"{prefix}{name}")
        return None

    position = attributes.integer("POSITION")
    orders = {d: [number(f"SH_DEGREE_{d}_COEF_{n}") for n in range(2 * d + 1)] for d in range(_HIGHEST_DEGREE + 1)}
    degree = max((d for d, found in orders.items() if any(entry is not None for entry in found)), default=0)
    count, bases = document.count(position), (degree + 1) ** 2
    refuse_too_large(document.path, document.size, taken + count, bases)

    def values(found: int | None, what: str, *types: str) -> Array:
        if found is None:
            raise malformed(document.path, f"its splat has no {what}", "export it anew")
        return document.numbers(found, types, count, what)

    colour, opacity = optional_integer(attributes, "COLOR_0"), number("OPACITY")
    painted = colour is not None and (opacity is None or orders[0][0] is None)
    colours = values(colour, "COLOR_0", "VEC3", "VEC4") if painted else np.empty((count, 0))
    harmonics = np.empty((count, bases, 3), np.float32)
    for d in range(degree + 1):
        for n, found in enumerate(orders[d]):
            if d == 0 and found is None and painted:
                harmonics[:, 0] = colour_to_dc(colours[:, :3])
            else:
                harmonics[:, d * d + n] = values(found, f"SH_DEGREE_{d}_COEF_{n}", "VEC3")
    if opacity is None and colours.shape[1] == 4:
        opacities = colours[:, 3]
    else:
        opacities = values(opacity, "OPACITY", "SCALAR")[:, 0]
    return Gaussians(
        means=values(position, "POSITION", "VEC3"),
        quaternions=np.roll(values(number("ROTATION"), "ROTATION", "VEC4"), 1, axis=1),
        scales=values(number("SCALE"), "SCALE", "VEC3"),
        opacities=in_unit_range(opacities, document.path),
        harmonics=harmonics,
    ), True


def _packed(document: Gltf, primitive: Meta, extension: Meta) -> int | None:
    """Number of the bufferView with a .spz, where there is one."""
    if _SPZ_ALONE in extension.entries:
        return extension.inner(_SPZ_ALONE).integer("bufferView")
    document.refuse(extension, "its splat has the extension", _SPZ)
    if "extensions" not in extension.entries:
        return None
    inner = extension.inner("extensions")
    name = next((name for name in _SPZ if name in inner.entries), None)
    return None if name is None else inner.inner(name).integer("bufferView")
