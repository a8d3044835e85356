"""Solids that were made before: the same Gaussians and options give the same solid.

They are kept in the user's cache folder, and the last few in memory: a run asks for that of an object several times,
and where there is no folder that can be written, in a container, it would be built as often.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import threading
from collections import OrderedDict
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.atomic import replacing
from gasp_core.io.cache_folders import cache_folder
from gasp_core.solid.building import solid_of
from gasp_core.solid.grid import Grid
from gasp_core.solid.options import SolidOptions
from gasp_core.solid.solid import Doubts, Sheets, Solid

__all__ = ["remembered"]

Array = NDArray[Any]

_VERSION = 8
"""Of what `solid_of` makes: another one wherever its numbers change."""
_MOST_BYTES = 256 * 2**20
_MOST_IN_MEMORY = 4
_NAME = re.compile(r"[0-9a-f]{64}\.solid\.npz")
_holding = threading.Lock()
_last: OrderedDict[str, Solid] = OrderedDict()
"""By key, the one that was used last behind the others."""
_DOUBTS = {name: type(value) for name, value in asdict(Doubts()).items()}


def remembered(gaussians: Gaussians, options: SolidOptions | None = None) -> Solid:
    """`solid_of`, from the cache where it is there.

    A folder that cannot be read or written, or a damaged file, costs time and nothing else. The oldest files go once
    there are more than 256 MB of them.
    """
    options = options or SolidOptions()
    key = _key(gaussians, options)
    with _holding:
        found = _last.pop(key, None)
    if found is None:
        found = _kept(key, gaussians, options)
        for array in (found.distance, found.grid.origin, found.sheets.positions, found.sheets.areas):
            array.flags.writeable = False
    with _holding:
        _last[key] = found
        while len(_last) > _MOST_IN_MEMORY:
            _last.popitem(last=False)
    return found


def _kept(key: str, gaussians: Gaussians, options: SolidOptions) -> Solid:
    """From the folder, or built and put there."""
    folder = cache_folder("solids")
    if folder is None:
        return solid_of(gaussians, options)
    path = folder / f"{key}.solid.npz"
    found = _read(path)
    if found is None:
        found = solid_of(gaussians, options)
        with suppress(OSError, SplatFormatError):
            folder.mkdir(parents=True, exist_ok=True)
            with replacing(path) as stream:
                stream.write(_packed(found))
            _forget_oldest(folder)
    return found


def _key(gaussians: Gaussians, options: SolidOptions) -> str:
    digest = hashlib.sha256(f"{_VERSION} {sorted(asdict(options).items())}".encode())
    for array in (gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities):
        digest.update(f"{array.shape} {array.dtype}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _packed(solid: Solid) -> bytes:
    stream = io.BytesIO()
    doubts = np.array([float(value) for value in asdict(solid.doubts).values()])
    numbers = np.array([solid.grid.spacing, solid.detail, solid.sheets.thickness])
    np.savez_compressed(
        stream,
        distance=solid.distance,
        origin=solid.grid.origin,
        numbers=numbers,
        doubts=doubts,
        wall=np.array(solid.wall),
        positions=solid.sheets.positions,
        areas=solid.sheets.areas,
    )
    return stream.getvalue()


def _read(path: Path) -> Solid | None:
    """A solid that is kept; None where there is none that is whole."""
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
        # What is used last is kept longest.
        os.utime(path)
        solid = _solid(arrays)
    except Exception:
        # Anything may be in a damaged file, and nothing of it matters: it is made anew.
        return None
    return solid


def _solid(arrays: dict[str, Array]) -> Solid:
    distance, origin, positions, areas = (arrays[name] for name in ("distance", "origin", "positions", "areas"))
    spacing, detail, thickness = (float(number) for number in arrays["numbers"])
    # Infinite where it is filled.
    wall = float(arrays.pop("wall"))
    x, y, z = distance.shape
    whole = (
        distance.dtype == np.float32
        and all(np.isfinite(array).all() for array in arrays.values())
        and origin.shape == (3,)
        and positions.shape == (len(areas), 3)
        and areas.ndim == 1
        and min(spacing, detail) > 0
        and wall > 0
    )
    if not whole:
        raise ValueError("it is none of the files that are written here")
    doubts = {name: kind(value) for (name, kind), value in zip(_DOUBTS.items(), arrays["doubts"], strict=True)}
    return Solid(
        grid=Grid(origin=origin, spacing=spacing, shape=(x, y, z)),
        distance=distance,
        detail=detail,
        sheets=Sheets(positions=positions, areas=areas, thickness=thickness),
        doubts=Doubts(**doubts),
        wall=wall,
    )


def _forget_oldest(folder: Path) -> None:
    """Remove the solids that were used longest ago, and nothing else, until the others fit."""
    kept = [(file, file.stat()) for file in folder.iterdir() if _NAME.fullmatch(file.name)]
    total = sum(status.st_size for _, status in kept)
    for file, status in sorted(kept, key=lambda entry: entry[1].st_mtime):
        if total <= _MOST_BYTES:
            break
        file.unlink(missing_ok=True)
        total -= status.st_size
