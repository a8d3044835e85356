"""The engine's state in a recording: bytes of an ``.npz``, as one Zarr array."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.recording.arrays import ArrayNode, array_node, chunk_key, decoded, encoded, sound
from gasp_core.recording.files import FileCheck, checksum, read_checked, read_file, short
from gasp_core.recording.nodes import read_node, sealed, whole

__all__ = ["checkpoint_files", "load_checkpoint", "read_checkpoint"]

Array = NDArray[Any]

_CHUNK = chunk_key((0,))
_STEEPEST = 256
"""Bytes that a byte of LZ4 can become."""
_SPARE = 1 << 20


def checkpoint_files(state: Mapping[str, Array]) -> dict[str, bytes]:
    """The files of a checkpoint, by their names."""
    packed = io.BytesIO()
    # Positional names: a key of the engine's may be anything.
    arrays: dict[str, Any] = {f"a{index}": np.asarray(array) for index, array in enumerate(state.values())}
    np.savez(packed, **arrays)
    values = np.frombuffer(packed.getbuffer(), dtype=np.uint8)
    chunk = encoded(values, "lz4", "bitshuffle")
    node = ArrayNode(shape=values.shape, chunks=values.shape, dtype=values.dtype)
    attributes = {"names": list(state), "files": {_CHUNK: [len(chunk), checksum(chunk)]}}
    return {_CHUNK: chunk, "zarr.json": sealed(array_node(node, attributes, "lz4", "bitshuffle"))}


def read_checkpoint(root: Path, frame: int, *, sealed: bool) -> dict[str, Array]:
    """The state kept at a frame of a recording; empty where it is damaged, so that an older one serves."""
    try:
        return load_checkpoint(root, frame, sealed=sealed)
    except RecordingError:
        return {}


def load_checkpoint(root: Path, frame: int, *, sealed: bool) -> dict[str, Array]:
    """The state kept at a frame of a recording.

    Parameters
    ----------
    root
        The recording.
    frame
        Its number.
    sealed
        Whether it must have a seal: from version 6 on.

    Raises
    ------
    RecordingError
        Where it is damaged; the message names the file.
    """
    folder = f"checkpoints/{frame:08d}"
    key, chunk = f"{folder}/zarr.json", f"{folder}/{_CHUNK}"
    try:
        found, content = read_node(root, key)
        if sealed and not whole(content):
            raise RecordingError(f"{root}: {key} is damaged: its checksum is another")
        node = ArrayNode.of(found)
        if node.dtype.name != "uint8" or len(node.shape) != 1 or node.chunks != node.shape:
            raise ValueError("it is no state of an engine")
        names: list[Any] = found["attributes"]["names"]
        size = (root / chunk).lstat().st_size
        if node.size > _SPARE + _STEEPEST * size:
            raise ValueError("it would unpack to more than it can mean")
        if not sealed and "files" not in found["attributes"]:
            packed = read_file(root, chunk, size)
            if not sound(packed):
                raise RecordingError(f"{root}: {chunk} is damaged: its checksum is another")
        else:
            size, found_checksum = found["attributes"]["files"][_CHUNK]
            packed = read_checked(root, chunk, FileCheck(size=size, checksum=found_checksum))
    except FileNotFoundError as error:
        missing = key if str(error.filename).endswith("zarr.json") else chunk
        raise RecordingError(f"{root}: {missing} is damaged: it is missing") from None
    except (ValueError, KeyError, TypeError, IndexError, OSError) as error:
        raise RecordingError(f"{root}: {key} is damaged: {short(error)}") from None
    try:
        return _state(decoded(packed, node).tobytes(), names)
    except (ValueError, KeyError, TypeError, OSError, EOFError, MemoryError, zipfile.BadZipFile) as error:
        raise RecordingError(f"{root}: {chunk} is damaged: {short(error)}") from None


def _state(content: bytes, names: list[Any]) -> dict[str, Array]:
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in packed.infolist()):
            raise ValueError("it is packed twice")
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        if len(arrays.files) != len(names) or not all(isinstance(name, str) for name in names):
            raise ValueError("its arrays are not those it names")
        return {name: arrays[f"a{index}"] for index, name in enumerate(names)}
