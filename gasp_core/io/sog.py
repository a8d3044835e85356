"""SOG, spatially ordered Gaussians: PlayCanvas' WebP textures with a meta.json, versions 1 and 2, zipped or a folder.

Positions are 16-bit in two images, through sign(x) ln(1 + |x|); version 1 has scales, colours and harmonics between
bounds, version 2 in codebooks; harmonics of degree >= 1 are labels into a palette of at most 64 x 1024.

An own reader because gsply's (0.4.6) needs a further package for WebP, unzips without bound, and looks labels up in
compiled code that checks neither codebooks nor images against them.
"""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import exponential, sigmoid
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.rotations import restore_largest
from gasp_core.io.webp import decode_webp

__all__ = ["ZIP_MAGIC", "read_sog_folder", "read_sog_zip", "sog_version"]

Array = NDArray[Any]
Fetch = Callable[[str, int], bytes]
"""(name, most bytes) -> content; raises SplatFormatError for a longer or missing one."""

ZIP_MAGIC = b"PK\x03\x04"

_META = "meta.json"
_LONGEST_META = 1 << 18
"""Bytes; three codebooks are 20 kB. JSON of nothing but brackets takes 25 times its length."""
_MOST_MEMBERS = 1000
_SPARE_PIXELS = 1 << 17
"""Beyond two for each Gaussian, for writers that fill up rows of 4096."""
_PALETTE_WIDTH = 64
_LARGEST_PALETTE = 1 << 16
_BASES_OF_DEGREE = {1: 3, 2: 8, 3: 15}
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
        metas = [name for name in names if PurePosixPath(name).name == _META]
        if len(metas) != 1:
            raise malformed(path, f"the zip holds {len(metas)} files {_META}, not one", "give a .sog of one splat")
        root = metas[0][: -len(_META)]

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
    meta = _Meta(_parse(fetch(_META, _LONGEST_META), path), "", path)
    version = sog_version(meta.entries)
    if version not in (1, 2):
        raise malformed(path, "its meta.json is of an unknown version", "versions 1 and 2 are read")
    count = meta.integer("count") if version == 2 else meta.inner("means").first_integer("shape")
    # Before anything is unpacked, so that a count that lies costs nothing.
    refuse_too_large(path, packed, count, 1 + (max(_BASES_OF_DEGREE.values()) if "shN" in meta.entries else 0))
    most_pixels = 2 * count + _SPARE_PIXELS

    def texture(attribute: _Meta, index: int, names: int) -> Array:
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


def _palette(shn: _Meta, version: int, fetch: Fetch, texture: Callable[[_Meta, int, int], Array], path: Path) -> Array:
    """Harmonics of degree >= 1, (N, K - 1, 3) float32: each Gaussian's label names a row of coefficients."""
    name = shn.file_names(2)[0]
    most = _PALETTE_WIDTH * max(_BASES_OF_DEGREE.values()) * (_LARGEST_PALETTE // _PALETTE_WIDTH)
    centroids = decode_webp(fetch(name, 4 * most + (1 << 20)), most, name, path)[..., :3]
    height, width, _ = centroids.shape
    bases = width // _PALETTE_WIDTH
    if width % _PALETTE_WIDTH or bases not in _BASES_OF_DEGREE.values():
        raise malformed(path, f"image {quoted(name)} is {width} pixels wide; palettes are 192, 512 or 960")
    size = height * _PALETTE_WIDTH
    rows = centroids.reshape(size, bases, 3)
    if version == 2:
        if _BASES_OF_DEGREE.get(shn.integer("bands")) != bases:
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


def _between(attribute: _Meta, fractions: Array, channels: int) -> Array:
    low, high = (np.array(attribute.numbers(name, channels)) for name in ("mins", "maxs"))
    return low + (high - low) * fractions


def _codebook(attribute: _Meta) -> Array:
    """The 256 values of a codebook, (256,) float64."""
    entries = attribute.array("codebook")
    # Early writers left the first entry null; their viewer extrapolates it from the rest, which are sorted.
    if len(entries) == 256 and entries[0] is None:
        second, last = _as_number(entries[1]), _as_number(entries[255])
        if second is not None and last is not None:
            entries = [second + (second - last) / 255, *entries[1:]]
    values = [_as_number(entry) for entry in entries]
    if len(values) != 256 or None in values:
        raise attribute.wrong("codebook", "a list of 256 numbers")
    return np.array(values, dtype=np.float64)


def _as_number(value: object) -> float | None:
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if np.isfinite(number) else None


def _parse(text: bytes, path: Path) -> dict[str, Any]:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        entries = dict(pairs)
        if len(entries) != len(pairs):
            raise ValueError("a key occurs twice")
        return entries

    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is no number of JSON")

    try:
        meta: object = json.loads(text, object_pairs_hook=unique, parse_constant=no_constant)
    except (ValueError, RecursionError) as error:
        reason = "it is nested too deep" if isinstance(error, RecursionError) else str(error)
        raise malformed(path, f"meta.json cannot be read: {quoted(reason)}") from error
    if not isinstance(meta, dict):
        raise malformed(path, "meta.json holds no object")
    meta = cast("dict[str, Any]", meta)
    if "lodLevels" in meta:
        raise malformed(path, "it lists levels of detail", "open one of the folders it names")
    return meta


class _Meta:
    """An object of meta.json whose entries are checked as they are asked for."""

    def __init__(self, entries: dict[str, Any], where: str, path: Path) -> None:
        self.entries = entries
        self._where = where
        self._path = path

    def wrong(self, name: str, wanted: str) -> Exception:
        found = quoted(json.dumps(self.entries[name])) if name in self.entries else "nothing"
        return malformed(self._path, f"meta.json has {found} for {self._where}{name}, where {wanted} belongs")

    def inner(self, name: str) -> _Meta:
        entry = self.entries.get(name)
        if not isinstance(entry, dict):
            raise self.wrong(name, "an object")
        return _Meta(cast("dict[str, Any]", entry), f"{name}.", self._path)

    def integer(self, name: str) -> int:
        entry = self.entries.get(name)
        if isinstance(entry, bool) or not isinstance(entry, int) or entry < 0:
            raise self.wrong(name, "a whole number")
        return entry

    def array(self, name: str) -> list[Any]:
        entry = self.entries.get(name)
        if not isinstance(entry, list):
            raise self.wrong(name, "a list")
        return cast("list[Any]", entry)

    def first_integer(self, name: str) -> int:
        entries = self.array(name)
        if not entries or isinstance(entries[0], bool) or not isinstance(entries[0], int) or entries[0] < 0:
            raise self.wrong(name, "a list of whole numbers")
        return entries[0]

    def number(self, name: str) -> float:
        value = _as_number(self.entries.get(name))
        if value is None:
            raise self.wrong(name, "a number")
        return value

    def numbers(self, name: str, length: int) -> list[float]:
        values = [_as_number(entry) for entry in self.array(name)]
        numbers = [value for value in values if value is not None]
        if len(numbers) != length or len(values) != length:
            raise self.wrong(name, f"a list of {length} numbers")
        return numbers

    def file_names(self, length: int) -> list[str]:
        entries = self.array("files")
        names = [entry for entry in entries if isinstance(entry, str)]
        if len(names) != length or len(entries) != length:
            raise self.wrong("files", f"a list of {length} file names")
        for name in names:
            # Neither up, nor absolute, nor a drive, nor a separator of another system.
            if not name or name in (".", "..") or any(c in name for c in "/\\:\0"):
                raise malformed(self._path, f"meta.json names the file {quoted(name)}, which is outside the splat")
        return names
