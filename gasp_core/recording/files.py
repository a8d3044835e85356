"""What is read of a recording's folder: regular files in folders of its own, of a bounded length, and checked.

A checksum is the CRC-32 of a file's bytes (`zlib.crc32`). It finds what copying, disks and memory do to a file; it is
no protection from somebody who means harm, for anybody can compute it. What such a file may do, other checks bound.
"""

from __future__ import annotations

import os
import stat
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gasp_core.errors import RecordingError
from gasp_core.io.format_errors import shown

__all__ = ["FileCheck", "TooLargeError", "UnreadableError", "checksum", "files_below", "is_folder", "read_checked"]
__all__ += ["read_file", "short"]

_OPENING = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""Not through a link, and without waiting for the other end of a pipe."""
_MOST_ENTRIES = 10_000_000
"""Of a recording's folders in all."""
_LONGEST_WORDS = 200
_DEEPEST = 8
"""Folders within folders; today's recordings have five."""


class UnreadableError(RecordingError):
    """What cannot be read here and now; nothing of it need be damaged, and nothing of it is to be removed."""


class TooLargeError(UnreadableError):
    """A recording that would take more memory than it may."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileCheck:
    """What a finished file must be: its length [bytes] and, from version 6 on, its checksum."""

    size: int
    checksum: int | None = None

    def fault(self, content: bytes) -> str:
        """What is wrong with a content, for a message; empty where nothing is."""
        if len(content) != self.size:
            return self.other_length(len(content))
        if self.checksum is not None and checksum(content) != self.checksum:
            return "its checksum is another"
        return ""

    def other_length(self, size: int) -> str:
        """What is wrong with a file of another length, for a message."""
        return f"has {size:,} bytes, expected {self.size:,}"


def short(error: BaseException) -> str:
    """What an error says, as a piece of a line; it may quote the file."""
    return shown(" ".join(str(error).split()) or type(error).__name__)[:_LONGEST_WORDS]


def checksum(content: bytes) -> int:
    """CRC-32."""
    return zlib.crc32(content)


def read_file(root: Path, key: str, most: int) -> bytes:
    """The content of a file of a recording.

    Parameters
    ----------
    root
        The recording.
    key
        Path within it, with slashes.
    most
        Bytes that it may have.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    RecordingError
        Where it, or a folder on the way, is a link, a pipe or a device, or it is too long.
    UnreadableError
        Where the system does not let it be read.
    """
    try:
        folder = os.fspath(root)
        *folders, name = key.split("/")
        for part in folders:
            folder = f"{folder}/{part}"
            _expect(stat.S_ISDIR(os.lstat(folder).st_mode), root, key, "lies in what is no folder")
        file = f"{folder}/{name}"
        _expect(stat.S_ISREG(os.lstat(file).st_mode), root, key, "is no file")
        descriptor = os.open(file, _OPENING)
        try:
            found = os.fstat(descriptor)
            # Between the look and the opening it may have become another.
            _expect(stat.S_ISREG(found.st_mode), root, key, "is no file")
            if found.st_size > most:
                raise RecordingError(
                    f"{root}: {key} has {found.st_size:,} bytes, {most:,} are the most for it: refused"
                )
            with open(descriptor, "rb", buffering=0, closefd=False) as stream:
                return stream.read(most + 1)[:most]
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise UnreadableError(f"{root}: {key} cannot be read: {error.strerror or error}") from None


def read_checked(root: Path, key: str, check: FileCheck) -> bytes:
    """The content of a file whose length, and checksum, is known.

    Raises
    ------
    RecordingError
        Where it is missing or another; the message names it.
    UnreadableError
        Where the system does not let it be read.
    """
    try:
        found = os.lstat(root / key)
        # What has another length is not read: it may have any.
        if stat.S_ISREG(found.st_mode) and found.st_size != check.size:
            raise RecordingError(f"{root}: {key} is damaged: {check.other_length(found.st_size)}")
        content = read_file(root, key, check.size)
    except FileNotFoundError:
        raise RecordingError(f"{root}: {key} is damaged: it is missing") from None
    except NotADirectoryError:
        raise RecordingError(f"{root}: {key} is damaged: it lies in what is no folder") from None
    except OSError as error:
        raise UnreadableError(f"{root}: {key} cannot be read: {error.strerror or error}") from None
    fault = check.fault(content)
    if fault:
        raise RecordingError(f"{root}: {key} is damaged: {fault}")
    return content


def is_folder(root: Path, key: str) -> bool:
    """Whether a recording has a folder of that name; a link is none."""
    try:
        return stat.S_ISDIR(os.lstat(root / key).st_mode)
    except OSError:
        return False


def files_below(root: Path, key: str = "") -> Iterator[tuple[str, bool]]:
    """Paths within a recording of all that lies below a folder of it, and whether each is a regular file.

    Folders are not among them, links, pipes and devices are.

    Raises
    ------
    RecordingError
        Where there are more, or deeper ones, than any recording has.
    """
    waiting, count = [key], 0
    while waiting:
        folder = waiting.pop()
        try:
            entries = sorted(os.scandir(root / folder), key=lambda entry: entry.name)
        except OSError as error:
            raise RecordingError(f"{root}: {folder or '.'} cannot be read: {error.strerror or error}") from None
        for entry in entries:
            count += 1
            path = f"{folder}/{entry.name}" if folder else entry.name
            if count > _MOST_ENTRIES or path.count("/") > _DEEPEST:
                raise RecordingError(f"{root}: {folder or '.'} has more, or deeper, folders than a recording: refused")
            if entry.is_dir(follow_symlinks=False):
                waiting.append(path)
            else:
                yield path, entry.is_file(follow_symlinks=False)


def _expect(kind: bool, root: Path, key: str, fault: str) -> None:
    if not kind:
        raise RecordingError(f"{root}: {key} {fault} (a link, a pipe or a device): refused")
