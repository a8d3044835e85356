"""What travels to the worker of a cluster, and what it does there.

A parcel holds a run and, of each file that its scene names, where it lies, its size and its digest. Where a worker sees
that file, it reads it; else it looks in the cache of its machine, by the digest, and asks for what is not there: the
driver sends it then, once to each machine.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import shutil
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gasp_core.errors import BackendError
from gasp_core.io.cache_folders import cache_folder
from gasp_core.io.detect import whole
from gasp_core.processes.scratch import scratch_folder
from gasp_core.recording.writer import refuse_existing
from gasp_core.scene.files import files_of, with_files
from gasp_core.studies.runs.outcome import Limits, Outcome, Run, RunStatus
from gasp_core.studies.runs.supervisor import keep, surroundings

__all__ = [
    "Missing",
    "Parcel",
    "Source",
    "begun_now",
    "carry_out_parcel",
    "on_worker",
    "outcome_of",
    "packed",
    "parcels_of",
]

_NAME = re.compile(r"[0-9a-f]{64}|\.[0-9a-f]{12}-\w+")
_KEPT = 30 * 86_400.0
"""Seconds for which a source is kept that nobody uses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A file, or a folder, that scenes name.

    Parameters
    ----------
    path
        Where the driver sees it.
    stamp
        Of each file in it: name, size and time of change, by which a worker knows it again.
    digest
        SHA-256 of its content.
    folder
        Whether it is one.
    """

    path: Path
    stamp: tuple[tuple[str, int, int], ...]
    digest: str
    folder: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Parcel:
    """A run as it travels.

    Parameters
    ----------
    run
        With absolute paths.
    sources
        Of its scene.
    limits
        That it has.
    fresh
        Whether nothing was where its recording goes: what is there then, a worker has left that was lost.
    """

    run: Run
    sources: tuple[Source, ...]
    limits: Limits
    fresh: bool = False

    def packed_source(self, digest: str) -> bytes:
        """One of its sources, to be sent."""
        return packed(next(source.path for source in self.sources if source.digest == digest))


@dataclass(frozen=True, slots=True)
class Missing:
    """Digests of sources that a worker has not got."""

    digests: tuple[str, ...]


def parcels_of(runs: Sequence[Run], limits: Limits) -> list[Parcel]:
    """Runs for workers that may be anywhere; each source is looked at once.

    Raises
    ------
    BackendError
        Where a source cannot be read.
    """
    known: dict[Path, Source] = {}
    parcels: list[Parcel] = []
    for run in runs:
        paths = [whole(path) for path in files_of(run.scene)]
        for path in paths:
            if path not in known:
                known[path] = _source(path)
        parcels.append(
            Parcel(
                run=run,
                sources=tuple(known[path] for path in dict.fromkeys(paths)),
                limits=limits,
            )
        )
    return parcels


def begun_now(parcels: Sequence[Parcel]) -> list[Parcel]:
    """The same, as the first of them is about to begin: what is not there yet, a lost worker may leave."""
    return [replace(parcel, fresh=not parcel.run.out.exists()) for parcel in parcels]


def packed(path: Path) -> bytes:
    """A file, or all files of a folder, as one .zip."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED, strict_timestamps=False) as archive:
        for name, file in _files(path):
            archive.write(file, name)
    return stream.getvalue()


def carry_out_parcel(parcel: Parcel, sent: Mapping[str, bytes], wanted: Callable[[], bool]) -> Outcome | Missing:
    """Make a run, on a worker; or say what it lacks.

    Parameters
    ----------
    parcel
        The run.
    sent
        Sources that came along, packed, by digest.
    wanted
        See `keep`.
    """
    places: dict[Path, Path] = {}
    missing: list[str] = []
    for source in parcel.sources:
        place = source.path if _is_there(source) else _cached(source, sent.get(source.digest))
        if place is None:
            missing.append(source.digest)
        else:
            places[source.path] = place
    if missing:
        return Missing(tuple(missing))
    if parcel.fresh and parcel.run.keep and refuse_existing(parcel.run.out, overwrite=True):
        shutil.rmtree(parcel.run.out)
    run = replace(parcel.run, scene=with_files(parcel.run.scene, lambda path: _moved(path, places)))
    with scratch_folder("gasp-worker-") as notes:
        around = replace(surroundings(), folder=str(notes))
        return keep(run, around, notes, parcel.limits, wanted)


def on_worker(
    parcel: Parcel, digests: Sequence[str], contents: Sequence[bytes], wanted: Callable[[], bool]
) -> Outcome | Missing:
    """`carry_out_parcel` with what came along, the contents of these digests."""
    return carry_out_parcel(parcel, dict(zip(digests, contents)), wanted)


def outcome_of(told: Callable[[], Outcome | Missing], parcel: Parcel) -> Outcome | Missing:
    """What a worker tells; where the cluster itself gives a run up, an outcome that says so."""
    try:
        return told()
    except Exception as error:
        # The cluster's own, of a run that has taken several workers along, or one that a worker could not begin.
        reason = f"no worker could make it: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
        return Outcome(key=parcel.run.key, ending=RunStatus.CRASHED, reason=reason)


def _moved(path: Path, places: Mapping[Path, Path]) -> Path:
    stands_for = whole(path)
    place = places.get(stands_for, stands_for)
    return place if stands_for == path else place / path.name


def _source(path: Path) -> Source:
    try:
        digest = hashlib.sha256()
        for name, file in _files(path):
            digest.update(name.encode())
            with file.open("rb") as stream:
                hashlib.file_digest(stream, lambda: digest)
        return Source(path=path, stamp=_stamp(path), digest=digest.hexdigest(), folder=path.is_dir())
    except OSError as error:
        raise BackendError(f"{path}: cannot be read, to be sent to workers: {error.strerror or error}") from None


def _files(path: Path) -> list[tuple[str, Path]]:
    """Files with their names from a folder on; the file itself where it is one."""
    if path.is_dir():
        return [(file.relative_to(path).as_posix(), file) for file in sorted(path.rglob("*")) if file.is_file()]
    return [(path.name, path)]


def _stamp(path: Path) -> tuple[tuple[str, int, int], ...]:
    found = [(name, file.stat()) for name, file in _files(path)]
    return tuple((name, state.st_size, int(state.st_mtime)) for name, state in found)


def _is_there(source: Source) -> bool:
    try:
        return source.path.exists() and _stamp(source.path) == source.stamp
    except OSError:
        return False


def _cached(source: Source, content: bytes | None) -> Path | None:
    """Where a source lies in this machine's cache, put there where it came along; None where it has to come."""
    folder = _cache() / source.digest
    place = folder / source.path.name
    if not folder.exists():
        if content is None:
            return None
        folder.parent.mkdir(parents=True, exist_ok=True)
        _forget_oldest(folder.parent)
        beside = Path(tempfile.mkdtemp(prefix=f".{source.digest[:12]}-", dir=folder.parent))
        own = beside / source.path.name
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            archive.extractall(own if source.folder else beside)
        try:
            beside.rename(folder)
        except OSError:
            # Another worker of this machine was quicker.
            shutil.rmtree(beside, ignore_errors=True)
    # What is used last is kept longest.
    os.utime(folder)
    return place


def _cache() -> Path:
    """Where sources are kept on this machine; where nothing is to be kept, among temporary files."""
    return cache_folder("sources") or Path(tempfile.gettempdir()) / f"gasp-sources-{os.getuid()}"


def _forget_oldest(folder: Path) -> None:
    """Remove what nobody has used for a month, of what is GASP's."""
    for entry in folder.iterdir():
        # Another worker of this machine may be about to rename it.
        with contextlib.suppress(OSError):
            if _NAME.fullmatch(entry.name) and time.time() - entry.stat().st_mtime > _KEPT:
                shutil.rmtree(entry, ignore_errors=True)
