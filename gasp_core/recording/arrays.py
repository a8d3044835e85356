"""Arrays of a recording: Zarr (version 3) with one chain of codecs, little-endian bytes, Blosc and CRC-32C.

Nothing but that chain is read, by this module alone: what a file names elsewhere (pickles, filters, other stores) is
refused, and runs nothing. Sizes are those that the caller expects before a byte is unpacked.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import google_crc32c
import numpy as np
from numpy.typing import NDArray

__all__ = ["CHUNK_ROWS", "ArrayNode", "array_node", "chunk_key", "decoded", "encoded", "pieces", "sound"]
__all__ += ["usual_chunks"]

Array = NDArray[Any]

CHUNK_ROWS = 2**18
"""Of an array that is written once."""
_TYPES = ("bool", "uint8", "int32", "int64", "float32", "float64")
_MOST_ROWS = 1 << 40
_KEYS = frozenset(
    {"shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes", "zarr_format"}
    | {"node_type", "storage_transformers"}
)
_FLAT = {"name": "default", "configuration": {"separator": "."}}
"""One flat folder of chunks, for each folder costs a flush of its own."""
_PACKERS = ("lz4", "zstd")
_SHUFFLES = {"noshuffle": 0, "shuffle": 1, "bitshuffle": 2}
_FORMATS = {1, 4}
"""Blosc's numbers for them, in a chunk."""
_HEAD, _CRC = 16, 4
_MOST_CHUNK = (1 << 31) - _HEAD - 1
"""Bytes that Blosc can pack."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayNode:
    """Shape, type and chunks of an array.

    Parameters
    ----------
    shape, chunks
        Of the array, and of each of its chunks, those at the end included.
    dtype
        One of those that recordings are made of.
    """

    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: np.dtype[Any]

    @classmethod
    def of(cls, node: Mapping[str, Any]) -> ArrayNode:
        """From metadata.

        Raises
        ------
        ValueError
            Where they say anything that no recording says; the message says what.
        """
        if node.get("node_type") != "array" or not node.keys() <= _KEYS or node.get("storage_transformers"):
            raise ValueError("it is no array of a recording")
        name = node.get("data_type")
        if name not in _TYPES:
            raise ValueError(f"a type {_short(name)} is in no recording")
        dtype = np.dtype(name).newbyteorder("<")
        shape = _lengths(node.get("shape"))
        grid = node.get("chunk_grid")
        regular = grid.get("configuration") if isinstance(grid, dict) and grid.get("name") == "regular" else None
        if not isinstance(regular, dict):
            raise ValueError("its chunks are no regular grid")
        chunks = _lengths(regular.get("chunk_shape"))
        if len(chunks) != len(shape) or not all(chunks) or math.prod(chunks) * dtype.itemsize > _MOST_CHUNK:
            raise ValueError("its chunks do not belong to its shape")
        if node.get("chunk_key_encoding") != _FLAT:
            raise ValueError("its chunks are not named as in a recording")
        if node.get("fill_value") not in (0, False):
            raise ValueError("it is not filled with zeros")
        _check_codecs(node.get("codecs"), dtype)
        return cls(shape=shape, chunks=chunks, dtype=dtype)

    @property
    def size(self) -> int:
        """Bytes of all its values."""
        return math.prod(self.shape) * self.dtype.itemsize

    @property
    def chunk_size(self) -> int:
        """Bytes of a chunk, unpacked."""
        return math.prod(self.chunks) * self.dtype.itemsize

    def places(self) -> Iterable[tuple[int, ...]]:
        """Numbers of all its chunks."""
        return itertools.product(*(range(-(-length // step)) for length, step in zip(self.shape, self.chunks)))

    def slices(self, place: tuple[int, ...]) -> tuple[slice, ...]:
        """What of the array a chunk holds."""
        return tuple(
            slice(number * step, min((number + 1) * step, length))
            for number, step, length in zip(place, self.chunks, self.shape)
        )


def usual_chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Chunks of an array that is written once."""
    return (max(min(shape[0], CHUNK_ROWS), 1), *(max(length, 1) for length in shape[1:]))


def array_node(
    node: ArrayNode, attributes: Mapping[str, Any] | None = None, packer: str = "zstd", shuffle: str = "shuffle"
) -> dict[str, Any]:
    """Metadata of an array."""
    size = node.dtype.itemsize
    name = node.dtype.name
    bytes_codec: dict[str, Any] = {"name": "bytes"} | ({"configuration": {"endian": "little"}} if size > 1 else {})
    blosc = {"typesize": size, "cname": packer, "clevel": 1, "shuffle": shuffle, "blocksize": 0}
    return {
        "shape": list(node.shape),
        "data_type": name,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(node.chunks)}},
        "chunk_key_encoding": _FLAT,
        "fill_value": False if name == "bool" else 0.0 if name.startswith("float") else 0,
        "codecs": [bytes_codec, {"name": "blosc", "configuration": blosc}, {"name": "crc32c"}],
        "zarr_format": 3,
        "node_type": "array",
        "storage_transformers": [],
        "attributes": dict(attributes or {}),
    }


def pieces(values: Array, chunks: tuple[int, ...] | None = None) -> tuple[ArrayNode, dict[str, Array]]:
    """An array that is written once, as its metadata and its chunks by the names of their files.

    `chunks` is their shape, the usual one where it is None.
    """
    chunks = chunks or usual_chunks(values.shape)
    node = ArrayNode(shape=values.shape, chunks=chunks, dtype=values.dtype.newbyteorder("<"))
    return node, {chunk_key(place): _padded(values[node.slices(place)], node.chunks) for place in node.places()}


def chunk_key(place: Iterable[int]) -> str:
    """File of a chunk in its array."""
    return ".".join(["c", *(str(number) for number in place)])


def encoded(values: Array, packer: str = "zstd", shuffle: str = "shuffle") -> bytes:
    """A chunk as the bytes of its file."""
    import numcodecs.blosc as blosc  # pyright: ignore[reportMissingImports]

    whole = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    packed: Any = blosc.compress(whole.reshape(-1), packer.encode(), 1, _SHUFFLES[shuffle])
    # The checksum is the outermost codec: damage is found before anything is unpacked.
    return packed + _crc(packed)


def decoded(content: bytes, node: ArrayNode) -> Array:
    """A chunk from the bytes of its file, which are known to be `sound`, or to have their checksum.

    Raises
    ------
    ValueError
        Where they would unpack to anything but a chunk of the array.
    """
    import numcodecs.blosc as blosc  # pyright: ignore[reportMissingImports]

    if len(content) < _HEAD + _CRC:
        raise ValueError("it is too short for a chunk")
    packed = np.frombuffer(content, dtype=np.uint8)[:-_CRC]
    size, block, held = (int.from_bytes(content[first : first + 4], "little") for first in (4, 8, 12))
    if (
        packed[0] != 2
        or packed[2] >> 5 not in _FORMATS
        or packed[3] != node.dtype.itemsize
        or size != node.chunk_size
        or held != len(packed)
        or not 0 < block <= max(size, 1)
    ):
        raise ValueError("it would not unpack to a chunk of its array")
    values = np.empty(node.chunks, dtype=node.dtype)
    try:
        blosc.decompress(packed, values.reshape(-1).view(np.uint8))
    except RuntimeError:
        raise ValueError("it cannot be unpacked") from None
    if node.dtype.name == "bool" and values.view(np.uint8).max(initial=0) > 1:
        raise ValueError("it has truths that are neither true nor false")
    return values


def sound(content: bytes) -> bool:
    """Whether a chunk ends with the CRC-32C of what is before: all that versions before 6 know of it."""
    packed = np.frombuffer(content, dtype=np.uint8)[:-_CRC]
    return len(content) >= _HEAD + _CRC and _crc(packed) == content[-_CRC:]


def _crc(packed: Any) -> bytes:
    return int(google_crc32c.value(packed)).to_bytes(4, "little")


def _padded(values: Array, chunks: tuple[int, ...]) -> Array:
    """As large as every chunk is, zeros at the end."""
    if values.shape == chunks:
        return values
    whole = np.zeros(chunks, dtype=values.dtype)
    whole[tuple(slice(0, length) for length in values.shape)] = values
    return whole


def _lengths(value: Any) -> tuple[int, ...]:
    lengths: list[Any] = value if isinstance(value, list) else []
    if not 1 <= len(lengths) <= 3 or not all(type(length) is int and 0 <= length < _MOST_ROWS for length in lengths):
        raise ValueError("its shape is of no array of a recording")
    return tuple(lengths)


def _check_codecs(codecs: Any, dtype: np.dtype[Any]) -> None:
    """Refuse all but the one chain that recordings are written with."""
    plain = {"name": "bytes"}
    little = plain | {"configuration": {"endian": "little"}}
    if not isinstance(codecs, list) or len(codecs) != 3 or not all(isinstance(codec, dict) for codec in codecs):
        raise ValueError("its codecs are not those of a recording")
    first, blosc, last = codecs
    how = blosc.get("configuration")
    fine = (
        (first == little or (first == plain and dtype.itemsize == 1))
        and blosc.keys() == {"name", "configuration"}
        and blosc["name"] == "blosc"
        and isinstance(how, dict)
        and how.keys() == {"typesize", "cname", "clevel", "shuffle", "blocksize"}
        and how["typesize"] == dtype.itemsize
        and how["cname"] in _PACKERS
        and how["shuffle"] in tuple(_SHUFFLES)
        and last in ({"name": "crc32c"}, {"name": "crc32c", "configuration": {}})
    )
    if not fine:
        raise ValueError(f"its codecs are not those of a recording ({_short([codec.get('name') for codec in codecs])})")


def _short(value: Any) -> str:
    return ascii(value)[:60]
