"""The compressed .ply of PlayCanvas: 256 Gaussians a chunk, packed between the chunk's bounds.

An own reader because gsply (0.4.6) refuses the old chunks of 12 bounds, and on the new ones of 18 clips opacities of 0
and 1 to logits of 10 and lets compiled code read past the chunks when their count lies. Layout after PlayCanvas'
``gsplat-compressed-data.js`` (MIT): positions and logarithmic scales 11, 10, 11 bits, rotations 2 bits for the
component left out and 10 each for the others, colours and opacity 8 each; colours lie between bounds only in the new
layout. Harmonics of degree >= 1 are bytes over -4..4 in an element of their own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import colour_to_dc, exponential
from gasp_core.io.format_errors import malformed
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.ply import PlyHeader, read_table
from gasp_core.io.rotations import restore_largest

__all__ = ["is_compressed", "read_compressed_ply"]

Array = NDArray[Any]

_CHUNK = 256
_PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_ENDS = ("min", "max")
_BASES = {9: 3, 24: 8, 45: 15}


def is_compressed(header: PlyHeader) -> bool:
    """Whether a PLY is of this kind."""
    vertex = header.element("vertex")
    return vertex is not None and "packed_position" in vertex.properties


def read_compressed_ply(data: bytes, header: PlyHeader, path: Path) -> Gaussians:
    """Gaussians of a compressed .ply, old chunks or new.

    Raises
    ------
    SplatFormatError
        Where elements or properties are missing, of wrong type, or not all there.
    """
    if not header.order:
        raise malformed(path, "a compressed PLY cannot be text", "export it as binary")
    bounds = [f"{end}_{name}" for end in ("min", "max") for name in ("x", "y", "z", "scale_x", "scale_y", "scale_z")]
    colour_bounds = [f"{end}_{name}" for end in ("min", "max") for name in "rgb"]
    chunk = header.element("chunk")
    has_colour_bounds = chunk is not None and any(name in chunk.properties for name in colour_bounds)
    _require(header, "chunk", [*bounds, *(colour_bounds if has_colour_bounds else ())], "f4", path)
    _require(header, "vertex", list(_PACKED), "u4", path)

    chunks = read_table(data, header, "chunk", path)
    packed = read_table(data, header, "vertex", path)
    count = len(packed)
    if len(chunks) != -(-count // _CHUNK):
        raise malformed(path, f"{count:,} Gaussians need {-(-count // _CHUNK):,} chunks, it has {len(chunks):,}")
    sh = header.element("sh")
    refuse_too_large(path, len(data), count, 1 + (len(sh.properties) // 3 if sh else 0))

    def between(names: tuple[str, str, str], fractions: Array) -> Array:
        low, high = (np.stack([chunks[f"{end}_{name}"] for name in names], 1, dtype=np.float64) for end in _ENDS)
        of_row = np.arange(count) // _CHUNK
        return low[of_row] * (1 - fractions) + high[of_row] * fractions

    with np.errstate(invalid="ignore", over="ignore"):
        means = between(("x", "y", "z"), _fractions(packed["packed_position"], (11, 10, 11))).astype(np.float32)
        logs = between(("scale_x", "scale_y", "scale_z"), _fractions(packed["packed_scale"], (11, 10, 11)))
        rgba = _fractions(packed["packed_color"], (8, 8, 8, 8))
        colours = between(("r", "g", "b"), rgba[:, :3]) if has_colour_bounds else rgba[:, :3]
        dc = colour_to_dc(colours)
    smaller = (_fractions(packed["packed_rotation"], (10, 10, 10)) - 0.5) * np.sqrt(2.0)
    return Gaussians(
        means=means,
        quaternions=restore_largest(smaller, (packed["packed_rotation"] >> np.uint32(30)).astype(np.intp)),
        scales=exponential(logs),
        opacities=rgba[:, 3].astype(np.float32),
        harmonics=np.concatenate([dc[:, None, :], _directional(data, header, count, path)], axis=1),
    )


def _require(header: PlyHeader, element: str, names: list[str], kind: str, path: Path) -> None:
    found = header.element(element)
    properties = {} if found is None else found.properties
    missing = [name for name in names if properties.get(name) != kind]
    if missing:
        what = "float" if kind == "f4" else "uint"
        raise malformed(path, f"element {element!r} of a compressed PLY lacks the {what} {', '.join(missing[:6])}")


def _fractions(words: Array, bits: tuple[int, ...]) -> Array:
    """Fields of the lowest sum(bits) bits, the first the highest, each as a fraction of its largest value."""
    shift = sum(bits)
    fields: list[Array] = []
    for width in bits:
        shift -= width
        largest = (1 << width) - 1
        fields.append(((words >> np.uint32(shift)) & np.uint32(largest)) / float(largest))
    return np.stack(fields, axis=1)


def _directional(data: bytes, header: PlyHeader, count: int, path: Path) -> Array:
    """Harmonics of degree >= 1, (N, K - 1, 3) float32."""
    element = header.element("sh")
    if element is None or not element.properties:
        return np.zeros((count, 0, 3), np.float32)
    total = len(element.properties)
    if total not in _BASES:
        raise malformed(path, f"element 'sh' has {total} properties", "spherical harmonics take 9, 24 or 45")
    names = [f"f_rest_{i}" for i in range(total)]
    _require(header, "sh", names, "u1", path)
    table = read_table(data, header, "sh", path)
    if len(table) != count:
        raise malformed(path, f"it has {count:,} Gaussians but harmonics for {len(table):,}")
    levels = np.arange(256)
    # The middle of each of 256 steps over -4..4, the outermost standing for the ends themselves.
    values = ((np.where(levels == 0, 0.0, np.where(levels == 255, 256.0, levels + 0.5)) / 256 - 0.5) * 8).astype("f4")
    flat = np.stack([table[name] for name in names], axis=1)
    return values[flat].reshape(count, 3, _BASES[total]).transpose(0, 2, 1)
