"""Files that are on disk once the call returns, whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Generator
from pathlib import Path

__all__ = ["folder_in_the_making", "remove_leftovers", "replace_file", "sync_file", "sync_folder", "sync_tree"]


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


def _scratch_name(path: Path, process: int) -> Path:
    return path.with_name(f".{path.name}.{process}.part")


@contextlib.contextmanager
def folder_in_the_making(path: Path) -> Generator[Path]:
    """A folder beside `path` that takes its place when the block ends well, and is gone when it does not.

    `path` itself must not exist, or be an empty folder.
    """
    beside = _scratch_name(path, os.getpid())
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    try:
        yield beside
        sync_tree(beside)
        beside.replace(path)
        sync_folder(path.parent)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise


def remove_leftovers(path: Path) -> None:
    """Remove what processes that died while making `path` left beside it."""
    for beside in path.parent.glob(f".{path.name}.*.part"):
        process = beside.name.split(".")[-2]
        if process.isdigit() and not _alive(int(process)):
            shutil.rmtree(beside, ignore_errors=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
