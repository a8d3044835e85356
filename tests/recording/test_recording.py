from __future__ import annotations

import json
import re
import shutil
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from gasp_core import Recording, RecordingChoice, Reduction
from gasp_core.errors import RecordingError, SceneError
from gasp_core.io import write_splat
from gasp_core.recording.commits import too_many_lost
from gasp_core.recording.durable import folder_in_the_making, replace_file
from gasp_core.recording.layout import VERSION
from gasp_core.recording.lock import lock, locked
from gasp_core.recording.nodes import sealed
from gasp_core.recording.verifying import verify
from gasp_core.recording.writer import split_displacements
from gasp_core.scene.settings import CameraChoice


@pytest.fixture
def recorded(scene_of, run, tmp_path):
    return run(scene_of(duration=0.2), tmp_path / "a.gasp")


def test_files_below_the_folder_of_a_recording_are_kept_by_where_they_lie_in_it(scene_of, cloud, run, tmp_path):
    """So that the folder can be sent and moved, and says nothing of the machine it was on."""
    here, elsewhere = tmp_path / "here", tmp_path / "elsewhere"
    for folder in (here, elsewhere):
        (folder / "splats").mkdir(parents=True)
        write_splat(folder / "splats" / "a.ply", cloud())
        (folder / "cameras.json").write_text("[]")
    for folder in (here, elsewhere):
        camera = CameraChoice(file=folder / "cameras.json")
        run(scene_of(folder / "splats" / "a.ply", duration=0.08, camera=camera), here / f"{folder.name}.gasp")
    assert str(tmp_path) not in (here / "here.gasp" / "zarr.json").read_text()
    moved = here.rename(tmp_path / "moved")
    scene = Recording.open(moved / "here.gasp").scene
    assert scene.objects[0].splat == moved / "splats" / "a.ply"
    assert scene.camera.file == moved / "cameras.json"
    scene = Recording.open(moved / "elsewhere.gasp").scene
    assert scene.objects[0].splat == elsewhere / "splats" / "a.ply"
    assert scene.camera.file == elsewhere / "cameras.json"


@pytest.mark.parametrize("link", ["to the recording", "to its folder"])
def test_files_are_found_through_a_link(scene_of, cloud, run, tmp_path, link):
    here = tmp_path / "here"
    here.mkdir()
    write_splat(here / "a.ply", cloud())
    # A path that goes up and down again leads there as well.
    splat = here / ".." / "here" / "a.ply"
    (tmp_path / "door").symlink_to(here)
    door = tmp_path / "door" / "a.gasp" if link == "to its folder" else here / "a.gasp"
    run(scene_of(splat, duration=0.08), door)
    assert str(tmp_path) not in (door / "zarr.json").read_text()
    (tmp_path / "latest.gasp").symlink_to(here / "a.gasp")
    for path in (door, here / "a.gasp", tmp_path / "latest.gasp"):
        assert Recording.open(path).scene.objects[0].splat.samefile(here / "a.ply")


def edit(path, change):
    node = json.loads(path.read_text())
    change(node["attributes"])
    path.write_bytes(sealed(node))


@given(st_numpy.arrays(np.float64, (20, 3), elements=st.floats(-1e6, 1e6)))
def test_split_displacements_add_up(displacements):
    """float32 has 24 bits: half an ulp of the rest, 2^-24 of it, and rounding of the mean in double."""
    bodies = [slice(0, 12), slice(12, 20)]
    means, relative = split_displacements(displacements, bodies)
    assert relative.dtype == np.float32
    for body, mean in zip(bodies, means):
        rest = np.abs(displacements[body] - mean)
        error = np.abs(relative[body] + mean - displacements[body])
        assert (error <= rest * 2**-24 + 1e-9 + 2**-149).all()
    zero, none = split_displacements(np.zeros((20, 3)), bodies)
    assert not zero.any() and not none.any()


def test_it_is_a_zarr_hierarchy_and_nothing_else(recorded):
    import zarr

    with warnings.catch_warnings():
        warnings.simplefilter("error")  # Zarr warns of what it does not know
        names = {name for name, _ in zarr.open_group(str(recorded.path), mode="r").members(max_depth=None)}
    assert {"frames/displacements", "reference/means", "commits/00000005", "status", "bodies/0/magnification"} <= names


def test_a_frame_without_its_commit_is_a_hole_and_not_the_end(recorded):
    (recorded.path / "commits" / "00000004" / "zarr.json").unlink()
    found = Recording.open(recorded.path)
    assert (found.frame_count, found.lost, found.status) == (6, (4,), "incomplete")
    assert "frame 4 lost" in found.reason
    with pytest.raises(RecordingError, match=r"frame 4 is lost: commits/00000004/zarr\.json is missing"):
        found.gaussians(4)
    assert np.isfinite(found.points(5)).all()
    with pytest.raises(RecordingError, match="has no frame 6, its frames are 0 to 5"):
        found.gaussians(6)
    with pytest.raises(RecordingError, match="has no frame -1"):
        recorded.points(-1)


def test_damage_is_found_where_it_is(recorded):
    chunk = recorded.path / "frames" / "displacements" / "c.3.0.0"
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(RecordingError, match="displacements of frame 3 is damaged"):
        recorded.points(3)
    chunk.write_bytes(content[:-5])
    with pytest.raises(RecordingError, match=r"frame 3 is damaged: frames/displacements/c.3.0.0: has \d+ bytes, expec"):
        recorded.points(3)
    chunk.unlink()
    with pytest.raises(RecordingError, match=r"frames/displacements/c\.3\.0\.0: it is missing"):
        recorded.gaussians(3)
    assert np.isfinite(recorded.points(2)).all() and np.isfinite(recorded.points(4)).all()


def test_damage_of_the_reference_is_found(recorded):
    chunk = next((recorded.path / "reference" / "means").glob("c*"))
    content = bytearray(chunk.read_bytes())
    content[-1] ^= 255
    chunk.write_bytes(content)
    with pytest.raises(RecordingError, match=r"reference/means/c\.0\.0 is damaged"):
        _ = Recording.open(recorded.path).reference


def test_what_is_no_recording(tmp_path, recorded):
    with pytest.raises(RecordingError, match="there is no such recording"):
        Recording.open(tmp_path / "nothing")
    with pytest.raises(RecordingError, match="is no recording"):
        Recording.open(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="is a file"):
        Recording.open(tmp_path / "file")
    header = recorded.path / "zarr.json"
    good = header.read_text()
    header.write_text(good[: len(good) // 2])
    with pytest.raises(RecordingError, match="damaged"):
        Recording.open(recorded.path)
    header.write_text(good)
    edit(header, lambda attributes: attributes.update(version=VERSION + 1))
    with pytest.raises(RecordingError, match="update GASP"):
        Recording.open(recorded.path)
    header.write_text(good)
    edit(header, lambda attributes: attributes.pop("spacing"))
    with pytest.raises(RecordingError, match="header"):
        Recording.open(recorded.path)
    header.write_text(good)
    edit(header, lambda attributes: attributes.update(format="else"))
    with pytest.raises(RecordingError, match="is no recording"):
        Recording.open(recorded.path)


def test_a_damaged_checkpoint_is_passed_over(scene_of, run, tmp_path):
    whole = run(scene_of(), tmp_path / "whole.gasp")
    run(scene_of(), tmp_path / "a.gasp", frames=8)
    last = max((tmp_path / "a.gasp" / "checkpoints").glob("0*"))
    assert last.name == "00000007"
    (last / "c.0").write_bytes(b"nonsense")
    again = run(scene_of(), tmp_path / "a.gasp", resume=True)
    assert again.status == "complete"
    assert np.array_equal(again.points(10), whole.points(10))


def test_a_state_of_another_time_is_not_gone_on_from(scene_of, run, tmp_path):
    scene = scene_of(recording=RecordingChoice(checkpoint_frames=2))
    path = tmp_path / "a.gasp"
    whole = run(scene, tmp_path / "whole.gasp")
    run(scene, path, frames=6)
    *_, other, last = sorted((path / "checkpoints").glob("0*"))
    # Whole, and sealed: that of another frame.
    shutil.rmtree(last)
    shutil.copytree(other, last)
    with pytest.raises(RecordingError, match=r"00000005: the engine's state is of .* s, frame 5 of .* s") as error:
        run(scene, path, resume=True)
    assert "\n" not in str(error.value)
    shutil.rmtree(last)
    again = run(scene, path, resume=True)
    end = whole.frame_count - 1
    assert np.array_equal(again.gaussians(end).means, whole.gaussians(end).means)


def test_what_a_run_is_gone_on_with_is_what_it_says(scene_of, run, tmp_path):
    """Duration and camera, which decide no frame; the header stays, and so does all that is asked of its digest."""
    path, above = tmp_path / "a.gasp", CameraChoice(view="top")
    run(scene_of(duration=0.12), path)
    header = (path / "zarr.json").read_bytes()
    assert Recording.open(path).scene.camera is None
    longer = run(scene_of(duration=0.2, camera=above), path, resume=True)
    assert (longer.status, longer.frame_count, longer.scene.duration) == ("complete", 6, 0.2)
    assert longer.scene.camera == above and longer.engine.name == longer.scene.engine.name
    assert (path / "zarr.json").read_bytes() == header and verify(path).damaged == verify(path).notes == ()
    # Nothing is left to do but to say so.
    assert run(scene_of(duration=0.2), path, resume=True).scene.camera is None
    # And where the status is lost there is what it was begun with.
    assert run(scene_of(duration=0.2, camera=above), path, resume=True).scene.camera == above
    (path / "status" / "zarr.json").unlink()
    assert Recording.open(path).scene.camera is None and Recording.open(path).scene.duration == 0.12


def test_gone_on_with_as_it_was_begun_nothing_more_is_said_than_of_a_run_that_never_stopped(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    run(scene_of(duration=0.12), path, frames=2)
    assert run(scene_of(duration=0.12, camera=CameraChoice(view="top")), path, resume=True).scene.camera is not None
    run(scene_of(duration=0.12), path, resume=True)
    assert "scene" not in json.loads((path / "status" / "zarr.json").read_text())["attributes"]


def test_frames_that_there_are_are_not_too_many(scene_of, run, tmp_path):
    """A scene of fewer was called complete, of so many frames as it did not have."""
    path = tmp_path / "a.gasp"
    run(scene_of(duration=1.0, frame_rate=30.0), path, frames=8)
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    told = r"has 8 frames, and the scene would have 4: none of them is taken back.*duration = (\S+), or run it anew"
    with pytest.raises(RecordingError, match=told) as refused:
        run(scene_of(duration=0.1, frame_rate=30.0), path, resume=True)
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before
    # What is advised is enough, to the last frame; a shorter scene than before may be gone on with as well.
    least = float(re.search(told, str(refused.value))[1])
    again = run(scene_of(duration=least, frame_rate=30.0), path, resume=True)
    assert (again.status, again.frame_count, again.frames_wanted, again.scene.duration) == ("complete", 8, 8, least)


def test_a_scene_in_the_status_that_is_none_is_refused(recorded, scene_of, run):
    edit(recorded.path / "status" / "zarr.json", lambda attributes: attributes.update(scene=3))
    found = Recording.open(recorded.path)
    with pytest.raises(RecordingError, match=r"status/zarr\.json is damaged: its scene is no text"):
        _ = found.status
    assert found.scene.duration == 0.2 and np.isfinite(found.points(5)).all()
    edit(recorded.path / "status" / "zarr.json", lambda attributes: attributes.update(scene="[scene"))
    with pytest.raises(SceneError, match=r"a\.gasp \(scene\)"):
        _ = Recording.open(recorded.path).scene
    with pytest.raises(RecordingError, match="cannot be compared"):
        edit(recorded.path / "zarr.json", lambda attributes: attributes.update(scene_digest="of an earlier version"))
        run(scene_of(duration=0.2), recorded.path, resume=True)


def test_velocities_are_of_all_frames_or_of_none(scene_of, run, tmp_path):
    path, wanted = tmp_path / "a.gasp", RecordingChoice(checkpoint_frames=2, velocities=True)
    run(scene_of(), path, frames=4)
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    with pytest.raises(RecordingError, match=r"begun without velocities.* leave velocities = true .* or run it anew"):
        run(scene_of(recording=wanted), path, resume=True)
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before
    with pytest.raises(RecordingError, match=r"say velocities = true .* and run it anew"):
        Recording.open(path).velocities(2)
    other = tmp_path / "b.gasp"
    run(scene_of(recording=wanted), other, frames=4)
    # One that has them goes on with them, also where they are asked for no more.
    assert run(scene_of(), other, resume=True).velocities(10).any()


def test_damage_explains_so_many_missing_frames_and_no_more():
    assert not too_many_lost(10_000, 0) and too_many_lost(10_001, 0)
    # Half of a long run may well be gone.
    assert not too_many_lost(15_000, 15_000) and too_many_lost(10_000_000, 20)


def test_one_writer_at_a_time_and_one_can_tell(recorded, scene_of, run):
    edit(recorded.path / "status" / "zarr.json", lambda attributes: attributes.update(state="running"))
    assert recorded.status == "incomplete" and "killed" in recorded.reason
    import os

    held = lock(recorded.path)
    try:
        assert locked(recorded.path)
        assert (recorded.status, recorded.reason) == ("running", "")
        with pytest.raises(RecordingError, match="another process is writing it"):
            run(scene_of(duration=0.2), recorded.path, resume=True)
        with pytest.raises(RecordingError, match="another process is writing it"):
            run(scene_of(duration=0.2), recorded.path, overwrite=True)
    finally:
        os.close(held)
    assert not locked(recorded.path)
    assert run(scene_of(duration=0.2), recorded.path, resume=True).status == "complete"


def test_files_appear_whole_or_not_at_all(tmp_path):
    replace_file(tmp_path / "a", b"one")
    replace_file(tmp_path / "a", b"two")
    assert (tmp_path / "a").read_bytes() == b"two"
    with pytest.raises(ValueError, match="on purpose"), folder_in_the_making(tmp_path / "b") as beside:
        (beside / "file").write_text("")
        raise ValueError("on purpose")
    with folder_in_the_making(tmp_path / "c") as beside:
        (beside / "file").write_text("")
        assert not (tmp_path / "c").exists()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a", "c"]


def test_a_recording_of_version_1_is_read_and_gone_on_with(scene_of, run, tmp_path):
    """Version 1 knew no carriers: every body was "all", its arrays are where they were."""
    whole = run(scene_of(), tmp_path / "whole.gasp")
    old = run(scene_of(), tmp_path / "old.gasp", frames=5)

    def backwards(attributes):
        attributes["version"] = 1
        for body in attributes["bodies"]:
            assert body.pop("carrier") == "all"

    edit(old.path / "zarr.json", backwards)
    read = Recording.open(old.path)
    assert np.array_equal(read.gaussians(4).means, whole.gaussians(4).means)
    again = run(scene_of(), old.path, resume=True)
    assert again.status == "complete"
    assert np.array_equal(again.gaussians(10).quaternions, whole.gaussians(10).quaternions)


def test_a_fit_of_version_3_is_read(scene_of, run, tmp_path):
    """Version 3 kept a fit in the order of the rows, and did not say so."""
    import zarr

    recorded = run(scene_of(reduction=Reduction(mode="cores", count=12)), tmp_path / "a.gasp", frames=3)
    (body,) = recorded.bodies
    fit = body.carrier.levels[0].transfer
    assert not np.array_equal(fit.order, np.arange(len(fit.order)))
    before = recorded.simplices(2)[body.name]
    own = zarr.open_group(str(recorded.path / "bodies" / "0" / "levels" / "0" / "transfer"), mode="r+")
    for name in ("neighbours", "weights", "inverses"):
        own[name][...] = own[name][...][np.argsort(fit.order)]
    shutil.rmtree(recorded.path / "bodies" / "0" / "levels" / "0" / "transfer" / "order")
    edit(recorded.path / "zarr.json", lambda attributes: attributes.update(version=3))
    assert np.array_equal(Recording.open(recorded.path).simplices(2)[body.name], before)


def test_a_carrier_from_the_future_or_without_its_arrays_is_refused(scene_of, run, tmp_path):
    recorded = run(scene_of(reduction=Reduction(mode="cores", count=4)), tmp_path / "a.gasp", frames=2)
    shutil.rmtree(recorded.path / "bodies" / "0" / "levels" / "0" / "transfer" / "weights")
    with pytest.raises(RecordingError, match=r"transfer/weights/zarr\.json is damaged: it is missing"):
        Recording.open(recorded.path).gaussians(1)
    edit(recorded.path / "zarr.json", lambda attributes: attributes["bodies"][0].update(carrier="splines"))
    with pytest.raises(RecordingError, match='carries body 0 by "splines", this GASP knows no such: update GASP'):
        Recording.open(recorded.path).gaussians(1)
