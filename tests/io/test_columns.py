"""A number for each Gaussian, from files that are trusted in nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import splat_files

from gasp_core.errors import SceneError, SplatFormatError
from gasp_core.io.columns import own_columns, read_npy_column, read_ply_column
from gasp_core.scene.columns import column_digest

COUNT = 7


@pytest.fixture
def labelled(tmp_path):
    """A .ply of 7 Gaussians with a property `label`, in each order of bytes and as text."""

    def make(order="<", kind="int"):
        names = [*splat_files.inria_names(0)]
        rows = np.random.default_rng(0).normal(size=(COUNT, len(names) + 1))
        rows[:, -1] = np.arange(COUNT) % 3
        path = tmp_path / "a.ply"
        path.write_bytes(splat_files.ply([*((name, "float") for name in names), ("label", kind)], rows, order=order))
        return path

    return make


@pytest.mark.parametrize("order", ["<", ">", ""])
@pytest.mark.parametrize("kind", ["int", "uchar", "float", "double"])
def test_a_property_is_read_whatever_its_type(labelled, order, kind):
    path = labelled(order, kind)
    found = read_ply_column(path, "label")
    assert found.tolist() == [0, 1, 2, 0, 1, 2, 0]
    assert found.dtype.isnative
    assert {name: column.tolist() for name, column in own_columns(path).items()} == {"label": found.tolist()}


def test_a_property_that_is_not_there_is_told_with_those_that_are(labelled, tmp_path):
    with pytest.raises(SplatFormatError, match=r"has no property 'lable'; beside those of any splat it has 'label'"):
        read_ply_column(labelled(), "lable")
    (tmp_path / "a.splat").write_bytes(bytes(64))
    with pytest.raises(SplatFormatError, match=r"is no \.ply, so it has no property 'label'"):
        read_ply_column(tmp_path / "a.splat", "label")
    with pytest.raises(SplatFormatError, match="is no file"):
        read_ply_column(tmp_path, "label")


@pytest.mark.parametrize("dtype", ["u1", "i2", ">i4", "i8", "f4", ">f8", "?"])
@pytest.mark.parametrize("shape", [(COUNT,), (COUNT, 1)])
def test_numbers_of_any_type_are_read(tmp_path, dtype, shape):
    wanted = (np.arange(COUNT) % 2).astype(dtype)
    np.save(tmp_path / "a.npy", wanted.reshape(shape))
    assert read_npy_column(tmp_path / "a.npy", COUNT).tolist() == wanted.tolist()


REFUSED = {
    "too few": (np.zeros(COUNT - 1), r"has the shape \(6,\), and the splat 7 Gaussians"),
    "a vector each": (np.zeros((COUNT, 3)), r"has the shape \(7, 3\)"),
    "one for all": (np.array(3), r"has the shape \(\)"),
    "text": (np.array(["a"] * COUNT), "no numbers"),
    "complex": (np.zeros(COUNT, complex), "no numbers"),
    "objects": (np.array([None] * COUNT), "is no .npy of numbers"),
    "records": (np.zeros(COUNT, [("a", "f4")]), "no numbers"),
    "nothing": (np.zeros(0), "is no .npy of numbers|has the shape"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_number_for_each_gaussian_is_refused(tmp_path, case):
    array, message = REFUSED[case]
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(SplatFormatError, match=message) as caught:
        read_npy_column(tmp_path / "a.npy", COUNT)
    assert "\n" not in str(caught.value)


def header(text):
    body = text.encode("latin-1")
    return b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body


HOSTILE = {
    "empty": b"",
    "no magic": b"hello",
    "cut in its header": header("{'descr': '<f8', 'fortran_order': False, 'shape': (7,), }\n")[:30],
    "cut in its numbers": header("{'descr': '<f8', 'fortran_order': False, 'shape': (7,), }\n") + bytes(8),
    "more than there are bytes": header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999,), }\n"),
    "less than none": header("{'descr': '<f8', 'fortran_order': False, 'shape': (-7,), }\n") + bytes(99),
    "another type": header("{'descr': 'zz9', 'fortran_order': False, 'shape': (7,), }\n") + bytes(99),
    "no dictionary": header("[1, 2]\n") + bytes(99),
    "open bracket": header("{'descr': ((((\n") + bytes(99),
    "deep": header("(" * 5000 + "\n") + bytes(99),
    "version 9": b"\x93NUMPY\x09\x00" + bytes(99),
    "an archive": b"PK\x03\x04" + bytes(99),
}


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("case", HOSTILE)
def test_a_file_that_lies_is_refused_in_one_line(tmp_path, case):
    (tmp_path / "a.npy").write_bytes(HOSTILE[case])
    with pytest.raises(SplatFormatError, match=r"a\.npy: ") as caught:
        read_npy_column(tmp_path / "a.npy", COUNT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "message"), [("gone.npy", "cannot be read: No such file"), (".", "no ordinary file")])
def test_what_is_no_file_is_refused(tmp_path, name, message):
    with pytest.raises(SplatFormatError, match=message):
        read_npy_column(tmp_path / name, COUNT)
    with pytest.raises(SceneError, match=message):
        column_digest(tmp_path / name)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs a file without an end")
def test_a_file_without_an_end_is_refused():
    with pytest.raises(SplatFormatError, match="no ordinary file"):
        read_npy_column(Path("/dev/zero"), COUNT)
    with pytest.raises(SceneError, match="no ordinary file"):
        column_digest(Path("/dev/zero"))
