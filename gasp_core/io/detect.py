"""Which format a file has: by its first bytes, then by its name."""

from __future__ import annotations

import stat
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_unread
from gasp_core.io.near_files import did_you_mean_file

__all__ = ["INDICES", "READ", "WRITTEN", "read", "whole", "write"]

READ = (
    *(".ply", ".compressed.ply", ".splat", ".spz", ".sog", "a folder with meta.json or lod-meta.json"),
    *(".glb", ".usdc, .usda, .usd or .usdz"),
)
WRITTEN = (".ply", ".splat", ".spz", ".sog", ".glb", ".usdc")

INDICES = ("meta.json", "lod-meta.json")
"""Files that name others beside and below them."""

_FOLDER = 'name a file, or the folder of one splat (a folder of frames wants motion = { kind = "frames" } in a scene)'
_TRAINING = (
    "name the point_cloud.ply of an iteration in it; what D-MiSo has trained to move"
    ' wants motion = { kind = "d-miso" } in a scene'
)
_HEAD = 128
"""Bytes that tell a stage of USD, which USD reads itself."""
_LFS = b"version https://git-lfs"
_ANNEX = b"/annex/objects/"


def whole(path: Path) -> Path:
    """All that a path stands for: the folder, where it is but the index of one."""
    return path.parent if path.name in INDICES else path


def read(path: str | PathLike[str], *, flat_axis: int = 2, level: int = 0) -> tuple[Gaussians, str]:
    """Gaussians of a file or folder, and the name of its format.

    Raises
    ------
    SplatFormatError
        As `gasp_core.io.read_splat`.
    """
    if flat_axis not in (0, 1, 2):
        raise SplatFormatError(f"flat_axis is {flat_axis}; give 0, 1 or 2")
    if "\0" in fspath(path):
        raise malformed(path, "a path cannot hold a null character", "check the path")
    try:
        return _read(Path(fspath(path)), flat_axis, level)
    except OSError as error:
        near = did_you_mean_file(Path(fspath(path))) if isinstance(error, FileNotFoundError) else ""
        remedy = f"check the path{near}" if near else "check the path and its permissions"
        raise malformed(path, f"cannot be read: {error.strerror or error}", remedy) from error
    except MemoryError as error:
        raise malformed(path, "does not fit into memory", "give a smaller splat, or a machine with more") from error


def _read(path: Path, flat_axis: int, level: int) -> tuple[Gaussians, str]:
    from gasp_core.io.gltf import GLB_MAGIC
    from gasp_core.io.sog import ZIP_MAGIC, read_sog_folder, read_sog_zip
    from gasp_core.io.sog_levels import is_set_of_levels, read_level
    from gasp_core.io.spz import GZIP_MAGIC, SPZ_MAGIC, read_spz
    from gasp_core.io.usd import READ_SUFFIXES, is_usd

    found = path.stat()
    if is_set_of_levels(path):
        gaussians, levels = read_level(path, level)
        return gaussians, f"streamed sog, level {level} of 0 to {levels - 1}"
    if level != 0:
        raise malformed(path, f"is of one level, there is no level {level}", "leave the level out")
    mode = found.st_mode
    if stat.S_ISDIR(mode):
        if (path / "point_cloud").is_dir():
            raise malformed(path, "is a folder of training, so no splat", _TRAINING)
        if not (path / "meta.json").is_file():
            raise malformed(path, "is a folder without meta.json or lod-meta.json, so no SOG", _FOLDER)
        gaussians, version = read_sog_folder(path)
        return gaussians, f"sog v{version} folder"
    if not stat.S_ISREG(mode):
        raise malformed(path, "is no ordinary file", "name a file or a folder")
    if path.suffix.lower() == ".json":
        if path.name != "meta.json":
            raise malformed(path, "is no splat", f"name the folder, or the {' or '.join(INDICES)}, of one splat")
        gaussians, version = read_sog_folder(path.parent)
        return gaussians, f"sog v{version} folder"

    refuse_unread(path, found.st_size)
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    if is_usd(head):
        from gasp_core.io.usd_reading import read_usd

        return read_usd(path, found.st_size)
    data = path.read_bytes()
    if not data:
        raise malformed(path, "is empty", "fetch or export it again")
    if data.startswith(_LFS):
        raise malformed(path, "is a Git LFS pointer, not the splat itself", "run `git lfs pull` where it came from")
    if len(data) < 1024 and _ANNEX in data:
        raise malformed(path, "is a git-annex pointer, not the splat itself", "run `git annex get` where it came from")
    if data[:4] in (b"ply\n", b"ply\r"):
        return _read_ply(data, path, flat_axis)
    if data.startswith(ZIP_MAGIC):
        gaussians, version = read_sog_zip(data, path)
        return gaussians, f"sog v{version}"
    if data.startswith(GLB_MAGIC):
        from gasp_core.io.glb_reading import read_glb

        return read_glb(data, path)
    if data.startswith((GZIP_MAGIC, SPZ_MAGIC)):
        return read_spz(data, path), "spz"
    if path.suffix.lower() == ".splat":
        from gasp_core.io.dot_splat import read_dot_splat

        return read_dot_splat(data, path), "splat"
    if path.suffix.lower() in (".obj", ".stl"):
        raise malformed(path, "is no splat", "of a mesh `gasp convert` makes one")
    if path.suffix.lower() == ".gltf":
        raise malformed(path, "is glTF as text, whose numbers lie beside it", "export it as one .glb")
    if path.suffix.lower() in (".ply", ".spz", ".sog", ".glb", *READ_SUFFIXES):
        raise malformed(path, f"does not begin as a {path.suffix.lower()} does")
    raise malformed(
        path, f"is of no known kind ({quoted(path.suffix or 'no suffix')})", f"splats are read from {', '.join(READ)}"
    )


def _read_ply(data: bytes, path: Path, flat_axis: int) -> tuple[Gaussians, str]:
    from gasp_core.io.compressed_ply import is_compressed, read_compressed_ply
    from gasp_core.io.inria import read_inria
    from gasp_core.io.ply import parse_header

    header = parse_header(data, path)
    if is_compressed(header):
        return read_compressed_ply(data, header, path), "compressed ply"
    return read_inria(data, header, path, flat_axis), "ply"


def write(path: str | PathLike[str], gaussians: Gaussians) -> None:
    """Write Gaussians in the format the suffix names.

    Raises
    ------
    SplatFormatError
        As `gasp_core.io.write_splat`.
    """
    from gasp_core.io.atomic import replacing
    from gasp_core.io.dot_splat import write_dot_splat
    from gasp_core.io.glb import write_glb
    from gasp_core.io.inria import write_inria
    from gasp_core.io.sog_writing import write_sog
    from gasp_core.io.spz import write_spz
    from gasp_core.io.usd import USD_SUFFIXES, write_usd

    if not (isinstance(path, str | PathLike) and isinstance(gaussians, Gaussians)):  # pyright: ignore[reportUnnecessaryIsInstance]
        found = f"{type(path).__name__} and {type(gaussians).__name__}"
        raise SplatFormatError(f"write_splat takes a path and Gaussians, in this order, found {found}")
    target = Path(fspath(path))
    suffix = target.suffix.lower()
    if suffix not in (*WRITTEN, *USD_SUFFIXES) or target.name.lower().endswith(".compressed.ply"):
        asked = ".compressed.ply" if suffix == ".ply" else suffix or target.name
        raise malformed(target, f"{quoted(asked)} cannot be written", f"choose one of {', '.join(WRITTEN)}")
    if not len(gaussians):
        raise malformed(target, "there are no Gaussians to write", "check what was selected")
    if suffix != ".ply":
        _refuse_unstorable(target, gaussians)
    if suffix in USD_SUFFIXES:
        write_usd(target, gaussians)
        return
    writers = {
        ".ply": write_inria,
        ".splat": write_dot_splat,
        ".spz": write_spz,
        ".sog": write_sog,
        ".glb": write_glb,
    }
    with replacing(target) as stream:
        writers[suffix](stream, gaussians)


def _refuse_unstorable(path: Path, gaussians: Gaussians) -> None:
    """Bytes hold no NaN: a file of bytes would turn one into some other number without a word."""
    arrays = (gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities, gaussians.harmonics)
    finite = np.ones(len(gaussians), bool)
    for array in arrays:
        finite &= np.isfinite(array).reshape(len(gaussians), -1).all(axis=1)
    if not finite.all():
        row, bad = int(np.argmin(finite)), int((~finite).sum())
        raise malformed(
            path,
            f"{bad:,} Gaussians are not finite, the first is {row:,}",
            "drop them, or write .ply, which can hold them",
        )
