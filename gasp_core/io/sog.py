"""SOG, spatially ordered Gaussians: PlayCanvas' WebP textures with a meta.json, versions 1 and 2, zipped or a folder.

Positions are 16-bit in two images, through sign(x) ln(1 + |x|); version 1 has scales, colours and harmonics between
bounds, version 2 in codebooks; harmonics of degree >= 1 are labels into a palette of at most 64 x 1024.

An own reader because gsply's (0.4.6) needs a further package for WebP, unzips without bound, and looks labels up in
compiled code that checks neither codebooks nor images against them.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import exponential, sigmoid
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.rotations import restore_largest
from gasp_core.io.sog_meta import LONGEST_META, META, Meta, as_number, parse_meta
from gasp_core.io.webp import decode_webp

__all__ = [
    "BASES_OF_DEGREE",
    "LARGEST_PALETTE",
    "PALETTE_WIDTH",
    "ZIP_MAGIC",
    "read_sog_folder",
    "read_sog_zip",
    "sog_version",
]

Array = NDArray[Any]
Fetch = Callable[[str, int], bytes]
"""(name, most bytes) -> content; raises SplatFormatError for a longer or missing one."""

ZIP_MAGIC = b"PK\x03\x04"

_MOST_MEMBERS = 1000
_SPARE_PIXELS = 1 << 17
"""Beyond two for each Gaussian, for writers that fill up rows of 4096."""
PALETTE_WIDTH = 64
LARGEST_PALETTE = 1 << 16
BASES_OF_DEGREE = {1: 3, 2: 8, 3: 15}
_ATTRIBUTES = ("means", "scales", "quats", "sh0", "shN")


def read_sog_zip(data: bytes, path: Path) -> tuple[Gaussians, int]:
    """Gaussians and version of a .sog.

    Raises
    ------
    SplatFormatError
        Where the zip, its meta.json or an image is missing, damaged, or larger than the count declared allows.
    """
    # Python keeps ten times what the list of contents takes in the file, and reads all of it on opening.
    if data.count(b"PK\x01\x02") > _MOST_MEMBERS:
        raise malformed(path, f"the zip holds more than {_MOST_MEMBERS} files", "give a .sog of one splat")
    try:
        archive = zipfile.ZipFile(BytesIO(data))
    except (zipfile.BadZipFile, struct.error, NotImplementedError, ValueError, OSError) as error:
        raise malformed(path, "it begins as a zip but is none, or is truncated") from error
    with archive:
        names = archive.namelist()
        metas = [name for name in names if PurePosixPath(name).name == META]
        if len(metas) != 1:
            raise malformed(path, f"the zip holds {len(metas)} files {META}, not one", "give a .sog of one splat")
        root = metas[0][: -len(META)]

        def fetch(name: str, most: int) -> bytes:
            if names.count(root + name) != 1:
                raise malformed(path, f"the zip holds {names.count(root + name)} files {quoted(name)}, not one")
            if archive.getinfo(root + name).compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise malformed(path, f"{quoted(name)} is packed in an unusual way", "zip it again with deflate")
            try:
                # The size in the directory may lie; reading one byte more than allowed tells.
                with archive.open(root + name) as member:
                    content = member.read(most + 1)
            except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError, ValueError) as error:
                raise malformed(path, f"{quoted(name)} cannot be unpacked from the zip") from error
            return _within(content, most, name, path)

        return _read_sog(fetch, len(data), path)


def read_sog_folder(folder: Path) -> tuple[Gaussians, int]:
    """Gaussians and version of a folder with meta.json and its images.

    Raises
    ------
    SplatFormatError
        As `read_sog_zip`.
    """

    def fetch(name: str, most: int) -> bytes:
        file = folder / name
        if not file.is_file():
            raise malformed(
                folder, f"it holds no file {quoted(name)}", "give the folder of one splat, with all its files"
            )
        with file.open("rb") as stream:
            return _within(stream.read(most + 1), most, name, folder)

    size = sum(file.stat().st_size for file in folder.iterdir() if file.is_file())
    return _read_sog(fetch, size, folder)


def sog_version(meta: dict[str, Any]) -> int:
    """Version of a meta.json; the first wrote none."""
    version = meta.get("version", 1)
    return version if isinstance(version, int) and not isinstance(version, bool) else 0


def _within(content: bytes, most: int, name: str, path: Path) -> bytes:
    if len(content) > most:
        raise malformed(path, f"{quoted(name)} unpacks to more than the {most:,} bytes such a splat may need")
    return content


def _read_sog(fetch: Fetch, packed: int, path: Path) -> tuple[Gaussians, int]:
    meta = parse_meta(fetch(META, LONGEST_META), META, path)
    if "lodLevels" in meta.entries:
        raise malformed(path, "it lists levels of detail", "such a file is called lod-meta.json")
    version = sog_version(meta.entries)
    if version not in (1, 2):
        raise malformed(path, "its meta.json is of an unknown version", "versions 1 and 2 are read")
    count = meta.integer("count") if version == 2 else meta.inner("means").first_integer("shape")
    # Before anything is unpacked, so that a count that lies costs nothing.
    refuse_too_large(path, packed, count, 1 + (max(BASES_OF_DEGREE.values()) if "shN" in meta.entries else 0))
    most_pixels = 2 * count + _SPARE_PIXELS

    def texture(attribute: Meta, index: int, names: int) -> Array:
        name = attribute.file_names(names)[index]
        encoded = fetch(name, 4 * most_pixels + (1 << 20))
        pixels = decode_webp(encoded, most_pixels, name, path).reshape(-1, 4)
        if len(pixels) < count:
            raise malformed(path, f"image {quoted(name)} has {len(pixels):,} pixels for {count:,} Gaussians")
        return pixels[:count]

    means, scales, sh0 = meta.inner("means"), meta.inner("scales"), meta.inner("sh0")
    position = texture(means, 0, 2)[:, :3] | (texture(means, 1, 2)[:, :3].astype(np.uint16) << 8)
    folded = _between(means, position / 65535.0, 3)
    with np.errstate(over="ignore"):
        centres = (np.sign(folded) * np.expm1(np.abs(folded))).astype(np.float32)

    scale_pixels, colour_pixels = texture(scales, 0, 1)[:, :3], texture(sh0, 0, 1)
    if version == 2:
        logs = _codebook(scales)[scale_pixels]
        dc, opacities = _codebook(sh0)[colour_pixels[:, :3]], (colour_pixels[:, 3] / 255.0).astype(np.float32)
    else:
        logs = _between(scales, scale_pixels / 255.0, 3)
        colours = _between(sh0, colour_pixels / 255.0, 4)
        dc, opacities = colours[:, :3], sigmoid(colours[:, 3])

    rotations = texture(meta.inner("quats"), 0, 1)
    largest = rotations[:, 3].astype(np.intp) - 252
    if np.any(largest < 0):
        raise malformed(path, f"the rotation of Gaussian {int(np.argmax(largest < 0)):,} names no largest component")
    harmonics = dc.astype(np.float32)[:, None, :]
    if "shN" in meta.entries:
        directional = _palette(meta.inner("shN"), version, fetch, texture, path)
        harmonics = np.concatenate([harmonics, directional], axis=1)
    gaussians = Gaussians(
        means=centres,
        quaternions=restore_largest((rotations[:, :3] / 127.5 - 1) * np.sqrt(0.5), largest),
        scales=exponential(logs),
        opacities=opacities,
        harmonics=harmonics,
    )
    return gaussians, version


def _palette(shn: Meta, version: int, fetch: Fetch, texture: Callable[[Meta, int, int], Array], path: Path) -> Array:
    """Harmonics of degree >= 1, (N, K - 1, 3) float32: each Gaussian's label names a row of coefficients."""
    name = shn.file_names(2)[0]
    most = PALETTE_WIDTH * max(BASES_OF_DEGREE.values()) * (LARGEST_PALETTE // PALETTE_WIDTH)
    centroids = decode_webp(fetch(name, 4 * most + (1 << 20)), most, name, path)[..., :3]
    height, width, _ = centroids.shape
    bases = width // PALETTE_WIDTH
    if width % PALETTE_WIDTH or bases not in BASES_OF_DEGREE.values():
        raise malformed(path, f"image {quoted(name)} is {width} pixels wide; palettes are 192, 512 or 960")
    size = height * PALETTE_WIDTH
    rows = centroids.reshape(size, bases, 3)
    if version == 2:
        if BASES_OF_DEGREE.get(shn.integer("bands")) != bases:
            raise malformed(path, f"its palette is {width} pixels wide, which is not that of the bands declared")
        book = _codebook(shn)
    else:
        low, high = shn.number("mins"), shn.number("maxs")
        book = low + (high - low) * (np.arange(256) / 255.0)
    values = book.astype(np.float32)[rows]
    labels = texture(shn, 1, 2)[:, :2].astype(np.intp)
    label = labels[:, 0] | (labels[:, 1] << 8)
    if int(label.max()) >= size:
        raise malformed(
            path, f"Gaussian {int(np.argmax(label)):,} names row {int(label.max()):,} of a palette of {size:,}"
        )
    return values[label]


def _between(attribute: Meta, fractions: Array, channels: int) -> Array:
    low, high = (np.array(attribute.numbers(name, channels)) for name in ("mins", "maxs"))
    return low + (high - low) * fractions


def _codebook(attribute: Meta) -> Array:
    """The 256 values of a codebook, (256,) float64."""
    entries = attribute.array("codebook")
    # Early writers left the first entry null; their viewer extrapolates it from the rest, which are sorted.
    if len(entries) == 256 and entries[0] is None:
        second, last = as_number(entries[1]), as_number(entries[255])
        if second is not None and last is not None:
            entries = [second + (second - last) / 255, *entries[1:]]
    values = [as_number(entry) for entry in entries]
    if len(values) != 256 or None in values:
        raise attribute.wrong("codebook", "a list of 256 numbers")
    return np.array(values, dtype=np.float64)
