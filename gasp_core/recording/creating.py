"""A recording as it is begun: all that is written once, and room for frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.recording.arrays import ArrayNode, array_node, encoded, pieces
from gasp_core.recording.files import checksum
from gasp_core.recording.layout import Header
from gasp_core.recording.nodes import group, is_readable, sealed
from gasp_core.recording.status import RecordedStatus, write_status

__all__ = ["create_store"]

Array = NDArray[Any]


def create_store(
    folder: Path, header: Header, arrays: Mapping[str, Array], rows: Mapping[str, int], frames_wanted: int
) -> Header:
    """Write a recording without frames.

    Parameters
    ----------
    folder
        Empty.
    header
        Less its files.
    arrays
        Those that are written once, by their path.
    rows
        Of a frame, of the arrays that every frame has a chunk of, by their name.
    frames_wanted
        Once it is complete.

    Returns
    -------
    Header
        With its files: they exist once the header does.

    Raises
    ------
    RecordingError
        Where the scene has so many objects that the header would be longer than any that is read.
    """
    files: dict[str, tuple[int, int]] = {}

    def keep(key: str, content: bytes) -> None:
        (folder / key).parent.mkdir(parents=True, exist_ok=True)
        (folder / key).write_bytes(content)
        files[key] = (len(content), checksum(content))

    for parent in sorted(_parents([*arrays, *(f"frames/{name}" for name in rows), "commits/0", "checkpoints/0"])):
        keep(f"{parent}/zarr.json", sealed(group({})))
    for name, values in arrays.items():
        node, chunks = pieces(np.asarray(values))
        keep(f"{name}/zarr.json", sealed(array_node(node)))
        for key, chunk in chunks.items():
            keep(f"{name}/{key}", encoded(chunk))
    for name, count in rows.items():
        node = ArrayNode(shape=(frames_wanted, count, 3), chunks=(1, count, 3), dtype=np.dtype("<f4"))
        (folder / "frames" / name).mkdir(parents=True, exist_ok=True)
        # Sealed, and not among the files: a run that is made longer has to change it.
        (folder / "frames" / name / "zarr.json").write_bytes(sealed(array_node(node)))
    write_status(folder, RecordedStatus(state="running", reason="", frames_wanted=frames_wanted))
    begun = dataclasses.replace(header, files=files)
    content = sealed(group(begun.attributes()))
    if not is_readable(content):
        raise RecordingError(f"{len(header.objects):,} objects are more than a recording can name: use fewer")
    (folder / "zarr.json").write_bytes(content)
    return begun


def _parents(paths: list[str]) -> set[str]:
    """All folders on the way to them."""
    return {"/".join(parts[:end]) for parts in (path.split("/") for path in paths) for end in range(1, len(parts))}
