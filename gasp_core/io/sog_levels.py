"""Streamed SOG: a folder of SOGs, several levels of detail in chunks, and lod-meta.json, which says what is where.

A level is all Gaussians of its chunks, which hold nothing else. Boxes and errors tell a viewer what to load when, and
the environment is a far background: neither is of interest here.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gasp_core.gaussians import Gaussians
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_too_large
from gasp_core.io.sog import read_sog_folder
from gasp_core.io.sog_meta import META, Meta, parse_meta

__all__ = ["INDEX", "is_set_of_levels", "level_counts", "read_level"]

INDEX = "lod-meta.json"
_LONGEST_INDEX = 1 << 22
"""Bytes: some 300,000 leaves of a few levels."""
_MOST_BASES = 16
_DEEPEST = 100
"""Of a tree that halves: more than any number of Gaussians takes."""


def is_set_of_levels(path: Path) -> bool:
    """Whether a path is that of an index, or of the folder of one."""
    return path.name == INDEX or (path.is_dir() and (path / INDEX).is_file() and not (path / META).exists())


def level_counts(path: Path) -> tuple[int, ...]:
    """Gaussians of each level, the finest first.

    Raises
    ------
    SplatFormatError
        Where the index is missing or damaged.
    """
    runs = _runs(_read_index(path), path)
    return tuple(sum(count for chunk in level.values() for _, count in chunk) for level in runs)


def read_level(path: Path, level: int) -> tuple[Gaussians, int]:
    """All Gaussians of one level, chunk by chunk, and how many levels there are.

    Parameters
    ----------
    path
        The index, or its folder.
    level
        0 the finest.

    Raises
    ------
    SplatFormatError
        Where there is no such level, index or chunks are missing or damaged, or chunks hold what the index does not
        say.
    """
    index = _read_index(path)
    runs = _runs(index, path)
    if not 0 <= level < len(runs):
        raise malformed(path, f"it has levels 0 to {len(runs) - 1}, not {level}", "choose one of them")
    chunks = runs[level]
    if not chunks:
        raise malformed(path, f"its level {level} is empty", "choose another")
    names, folder = _file_names(index, path), _folder(path)
    folders: dict[int, Path] = {}
    for file in sorted(chunks):
        if file >= len(names):
            raise malformed(path, f"{INDEX} names file {file} of {len(names)}")
        folders[file] = folder / names[file]
    total = sum(count for chunk in chunks.values() for _, count in chunk)
    held = sum(part.stat().st_size for one in folders.values() if one.is_dir() for part in one.iterdir())
    # Before any of them is unpacked: each alone may be bearable.
    refuse_too_large(path, held, total, _MOST_BASES)
    found: list[Gaussians] = []
    for file, chunk in folders.items():
        if not (chunk / META).is_file():
            raise malformed(path, f"it has lost its file {quoted(names[file])}/{META}", "copy the whole folder again")
        gaussians, _ = read_sog_folder(chunk)
        _check_runs(chunks[file], len(gaussians), names[file], path)
        found.append(gaussians)
    return _joined(found), len(runs)


def _folder(path: Path) -> Path:
    return path.parent if path.name == INDEX else path


def _read_index(path: Path) -> Meta:
    with (_folder(path) / INDEX).open("rb") as stream:
        text = stream.read(_LONGEST_INDEX + 1)
    if len(text) > _LONGEST_INDEX:
        raise malformed(path, f"{INDEX} is longer than {_LONGEST_INDEX:,} bytes", "is it what it is called?")
    index = parse_meta(text, INDEX, path)
    # Written by nobody before there was a version.
    if index.entries.get("version", 1) != 1:
        raise malformed(path, f"{INDEX} is of an unknown version", "version 1 is read")
    return index


def _runs(index: Meta, path: Path) -> list[dict[int, list[tuple[int, int]]]]:
    """For each level, and each of its files, offsets and counts of the Gaussians of leaves."""
    levels = index.integer("lodLevels")
    if not 0 < levels <= _DEEPEST:
        raise index.wrong("lodLevels", f"a number from 1 to {_DEEPEST}")
    runs: list[dict[int, list[tuple[int, int]]]] = [defaultdict(list) for _ in range(levels)]
    for leaf in _leaves(index.inner("tree"), path):
        for name in leaf.entries:
            if not (name.isascii() and name.isdigit() and len(name) < 4 and int(name) < levels):
                raise malformed(path, f"{INDEX} has a level {quoted(name)}, its levels are 0 to {levels - 1}")
            run = leaf.inner(name)
            runs[int(name)][run.integer("file")].append((run.integer("offset"), run.integer("count")))
    return runs


def _leaves(tree: Meta, path: Path) -> Iterator[Meta]:
    """The levels of every leaf; no deeper than a sound tree is."""
    waiting = [(tree, 0)]
    while waiting:
        node, depth = waiting.pop()
        if "lods" in node.entries:
            yield node.inner("lods")
        elif depth == _DEEPEST:
            raise malformed(path, f"the tree of {INDEX} is more than {_DEEPEST} nodes deep")
        else:
            waiting += [(child, depth + 1) for child in reversed(node.objects("children"))]


def _file_names(index: Meta, path: Path) -> list[str]:
    """Folders of the chunks, below that of the index."""
    names: list[str] = []
    for entry in index.array("filenames"):
        parts = entry.split("/") if isinstance(entry, str) else []
        # Neither up, nor absolute, nor a drive, nor a separator of another system.
        if len(parts) < 2 or parts[-1] != META or any(p in ("", ".", "..") or set(p) & set("\\:\0") for p in parts):
            raise malformed(path, f"{INDEX} names the file {quoted(str(entry))}, which is no {META} below its folder")
        names.append("/".join(parts[:-1]))
    return names


def _check_runs(runs: list[tuple[int, int]], count: int, name: str, path: Path) -> None:
    """Leaves share the Gaussians of a chunk out, all of them, each once."""
    end = 0
    for offset, length in sorted(runs):
        if offset != end:
            break
        end = offset + length
    else:
        if end == count:
            return
    raise malformed(path, f"{quoted(name)} holds {count:,} Gaussians, which {INDEX} does not share out one by one")


def _joined(found: list[Gaussians]) -> Gaussians:
    """One after the other, their harmonics filled up with zeros."""
    most = max(part.harmonics.shape[1] for part in found)

    def joined(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in found])

    harmonics = [np.pad(part.harmonics, ((0, 0), (0, most - part.harmonics.shape[1]), (0, 0))) for part in found]
    return Gaussians(
        means=joined("means"),
        quaternions=joined("quaternions"),
        scales=joined("scales"),
        opacities=joined("opacities"),
        harmonics=np.concatenate(harmonics),
    )
