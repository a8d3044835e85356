"""Writing .glb: one cloud of points with the extension KHR_gaussian_splatting of glTF 2.0.

Values are those of the Gaussians themselves, scales linear and opacities 0..1; y is up and z towards the viewer. What
does not know the extension shows coloured points.
"""

from __future__ import annotations

import json
import struct
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import dc_to_colour
from gasp_core.io.rotations import unit_quaternions
from gasp_core.io.spz import turned

__all__ = ["write_glb"]

Array = NDArray[Any]

_EXTENSION = "KHR_gaussian_splatting"
_HIGHEST_DEGREE = 3
_FLOAT, _UNSIGNED_BYTE, _ARRAY_BUFFER, _POINTS = 5126, 5121, 34962, 0
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942


def write_glb(stream: BinaryIO, gaussians: Gaussians) -> None:
    """Write finite Gaussians, right-down-front, as a .glb, which is right-up-back; degree 4 is dropped."""
    attributes = _attributes(turned(gaussians))
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    end = 0
    for name, values in attributes.items():
        views.append({"buffer": 0, "byteOffset": end, "byteLength": values.nbytes, "target": _ARRAY_BUFFER})
        accessor: dict[str, Any] = {
            "bufferView": len(accessors),
            "componentType": _FLOAT if values.dtype == np.float32 else _UNSIGNED_BYTE,
            "count": len(values),
            "type": _KINDS[values.shape[1]],
        }
        if values.dtype == np.uint8:
            accessor["normalized"] = True
        if name == "POSITION":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(accessor)
        # Of four or more bytes a row, so every view begins at a multiple of four.
        end += values.nbytes
    splatting = {
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    }
    primitive = {
        "mode": _POINTS,
        "attributes": {name: number for number, name in enumerate(attributes)},
        "extensions": {_EXTENSION: splatting},
    }
    document = {
        "asset": {"version": "2.0", "generator": "GASP"},
        "extensionsUsed": [_EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": end}],
    }
    text = json.dumps(document, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    stream.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + end))
    stream.write(struct.pack("<II", len(text), _JSON) + text)
    stream.write(struct.pack("<II", end, _BINARY))
    for values in attributes.values():
        stream.write(values.tobytes())


def _attributes(gaussians: Gaussians) -> dict[str, Array]:
    """By name, (N, 1 to 4) each, rows of four bytes or more."""
    harmonics = gaussians.harmonics
    rgba = np.append(dc_to_colour(harmonics[:, 0]), gaussians.opacities[:, None].astype(np.float64), axis=1)
    found: dict[str, Array] = {
        "POSITION": gaussians.means,
        "COLOR_0": np.round(np.clip(rgba, 0, 1) * 255).astype(np.uint8),
        f"{_EXTENSION}:ROTATION": np.roll(unit_quaternions(gaussians.quaternions), -1, axis=1),
        f"{_EXTENSION}:SCALE": gaussians.scales,
        f"{_EXTENSION}:OPACITY": np.clip(gaussians.opacities, 0, 1)[:, None],
    }
    for degree in range(min(gaussians.sh_degree, _HIGHEST_DEGREE) + 1):
        for order in range(2 * degree + 1):
            found[f"{_EXTENSION}:SH_DEGREE_{degree}_COEF_{order}"] = harmonics[:, degree**2 + order]
    return {
        name: values if values.dtype == np.uint8 else values.astype("<f4", order="C") for name, values in found.items()
    }
