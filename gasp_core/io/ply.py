"""The PLY container: header and tables of numbers, trusted in nothing.

An own reader because those at hand take the header at its word: gsply (0.4.6) allocates what it claims, skips every
property that is not ``float`` without a word, so that the others shift, and does not say what was wrong; plyfile's
licence (GPL) keeps it in the tests.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.io.format_errors import malformed, quoted

__all__ = ["PlyElement", "PlyHeader", "parse_header", "read_table"]

Array = NDArray[Any]

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_LONGEST_HEADER = 1 << 18
_MOST_DIGITS = 15
_MOST_ELEMENTS = 64
_MOST_PROPERTIES = 1024
_LONGEST_WORD = 1 << 10
_PIECE = 1 << 20
"""Bytes of text taken apart at a time: as words they take 30 times as much."""


@dataclass(frozen=True, slots=True)
class PlyElement:
    """One table of a PLY file.

    Parameters
    ----------
    name
        As in the header, ``vertex`` for Gaussians.
    count
        Rows the header claims.
    properties
        Column name to NumPy type without byte order (``f4``); empty string for a list.
    """

    name: str
    count: int
    properties: dict[str, str]


@dataclass(frozen=True, slots=True)
class PlyHeader:
    """What a PLY file says of itself.

    Parameters
    ----------
    order
        ``<``, ``>``, or empty for text.
    elements
        Tables in their order.
    size
        Bytes of the header, its last line included.
    """

    order: str
    elements: tuple[PlyElement, ...]
    size: int

    def element(self, name: str) -> PlyElement | None:
        """The table of that name, if there is one."""
        return next((element for element in self.elements if element.name == name), None)


def parse_header(data: bytes, path: Path) -> PlyHeader:
    """Parse a PLY header.

    Raises
    ------
    SplatFormatError
        Where it is not one, or does not end.
    """
    order: str | None = None
    elements: list[PlyElement] = []
    start = 0
    head = data[:_LONGEST_HEADER]
    while True:
        end = head.find(b"\n", start)
        if end < 0:
            raise malformed(path, "the PLY header has no end_header line")
        line = head[start:end].decode("latin-1").strip()
        start, first = end + 1, start == 0
        words = line.split()
        if first:
            if line != "ply":
                raise malformed(path, "the file does not begin with the line 'ply'")
        elif not words or words[0] in ("comment", "obj_info"):
            continue
        elif words == ["end_header"]:
            break
        elif words[0] == "format" and len(words) == 3:
            if words[1] not in _ORDERS:
                raise malformed(path, f"unknown PLY format {quoted(words[1])}", f"known are {', '.join(_ORDERS)}")
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3:
            elements.append(_element(words[1], words[2], elements, path))
        elif words[0] == "property" and elements:
            _add_property(elements[-1], words[1:], path)
        else:
            raise malformed(path, f"the PLY header has a line that means nothing: {quoted(line)}")
    if order is None:
        raise malformed(path, "the PLY header names no format")
    return PlyHeader(order, tuple(elements), start)


def _element(name: str, count: str, others: list[PlyElement], path: Path) -> PlyElement:
    if not (count.isascii() and count.isdigit() and len(count) <= _MOST_DIGITS):
        raise malformed(path, f"element {quoted(name)} has the impossible count {quoted(count)}")
    if len(others) == _MOST_ELEMENTS:
        raise malformed(path, f"the PLY header has more than {_MOST_ELEMENTS} elements")
    if any(other.name == name for other in others):
        raise malformed(path, f"element {quoted(name)} is declared twice")
    return PlyElement(name, int(count), {})


def _add_property(element: PlyElement, words: list[str], path: Path) -> None:
    is_list = len(words) == 4 and words[0] == "list"
    if not is_list and (len(words) != 2 or words[0] not in _TYPES):
        raise malformed(path, f"element {quoted(element.name)} has an unknown property {quoted(' '.join(words))}")
    if words[-1] in element.properties:
        raise malformed(path, f"property {quoted(words[-1])} of element {quoted(element.name)} is declared twice")
    if len(element.properties) == _MOST_PROPERTIES:
        raise malformed(path, f"element {quoted(element.name)} has more than {_MOST_PROPERTIES} properties")
    element.properties[words[-1]] = "" if is_list else _TYPES[words[0]]


def read_table(data: bytes, header: PlyHeader, name: str, path: Path) -> Array:
    """The rows of one element as a structured array, (count,), after checking that they are there.

    Raises
    ------
    SplatFormatError
        Where the element is missing, empty, behind or made of lists, or longer than the file.
    """
    wanted = header.element(name)
    if wanted is None or not wanted.properties:
        raise malformed(path, f"the PLY has no element {name!r}", "it is no splat: give a trained 3DGS file")
    if wanted.count == 0:
        raise malformed(path, f"element {name!r} is empty", "export it again with Gaussians in it")
    before = header.elements[: header.elements.index(wanted)]
    for element in (*before, wanted):
        if "" in element.properties.values() and element.count:
            raise malformed(
                path, f"element {quoted(element.name)} holds lists, which hide where {name!r} begins", "export without"
            )
    return (_binary_table if header.order else _text_table)(data, header, before, wanted, path)


def _binary_table(
    data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], wanted: PlyElement, path: Path
) -> Array:
    def row(element: PlyElement) -> np.dtype[Any]:
        return np.dtype([(name, header.order + kind) for name, kind in element.properties.items()])

    offset = header.size + sum(element.count * row(element).itemsize for element in before if element.count)
    dtype = row(wanted)
    need, have = wanted.count * dtype.itemsize, max(0, len(data) - offset)
    if need > have:
        raise _too_short(path, wanted, f"{need:,} bytes", f"{have:,}")
    return np.frombuffer(data, dtype, wanted.count, offset)


def _text_table(
    data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], wanted: PlyElement, path: Path
) -> Array:
    skip = sum(element.count * len(element.properties) for element in before)
    columns = len(wanted.properties)
    need, have, parts = wanted.count * columns, 0, list[Array]()
    try:
        for words in _words(data, header.size):
            part = words[max(0, skip) : max(0, skip + need - have)]
            skip -= min(skip, len(words))
            have += len(part)
            parts.append(_numbers(part))
            if have == need:
                break
    except ValueError as error:
        raise malformed(path, f"element {wanted.name!r} holds something that is no number") from error
    if have < need:
        raise _too_short(path, wanted, f"{need:,} numbers", f"{have:,}")
    numbers = np.concatenate(parts).reshape(wanted.count, columns)
    # Keeps the declared precision: text of a float property means the nearest float32.
    dtype = np.dtype([(name, "f8" if kind == "f8" else "f4") for name, kind in wanted.properties.items()])
    table = np.empty(wanted.count, dtype)
    for column, name in enumerate(wanted.properties):
        values = numbers[:, column]
        beyond = np.isfinite(values) & (np.abs(values) > float(np.finfo(dtype[name]).max))
        if beyond.any():
            row = int(np.argmax(beyond))
            raise malformed(
                path, f"property {quoted(name)} of row {row:,} is {values[row]:.3g}, beyond the 3.4e38 of float32"
            )
        table[name] = values
    return table


def _numbers(words: list[bytes]) -> Array:
    """Words as float64; infinite only where they say so."""
    numbers = np.array(words, dtype=np.float64)
    for place in np.flatnonzero(np.isinf(numbers)):
        if b"n" not in words[place].lower():
            raise ValueError("a number beyond 1e308")
    return numbers


def _words(data: bytes, start: int) -> Iterator[list[bytes]]:
    """The words of a text from `start` on, those of a piece at a time."""
    rest = b""
    while start < len(data):
        piece = rest + data[start : start + _PIECE]
        start += _PIECE
        words = piece.split()
        # The last word of a piece may go on in the next one.
        rest = words.pop() if start < len(data) and words and not piece[-1:].isspace() else b""
        if len(rest) > _LONGEST_WORD:
            raise ValueError("a word without end")
        yield words


def _too_short(path: Path, element: PlyElement, need: str, have: str) -> SplatFormatError:
    return malformed(path, f"element {element.name!r} of {element.count:,} rows needs {need}, the file has {have}")
