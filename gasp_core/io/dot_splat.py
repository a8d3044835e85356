"""The .splat of antimatter15's viewer: 32 bytes a Gaussian and no header.

Position and linear scale as three float32 each, colour and opacity as four bytes, quaternion w x y z as four bytes
(q * 128 + 128). An own reader because gsply has none.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import colour_to_dc, dc_to_colour
from gasp_core.io.format_errors import malformed
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.rotations import unit_quaternions

__all__ = ["read_dot_splat", "write_dot_splat"]

_ROW = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("rotation", "u1", 4)])


def read_dot_splat(data: bytes, path: Path) -> Gaussians:
    """Gaussians of a .splat.

    Raises
    ------
    SplatFormatError
        Where the size is no multiple of 32 bytes or scales are negative, as they are in any other kind of file.
    """
    if len(data) % _ROW.itemsize:
        raise malformed(path, f"a .splat has 32 bytes a Gaussian, {len(data):,} bytes is no multiple of that")
    rows = np.frombuffer(data, _ROW)
    refuse_too_large(path, len(data), len(rows), 1)
    scales = rows["scale"].astype(np.float32)
    if np.any(scales < 0):
        row = int(np.argmax(np.any(scales < 0, axis=1)))
        raise malformed(path, f"Gaussian {row:,} has a negative scale, so this is no .splat")
    rgba = rows["rgba"] / 255.0
    return Gaussians(
        means=rows["mean"].astype(np.float32),
        quaternions=((rows["rotation"] - 128.0) / 128.0).astype(np.float32),
        scales=scales,
        opacities=rgba[:, 3].astype(np.float32),
        harmonics=colour_to_dc(rgba[:, None, :3]),
    )


def write_dot_splat(stream: BinaryIO, gaussians: Gaussians) -> None:
    """Write Gaussians as a .splat: harmonics of degree >= 1 are dropped, colours cut to 0..1."""
    rows = np.zeros(len(gaussians), _ROW)
    rows["mean"] = gaussians.means
    rows["scale"] = gaussians.scales
    rgba = np.concatenate([dc_to_colour(gaussians.harmonics[:, 0]), gaussians.opacities[:, None]], axis=1)
    rows["rgba"] = np.clip(np.round(rgba * 255), 0, 255)
    rows["rotation"] = np.clip(np.round(unit_quaternions(gaussians.quaternions) * 128 + 128), 0, 255)
    stream.write(rows.tobytes())
