"""The files of a recording by what they are: arrays that are written once, and those of its frames."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError, SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.memory_limit import may_take, most_gaussians, refuse_too_large
from gasp_core.recording.arrays import ArrayNode, chunk_key, decoded, sound, usual_chunks
from gasp_core.recording.files import FileCheck, TooLargeError, files_below, is_folder, read_checked, read_file
from gasp_core.recording.layout import Header
from gasp_core.recording.nodes import MOST_BYTES, parsed, read_node, whole

__all__ = ["Store"]

Array = NDArray[Any]

_NEVER_ZERO = ("quaternions", "scales", "opacities", "moving", "magnification", "weights")
"""Arrays of which no chunk is all zeros. Before version 6 such a chunk had no file: a lost one looks the same."""
_LARGEST = float(np.finfo(np.float32).max)
"""Of values, float64 ones too: what lies beyond is infinite to everything that is made of them."""
_WIDEST = 12
"""Values in a row of a carrier: the corners of a core."""
_WIDE = 400
"""Bytes for each Gaussian that a carrier may take whatever its files hold: one that drifts takes 320."""
_CARRIER = re.compile(
    r"unmoved|driven|magnification|points|spacing|neighbours|order|labels|weights|standing_for|corners|coefficients"
    r"|(gradients|levels/[0-9]/transfer)/(labels|neighbours|weights|inverses|fallen|order)|levels/[0-9]/points"
)
"""Arrays of carriers."""
_LONGEST_ROW = 512
"""Bytes that a file may hold for each Gaussian: fifteen harmonics of float64 are 384."""
_SPARE = 64
"""Packing may add one byte for so many of a chunk, and a kibibyte."""


class Store:
    """The arrays of a recording, each checked against what the header says before it is unpacked."""

    def __init__(self, root: Path, header: Header) -> None:
        self.root = root
        self.header = header
        self._files = {key: FileCheck(size=size, checksum=found) for key, (size, found) in header.files.items()}

    @property
    def files(self) -> Mapping[str, FileCheck]:
        """What every file must be that was written once; empty before version 6."""
        return self._files

    @property
    def groups(self) -> list[str]:
        """Files that are written once and say nothing but that there is a folder."""
        folders = {key.rpartition("/")[0] for key in self._files}
        above = {"frames", "commits", "checkpoints"} | {
            folder[:end] for folder in folders for end, letter in enumerate(folder) if letter == "/"
        }
        return [f"{folder}/zarr.json" for folder in sorted(above & folders)]

    @property
    def rows(self) -> int:
        """Drawn Gaussians."""
        return self.header.objects[-1].last

    @property
    def points(self) -> int:
        """The engine's points."""
        return self.header.bodies[-1].last

    @cached_property
    def plausible_rows(self) -> int:
        """Drawn Gaussians, no more of them than what their files hold can mean."""
        try:
            return min(self.rows, most_gaussians(self.root, sum(map(self._size, self._reference_files()))))
        except SplatFormatError as error:
            raise TooLargeError(str(error)) from None

    def _names(self, index: int) -> list[str]:
        """Arrays of a body's carrier, by their path from its folder."""
        folder = f"bodies/{index}"
        if self._files:
            keys = self._of_bodies.get(folder, [])
        else:
            keys = [key for key, _ in files_below(self.root, folder)] if is_folder(self.root, folder) else []
        found = sorted({key.rpartition("/")[0] for key in keys})
        groups = {folder} | {parent.rpartition("/")[0] for parent in found}
        return [name[len(folder) + 1 :] for name in found if name not in groups]

    @cached_property
    def _of_bodies(self) -> dict[str, list[str]]:
        """Files by the folder of the body that they are of."""
        found: dict[str, list[str]] = {}
        for key in self._files:
            if key.count("/") > 1:
                found.setdefault("/".join(key.split("/", 2)[:2]), []).append(key)
        return found

    def has(self, name: str) -> bool:
        """Whether there is an array, of those that are written once."""
        key = f"{name}/zarr.json"
        return key in self._files if self._files else is_folder(self.root, name)

    def array(self, name: str, shape: Sequence[int | None], kinds: str) -> Array:
        """An array that was written once.

        Parameters
        ----------
        name
            Its path.
        shape
            That it must have; None: any length.
        kinds
            Letters of NumPy's kinds of types that it may be of.

        Raises
        ------
        RecordingError
            Where it, or a file of it, is missing or damaged.
        """
        node = self._node(name)
        fits = len(node.shape) == len(shape) and all(want in (None, own) for own, want in zip(node.shape, shape))
        if not fits or node.dtype.kind not in kinds:
            told = " x ".join("any" if length is None else str(length) for length in shape)
            raise RecordingError(
                f"{self.root}: {name} is damaged: it is {node.dtype.name} of shape {node.shape}, expected {told}"
            )
        return self._values(name, node)

    def carrier(self, index: int, rows: int) -> dict[str, Array]:
        """The arrays of a body of so many rows, by their names; see `gasp_core.recording.checks.check_carrier`.

        Raises
        ------
        RecordingError
            Where one is missing, damaged, or larger than any of so many rows; where they would unpack to more than
            their files can mean.
        """
        nodes: dict[str, ArrayNode] = {}
        held = 0
        for name in self._names(index):
            path = f"bodies/{index}/{name}"
            if _CARRIER.fullmatch(name) is None:
                raise RecordingError(f"{self.root}: {path} is damaged: no carrier has such an array")
            node = nodes[name] = self._node(path)
            if node.shape[0] > rows or math.prod(node.shape[1:]) > _WIDEST:
                raise RecordingError(f"{self.root}: {path} is damaged: {node.shape} is more than its body has")
            self._expect_usual_chunks(path, node)
            held += sum(self._size(f"{path}/{chunk_key(place)}") for place in node.places())
        if sum(node.size for node in nodes.values()) > max(may_take(held), _WIDE * rows):
            raise RecordingError(f"{self.root}: bodies/{index} is damaged: it would unpack to more than it can mean")
        return {name: self._values(f"bodies/{index}/{name}", node) for name, node in nodes.items()}

    def _values(self, name: str, node: ArrayNode) -> Array:
        _ = self._honest
        self._expect_usual_chunks(name, node)
        contents = {place: self._chunk(name, place, node) for place in node.places()}
        chunks = {
            place: self._unpacked(content, f"{name}/{chunk_key(place)}", node, bool(self._files))
            for place, content in contents.items()
            if content is not None
        }
        if node.chunks == node.shape and chunks:
            (values,) = chunks.values()
        else:
            values = np.zeros(node.shape, dtype=node.dtype)
            for place, chunk in chunks.items():
                rows = node.slices(place)
                values[rows] = chunk[tuple(slice(0, part.stop - part.start) for part in rows)]
        if node.dtype.kind == "f" and not (np.abs(values) <= _LARGEST).all():
            raise RecordingError(f"{self.root}: {name} is damaged: it is not finite")
        return values

    def _expect_usual_chunks(self, name: str, node: ArrayNode) -> None:
        if node.chunks != usual_chunks(node.shape):
            raise RecordingError(f"{self.root}: {name} is damaged: it is in chunks of {node.chunks}")

    def reference(self) -> Gaussians:
        """The drawn scene at rest.

        Raises
        ------
        RecordingError
            Where it is damaged, or larger than its files can mean.
        """
        count = self.rows
        shapes: dict[str, tuple[int | None, ...]] = {
            "means": (count, 3),
            "quaternions": (count, 4),
            "scales": (count, 3),
            "opacities": (count,),
            "harmonics": (count, None, 3),
        }
        arrays = {name: self.array(f"reference/{name}", shape, "f") for name, shape in shapes.items()}
        try:
            return Gaussians(**arrays)
        except SplatFormatError as error:
            raise RecordingError(f"{self.root}: reference is damaged: {error}") from None

    def frame(self, name: str, number: int, check: FileCheck, rows: int | None) -> Array:
        """What a frame has in an array of frames, (rows, 3) float32.

        Parameters
        ----------
        name
            Of the array.
        number
            Of the frame.
        check
            What its commit says of its chunk.
        rows
            That it must have; None: at most as many as there are corners.

        Raises
        ------
        RecordingError
            Where its chunk is missing or damaged.
        """
        _ = self._honest
        node = self.frame_node(name)
        own = node.shape[1]
        if number >= node.shape[0] or (own != rows if rows is not None else own > 4 * self.rows):
            raise RecordingError(f"{self.root}: frames/{name} is damaged: it has the shape {node.shape}")
        key = f"frames/{name}/{chunk_key((number, 0, 0))}"
        if check.size == 0 and not self._files:
            # Before version 6 a chunk of zeros had no file.
            return np.zeros((own, 3), dtype=np.float32)
        values = self._unpacked(self.checked(key, check), key, node, check.checksum is not None)[0]
        if not np.isfinite(values).all():
            raise RecordingError(f"{self.root}: {key} is damaged: it is not finite")
        return values

    def frame_node(self, name: str) -> ArrayNode:
        """Shape and chunks of an array of frames.

        Raises
        ------
        RecordingError
            Where its metadata are missing or damaged.
        """
        key = f"frames/{name}/zarr.json"
        try:
            found, content = read_node(self.root, key)
        except FileNotFoundError:
            raise RecordingError(f"{self.root}: {key} is damaged: it is missing") from None
        if self._files and not whole(content):
            raise RecordingError(f"{self.root}: {key} is damaged: its checksum is another")
        node = self._array_node(key, found)
        if node.dtype.name != "float32" or len(node.shape) != 3 or node.chunks != (1, *node.shape[1:]):
            raise RecordingError(f"{self.root}: {key} is damaged: it is no array of frames")
        return node

    @cached_property
    def _honest(self) -> bool:
        """Asked before anything is unpacked: whether there can be as many Gaussians as the header declares.

        All else is bounded by their number.
        """
        bases = math.prod(self._node("reference/harmonics").shape[1:2])
        try:
            refuse_too_large(self.root, sum(map(self._size, self._reference_files())), self.rows, bases)
        except SplatFormatError as error:
            raise TooLargeError(str(error)) from None
        return True

    def frame_names(self) -> list[str]:
        """Arrays that every frame has a chunk of."""
        return [name for name in ("displacements", "velocities", "drifts") if is_folder(self.root, f"frames/{name}")]

    def _node(self, name: str) -> ArrayNode:
        key = f"{name}/zarr.json"
        return self._array_node(key, parsed(self.root, key, self._read(key, MOST_BYTES)))

    def _array_node(self, key: str, node: Mapping[str, Any]) -> ArrayNode:
        try:
            return ArrayNode.of(node)
        except ValueError as error:
            raise RecordingError(f"{self.root}: {key} is damaged: {error}") from None

    def _read(self, key: str, most: int) -> bytes:
        """A file that was written once."""
        if self._files:
            if key not in self._files:
                raise RecordingError(f"{self.root}: {key} is damaged: the header does not know it")
            if self._files[key].size > most:
                raise RecordingError(f"{self.root}: {key} is damaged: it is longer than it can be")
            return read_checked(self.root, key, self._files[key])
        try:
            return read_file(self.root, key, most)
        except FileNotFoundError:
            raise RecordingError(f"{self.root}: {key} is damaged: it is missing") from None

    def _chunk(self, name: str, place: tuple[int, ...], node: ArrayNode) -> bytes | None:
        """The content of a chunk's file; None where, before version 6, it is all zeros."""
        key = f"{name}/{chunk_key(place)}"
        most = node.chunk_size + node.chunk_size // _SPARE + 1024
        if self._files or name.rpartition("/")[2] in _NEVER_ZERO or self._exists(key):
            return self._read(key, most)
        return None

    def checked(self, key: str, check: FileCheck) -> bytes:
        """A file that is as the header, or a commit, says that it is.

        Raises
        ------
        RecordingError
            Where it is missing, damaged, or longer than any of so many Gaussians.
        """
        if check.size > MOST_BYTES + _LONGEST_ROW * self.plausible_rows:
            raise RecordingError(f"{self.root}: {key} is damaged: it is longer than it can be")
        return read_checked(self.root, key, check)

    def _exists(self, key: str) -> bool:
        return (self.root / key).exists() or (self.root / key).is_symlink()

    def _unpacked(self, content: bytes, key: str, node: ArrayNode, checked: bool) -> Array:
        """A chunk; where its file has no checksum, its own is asked."""
        try:
            if not (checked or sound(content)):
                raise ValueError("its checksum is another")
            return decoded(content, node)
        except ValueError as error:
            raise RecordingError(f"{self.root}: {key} is damaged: {error}") from None

    def _reference_files(self) -> list[str]:
        if self._files:
            return [key for key in self._files if key.startswith("reference/")]
        return [key for key, regular in files_below(self.root, "reference") if regular]

    def _size(self, key: str) -> int:
        try:
            return (self.root / key).lstat().st_size
        except OSError:
            return 0
