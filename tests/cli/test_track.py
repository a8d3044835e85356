"""``gasp track``, as it is run."""

import json

import numpy as np
import pytest

from gasp_core import EngineChoice, FrameSequence, Scene, SplatObject, material_preset, simulate
from gasp_core.cli.main import main
from gasp_core.errors import GaspError
from gasp_core.io import read_splat, write_splat
from gasp_core.toy import make_toy


def turning(toy, tmp_path):
    """It turns by five degrees a frame, its rows in another order in each and a fortieth more of them missing."""
    random = np.random.default_rng(0)
    (tmp_path / "book").mkdir()
    for k in range(4):
        angle = np.radians(5 * k)
        c, s = np.cos(angle), np.sin(angle)
        moved = toy.with_(means=toy.means @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))
        rows = np.arange(len(toy)) if k == 0 else random.permutation(len(toy))[: len(toy) * (40 - k) // 40]
        write_splat(tmp_path / "book" / f"f{k}.ply", moved.select(rows))
    return toy


@pytest.fixture
def flipbook(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return turning(make_toy(2000), tmp_path)


@pytest.fixture
def small_flipbook(tmp_path, monkeypatch):
    """For what is said and written, wherever Gaussians are found."""
    monkeypatch.chdir(tmp_path)
    return turning(make_toy(400), tmp_path)


def test_frames_that_can_be_simulated(flipbook, capsys):
    def played(folder):
        jelly, motion = material_preset("jelly"), FrameSequence(frame_rate=25)
        item = SplatObject(name="toy", splat=folder, up="+z", height=0.5, motion=motion, material=jelly)
        scene = Scene(duration=0.12, frame_rate=25, objects=(item,), engine=EngineChoice(name="reference-mpm"))
        return simulate(scene.with_resolution(8), out="run.gasp", overwrite=True, progress=False)

    with pytest.raises(GaspError, match="gasp track"):
        played("book")
    assert main(["track", "book", "--nodes", "40"]) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0].split() == ["FRAME", "DISTANCE", "%", "SPACINGS", "UNSEEN", "%"]
    assert said.out.splitlines()[-1] == "book_tracked: 4 files of 2,000 Gaussians" and said.err == ""
    first, last = read_splat("book_tracked/f0.ply"), read_splat("book_tracked/f3.ply")
    np.testing.assert_allclose(first.means, flipbook.means, atol=1e-6)
    c, s = np.cos(np.radians(15)), np.sin(np.radians(15))
    true = flipbook.means @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    off = np.sqrt(((last.means - true) ** 2).sum(axis=1).mean())
    assert off < 0.01 * np.linalg.norm(np.ptp(flipbook.means, axis=0))
    assert played("book_tracked").frame_count == 4


def test_numbers_and_another_format(flipbook, capsys):
    assert main(["track", "book", "--nodes", "40", "--json", "--format", "splat", "-o", "out"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [frame["file"] for frame in said["frames"]] == ["f1.ply", "f2.ply", "f3.ply"]
    assert all(frame["distance"] > 0 and 0 <= frame["unseen"] < 0.05 for frame in said["frames"])
    assert len(read_splat("out/f2.splat")) == said["gaussians"] == 2000


def test_numbers_between_points_tell_frames_apart(small_flipbook, tmp_path, capsys):
    for k in range(4):
        (tmp_path / "book" / f"f{k}.ply").rename(tmp_path / "book" / f"shot.{k:04d}.compressed.ply")
    assert main(["track", "book", "--nodes", "20"]) == 0
    names = [f"shot.{k:04d}.ply" for k in range(4)]
    assert sorted(file.name for file in (tmp_path / "book_tracked").iterdir()) == names


def test_frames_that_would_have_one_name_are_refused_before_anything_is_tracked(flipbook, tmp_path, capsys):
    (tmp_path / "book" / "f1.PLY").write_bytes(b"never read")
    assert main(["track", "book"]) == 2
    said = capsys.readouterr().err
    assert "would be written as f1.ply, as f1." in said and "rename one of them" in said
    assert not (tmp_path / "book_tracked").exists()


def test_of_one_frame_there_is_nothing_to_track(flipbook, tmp_path, capsys):
    for k in range(1, 4):
        (tmp_path / "book" / f"f{k}.ply").unlink()
    assert main(["track", "book"]) == 2
    assert "book: has one frame, f0.ply: there is nothing to track" in capsys.readouterr().err
    assert not (tmp_path / "book_tracked").exists()


def test_what_is_lost_is_warned_of(small_flipbook, tmp_path, capsys):
    frame = read_splat("book/f3.ply")
    write_splat(tmp_path / "book" / "f3.ply", frame.with_(means=frame.means + [9.0, 0, 0] * (frame.means[:, :1] > 0)))
    assert main(["track", "book", "--nodes", "40"]) == 0
    assert "warning: from f3.ply on, in 1 frames, what is tracked is nowhere near" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere"], "nowhere: is no folder"),
        (["book", "-o", "book"], "holds the frames themselves"),
        (["book", "-o", "book/sub"], "lies among them"),
        (["book", "-o", "few/a.ply"], "no folder can be made there"),
        (["book", "-o", "tracked.ply"], "tracked.ply is to be a folder"),
        (["book", "-o", "no/where"], "no folder can be made there"),
        (["book", "--nodes", "3"], "--nodes"),
        (["few"], "tracking wants 100"),
    ],
)
def test_what_cannot_be_tracked_is_one_line(small_flipbook, tmp_path, capsys, arguments, says):
    (tmp_path / "few").mkdir()
    for name in ("a.ply", "b.ply"):
        write_splat(tmp_path / "few" / name, make_toy(20))
    assert main(["track", *arguments]) == 2
    said = capsys.readouterr().err.strip()
    assert says in said and "Traceback" not in said


def test_half_of_the_frames_are_none(small_flipbook, tmp_path, capsys):
    """One that cannot be read: nothing is left, and nothing of an earlier one is gone."""
    assert main(["track", "book", "--nodes", "20"]) == 0
    before = {file.name: file.read_bytes() for file in (tmp_path / "book_tracked").iterdir()}
    (tmp_path / "book" / "f2.ply").write_bytes(b"torn")
    assert main(["track", "book", "--nodes", "30", "--overwrite"]) == 2
    assert main(["track", "book", "--nodes", "30", "-o", "other"]) == 2
    assert {file.name: file.read_bytes() for file in (tmp_path / "book_tracked").iterdir()} == before
    assert {entry.name for entry in tmp_path.iterdir()} == {"book", "book_tracked"}


def test_nothing_else_lies_among_frames(small_flipbook, tmp_path, capsys):
    assert main(["track", "book", "--nodes", "20", "-o", "out"]) == 0
    assert main(["track", "book", "--nodes", "20", "-o", "out", "--format", "splat", "--overwrite"]) == 2
    assert "holds f0.ply too" in capsys.readouterr().err
    assert main(["track", "book", "--nodes", "30", "-o", "out", "--overwrite"]) == 0


def test_what_is_there_stays(small_flipbook, tmp_path, capsys):
    (tmp_path / "book_tracked").mkdir()
    (tmp_path / "book_tracked" / "f2.ply").write_text("precious")
    assert main(["track", "book"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "book_tracked" / "f2.ply").read_text() == "precious"
