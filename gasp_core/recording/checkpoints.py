"""The engine's state in a recording: bytes of an ``.npz``, as one Zarr array."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.recording.arrays import ArrayNode, array_node, chunk_key, decoded, encoded, pieces, sound
from gasp_core.recording.files import FileCheck, UnreadableError, checksum, read_checked, read_file, short
from gasp_core.recording.nodes import read_node, sealed, whole

__all__ = ["checkpoint_files", "load_checkpoint"]

Array = NDArray[Any]

_LARGEST_CHUNK = 1 << 30
"""Bytes of a state in one file; Blosc packs less than twice as many."""
_MOST_CHUNKS = 1 << 10
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
    count = -(-len(values) // _LARGEST_CHUNK)
    # Equal ones: the last is filled up with zeros.
    node, chunks = pieces(values, (-(-len(values) // count),))
    files = {key: encoded(chunk, "lz4", "bitshuffle") for key, chunk in chunks.items()}
    attributes = {"names": list(state), "files": {key: [len(file), checksum(file)] for key, file in files.items()}}
    return {**files, "zarr.json": sealed(array_node(node, attributes, "lz4", "bitshuffle"))}


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
    UnreadableError
        Where the system does not let it be read.
    """
    folder = root / "checkpoints" / f"{frame:08d}"
    file = folder / "zarr.json"
    try:
        found, content = read_node(root, _key(root, file))
        if sealed and not whole(content):
            raise RecordingError(f"{root}: {_key(root, file)} is damaged: its checksum is another")
        node = ArrayNode.of(found)
        many = node.shape[0] > _MOST_CHUNKS * node.chunks[0] or node.chunk_size > _LARGEST_CHUNK
        if node.dtype.name != "uint8" or len(node.shape) != 1 or many:
            raise ValueError("it is no state of an engine")
        names: list[Any] = found["attributes"]["names"]
        checks: dict[str, Any] | None = found["attributes"].get("files")
        if checks is None and sealed:
            raise ValueError("it does not say what its files are")
        chunks = [folder / chunk_key(place) for place in node.places()]
        size = 0
        for file in chunks:
            found_size = file.lstat().st_size
            if found_size > 2 * _LARGEST_CHUNK:
                raise ValueError("it is longer than it can be")
            size += found_size
        file = folder / "zarr.json"
        if node.chunk_size * len(chunks) > _SPARE + _STEEPEST * size:
            raise ValueError("it would unpack to more than it can mean")
        packed: list[bytes] = []
        for file in chunks:
            packed.append(_packed(root, file, None if checks is None else checks[file.name]))
    except FileNotFoundError:
        raise RecordingError(f"{root}: {_key(root, file)} is damaged: it is missing") from None
    except NotADirectoryError:
        raise RecordingError(f"{root}: {_key(root, file)} is damaged: it lies in what is no folder") from None
    except OSError as error:
        raise UnreadableError(f"{root}: {_key(root, file)} cannot be read: {error.strerror or error}") from None
    except (ValueError, LookupError, TypeError) as error:
        raise RecordingError(f"{root}: {_key(root, file)} is damaged: {short(error)}") from None
    try:
        return _state(b"".join(decoded(chunk, node).tobytes() for chunk in packed)[: node.size], names)
    except MemoryError:
        # No word about the state: another time there may be room for it.
        raise
    except Exception as error:  # of NumPy's and the archive's readers, which do not say what they raise
        raise RecordingError(f"{root}: {_key(root, folder)} is damaged: {short(error)}") from None


def _key(root: Path, file: Path) -> str:
    return file.relative_to(root).as_posix()


def _packed(root: Path, file: Path, check: Any) -> bytes:
    """A chunk's file, of a length and a checksum; before version 6 the chunk alone says whether it is whole."""
    key = _key(root, file)
    if check is not None:
        size, found = check
        if not type(size) is type(found) is int:
            raise ValueError("it does not say what its files are")
        return read_checked(root, key, FileCheck(size=size, checksum=found))
    content = read_file(root, key, file.lstat().st_size)
    if not sound(content):
        raise RecordingError(f"{root}: {key} is damaged: its checksum is another")
    return content


def _state(content: bytes, names: list[Any]) -> dict[str, Array]:
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        for entry in packed.infolist():
            if entry.compress_type != zipfile.ZIP_STORED or entry.file_size != entry.compress_size:
                raise ValueError("it is packed twice")
            with packed.open(entry) as stream:
                _expect_as_long_as_told(stream, entry.file_size)
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        if len(arrays.files) != len(names) or not all(isinstance(name, str) for name in names):
            raise ValueError("its arrays are not those it names")
        return {name: arrays[f"a{index}"] for index, name in enumerate(names)}


def _expect_as_long_as_told(stream: IO[bytes], size: int) -> None:
    """Refuse an array whose header declares more, or less, than what follows; the room for it is taken at once."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if math.prod(shape) * dtype.itemsize != size - stream.tell():
        raise ValueError("an array in it is not as long as it says")
