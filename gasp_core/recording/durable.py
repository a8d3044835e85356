"""Files that are on disk once the call returns, whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Generator
from pathlib import Path

from gasp_core.processes.scratch import Scratch, clear_left_over

__all__ = [
    "discard",
    "folder_in_the_making",
    "remove_leftovers",
    "replace_file",
    "sync_file",
    "sync_folder",
    "sync_tree",
]


def sync_file(path: Path) -> None:
    """Flush a file's content to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(path: Path) -> None:
    """Flush a folder's names to the disk, where the system lets one open a folder."""
    if os.name == "nt":
        return
    sync_file(path)


def sync_tree(path: Path) -> None:
    """Flush all files and folders below a folder, and the folder."""
    for parent, _, files in os.walk(path, topdown=False):
        for name in files:
            sync_file(Path(parent) / name)
        sync_folder(Path(parent))


def replace_file(path: Path, content: bytes) -> None:
    """Write a file beside its place and rename it into it: a reader sees the old content or the new, never a part."""
    beside = path.with_name(f"{path.name}.part")
    with beside.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    beside.replace(path)
    sync_folder(path.parent)


@contextlib.contextmanager
def folder_in_the_making(path: Path) -> Generator[Path]:
    """A folder beside `path` that takes its place when the block ends well, and is gone when it does not.

    `path` itself must not exist, or be an empty folder.
    """
    scratch = Scratch(_prefix(path), path.parent)
    beside = scratch.path / path.name
    try:
        beside.mkdir()
        yield beside
        sync_tree(beside)
        beside.replace(path)
        sync_folder(path.parent)
    finally:
        scratch.remove()


def discard(path: Path) -> None:
    """Take a folder out of its place at once, and then remove it: killed meanwhile, the rest is left over."""
    scratch = Scratch(_prefix(path), path.parent)
    try:
        path.replace(scratch.path / path.name)
    finally:
        scratch.remove()


def remove_leftovers(path: Path) -> None:
    """Remove what processes that died while making `path` left beside it."""
    clear_left_over(_prefix(path), path.parent)


def _prefix(path: Path) -> str:
    return f".{path.name}."
