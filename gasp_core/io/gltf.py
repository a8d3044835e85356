"""Binary glTF 2.0: its document, and the numbers of its accessors, held against the bytes that are there.

After the Khronos specification, https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.sog_meta import Meta, parse_meta

__all__ = ["GLB_MAGIC", "Gltf", "optional_integer"]

Array = NDArray[Any]

GLB_MAGIC = b"glTF"

_HEADER, _CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_LONGEST_JSON = 1 << 20
"""Bytes of JSON that any file may have; JSON of nothing but brackets takes 25 times its length of memory."""
_SHARE_OF_JSON = 16
"""A larger file may have one sixteenth of its own."""
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_INDICES = (5121, 5123, 5125)
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_WHERE = "its JSON"


def optional_integer(meta: Meta, name: str) -> int | None:
    """A whole number, not negative; None where there is none."""
    return meta.integer(name) if name in meta.entries else None


class Gltf:
    """A .glb.

    Parameters
    ----------
    data
        The content of the file.
    path
        For messages.

    Raises
    ------
    SplatFormatError
        Where it ends too early, or is of another version; from all methods where an entry is not what belongs there.
    """

    def __init__(self, data: bytes, path: Path) -> None:
        self.path = path
        self.size = len(data)
        if len(data) < _HEADER.size + _CHUNK.size:
            raise malformed(path, "it ends within its header")
        _, version, length = _HEADER.unpack_from(data)
        if version != 2:
            raise malformed(path, f"it is glTF of version {version}", "version 2 is read: export it anew")
        if length > len(data):
            raise malformed(path, f"it ends too early: its header says {length:,} bytes, there are {len(data):,}")
        text, start = self._chunk(data, _HEADER.size, length, _JSON, "JSON")
        if len(text) > max(_LONGEST_JSON, len(data) // _SHARE_OF_JSON):
            raise malformed(path, f"its JSON is {len(text):,} bytes long", "write the splat into a .glb of its own")
        self.document = parse_meta(bytes(text), _WHERE, path)
        self._lists: dict[str, list[Meta]] = {}
        self._binary = memoryview(b"")
        if start + _CHUNK.size <= length:
            self._binary, _ = self._chunk(data, start, length, _BINARY, "numbers")

    def _chunk(self, data: bytes, start: int, length: int, kind: int, what: str) -> tuple[memoryview, int]:
        """Content of the chunk at a place, and where the next one begins."""
        size, found = _CHUNK.unpack_from(data, start)
        start += _CHUNK.size
        if found != kind:
            raise malformed(self.path, f"it has something else where its {what} belongs")
        if start + size > length:
            raise malformed(self.path, f"it ends within its {what}")
        return memoryview(data)[start : start + size], start + size

    def listed(self, name: str) -> list[Meta]:
        """The objects of a list of the document; empty where there is none."""
        if name not in self._lists:
            self._lists[name] = self.document.objects(name) if name in self.document.entries else []
        return self._lists[name]

    def entry(self, name: str, number: int) -> Meta:
        """An object of a list of the document, by its number."""
        entries = self.listed(name)
        if number >= len(entries):
            raise malformed(self.path, f"{_WHERE} names {name}[{number}], there are {len(entries):,}")
        return entries[number]

    def view(self, number: int) -> tuple[memoryview, int | None]:
        """Bytes of a bufferView, and from one row of it to the next, where it says."""
        view = self.entry("bufferViews", number)
        self.refuse(view, "its numbers are packed by", ())
        buffer = view.integer("buffer")
        if buffer != 0 or "uri" in self.entry("buffers", buffer).entries:
            raise malformed(self.path, "its numbers lie outside of it", "export it as one .glb with all in it")
        start, size = optional_integer(view, "byteOffset") or 0, view.integer("byteLength")
        if start + size > len(self._binary):
            raise malformed(
                self.path,
                f"bufferViews[{number}] ends at byte {start + size:,} of {len(self._binary):,} that are there",
            )
        return self._binary[start : start + size], optional_integer(view, "byteStride")

    def count(self, number: int) -> int:
        """Rows of an accessor."""
        return self.entry("accessors", number).integer("count")

    def numbers(self, number: int, types: tuple[str, ...], count: int, what: str) -> Array:
        """Rows of an accessor, (N, 1 to 4) float32, normalised ones in 0..1 or -1..1.

        Parameters
        ----------
        number
            Of the accessor.
        types
            Of which its type must be one, such as "VEC3".
        count
            Rows that it must have; they fit into memory.
        what
            What it holds, for messages.
        """
        accessor = self.entry("accessors", number)
        kind = accessor.entries.get("type")
        if kind not in types:
            raise malformed(self.path, f"its {what} is of type {quoted(kind)}, where {' or '.join(types)} belongs")
        if accessor.integer("count") != count:
            raise malformed(self.path, f"it has {count:,} positions, but {accessor.integer('count'):,} of {what}")
        component = accessor.integer("componentType")
        if component not in _TYPES:
            raise malformed(self.path, f"its {what} has the unknown componentType {component}")
        dtype, width = np.dtype(_TYPES[component]), _WIDTHS[str(kind)]
        sparse = accessor.inner("sparse") if "sparse" in accessor.entries else None
        view = optional_integer(accessor, "bufferView")
        if view is not None:
            start = optional_integer(accessor, "byteOffset") or 0
            rows = self._rows(view, start, count, dtype, width, what)
        elif sparse is not None:
            rows = np.zeros((count, width), dtype)
        else:
            raise malformed(
                self.path,
                f"its {what} has no bufferView, so an extension packs it that is not read",
                "export it unpacked",
            )
        if sparse is not None:
            rows = self._filled(rows, sparse, what)
        values = rows.astype(np.float32)
        if accessor.entries.get("normalized") is True and dtype.kind != "f":
            values /= np.iinfo(dtype).max
            # The lowest of a signed integer is one more than the highest.
            np.maximum(values, -1, out=values)
        return values

    def _rows(self, view: int, start: int, count: int, dtype: np.dtype[Any], width: int, what: str) -> Array:
        content, stride = self.view(view)
        size = dtype.itemsize * width
        stride = size if stride is None else stride
        end = start + (count - 1) * stride + size
        if stride < size or end > len(content):
            raise malformed(
                self.path,
                f"its {what} needs {end:,} bytes in rows of {stride}, bufferViews[{view}] has {len(content):,}",
            )
        return np.ndarray((count, width), dtype, content, start, (stride, dtype.itemsize))

    def _filled(self, rows: Array, sparse: Meta, what: str) -> Array:
        """Rows, some of them replaced."""
        count, indices, values = sparse.integer("count"), sparse.inner("indices"), sparse.inner("values")
        kind = indices.integer("componentType")
        if kind not in _INDICES or not 0 < count <= len(rows):
            raise malformed(
                self.path, f"its {what} has a sparse part of {count:,} rows of {len(rows):,} that is damaged"
            )
        where = optional_integer(indices, "byteOffset") or 0
        chosen = self._rows(indices.integer("bufferView"), where, count, np.dtype(_TYPES[kind]), 1, what)[:, 0]
        if chosen.max() >= len(rows):
            raise malformed(self.path, f"its {what} replaces row {chosen.max():,} of {len(rows):,}")
        where = optional_integer(values, "byteOffset") or 0
        rows = np.array(rows)
        rows[chosen] = self._rows(values.integer("bufferView"), where, count, rows.dtype, rows.shape[1], what)
        return rows

    def refuse(self, meta: Meta, what: str, known: tuple[str, ...]) -> None:
        """Refuse, by name, the extensions of an object that are none of those known."""
        extensions = meta.entries.get("extensions")
        for name in cast("dict[str, Any]", extensions) if isinstance(extensions, dict) else ():
            if name not in known:
                raise malformed(self.path, f"{what} {quoted(name)}, which is not read", "export it without")
