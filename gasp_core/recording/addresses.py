"""Recordings at addresses: object stores, other machines, whatever fsspec opens (the extra `remote`).

On this machine such a recording is a folder in the cache, which is made the same as what is at the address before it is
read or gone on with, and what is at the address is made the same as it after every frame. What a frame's commit names
is there before the commit is: a connection that is lost leaves whole frames, and at most files that nobody names.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Generator
from pathlib import Path, PurePosixPath
from typing import Any, cast

from gasp_core.errors import RecordingError
from gasp_core.io.atomic import replacing
from gasp_core.io.cache_folders import cache_folder
from gasp_core.processes.scratch import MARK
from gasp_core.recording.address_names import address_of, path_here
from gasp_core.recording.file_systems import file_system, said
from gasp_core.recording.layout import FILES

__all__ = ["Mirror", "address_of", "local_copy", "made_here", "mirrored", "pushing"]

_TAGS = ("ETag", "etag", "md5Hash", "LastModified", "mtime", "created", "updated")
"""Under which file systems say that a file is another one than before."""
_KEYED = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oci", "oss", "r2", "memory"})
"""Where there are keys and no folders."""
_FOLDERS = frozenset({"bodies", "checkpoints", "commits", "frames", "reference", "status"})
_NOTES = ".gasp-mirror.json"
_PROBE = ".gasp-probe"
_ATTEMPTS, _PAUSE = 3, 1.0
"""Times that something is tried, and seconds between the first two of them; then twice as many."""
_LONG = 20.0
"""Seconds after which a file system has tried again by itself."""


def local_copy(path: str | Path) -> Path:
    """Where a recording lies on this machine: of one at an address, its copy, which is brought up to date.

    Raises
    ------
    RecordingError
        Where there is none, or it cannot be read.
    """
    address = address_of(path)
    return path_here(path) if address is None else Mirror(address).fetched()


def made_here(address: str) -> Path:
    """Where a recording that is to be at an address is made; whoever reads what is at the address has another copy."""
    return _in_cache(address, PurePosixPath(file_system(address)[1]).name, "made")


@contextlib.contextmanager
def mirrored(address: str, *, resume: bool, overwrite: bool, here: Path | None = None) -> Generator[Mirror]:
    """A recording that is made on this machine, and is at the address too in the end, however that comes about.

    Parameters
    ----------
    address
        Of the recording.
    resume, overwrite
        As of `gasp_core.simulate`.
    here
        See `Mirror`.

    Raises
    ------
    RecordingError
        See `Mirror`.
    """
    mirror = Mirror(address, made_here(address) if here is None else here)
    if resume and mirror.exists():
        mirror.fetched()
    else:
        mirror.begin(overwrite=overwrite)
    try:
        yield mirror
    except BaseException:
        mirror.push()
        raise
    mirror.finish()


def pushing(mirror: Mirror, recorded: Callable[[int], None] | None) -> Callable[[int], None]:
    """To be told of each frame: it is brought to the address, then `recorded` is told."""

    def pushed(frame: int) -> None:
        mirror.push()
        if recorded is not None:
            recorded(frame)

    return pushed


class Mirror:
    """A recording at an address, and its copy on this machine.

    Parameters
    ----------
    address
        Of the recording.
    here
        Folder of the copy; None: one in the cache.

    Raises
    ------
    RecordingError
        Where nobody opens such addresses, or fsspec or what it takes for them is not installed.
    """

    def __init__(self, address: str, here: Path | None = None) -> None:
        self.address = address
        self._files, self._root = file_system(address)
        self.path = _in_cache(address, PurePosixPath(self._root).name, "read") if here is None else here
        self._pushed: dict[str, tuple[int, int]] = {}
        protocols = self._files.protocol
        self._foldered = _KEYED.isdisjoint([protocols] if isinstance(protocols, str) else protocols)
        self._folders: set[str] = set()
        self.behind = ""
        """Why what is at the address is not the same as here; empty where it is."""

    # --- from there ---------------------------------------------------------------------------------------------------

    def fetched(self) -> Path:
        """The copy, the same as what is there; what is not read again has not changed.

        Raises
        ------
        RecordingError
            Where there is no recording, or it cannot be read.
        """
        there = self._there()
        if "zarr.json" not in there:
            what = "is no recording (no zarr.json in it)" if there else "there is no such recording"
            raise RecordingError(f"{self.address}: {what}")
        known = self._notes()
        # Whatever else is listed there has no business on this machine.
        there = {key: stamp for key, stamp in there.items() if _is_known(key)}
        for key, (size, tag) in there.items():
            file = self.path / key
            if known.get(key) == [size, tag] and file.is_file() and file.stat().st_size == size:
                continue
            file.parent.mkdir(parents=True, exist_ok=True)
            beside = file.with_name(f".{file.name}.{os.getpid()}.part")
            self._get(key, beside)
            beside.replace(file)
        for file in [file for file in self.path.rglob("*") if file.is_file()]:
            if file.relative_to(self.path).as_posix() not in there and file.suffix != ".part":
                file.unlink(missing_ok=True)
        self._note({key: list(value) for key, value in there.items()})
        self._pushed = self._here()
        return self.path

    def _get(self, key: str, beside: Path) -> None:
        self._tried(f"{key} cannot be read", lambda: self._files.get_file(f"{self._root}/{key}", str(beside)))

    def exists(self) -> bool:
        """Whether a recording is there."""
        return "zarr.json" in self._there()

    # --- to there -----------------------------------------------------------------------------------------------------

    def begin(self, *, overwrite: bool) -> Path:
        """The folder for a new recording, empty, once it is known that one may write there.

        Raises
        ------
        RecordingError
            Where something is there that is not to be replaced, or is no recording; where one may not write.
        """
        there = self._there()
        strange = [key for key in there if not _is_known(key)]
        if strange:
            raise RecordingError(f"{self.address}: holds {strange[0]}, which is of no recording")
        # Without it a connection was lost before anything could be read: that is in nobody's way.
        if "zarr.json" in there and not overwrite:
            raise RecordingError(
                f"{self.address}: a recording is there already: resume it, choose another name, or overwrite it"
            )
        probe = f"{self._root}/{_PROBE}"

        def tried() -> None:
            self._make_folder(_PROBE)
            self._files.pipe_file(probe, b"")
            self._files.rm_file(probe)

        self._tried("cannot be written", tried, missing=self._bucket)
        shutil.rmtree(self.path, ignore_errors=True)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # What is replaced is taken away when there is something in its place.
        self._pushed = dict.fromkeys(there, (-1, -1))
        return self.path

    def push(self) -> None:
        """Make what is there the same as here; where the connection is lost `behind` says so, and the next one does it.

        Commits that are no more, or others, go first, and new ones come last.
        """
        try:
            here = self._here()
            changed = [key for key, stamp in here.items() if self._pushed.get(key) != stamp]
            gone = [key for key in self._pushed if key not in here]
            for key in [key for key in (*gone, *changed) if _is_commit(key) and key in self._pushed]:
                self._remove(key)
            for key in sorted(changed, key=_order):
                self._make_folder(key)
                self._files.put_file(str(self.path / key), f"{self._root}/{key}")
                self._pushed[key] = here[key]
            for key in gone:
                self._remove(key)
            self.behind = ""
        except Exception as error:  # file systems raise whatever their libraries do
            self.behind = said(error)
            if not isinstance(error, (PermissionError, FileNotFoundError)):
                self._reopen()

    def finish(self) -> None:
        """The last `push`, tried again where it has to be.

        Raises
        ------
        RecordingError
            Where not all is there; the copy on this machine has it.
        """
        for attempt in range(_ATTEMPTS):
            self.push()
            if not self.behind:
                return
            time.sleep(_PAUSE * 2**attempt)
        raise RecordingError(
            f"{self.address}: is not complete, the connection was lost ({self.behind}): what is there can be"
            " read, and gone on with (gasp run --resume)"
        )

    def _make_folder(self, key: str) -> None:
        """The folder that a file is in, where there are such: in an object store one would make a bucket."""
        folder = f"{self._root}/{key}".rpartition("/")[0]
        if self._foldered and folder not in self._folders:
            self._files.makedirs(folder, exist_ok=True)
            self._folders.add(folder)

    def _remove(self, key: str) -> None:
        if key in self._pushed:
            with contextlib.suppress(FileNotFoundError):
                self._files.rm_file(f"{self._root}/{key}")
            self._pushed.pop(key, None)

    # --- both ---------------------------------------------------------------------------------------------------------

    def _there(self) -> dict[str, tuple[int, str]]:
        """Files at the address: size, and what tells one from another, by their keys."""

        def listed() -> dict[str, Any]:
            self._files.invalidate_cache()
            try:
                return self._walked() if self._foldered else self._files.find(self._root, detail=True)
            except FileNotFoundError:
                return {}

        found: dict[str, tuple[int, str]] = {}
        for name, info in self._tried("cannot be read", listed).items():
            key = str(name).removeprefix("/").removeprefix(self._root.removeprefix("/")).removeprefix("/")
            if info.get("type") == "file" and key and key != _PROBE:
                tag = next((str(info[tag]) for tag in _TAGS if info.get(tag) is not None), "")
                found[key] = (int(info["size"]), tag)
        return found

    def _walked(self) -> dict[str, Any]:
        """All files, of folder after folder: `find` passes over those that cannot be read, and says nothing."""
        found: dict[str, Any] = {}
        folders, seen = [self._root], {self._root}
        while folders:
            folder = folders.pop()
            try:
                entries = self._files.ls(folder, detail=True)
            except FileNotFoundError:
                # Whoever writes there may have taken it away meanwhile, but not all of it.
                if folder == self._root:
                    raise
                continue
            within = {info["name"] for info in entries if info["type"] == "directory"} - seen
            folders += within
            seen |= within
            found |= {info["name"]: info for info in entries if info["type"] != "directory"}
        return found

    def _here(self) -> dict[str, tuple[int, int]]:
        """Files of the copy that are of a recording: size and time of change, by their keys."""
        found: dict[str, tuple[int, int]] = {}
        for file in self.path.rglob("*"):
            key = file.relative_to(self.path).as_posix()
            if _is_known(key) and not key.endswith((".part", ".partial")) and file.is_file():
                state = file.stat()
                found[key] = (state.st_size, state.st_mtime_ns)
        return found

    def _notes(self) -> dict[str, list[Any]]:
        """What the files of the copy were at the address."""
        try:
            return cast("dict[str, list[Any]]", json.loads((self.path.parent / _NOTES).read_text()))
        except (OSError, ValueError):
            return {}

    def _note(self, notes: dict[str, list[Any]]) -> None:
        with replacing(self.path.parent / _NOTES) as stream:
            stream.write(json.dumps(notes).encode())

    @property
    def _bucket(self) -> str:
        """What there must be before anything can be written there; empty where folders are made."""
        return "" if self._foldered else f'there is no bucket "{self._root.strip("/").partition("/")[0]}"'

    def _tried(self, what: str, action: Callable[[], Any], *, missing: str = "") -> Any:
        """Do something, again where the connection is lost; refused, or not there, is what it is.

        What is `missing` where something is not there is told instead of what the file system says.
        """
        for attempt in range(_ATTEMPTS):
            begin = time.monotonic()
            try:
                return action()
            except (PermissionError, FileNotFoundError) as error:
                told = missing if missing and isinstance(error, FileNotFoundError) else said(error)
                raise RecordingError(f"{self.address}: {what}: {told}") from None
            except Exception as error:  # file systems raise whatever their libraries do
                if attempt == _ATTEMPTS - 1 or time.monotonic() - begin > _LONG:
                    raise RecordingError(f"{self.address}: {what}: {said(error)}") from None
                time.sleep(_PAUSE * 2**attempt)
                self._reopen()
        return None

    def _reopen(self) -> None:
        """Call the host again: a file system that keeps a connection has a dead one once it is lost."""
        if self._foldered:
            # Where nobody answers, the file system that was there says so the next time.
            with contextlib.suppress(RecordingError):
                self._files, _ = file_system(self.address, anew=True)


def _is_known(key: str) -> bool:
    """Whether it is a file of a recording, by its name and place."""
    head, _, rest = key.partition("/")
    name = PurePosixPath(key).name
    if not {"", ".", ".."}.isdisjoint(key.split("/")) or "\\" in key:
        return False
    return (head in _FOLDERS if rest else key == "zarr.json") and name != MARK and FILES.fullmatch(name) is not None


def _is_commit(key: str) -> bool:
    return key.startswith("commits/")


def _order(key: str) -> tuple[int, str]:
    """In which files are written: commits after what they name, the status last; before them the header, once what it
    names is there."""
    if key == "zarr.json":
        return 1, key
    if _is_commit(key):
        return 2, key
    return (3 if key.startswith("status") else 0), key


def _in_cache(address: str, name: str, use: str) -> Path:
    cache = cache_folder("recordings")
    if cache is None:
        raise RecordingError(f"{address}: its copy would lie in the cache, which GASP_CACHE has switched off")
    return cache / f"{hashlib.sha256(address.encode()).hexdigest()[:16]}-{use}" / name
