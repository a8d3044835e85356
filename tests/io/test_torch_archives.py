"""What torch.save wrote: read without it, and without running what is in it."""

import pickle
import struct
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io.torch_archives import read_archive

SAVED = Path(__file__).parent / "saved_by_torch.pt"
"""Written by PyTorch 2.13, of everything that a model may hold."""


def test_what_pytorch_wrote():
    found = read_archive(SAVED)
    state = found["state"]
    assert isinstance(state, OrderedDict)
    assert np.array_equal(state["0.weight"], np.arange(6, dtype=np.float32).reshape(2, 3))
    assert np.array_equal(state["0.bias"], np.float32([-1, 0.5]))
    assert np.array_equal(found["parameter"], np.full((2, 1), np.float32(0.25)))
    assert np.array_equal(found["transposed"], np.arange(24.0).reshape(4, 6).T)
    assert np.array_equal(found["part"], [5.0, 6, 7, 8])
    assert np.array_equal(found["half"], np.float16([1.5, -2])) and found["half"].dtype == np.float16
    assert np.array_equal(found["whole"], [[2**40, -1]])
    assert np.array_equal(found["true"], [True, False])
    assert found["empty"].shape == (0, 3)
    assert (found["number"], found["flag"], found["list"]) == (7, True, [1, 2.5, "x", None])


def archive(path, described, *, storages=(b"\0" * 24,), compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as file:
        file.writestr("a/data.pkl", described)
        for key, data in enumerate(storages):
            file.writestr(f"a/data/{key}", data)
    return path


def tensor(shape, strides, offset=0, count=6, key="0", kind="FloatStorage", what="storage"):
    """The pickle of one tensor, written out."""

    def text(value):
        return pickle.BINUNICODE + struct.pack("<I", len(value)) + value.encode()

    def number(value):
        return pickle.LONG1 + bytes([9]) + value.to_bytes(9, "little", signed=True)

    def numbers(values):
        return pickle.MARK + b"".join(map(number, values)) + pickle.TUPLE

    storage = pickle.MARK + text(what) + f"ctorch\n{kind}\n".encode() + text(key) + text("cpu") + number(count)
    said = pickle.PROTO + b"\x02ctorch._utils\n_rebuild_tensor_v2\n" + pickle.MARK + storage + pickle.TUPLE
    said += pickle.BINPERSID + number(offset) + numbers(shape) + numbers(strides) + pickle.NEWFALSE
    return said + pickle.EMPTY_DICT + pickle.TUPLE + pickle.REDUCE + pickle.STOP


def test_the_tensor_of_these_tests_is_one(tmp_path):
    path = archive(tmp_path / "a.pt", tensor((2, 3), (3, 1)), storages=[np.arange(6, dtype="<f4").tobytes()])
    assert np.array_equal(read_archive(path), np.arange(6).reshape(2, 3))


FAULTS = {
    "beyond its storage": (tensor((3, 3), (3, 1)), "a tensor of shape"),
    "from beyond it": (tensor((2, 3), (3, 1), offset=1), "a tensor of shape"),
    "from before it": (tensor((1, 1), (1, 1), offset=-1), "an impossible shape"),
    "backwards": (tensor((2, 2), (-1, 1)), "an impossible shape"),
    "of a shape below zero": (tensor((-1, -6), (1, 1)), "an impossible shape"),
    "huge, of one number": (tensor((2**40, 2**20), (0, 0)), "a tensor of shape"),
    "huge and empty": (tensor((2**62, 2**62), (1, 1)), "a tensor of shape"),
    "without a stride": (tensor((2, 3), (1,)), "an impossible shape"),
    "of a storage that says too much": (tensor((2, 3), (3, 1), count=7), "24 bytes, 7 numbers of 4 bytes"),
    "of one below zero": (tensor((0,), (1,), count=-1), "fewer than no numbers"),
    "of one that is not there": (tensor((2,), (1,), key="9"), "has no 'data/9'"),
    "of one elsewhere": (tensor((2,), (1,), key="../../a"), "has no 'data/../../a'"),
    "of another thing": (tensor((2,), (1,), what="module"), "no storage"),
    "of complex numbers": (tensor((2,), (1,), kind="ComplexFloatStorage"), "no part of a tensor"),
    "of the name of a function": (b"\x80\x02cos\nsystem\n.", "'os.system', which is no part of a tensor"),
    "called by number": (b"\x80\x02\x82\x01.", "cannot be read"),
    "an import by parts": (b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93.", "'builtins.eval'"),
    "ours, misused": (b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n(K\x01K\x00))tR.", "cannot be read"),
    "a memo of gigabytes": (b"\x80\x02}r\xf0\xff\xff\x7f.", "it remembers more than it holds"),
    "nothing": (b"", "cannot be read"),
    "no pickle": (b"hello", "cannot be read"),
    "a stack that is empty": (b"\x80\x02.", "cannot be read"),
    "a frame of terabytes": (b"\x80\x04\x95\xff\xff\xff\xff\xff\x00\x00\x00N.", "cannot be read"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_refuses(fault, tmp_path):
    described, said = FAULTS[fault]
    path = archive(tmp_path / "a.pt", described)
    with pytest.raises(SplatFormatError) as caught:
        read_archive(path)
    assert said in str(caught.value) and "a.pt: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_refuses_what_unpacks_to_more(tmp_path):
    path = archive(tmp_path / "a.pt", tensor((10**7,), (1,), count=10**7), storages=[b"\0" * (4 * 10**7)],
                   compression=zipfile.ZIP_DEFLATED)  # fmt: skip
    assert path.stat().st_size < 10**5
    with pytest.raises(SplatFormatError, match="larger than the file can hold"):
        read_archive(path)


def test_refuses_other_files(tmp_path):
    for name, data in (("old.pt", b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."), ("empty.pt", b"")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(SplatFormatError, match=r"is no archive of PyTorch.*before PyTorch 1\.6"):
            read_archive(tmp_path / name)
    with pytest.raises(SplatFormatError, match="cannot be read: No such file"):
        read_archive(tmp_path / "nowhere.pt")
    with zipfile.ZipFile(tmp_path / "other.pt", "w") as file:
        file.writestr("word/document.xml", "")
    with pytest.raises(SplatFormatError, match=r"has no data\.pkl"):
        read_archive(tmp_path / "other.pt")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_refuses_what_is_damaged(tmp_path, share):
    """Bytes changed anywhere: read as something, or refused."""
    generator = np.random.default_rng(int(100 * share))
    whole = np.frombuffer(SAVED.read_bytes(), np.uint8)
    for _ in range(200):
        damaged = whole.copy()
        rows = generator.integers(0, len(whole), 3)
        damaged[rows] = generator.integers(0, 256, 3)
        damaged = damaged[: int(len(whole) * share)] if generator.random() < 0.3 else damaged
        (tmp_path / "a.pt").write_bytes(damaged.tobytes())
        try:
            read_archive(tmp_path / "a.pt")
        except SplatFormatError as error:
            assert "\n" not in str(error)
