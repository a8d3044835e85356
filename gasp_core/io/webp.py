"""Lossless WebP textures, decoded by Pillow once their size is known to be bearable."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.format_errors import malformed, quoted

__all__ = ["decode_webp"]

Array = NDArray[Any]


def decode_webp(data: bytes, most_pixels: int, name: str, path: Path) -> Array:
    """Pixels of a WebP image.

    Parameters
    ----------
    data
        The encoded image.
    most_pixels
        What the size in the header may be: Pillow allocates on opening, so it is read here first.
    name, path
        Image and the file it came from, for messages.

    Returns
    -------
    (height, width, 4) uint8, RGBA.

    Raises
    ------
    SplatFormatError
        Where it is no WebP, too large, or damaged.
    """
    from PIL import Image

    width, height = _size(data, name, path)
    if width * height > most_pixels:
        raise malformed(path, f"image {quoted(name)} of {width} x {height} pixels is far larger than the splat needs")
    try:
        with Image.open(io.BytesIO(data), formats=["WEBP"]) as image:
            pixels = np.asarray(image.convert("RGBA"))
    # What Pillow raises on damaged input, by its own documentation and plugins.
    except (OSError, ValueError, SyntaxError, EOFError, struct.error, Image.DecompressionBombError) as error:
        raise malformed(path, f"image {quoted(name)} cannot be decoded") from error
    if pixels.shape != (height, width, 4):
        raise malformed(path, f"image {quoted(name)} is not of the size its header says")
    return pixels


def _size(data: bytes, name: str, path: Path) -> tuple[int, int]:
    """Width and height as the container declares them (RFC 9649, sections 2.4-2.7)."""
    if len(data) >= 30 and data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        kind = data[12:16]
        if kind == b"VP8L" and data[20] == 0x2F:
            word = int.from_bytes(data[21:25], "little")
            return (word & 0x3FFF) + 1, ((word >> 14) & 0x3FFF) + 1
        if kind == b"VP8X":
            return int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
        if kind == b"VP8 ":
            # Lossy blocks would smear bits that mean numbers.
            raise malformed(path, f"image {quoted(name)} is lossy", "export it with lossless WebP")
    raise malformed(path, f"image {quoted(name)} is no WebP")
