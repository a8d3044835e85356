"""What `torch.save` wrote, read without PyTorch and without running what is in it.

Such a file is a zip of a pickle, which says what there is, and of the bytes of each tensor. A pickle may name any
function and have it called. This one may name the few that put tensors together, and is given ours in their place.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
import struct
import zipfile
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.io.format_errors import malformed, quoted, shown
from gasp_core.io.memory_limit import refuse_unread

__all__ = ["read_archive"]

Array = NDArray[Any]

_NOT_RUN = "it may be code, and was not run: get the weights from somebody you trust"
_LONGEST_PICKLE = 1 << 24
"""Bytes: of a network it is some kB."""
_MEMO = ("PUT", "BINPUT", "LONG_BINPUT")


@dataclass(frozen=True, slots=True)
class _Kind:
    """A kind of storage: its numbers."""

    letter: str


_STORAGES = {
    "DoubleStorage": "f8", "FloatStorage": "f4", "HalfStorage": "f2", "LongStorage": "i8", "IntStorage": "i4",
    "ShortStorage": "i2", "CharStorage": "i1", "ByteStorage": "u1", "BoolStorage": "?",
}  # fmt: skip


def read_archive(path: Path) -> Any:
    """What a file of `torch.save` holds, its tensors and parameters as NumPy arrays.

    Parameters
    ----------
    path
        Of PyTorch 1.6 or later; tensors of any device.

    Returns
    -------
    Dicts, lists, tuples, numbers, texts and arrays, as they were saved.

    Raises
    ------
    SplatFormatError
        Where the file is none, is damaged, or names anything but tensors.
    """
    try:
        size = path.stat().st_size
        refuse_unread(path, size)
        with path.open("rb") as stream:
            if not zipfile.is_zipfile(stream):
                raise malformed(
                    path,
                    "is no archive of PyTorch",
                    "fetch it again; one of before PyTorch 1.6 has to be loaded and saved by a later one",
                )
            with zipfile.ZipFile(stream) as archive:
                return _Archive(path, archive, size).load()
    except OSError as error:
        raise malformed(
            path, f"cannot be read: {error.strerror or error}", "check the path and its permissions"
        ) from error
    except SplatFormatError:
        raise
    # All that zipfile raises of damaged bytes, as the tests and the fuzz damage them: it is told, not passed over.
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, ValueError, EOFError, struct.error) as error:
        raise malformed(path, f"is a damaged archive ({shown(error)[:80]})") from error


class _Archive:
    """An open archive, and how many of its bytes may still be read."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, size: int) -> None:
        self._path = path
        self._archive = archive
        self._left = size
        pickles = [name for name in archive.namelist() if name.count("/") == 1 and name.endswith("/data.pkl")]
        if len(pickles) != 1:
            raise malformed(path, "is a zip, but no archive of PyTorch: it has no data.pkl")
        self._root = pickles[0].removesuffix("data.pkl")
        self._storages: dict[str, Array] = {}

    def load(self) -> Any:
        described = self._bytes("data.pkl")
        if len(described) > _LONGEST_PICKLE:
            raise malformed(self._path, "its data.pkl is longer than that of any network")
        order = "<"
        if f"{self._root}byteorder" in self._archive.namelist():
            order = ">" if self._bytes("byteorder") == b"big" else "<"
        try:
            for opcode, argument, _ in pickletools.genops(described):
                # The unpickler makes room for as many as it is told to remember.
                if opcode.name in _MEMO and int(argument or 0) > len(described):
                    raise pickle.UnpicklingError("it remembers more than it holds")
            return _Unpickler(self, described, order).load()
        except SplatFormatError:
            raise
        except _RefusedError as error:
            raise malformed(self._path, str(error), _NOT_RUN) from None
        # What bytes from outside make an unpickler raise is anything.
        except Exception as error:
            said = shown(error)[:80] or type(error).__name__
            raise malformed(self._path, f"its data.pkl cannot be read ({said})") from error

    def storage(self, key: str, letter: str, count: int) -> Array:
        """The numbers of a storage, as a tensor names it."""
        if key not in self._storages:
            held = self._bytes(f"data/{key}")
            width = np.dtype(letter).itemsize
            if len(held) < count * width:
                raise ValueError(
                    f"storage {key[:20]} holds {len(held)} bytes, {count} numbers of {width} bytes are said"
                )
            self._storages[key] = np.frombuffer(held, letter, count)
        found = self._storages[key]
        if found.dtype != np.dtype(letter) or len(found) != count:
            raise ValueError(f"storage {key[:20]} is said to be two things")
        return found

    def _bytes(self, name: str) -> bytes:
        try:
            entry = self._archive.getinfo(self._root + name)
        except KeyError:
            raise malformed(self._path, f"has no {quoted(name)}") from None
        # PyTorch packs nothing, so that all of it is no larger than the file.
        if entry.compress_type != zipfile.ZIP_STORED or entry.file_size > self._left:
            raise malformed(self._path, f"its {quoted(name)} is larger than the file can hold")
        self._left -= entry.file_size
        return self._archive.read(entry)


class _RefusedError(pickle.UnpicklingError):
    """The pickle names what it may not."""


class _Unpickler(pickle.Unpickler):
    """Knows the names of what tensors are made of, and no others."""

    def __init__(self, archive: _Archive, described: bytes, order: str) -> None:
        super().__init__(io.BytesIO(described))
        self._archive = archive
        self._order = order

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        if module_name == "torch" and global_name in _STORAGES:
            return _Kind(_STORAGES[global_name])
        known = {
            ("collections", "OrderedDict"): OrderedDict,
            ("torch._utils", "_rebuild_tensor_v2"): _tensor,
            ("torch._utils", "_rebuild_parameter"): _parameter,
        }
        found = known.get((module_name, global_name))
        if found is None:
            _refuse(f"{module_name}.{global_name}")
        return found

    def persistent_load(self, pid: Any, /) -> Array:
        what, kind, key, _, count = pid
        if what != "storage" or not isinstance(kind, _Kind) or type(key) is not str or type(count) is not int:
            raise pickle.UnpicklingError("it names what is no storage")
        if count < 0:
            raise pickle.UnpicklingError("a storage of fewer than no numbers")
        return self._archive.storage(key, self._order + kind.letter, count)


def _refuse(name: str) -> NoReturn:
    raise _RefusedError(f"names {quoted(name)}, which is no part of a tensor")


def _tensor(storage: Any, offset: Any, shape: Any, strides: Any, *_: Any) -> Array:
    """The tensor of a shape, and of distances between its numbers, in a storage."""
    if not isinstance(storage, np.ndarray):
        raise pickle.UnpicklingError("a tensor without a storage")
    numbers = [offset, *shape, *strides]
    if len(shape) != len(strides) or not all(type(number) is int and number >= 0 for number in numbers):
        raise pickle.UnpicklingError("a tensor of an impossible shape")
    last = offset + sum((length - 1) * stride for length, stride in zip(shape, strides))
    if math.prod(shape) > len(storage) or (math.prod(shape) and last >= len(storage)):
        raise pickle.UnpicklingError(f"a tensor of shape {tuple(shape)} in a storage of {len(storage)} numbers")
    width = storage.itemsize
    window = np.lib.stride_tricks.as_strided(
        storage[offset:], tuple(shape), tuple(stride * width for stride in strides), writeable=False
    )
    return window.astype(storage.dtype.newbyteorder("="))


def _parameter(tensor: Any, *_: Any) -> Any:
    return tensor
