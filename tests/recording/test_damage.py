"""What damage does to a recording: it is named, and what it does not touch can be read, to the last bit."""

from __future__ import annotations

import shutil

import flying_points
import numpy as np
import pytest

from gasp_core import Gaussians, Recording, RecordingChoice, Reduction, simulate
from gasp_core.cli.main import main
from gasp_core.errors import RecordingError
from gasp_core.io import read_splat, write_splat
from gasp_core.recording.checkpoints import load_checkpoint
from gasp_core.recording.verifying import verify

FRAMES = 4
FIELDS = tuple(Gaussians.__dataclass_fields__)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def whole(kept, scene_of, run):
    """A small finished recording of cores; not to be changed."""
    path = kept / "whole.gasp"
    if not path.exists():
        scene = scene_of(duration=0.12, reduction=Reduction(mode="cores", count=12), options={"spin": 3.0})
        assert run(scene, path).frame_count == FRAMES
    return path


@pytest.fixture
def copy(whole, tmp_path):
    def make():
        path = tmp_path / "copy.gasp"
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(whole, path)
        return path

    return make


def same(found, expected):
    return all(np.array_equal(getattr(found, name), getattr(expected, name)) for name in FIELDS)


def deleted(file):
    file.unlink()


def zeroed(file):
    file.write_bytes(bytes(file.stat().st_size))


def test_a_whole_recording_is_whole(whole, capsys):
    found = verify(whole)
    assert (found.damaged, found.readable, found.lost, found.notes) == ((), tuple(range(FRAMES)), (), ())
    assert main(["verify", str(whole)]) == 0
    assert "whole, 4 frames" in capsys.readouterr().out


@pytest.mark.thorough
@pytest.mark.parametrize("harm", [deleted, zeroed])
def test_every_file_that_is_damaged_is_named_and_the_other_frames_are_what_they_were(whole, copy, tmp_path, harm):
    truth = [Recording.open(whole).gaussians(frame) for frame in range(FRAMES)]
    files = sorted(file.relative_to(whole).as_posix() for file in whole.rglob("*") if file.is_file())
    assert len(files) > 40
    for file in files:
        path = copy()
        harm(path / file)
        found = verify(path)
        assert any(file in line for line in found.damaged), file
        assert main(["verify", str(path)]) == 1, file
        try:
            recording = Recording.open(path)
        except RecordingError:
            assert file == "zarr.json"
            continue
        for frame in range(FRAMES):
            try:
                gaussians = recording.gaussians(frame)
            except RecordingError:
                assert frame not in found.readable, (file, frame)
            else:
                assert same(gaussians, truth[frame]), (file, frame)
                assert frame in found.readable, (file, frame)
        own = [part for part in file.split("/") if file.startswith(("frames/", "commits/0"))]
        if file.startswith("commits/0") or ("/c." in file and own):
            number = int(own[1]) if file.startswith("commits/0") else int(own[2].split(".")[1])
            assert found.readable == tuple(frame for frame in range(FRAMES) if frame != number), file
            assert number in found.lost
        out = tmp_path / "out"
        status = main(["export", str(path), "--all", "--out", str(out)])
        exported = sorted(int(entry.stem.rpartition("_")[2]) for entry in out.glob("*.ply"))
        assert exported == list(found.readable), file
        assert status == (0 if len(exported) == FRAMES else 1 if exported else 2), file
        shutil.rmtree(out, ignore_errors=True)


def test_export_and_render_do_the_good_frames_and_name_the_rest(copy, tmp_path, capsys):
    path = copy()
    zeroed(path / "frames" / "displacements" / "c.2.0.0")
    assert main(["export", str(path), "--all", "--out", str(tmp_path / "out")]) == 1
    assert "frame 2 is damaged: frames/displacements/c.2.0.0" in capsys.readouterr().err
    assert [int(entry.stem[-4:]) for entry in sorted((tmp_path / "out").iterdir())] == [0, 1, 3]
    write_splat(tmp_path / "truth.ply", Recording.open(path).gaussians(3))
    assert same(read_splat(tmp_path / "out" / "copy_0003.ply"), read_splat(tmp_path / "truth.ply"))
    assert main(["render", str(path), "-o", f"{tmp_path / 'pictures'}/", "--size", "64x64"]) == 1
    assert "frame 2: frames/displacements/c.2.0.0" in capsys.readouterr().err
    assert len(list((tmp_path / "pictures").glob("*.png"))) == 3


def test_what_is_no_recording_has_a_status_of_its_own(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "empty", tmp_path / "nothing"):
        assert main(["verify", str(path)]) == 2
    assert "recording" in capsys.readouterr().err


@pytest.mark.parametrize("torn", [b"", bytes(300), "half", "all but the last byte"])
def test_a_torn_last_commit_is_dropped_and_the_run_goes_on_bit_for_bit(scene_of, run, tmp_path, capsys, torn):
    scene = scene_of(recording=RecordingChoice(checkpoint_frames=2))
    whole = run(scene, tmp_path / "whole.gasp")
    path = tmp_path / "a.gasp"
    run(scene, path, frames=8)
    commit = path / "commits" / "00000007" / "zarr.json"
    content = commit.read_bytes()
    cut = {"half": content[: len(content) // 2], "all but the last byte": content[:-1]}
    commit.write_bytes(cut[torn] if isinstance(torn, str) else torn)
    found = Recording.open(path)
    assert (found.frame_count, found.torn, found.lost) == (7, (7,), ())
    assert any("commits/00000007/zarr.json is damaged" in line for line in verify(path).damaged)
    capsys.readouterr()
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    again = simulate(scene, engine=engine, out=path, progress=True, resume=True)
    assert "frame 7 of" in (said := capsys.readouterr().err) and "computed again" in said
    assert (again.status, again.torn) == ("complete", ())
    assert verify(path).damaged == ()
    for frame in range(whole.frame_count):
        assert same(again.gaussians(frame), whole.gaussians(frame))


def test_whatever_of_a_last_commit_was_written_it_is_dropped(copy):
    path = copy()
    commit = path / "commits" / f"{FRAMES - 1:08d}" / "zarr.json"
    content = commit.read_bytes()
    for length in range(len(content)):
        commit.write_bytes(content[:length])
        found = Recording.open(path)
        assert (found.frame_count, found.torn) == (FRAMES - 1, (FRAMES - 1,)), length
    commit.write_bytes(content)
    assert Recording.open(path).torn == ()


@pytest.mark.parametrize("harm", [deleted, zeroed])
@pytest.mark.parametrize("file", ["frames/displacements/c.6.0.0", "commits/00000006/zarr.json", "status/zarr.json"])
def test_resuming_goes_back_to_the_last_good_frame_and_on_from_there(scene_of, run, tmp_path, file, harm):
    whole = run(scene_of(), tmp_path / "whole.gasp")
    path = tmp_path / "a.gasp"
    run(scene_of(), path, frames=8)
    harm(path / file)
    again = run(scene_of(), path, resume=True)
    assert again.status == "complete" and verify(path).damaged == ()
    for frame in range(whole.frame_count):
        assert same(again.gaussians(frame), whole.gaussians(frame))


def test_resuming_refuses_where_what_all_frames_need_is_damaged(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    run(scene_of(), path, frames=4)
    zeroed(path / "reference" / "means" / "c.0.0")
    before = sorted(path.rglob("*"))
    with pytest.raises(RecordingError, match=r"reference/means/c\.0\.0 is damaged.*run it anew"):
        run(scene_of(), path, resume=True)
    assert sorted(path.rglob("*")) == before


def test_a_complete_run_that_has_lost_its_end_is_not_complete(copy):
    path = copy()
    shutil.rmtree(path / "commits" / f"{FRAMES - 1:08d}")
    found = Recording.open(path)
    assert (found.frame_count, found.lost, found.status) == (FRAMES - 1, (FRAMES - 1,), "incomplete")
    assert f"frame {FRAMES - 1} lost" in found.reason


def test_a_frame_that_was_swapped_with_another_is_damaged(copy):
    path = copy()
    chunks = [path / "frames" / "displacements" / f"c.{frame}.0.0" for frame in (1, 2)]
    contents = [chunk.read_bytes() for chunk in chunks]
    for chunk, content in zip(chunks, reversed(contents)):
        chunk.write_bytes(content)
    assert verify(path).lost == (1, 2)
    for frame in (1, 2):
        with pytest.raises(RecordingError, match=f"frame {frame} is damaged"):
            Recording.open(path).gaussians(frame)


@pytest.mark.parametrize("version", ["4", "5", "6"])
def test_a_version_that_damage_made_an_earlier_one_does_not_do_away_with_checksums(copy, version):
    path = copy()
    header = path / "zarr.json"
    content = header.read_bytes()
    assert content.count(b'"version": 7') == 1
    header.write_bytes(content.replace(b'"version": 7', b'"version": ' + version.encode()))
    with pytest.raises(RecordingError, match=r"zarr\.json is damaged: its checksum is another"):
        Recording.open(path)


def test_a_state_that_is_too_large_for_a_file_lies_in_several(scene_of, run, tmp_path, monkeypatch):
    scene = scene_of(recording=RecordingChoice(checkpoint_frames=2))
    whole = run(scene, tmp_path / "whole.gasp")
    # Blosc packs less than 2 GiB; the boundary is what is tried here.
    monkeypatch.setattr("gasp_core.recording.checkpoints._LARGEST_CHUNK", 2500)
    path = tmp_path / "a.gasp"
    run(scene, path, frames=8)
    last = max((path / "checkpoints").glob("0*"))
    files = sorted(file.name for file in last.glob("c.*"))
    assert len(files) > 2 and load_checkpoint(path, int(last.name), sealed=True)["x"].ndim
    assert verify(path).damaged == ()
    again = run(scene, shutil.copytree(path, tmp_path / "b.gasp"), resume=True)
    for frame in range(whole.frame_count):
        assert same(again.gaussians(frame), whole.gaussians(frame))
    for harm in (zeroed, deleted):
        harm(last / files[1])
        (fault,) = verify(path).damaged
        assert fault.startswith(f"checkpoints/{last.name}/{files[1]} is damaged: ")


def test_a_recording_that_would_take_too_much_memory_is_not_called_damaged(whole, capsys):
    assert main(["verify", str(whole), "--most-memory", "1K"]) == 2
    assert "--most-memory" in (said := capsys.readouterr().err) and "damaged" not in said
    assert main(["verify", str(whole), "--most-memory", "1G"]) == 0


def test_the_memory_of_a_recording_is_reckoned_as_that_of_its_splat(whole, monkeypatch):
    asked = []
    monkeypatch.setattr("gasp_core.recording.store.refuse_too_large", lambda *given: asked.append(given[2:]))
    reference = Recording.open(whole).reference
    assert asked == [reference.harmonics.shape[:2]]
