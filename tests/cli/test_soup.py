"""``gasp soup``, as it is run."""

import numpy as np
import pytest

from gasp_core.cli.main import main
from gasp_core.io import read_splat, write_splat
from gasp_core.toy import make_toy


@pytest.fixture
def splat(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_splat(tmp_path / "toy.ply", make_toy(64))
    return tmp_path


def test_there_and_back(splat, capsys):
    assert main(["soup", "export", "toy.ply", "--up", "+z"]) == 0
    assert capsys.readouterr().out == "toy.soup.ply: 64 Gaussians of 4 vertices\n"
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "toy.soup.ply"]) == 0
    assert capsys.readouterr().out == "toy_moved.ply\n"
    assert np.array_equal(read_splat("toy_moved.ply").means, read_splat("toy.ply").means)


def test_a_soup_under_the_name_of_another_format_is_refused(splat, capsys):
    assert main(["soup", "export", "toy.ply", "-o", "soup.obj"]) == 2
    assert capsys.readouterr().err.startswith("gasp: soup.obj: a soup is a .ply")
    assert names(splat) == ["toy.ply"]


def test_frames_of_a_script(splat, capsys):
    assert main(["soup", "export", "toy.ply", "--vertices", "3", "-o", "a.ply"]) == 0
    vertices = 3 * 64
    frames = np.zeros((3, vertices, 3), np.float32)
    np.save("flat.npy", frames)
    capsys.readouterr()
    assert main(["soup", "import", "toy.ply", "a.ply", "flat.npy", "--format", "splat"]) == 0
    assert capsys.readouterr().out == "toy_moved: 3 files, flat_0000.splat to flat_0002.splat\n"
    assert len(read_splat("toy_moved/flat_0001.splat")) == 64


def moving(frames, name="moved.npy"):
    """A motion of so many frames, each farther away than the one before."""
    lifts = np.arange(frames, dtype=np.float32)[:, None, None]
    np.save(name, np.zeros((frames, 4 * 64, 3), np.float32) + lifts)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_shorter_motion_takes_the_place_of_a_longer_one(splat, capsys):
    assert main(["soup", "export", "toy.ply"]) == 0
    moving(4)
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy"]) == 0
    (splat / "toy_moved" / "notes.txt").write_text("mine")
    for frames in (2, 1):
        moving(frames)
        assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy", "-o", "toy_moved"]) == 2
        assert "is there already" in capsys.readouterr().err
        assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy", "-o", "toy_moved", "--overwrite"]) == 0
        expected = ["moved_0000.ply", "moved_0001.ply"] if frames == 2 else ["moved.ply"]
        assert names(splat / "toy_moved") == [*expected, "notes.txt"]


def test_a_motion_that_ends_early_leaves_the_earlier_one_as_it_was(splat, interrupted_at):
    assert main(["soup", "export", "toy.ply"]) == 0
    moving(3)
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy"]) == 0
    before = {path: path.read_bytes() for path in splat.rglob("*") if path.is_file()}
    interrupted_at("moved_0001.ply")
    np.save("moved.npy", np.load("moved.npy") + 1)
    before[splat / "moved.npy"] = (splat / "moved.npy").read_bytes()
    assert main(["soup", "import", "toy.ply", "toy.soup.ply", "moved.npy", "--overwrite"]) != 0
    assert {path: path.read_bytes() for path in splat.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["export", "nowhere.ply"], "nowhere.ply"),
        (["export", "toy.ply", "-o", "toy.ply", "--overwrite"], "toy.ply is what is read"),
        (["import", "toy.ply", "toy.ply", "toy.ply"], "is no soup as gasp wrote it"),
        (["import", "other.ply", "a.ply", "a.ply"], "is that of another splat"),
        (["import", "toy.ply", "a.ply", "a.ply", "a.ply"], "two of MOVED have one name"),
        (["import", "toy.ply", "a.ply", "a.ply", "-o", "toy.ply", "--overwrite"], "toy.ply is what is read"),
        (["import", "toy.ply", "a.ply", "a.ply", "--format", "sog", "-o", "b.splat"], "does not end in .sog"),
        (["import", "toy.ply", "a.ply", "two.npy", "-o", "b.splat"], "b.splat is to be a folder"),
        (["import", "toy.ply", "a.ply"], "Missing argument"),
    ],
)
def test_refuses(splat, capsys, arguments, said):
    write_splat("other.ply", make_toy(64, seed=1))
    assert main(["soup", "export", "toy.ply", "-o", "a.ply"]) == 0
    moving(2, "two.npy")
    before = {path.name: path.read_bytes() for path in splat.iterdir()}
    capsys.readouterr()
    assert main(["soup", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert {path.name: path.read_bytes() for path in splat.iterdir()} == before
