"""A number for each Gaussian, out of a ``.npy`` or of a property of the splat's own ``.ply``; trusted in nothing."""

from __future__ import annotations

from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_unread
from gasp_core.io.ply import PlyHeader, parse_header, read_table

__all__ = ["map_npy", "own_columns", "read_npy_column", "read_ply_column"]

Array = NDArray[Any]

_NUMBERS = "iuf"
_UNREADABLE = (ValueError, TypeError, LookupError, EOFError, OverflowError, SyntaxError, TokenError, RecursionError)
"""What NumPy raises of a header that is none."""
_SAVE = "save it with numpy.save, a whole number or a float for each Gaussian"
_OF_A_SPLAT = ("f_dc_", "f_rest_", "scale_", "rot_", "packed_")
_OF_A_VERTEX = {"x", "y", "z", "nx", "ny", "nz", "opacity", "red", "green", "blue", "alpha"}


def read_npy_column(path: Path, count: int) -> Array:
    """Numbers (count,) of a ``.npy``, of whatever type it has; truth values come as 0 and 1.

    Parameters
    ----------
    path
        The file.
    count
        Gaussians that it is to have a number for. Held against its header before anything else of it is read.

    Raises
    ------
    SplatFormatError
        Where it cannot be read, is none, or has numbers of another kind or another number of them.
    """
    mapped = map_npy(path, _SAVE)
    if mapped.shape not in ((count,), (count, 1)):
        raise malformed(
            path,
            f"has the shape {mapped.shape}, and the splat {count:,} Gaussians",
            f"give one number for each Gaussian of the file, in its order: shape ({count},)",
        )
    try:
        return np.array(mapped).reshape(count)
    except MemoryError:
        raise malformed(path, "does not fit into memory", "give a machine with more") from None


def map_npy(path: Path, remedy: str) -> Array:
    """The numbers of a ``.npy``, of which no more than the header is read; truth values as 0 and 1.

    Parameters
    ----------
    path
        The file.
    remedy
        What to do where it is none.

    Raises
    ------
    SplatFormatError
        Where it cannot be read, is none, or has numbers of another kind.
    """
    try:
        if path.exists() and not path.is_file():
            raise malformed(path, "is no ordinary file", remedy)
        # Of Python's own objects it knows nothing.
        mapped: Array = np.lib.format.open_memmap(path, mode="r")
        if mapped.dtype == np.bool_:
            mapped = mapped.view(np.uint8)
        if mapped.dtype.kind not in _NUMBERS:
            raise malformed(path, f"holds {quoted(mapped.dtype)}, no numbers", remedy)
    except OSError as error:
        raise malformed(path, f"cannot be read: {error.strerror or error}", "check the path") from None
    except MemoryError:
        raise malformed(path, "does not fit into memory", "give a machine with more") from None
    except _UNREADABLE:
        raise malformed(path, "is no .npy of numbers, or not whole", remedy) from None
    return mapped


def read_ply_column(path: Path, name: str) -> Array:
    """A scalar property of the Gaussians of a ``.ply``, (N,).

    Raises
    ------
    SplatFormatError
        Where the file is no ``.ply``, has no such property (those that it has are named), or is not whole.
    """
    data = _read(path)
    if data[:4] not in (b"ply\n", b"ply\r"):
        raise malformed(path, f"is no .ply, so it has no property {quoted(name)}", "give the numbers in a .npy")
    header = parse_header(data, path)
    vertex = header.element("vertex")
    if vertex is None or name not in vertex.properties:
        own = ", ".join(quoted(each) for each in _own_properties(header)[:8])
        raise malformed(path, f"has no property {quoted(name)}", f"beside those of any splat it has {own or 'none'}")
    return _native(read_table(data, header, "vertex", path)[name])


def own_columns(path: Path) -> dict[str, Array]:
    """Scalar properties of a ``.ply``'s Gaussians that are none of any splat's: labels, fields of materials.

    Raises
    ------
    SplatFormatError
        Where the file is no ``.ply``, or not whole.
    """
    data = _read(path)
    header = parse_header(data, path)
    names = _own_properties(header)
    table = read_table(data, header, "vertex", path) if names else None
    return {} if table is None else {name: _native(table[name]) for name in names}


def _read(path: Path) -> bytes:
    try:
        if not path.is_file():
            raise malformed(path, "is no file, and has no properties", "give the numbers in a .npy")
        refuse_unread(path, path.stat().st_size)
        return path.read_bytes()
    except OSError as error:
        raise malformed(path, f"cannot be read: {error.strerror or error}", "check the path") from None


def _native(column: Array) -> Array:
    """A copy in the order of bytes of the machine."""
    return column.astype(column.dtype.newbyteorder("="))


def _own_properties(header: PlyHeader) -> list[str]:
    vertex = header.element("vertex")
    return [
        name
        for name in (vertex.properties if vertex else {})
        if name not in _OF_A_VERTEX and not name.startswith(_OF_A_SPLAT)
    ]
