"""The .ply of 3D Gaussian Splatting (Kerbl et al. 2023, 10.1145/3592433) and its flat kin, read and written.

``x y z nx ny nz f_dc_0..2 f_rest_0..k opacity scale_0..2 rot_0..3``: opacities as logits, scales as logarithms,
quaternions w x y z not normalised, harmonics of degree >= 1 all of red, then green, then blue.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import exponential, logarithm, logit, sigmoid
from gasp_core.io.format_errors import malformed
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.ply import PlyHeader, read_table

__all__ = ["read_inria", "write_inria"]

Array = NDArray[Any]

_BASES = {0: 1, 9: 4, 24: 9, 45: 16, 72: 25}
"""Number of f_rest to number of harmonics a channel."""
_LARGEST = float(np.finfo(np.float32).max)
_BLOCK = 4096
"""Rows gathered at a time: a block of wide rows stays in the cache while its columns are picked out."""


def read_inria(data: bytes, header: PlyHeader, path: Path, flat_axis: int = 2) -> Gaussians:
    """Gaussians of an INRIA .ply.

    A file with only two scales is flat: 2DGS (Huang et al. 2024, 10.1145/3641519.3657428) spans its disc by the first
    two axes of the rotation and has the normal in the third, GaMeS and D-MiSo have it in the first. The file does not
    tell which, so `flat_axis` does, and the scale of that axis is 0. Where ``scale_0`` or ``scale_1`` is the missing
    one, it is that axis whatever `flat_axis` says.

    Raises
    ------
    SplatFormatError
        Where properties are missing (they are named) or the rows are not all there.
    """
    element = header.element("vertex")
    names = set(element.properties if element else ())
    rest = sum(name.startswith("f_rest_") for name in names)
    if rest not in _BASES:
        raise malformed(path, f"it has {rest} properties f_rest_*", "spherical harmonics take 0, 9, 24, 45 or 72")
    rest_names = [f"f_rest_{i}" for i in range(rest)]
    present = [f"scale_{i}" for i in range(3) if f"scale_{i}" in names]
    scale_names = present if len(present) == 2 else ["scale_0", "scale_1", "scale_2"]
    groups = {
        "means": ["x", "y", "z"],
        "quaternions": [f"rot_{i}" for i in range(4)],
        "scales": scale_names,
        "opacities": ["opacity"],
        "harmonics": [f"f_dc_{i}" for i in range(3)] + rest_names,
    }
    missing = [name for group in groups.values() for name in group if name not in names]
    if missing:
        listed = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
        raise malformed(path, f"the PLY lacks the properties {listed}", "it is no splat: give a trained 3DGS file")

    table = read_table(data, header, "vertex", path)
    refuse_too_large(path, len(data), len(table), _BASES[rest])
    arrays = {name: _columns(table, group, path) for name, group in groups.items()}
    bases = _BASES[rest]
    harmonics = np.empty((len(table), bases, 3), np.float32)
    harmonics[:, 0] = arrays["harmonics"][:, :3]
    harmonics[:, 1:] = arrays["harmonics"][:, 3:].reshape(len(table), 3, bases - 1).transpose(0, 2, 1)
    scales = exponential(arrays["scales"])
    if len(present) == 2:
        by_name = {"scale_0": 0, "scale_1": 1}
        thin = next((axis for name, axis in by_name.items() if name not in names), flat_axis)
        scales = np.insert(scales, thin, 0.0, axis=1)
    return Gaussians(
        means=arrays["means"],
        quaternions=arrays["quaternions"].astype(np.float32, copy=False),
        scales=scales,
        opacities=sigmoid(arrays["opacities"][:, 0]),
        harmonics=harmonics,
    )


def _columns(table: Array, names: list[str], path: Path) -> Array:
    """Columns side by side, (N, len(names)): float64 where one of them is double, else float32."""
    fields = table.dtype
    double = any(fields[name].type is np.float64 for name in names)
    columns = np.empty((len(table), len(names)), np.float64 if double else np.float32)
    for start in range(0, len(table), _BLOCK):
        block = table[start : start + _BLOCK]
        for column, name in enumerate(names):
            columns[start : start + _BLOCK, column] = block[name]
            if double and fields[name].type is np.float64:
                _refuse_beyond_float32(block[name], name, start, path)
    return columns


def _refuse_beyond_float32(values: Array, name: str, first: int, path: Path) -> None:
    """Refuse a double that float32 has no number for; what is infinite or NaN in the file itself, `inspect` reports."""
    beyond = np.isfinite(values) & (np.abs(values) > _LARGEST)
    if beyond.any():
        row = int(np.argmax(beyond))
        raise malformed(
            path,
            f"property {name!r} of Gaussian {first + row:,} is {values[row]:.3g}, beyond the 3.4e38 of float32",
            "drop that Gaussian",
        )


def write_inria(stream: BinaryIO, gaussians: Gaussians) -> None:
    """Write Gaussians as a binary INRIA .ply of float32, normals zero as its own trainer leaves them."""
    count, bases, _ = gaussians.harmonics.shape
    rest = 3 * (bases - 1)
    names = [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *(f"f_rest_{i}" for i in range(rest)),
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property float {name}" for name in names]
    stream.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
    for start in range(0, count, 16 * _BLOCK):
        part = slice(start, start + 16 * _BLOCK)
        means = gaussians.means[part]
        rows = np.zeros((len(means), len(names)), "<f4")
        rows[:, 0:3] = means
        rows[:, 6:9] = gaussians.harmonics[part, 0]
        rows[:, 9 : 9 + rest] = gaussians.harmonics[part, 1:].transpose(0, 2, 1).reshape(len(means), rest)
        rows[:, 9 + rest] = logit(gaussians.opacities[part])
        rows[:, 10 + rest : 13 + rest] = logarithm(gaussians.scales[part])
        rows[:, 13 + rest :] = gaussians.quaternions[part]
        stream.write(rows.tobytes())
