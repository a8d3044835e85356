"""Niantic's .spz, versions 1 to 4, and the turn between its frame and the ordinary one.

Layout after github.com/nianticlabs/spz (MIT): 24-bit fixed-point positions (halves in version 1), one byte for each
opacity, colour, logarithmic scale and harmonic, rotations in three bytes (x y z) or, from version 3, four (the three
smaller components). Versions 1 to 3 are one gzip stream, 4 has a zstd stream an attribute.

An own reader because gsply's (0.4.6) unzips without bound, clips opacities at logits of 14, needs a further package
for version 4 and leaves the frame as it is. Writing is gsply's, turned.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import exponential, logarithm, logit
from gasp_core.io.format_errors import malformed
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.rotations import restore_largest, unit_quaternions

__all__ = ["GZIP_MAGIC", "SPZ_MAGIC", "position_bits", "read_spz", "turned", "write_spz"]

Array = NDArray[Any]

SPZ_MAGIC = b"NGSP"
GZIP_MAGIC = b"\x1f\x8b\x08"

_HEADER = struct.Struct("<4sIIBBBB")
_HEADER_4 = struct.Struct("<4sIIBBBBI12x")
_STREAM = struct.Struct("<QQ")
_BASES = {0: 0, 1: 3, 2: 8, 3: 15, 4: 24}
_MOST_FRACTION_BITS = 24
_LONGEST_EXTENSION = 1 << 20
_DC_SCALE = 0.15

# Signs of the harmonics under (x, y, z) -> (x, -y, -z), from their polynomials in order: a factor y or z each.
_SIGNS = np.array(
    [1]
    + [-1, -1, 1]  # y, z, x
    + [-1, 1, 1, -1, 1]  # xy, yz, 3zz-1, xz, xx-yy
    + [-1, 1, -1, -1, 1, -1, 1]  # y(3xx-yy), xyz, y(5zz-1), z(5zz-3), x(5zz-1), z(xx-yy), x(xx-3yy)
    # xy(xx-yy), yz(3xx-yy), xy(7zz-1), yz(7zz-3), 35zzzz-30zz+3, xz(7zz-3), (xx-yy)(7zz-1), xz(xx-3yy), x^4-6xxyy+y^4
    + [-1, 1, -1, 1, 1, -1, 1, -1, 1],
    dtype=np.float32,
)


@dataclass(frozen=True, slots=True)
class _Layout:
    """What a header says."""

    version: int
    count: int
    degree: int
    fraction_bits: int

    def sizes(self) -> tuple[int, ...]:
        """Bytes of positions, opacities, colours, scales, rotations, harmonics."""
        position = 6 if self.version == 1 else 9
        rotation = 3 if self.version <= 2 else 4
        return tuple(self.count * size for size in (position, 1, 3, 3, rotation, 3 * _BASES[self.degree]))


def turned(gaussians: Gaussians) -> Gaussians:
    """Gaussians turned by half a turn about x, (x, y, z) -> (x, -y, -z): right-down-front to right-up-back and back."""
    bases = gaussians.harmonics.shape[1]
    # A damaged half-precision file may hold signalling NaNs, which `inspect` is to report, not arithmetic.
    with np.errstate(invalid="ignore"):
        means = gaussians.means * np.array([1, -1, -1], gaussians.means.dtype)
    return Gaussians(
        means=means,
        quaternions=gaussians.quaternions * np.array([1, 1, -1, -1], gaussians.quaternions.dtype),
        scales=gaussians.scales,
        opacities=gaussians.opacities,
        harmonics=gaussians.harmonics * _SIGNS[:bases, None].astype(gaussians.harmonics.dtype),
    )


def read_spz(data: bytes, path: Path) -> Gaussians:
    """Gaussians of a .spz in the frame of the .ply it came from.

    Raises
    ------
    SplatFormatError
        Where it is no .spz, of an unknown version, truncated, or unpacks to another size than it declares.
    """
    layout, sections = _unzip(data, path) if data.startswith(GZIP_MAGIC) else _decompress_4(data, path)
    positions, opacities, colours, scales, rotations, harmonics = sections
    count, bases = layout.count, _BASES[layout.degree]
    if layout.version == 1:
        means = positions.view("<f2").reshape(count, 3).astype(np.float32)
    else:
        low, middle, high = positions.reshape(count, 3, 3).astype(np.int32).transpose(2, 0, 1)
        fixed = low | (middle << 8) | (high << 16)
        means = ((fixed - ((fixed & 0x800000) << 1)) / float(1 << layout.fraction_bits)).astype(np.float32)
    dc = ((colours.reshape(count, 1, 3) / 255.0 - 0.5) / _DC_SCALE).astype(np.float32)
    directional = (harmonics.reshape(count, bases, 3).astype(np.float32) - 128) / 128
    return turned(
        Gaussians(
            means=means,
            quaternions=_rotations(rotations.reshape(count, -1)),
            scales=exponential(scales.reshape(count, 3) / 16.0 - 10.0),
            opacities=(opacities / 255.0).astype(np.float32),
            harmonics=np.concatenate([dc, directional], axis=1),
        )
    )


def _rotations(stored: Array) -> Array:
    """Quaternions w x y z of three bytes x y z, or of four bytes with the three smaller components."""
    count = len(stored)
    if stored.shape[1] == 3:
        # Rounding can leave |xyz| slightly above 1; w is then 0.
        return restore_largest(stored / 127.5 - 1.0, np.zeros(count, np.intp))
    words = np.ascontiguousarray(stored).view("<u4")[:, 0]
    # Ten bits each, sign and magnitude, the last stored component lowest.
    fields = (words[:, None] >> np.array([20, 10, 0], np.uint32)) & np.uint32(0x3FF)
    magnitudes = (fields & np.uint32(0x1FF)) / 511.0 * np.sqrt(0.5)
    smaller = np.where(fields & np.uint32(0x200), -magnitudes, magnitudes)
    return restore_largest(smaller, (words >> np.uint32(30)).astype(np.intp))[:, [3, 0, 1, 2]]


def _checked(version: int, count: int, degree: int, bits: int, versions: range, packed: int, path: Path) -> _Layout:
    if version not in versions:
        raise malformed(path, f".spz version {version} is unknown", "versions 1 to 4 are read: export it as version 3")
    if degree not in _BASES:
        raise malformed(path, f"its header claims harmonics of degree {degree}")
    if bits > _MOST_FRACTION_BITS:
        raise malformed(path, f"its header claims {bits} fractional bits of 24")
    layout = _Layout(version, count, degree, bits)
    refuse_too_large(path, packed, count, 1 + _BASES[degree])
    return layout


def _unzip(data: bytes, path: Path) -> tuple[_Layout, list[Array]]:
    """Header and sections of versions 1 to 3; never unpacks more than the header declares."""
    try:
        with gzip.GzipFile(fileobj=BytesIO(data)) as stream:
            head = stream.read(_HEADER.size)
            if len(head) < _HEADER.size or head[:4] != SPZ_MAGIC:
                raise malformed(path, "it is gzip with no .spz inside", "give a splat")
            _, version, count, degree, bits, _, _ = _HEADER.unpack(head)
            layout = _checked(version, count, degree, bits, range(1, 4), len(data), path)
            sizes = layout.sizes()
            payload = stream.read(sum(sizes))
            # Extensions of newer writers; behind them gzip checks its sum, so damage shows.
            stream.read(_LONGEST_EXTENSION)
    except (EOFError, zlib.error, OSError) as error:
        raise malformed(path, "its gzip stream is damaged or ends too early") from error
    if len(payload) < sum(sizes):
        raise malformed(
            path, f"its header claims {count:,} Gaussians of {sum(sizes):,} bytes, the file holds {len(payload):,}"
        )
    whole = np.frombuffer(payload, np.uint8)
    return layout, np.split(whole, np.cumsum(sizes)[:-1])


def _decompress_4(data: bytes, path: Path) -> tuple[_Layout, list[Array]]:
    """Header and sections of version 4."""
    if len(data) < _HEADER_4.size:
        raise malformed(path, "it ends within its header")
    _, version, count, degree, bits, _, streams, table = _HEADER_4.unpack_from(data)
    layout = _checked(version, count, degree, bits, range(4, 5), len(data), path)
    sizes = layout.sizes()
    present = [size for size in sizes if size]
    start = table + streams * _STREAM.size
    # An empty section of harmonics may or may not be listed.
    if streams not in (len(present), len(sizes)) or table < _HEADER_4.size or start > len(data):
        raise malformed(path, f"its table of {streams} streams does not fit its header")
    sections: list[Array] = []
    for index, size in enumerate(sizes):
        if index >= streams:
            sections.append(np.zeros(0, np.uint8))
            continue
        packed, unpacked = _STREAM.unpack_from(data, table + index * _STREAM.size)
        if unpacked != size or start + packed > len(data):
            raise malformed(path, f"stream {index} of {unpacked:,} bytes does not fit the {count:,} Gaussians declared")
        sections.append(_zstd(data[start : start + packed], size, index, path))
        start += packed
    return layout, sections


def _zstd(packed: bytes, size: int, index: int, path: Path) -> Array:
    """One zstd frame that must unpack to `size` bytes."""
    if size == 0:
        return np.zeros(0, np.uint8)
    declared = _zstd_content_size(packed)
    if declared is not None and declared != size:
        raise malformed(path, f"stream {index} would unpack to {declared:,} bytes, not {size:,}")
    # Recordings need numcodecs anyway; a package of its own for one version of one format is not worth it.
    from numcodecs import Zstd

    try:
        return np.frombuffer(Zstd().decode(packed, bytearray(size)), np.uint8)
    except (RuntimeError, ValueError) as error:
        raise malformed(path, f"stream {index} is damaged") from error


def _zstd_content_size(frame: bytes) -> int | None:
    """Size a zstd frame declares (RFC 8878, section 3.1.1.1); None where it does not."""
    if len(frame) < 6 or frame[:4] != b"\x28\xb5\x2f\xfd":
        return None
    descriptor = frame[4]
    single = bool(descriptor & 0x20)
    width = (1 if single else 0, 2, 4, 8)[descriptor >> 6]
    if width == 0:
        return None
    start = 5 + (not single) + (0, 1, 2, 4)[descriptor & 3]
    return int.from_bytes(frame[start : start + width], "little") + (256 if width == 2 else 0)


def position_bits(means: Array) -> int:
    """Fractional bits with which the positions fit into 24 bits, as many as do (1..24).

    Raises
    ------
    SplatFormatError
        Where a coordinate is beyond 4 million.
    """
    largest = float(np.max(np.abs(means), initial=0.0))
    fitting = [bits for bits in range(1, _MOST_FRACTION_BITS + 1) if np.round(largest * 2.0**bits) < 1 << 23]
    if not fitting:
        raise SplatFormatError(
            f"a coordinate of {largest:.3g} does not fit a .spz; write .ply, or centre the splat first"
        )
    return fitting[-1]


def write_spz(stream: BinaryIO, gaussians: Gaussians) -> None:
    """Write Gaussians as a .spz of version 3, harmonics beyond degree 3 dropped.

    Parameters
    ----------
    stream
        An open file with a name: gsply writes by name.
    gaussians
        Finite, in the ordinary frame.

    Raises
    ------
    SplatFormatError
        Where a coordinate does not fit (`position_bits`).
    """
    import gsply

    bits = position_bits(gaussians.means)
    stored = turned(gaussians)
    data = gsply.GSData.from_arrays(
        means=stored.means.astype(np.float32),
        scales=logarithm(stored.scales),
        quats=unit_quaternions(stored.quaternions).astype(np.float32),
        opacities=logit(stored.opacities),
        sh0=stored.harmonics[:, 0].astype(np.float32),
        shN=stored.harmonics[:, 1:16].astype(np.float32) if gaussians.sh_degree else None,
        format="ply",
    )
    with np.errstate(over="ignore"):
        gsply.write_spz(stream.name, data, version=3, fractional_bits=bits)
