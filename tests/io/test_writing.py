"""Files appear whole or not at all, and cheaply: importing the package loads no format."""

import os
import resource
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io import read_splat, write_splat
from gasp_core.io.convert import convert, losses

SUFFIXES = (".ply", ".splat", ".spz", ".sog")


def one_line(error):
    text = str(error.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_replaces_a_file_and_leaves_nothing_beside(some, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")
    write_splat(path, some())
    assert len(read_splat(path)) == 7
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_opacities_beyond_what_there_is_are_nothing_or_all(some, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    opacities = np.array([-0.1, 0, 0.5, 1, np.nextafter(1, 2), 1.2, 1e30])
    write_splat(path, some(7).with_(opacities=opacities))
    found = sorted(read_splat(path).opacities.tolist())
    # A half may be a byte, 127 or 128.
    assert found == [0, 0, pytest.approx(0.5, abs=0.51 / 255), 1, 1, 1, 1]


def test_what_is_not_finite_stays_so_in_a_ply(some, tmp_path):
    path = tmp_path / "a.ply"
    write_splat(path, some(4).with_(opacities=np.array([np.nan, np.inf, -np.inf, 0.5])))
    assert np.isnan(read_splat(path).opacities).tolist() == [True, True, True, False]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_leaves_the_old_file(some, tmp_path, monkeypatch, suffix):
    """A limit on file sizes stands in for the disk: the system refuses the same write, with another number."""
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")
    # Nor is what is imported meanwhile to be left cut off in the cache of bytecode.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(SplatFormatError) as error:
            write_splat(path, some(5000, 0))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "cannot be written" in one_line(error)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_refusals_of_the_system_are_one_line(some, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "folder.ply").mkdir()
    for bad in ("missing/a.ply", "file/a.ply", "folder.ply", "x" * 300 + ".ply"):
        with pytest.raises(SplatFormatError) as error:
            write_splat(tmp_path / bad, some())
        assert "cannot be written" in one_line(error)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder.ply"]


@contextmanager
def nobody_special():
    """The superuser may write anywhere: for the while of the test be somebody else."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs the owners and modes of POSIX")
def test_an_unwritable_folder(some):
    # Not under tmp_path, which is locked to others as a whole.
    with tempfile.TemporaryDirectory() as parent:
        Path(parent).chmod(0o755)
        folder = Path(parent) / "locked"
        folder.mkdir()
        splat = some()
        write_splat(folder / "first.ply", splat)
        folder.chmod(0o555)
        with nobody_special(), pytest.raises(SplatFormatError, match="cannot be written: Permission denied"):
            write_splat(folder / "a.ply", splat)
        assert [path.name for path in folder.iterdir()] == ["first.ply"]
        folder.chmod(0o755)


@pytest.mark.parametrize("name", ["a.obj", "a", "a.compressed.ply", "a.ksplat"])
def test_formats_that_are_not_written(some, tmp_path, name):
    with pytest.raises(SplatFormatError, match=r"cannot be written; choose one of \.ply, \.splat, \.spz, \.sog, \.glb"):
        write_splat(tmp_path / name, some())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nothing_is_written_of_no_gaussians(some, tmp_path, suffix):
    with pytest.raises(SplatFormatError, match="no Gaussians"):
        write_splat(tmp_path / f"a{suffix}", some().select(np.zeros(7, bool)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("field", ["means", "quaternions", "scales", "opacities", "harmonics"])
def test_bytes_cannot_hold_nan(some, tmp_path, field):
    g = some()
    array = getattr(g, field).copy()
    array[3] = np.nan
    g = g.with_(**{field: array})
    for suffix in (".splat", ".spz", ".sog", ".glb"):
        with pytest.raises(SplatFormatError, match="1 Gaussians are not finite, the first is 3"):
            write_splat(tmp_path / f"a{suffix}", g)
    assert not list(tmp_path.iterdir())
    write_splat(tmp_path / "a.ply", g)
    assert np.isnan(getattr(read_splat(tmp_path / "a.ply"), field)[3]).all()


def test_coordinates_beyond_spz(some, tmp_path):
    g = some().with_(means=np.full((7, 3), 1e8, np.float32))
    with pytest.raises(SplatFormatError, match=r"does not fit a \.spz"):
        write_splat(tmp_path / "a.spz", g)
    assert not list(tmp_path.iterdir())


def test_convert_tells_what_is_lost(some, tmp_path):
    g = some(9, 3)
    harmonics = g.harmonics.copy()
    harmonics[0, 0], harmonics[1, 5] = 9.0, -3.0
    g = g.with_(harmonics=harmonics, scales=np.where(np.arange(9)[:, None] == 4, np.float32(1e-7), g.scales))
    write_splat(tmp_path / "a.ply", g)
    assert convert(tmp_path / "a.ply", tmp_path / "b.ply") == ()
    assert (tmp_path / "b.ply").read_bytes() == (tmp_path / "a.ply").read_bytes()
    lost = "; ".join(convert(tmp_path / "a.ply", tmp_path / "b.splat"))
    assert "harmonics of degree 1 to 3 are dropped" in lost
    assert "colours of 1 Gaussians are cut" in lost
    lost = "; ".join(convert(tmp_path / "a.ply", tmp_path / "b.spz"))
    assert "scales of 1 Gaussians are cut" in lost
    assert "colours of 1 Gaussians are cut" in lost
    assert "harmonics of 1 Gaussians are cut" in lost


@pytest.mark.parametrize("suffix", [".splat", ".spz", ".sog"])
def test_what_is_not_said_to_be_cut_is_within_a_step(some, suffix):
    lost = losses(some(100, 0), suffix)
    assert len(lost) == 1
    assert "rounded" in lost[0]


def test_degree_four_goes_into_ply_whole_and_into_spz_without_its_last_band(some, tmp_path):
    g = some(9, 4)
    write_splat(tmp_path / "a.ply", g)
    assert np.array_equal(read_splat(tmp_path / "a.ply").harmonics, g.harmonics)
    lost = convert(tmp_path / "a.ply", tmp_path / "a.spz")
    assert "harmonics of degree 4 are dropped" in lost
    assert read_splat(tmp_path / "a.spz").sh_degree == 3


def test_importing_loads_no_format():
    code = (
        "import sys, gasp_core.io\n"
        "heavy = {'numba', 'gsply', 'PIL', 'scipy', 'numcodecs', 'zipfile', 'gasp_core.io.sog', 'gasp_core.io.spz'}\n"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
