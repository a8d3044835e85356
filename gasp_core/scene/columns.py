"""A number for each Gaussian, as a scene asks for it: a ``.npy``, a property of the object's own ``.ply``, an array."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.errors import SceneError, SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.columns import read_npy_column, read_ply_column
from gasp_core.io.format_errors import shown

__all__ = ["Column", "GivenColumn", "PlyProperty", "column_digest", "column_of", "column_name", "read_column"]

Array = NDArray[Any]

_LONGEST_NAME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class PlyProperty:
    """A scalar property of the object's own ``.ply``, such as ``label``.

    Parameters
    ----------
    property
        Its name in the header.
    """

    property: str

    def __post_init__(self) -> None:
        if not 0 < len(self.property) <= _LONGEST_NAME:
            raise SceneError(f"PlyProperty.property must be the name of a property, found {self.property!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GivenColumn:
    """Numbers from memory.

    Parameters
    ----------
    values : (N,)
        Of each Gaussian of the splat, in its order.
    """

    values: Array

    def __post_init__(self) -> None:
        values = np.array(self.values)
        values = values.astype(np.uint8) if values.dtype == np.bool_ else values
        if values.ndim != 1 or values.dtype.kind not in "iuf":
            raise SceneError(
                f"GivenColumn.values must be one number for each Gaussian, found {values.dtype} of shape {values.shape}"
            )
        values.flags.writeable = False
        object.__setattr__(self, "values", values)


Column = Path | PlyProperty | GivenColumn


def column_of(value: Column | str | ArrayLike) -> Column:
    """What a caller gives for a column: a path, as text too, a property, or an array."""
    if isinstance(value, (Path, PlyProperty, GivenColumn)):
        return value
    return Path(value) if isinstance(value, str) else GivenColumn(values=np.asarray(value))


def column_name(column: Column) -> str:
    """For messages."""
    if isinstance(column, PlyProperty):
        return f'the property "{shown(column.property)}"'
    return f'"{shown(column.name)}"' if isinstance(column, Path) else "the given array"


def column_digest(column: Column) -> str:
    """SHA-256 of what is in it; of a property, which is in the splat itself, nothing.

    Raises
    ------
    SceneError
        Where its file cannot be read.
    """
    if isinstance(column, PlyProperty):
        return ""
    if isinstance(column, GivenColumn):
        digest = hashlib.sha256()
        digest.update(f"{column.values.dtype.str} {column.values.shape};".encode())
        digest.update(np.ascontiguousarray(column.values).tobytes())
        return digest.hexdigest()
    try:
        if column.exists() and not column.is_file():
            raise SceneError(f"{shown(column)}: is no ordinary file: give the numbers in a .npy")
        with column.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise SceneError(f"{shown(column)}: cannot be read: {error.strerror or error}") from None


def read_column(column: Column, splat: Path | Gaussians, count: int, where: str) -> Array:
    """The numbers of a column, (count,), in the type they have.

    Parameters
    ----------
    column
        Where they are.
    splat
        The object's own.
    count
        Its Gaussians.
    where
        Object and key, for messages.

    Raises
    ------
    SceneError
        Where they cannot be read, or are another number.
    """
    try:
        if isinstance(column, Path):
            return read_npy_column(column, count)
        if isinstance(column, PlyProperty):
            if isinstance(splat, Gaussians):
                raise SceneError(
                    f'{where}: Gaussians in memory have no property "{shown(column.property)}": give an array'
                )
            values = read_ply_column(splat, column.property)
        else:
            values = column.values
    except SplatFormatError as error:
        raise SceneError(f"{where}: {error}") from None
    if len(values) != count:
        raise SceneError(
            f"{where}: {column_name(column)} has {len(values):,} numbers, and the splat {count:,} Gaussians:"
            " give one for each Gaussian of the file, in its order"
        )
    return values
