"""Runs through the command line: frames, resuming, interrupting, exporting."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from flown_water import flown_water

from gasp_core import MovingSplat, Recording, read_splat
from gasp_core.errors import SplatFormatError
from gasp_core.progress import _Lines
from gasp_core.recording.drawn import DrawnFrames
from gasp_core.rendering.footage import open_footage

FAKES = Path(__file__).parents[1] / "fake_plugins"


def test_run_tells_what_it_made_and_what_to_do_next(gasp, workplace):
    outcome = gasp("run", "scene.toml")
    assert (outcome.status, outcome.err) == (0, "")
    assert "scene.gasp: 3 frames, complete" in outcome.out
    assert "gasp export scene.gasp --all" in outcome.out
    assert Recording.open(workplace / "scene.gasp").status == "complete"


def test_json_of_a_run(gasp, workplace):
    outcome = gasp("run", "scene.toml", "--json", "--frames", 2, "--out", "short.gasp")
    assert (outcome.status, outcome.err) == (0, "")
    told = json.loads(outcome.out)
    assert told["recording"] == "short.gasp"
    assert (told["status"], told["engine"]) == ("incomplete", "ballistic")
    assert (told["frame_count"], told["frames_wanted"]) == (2, 3)
    assert told["times"] == [0.0, 0.04]


def test_resume_goes_on_to_the_same_end(gasp, workplace):
    assert gasp("run", "scene.toml", "--out", "whole.gasp").status == 0
    assert gasp("run", "scene.toml", "--out", "parts.gasp", "--frames", 2).status == 0
    assert gasp("run", "scene.toml", "--out", "parts.gasp", "--resume").status == 0
    whole, parts = Recording.open("whole.gasp"), Recording.open("parts.gasp")
    assert parts.status == "complete"
    for frame in range(3):
        np.testing.assert_array_equal(parts.points(frame), whole.points(frame))


def test_resuming_says_where_there_is_nothing_to_do_it_with_or_for(gasp, workplace):
    begun = gasp("run", "scene.toml", "--out", "new.gasp", "--resume", "--frames", 2)
    assert begun.status == 0 and "new.gasp: no recording is there to go on with, it begins" in begun.out
    again = gasp("run", "scene.toml", "--out", "new.gasp", "--resume", "--frames", 1)
    told = "new.gasp: has 2 frames already, more than frames = 1: nothing is to be done"
    assert again.status == 0 and told in again.out and "begins" not in again.out


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("film.mp4", "--out film.mp4 is where frames are kept, a folder: --render film.mp4 films them"),
        ("toy.ply/x.gasp", "toy.ply is a file, and no folder"),
    ],
)
def test_where_no_run_can_be_kept_nothing_begins(refused, out, says):
    assert "starting" not in refused("run", "scene.toml", "--out", out, says=[says])


def test_engine_named_on_the_command_line_wins(gasp, workplace):
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text().replace("ballistic", "nothing"))
    assert gasp("run", scene, "--engine", "ballistic").status == 0


@pytest.fixture
def run(gasp, workplace):
    assert gasp("run", "scene.toml").status == 0
    return Recording.open(workplace / "scene.gasp")


@pytest.mark.parametrize("kind", ["ply", "splat", "spz", "sog"])
def test_export_of_all_frames(gasp, run, workplace, kind):
    outcome = gasp("export", "scene.gasp", "--all", "--format", kind)
    assert outcome.status == 0 and (outcome.err == "") == (kind == "ply")
    assert all(line.startswith(f"  .{kind}: ") for line in outcome.err.splitlines())
    paths = sorted((workplace / "scene_frames").iterdir())
    assert [path.name for path in paths] == [f"scene_{frame:04d}.{kind}" for frame in range(3)]
    # .spz keeps 24 bits of position with at least 12 of them after the point, .splat and .ply float32, .sog 2^16
    # steps over what is less than a metre wide and less than a metre away.
    bound = {"spz": 2.0**-13, "sog": 2.0**-16}.get(kind, 1e-6)
    for frame, path in enumerate(paths):
        np.testing.assert_allclose(read_splat(path).means, run.gaussians(frame).means, rtol=0, atol=bound)


def test_what_stands_on_z_stands_on_y_in_a_glb(gasp, run, refused, workplace):
    trimesh = pytest.importorskip("trimesh")
    assert gasp("export", "scene.gasp", "--frame", 2, "-o", "still.glb").status == 0
    (points,) = trimesh.load(workplace / "still.glb").geometry.values()
    means = run.gaussians(2).means
    np.testing.assert_allclose(points.vertices[:, 1], means[:, 2], atol=1e-6)
    refused("export", "scene.gasp", "--frame", 2, "--up", "+z", "-o", "other.glb", says=["--up +z", ".glb"])


def test_all_frames_in_one_stage(gasp, run, refused, workplace):
    usd = pytest.importorskip("pxr.Usd")
    assert gasp("export", "scene.gasp", "--all", "--format", "usd").out == "scene.usdc: 3 frames\n"
    stage = usd.Stage.Open("scene.usdc")
    assert (stage.GetMetadata("upAxis"), stage.GetTimeCodesPerSecond()) == ("Z", run.header.frame_rate)
    (name,) = (item.name for item in run.header.objects)
    positions = stage.GetPrimAtPath(f"/splats/{name}").GetAttribute("positions")
    for frame in range(3):
        np.testing.assert_allclose(np.array(positions.Get(frame)), run.gaussians(frame).means, rtol=0, atol=1e-6)
    refused("export", "scene.gasp", "--all", "-o", "scene.usdc", says=["scene.usdc is there already"])
    refused("export", "scene.gasp", "--all", "--up", "-y", "-o", "other.usdc", says=["--up -y", "+y or +z"])
    refused("export", "scene.gasp", "--all", "--format", "usd", "-o", "other.ply", says=["other.ply", ".usdc"])
    assert gasp("export", "scene.gasp", "--frame", 2, "--up", "+y", "-o", "still.usda").status == 0
    stage = usd.Stage.Open("still.usda")
    still = np.array(stage.GetPrimAtPath(f"/splats/{name}").GetAttribute("positions").Get())
    assert stage.GetMetadata("upAxis") == "Y"
    np.testing.assert_allclose(still[:, 1], run.gaussians(2).means[:, 2], rtol=0, atol=1e-6)


def test_an_object_that_is_called_as_grains_are_stays_in_its_stage(gasp, workplace):
    usd = pytest.importorskip("pxr.Usd")
    recording = flown_water(workplace / "water.gasp", name="grains")
    assert gasp("export", "water.gasp", "--all", "--as-drawn", "-o", "water.usdc").status == 0
    stage = usd.Stage.Open("water.usdc")
    prims = [prim.GetAttribute("positions") for prim in stage.Traverse() if prim.HasAttribute("positions")]
    drawn, last = DrawnFrames(recording), recording.frame_count - 1
    counts = [len(positions.Get(usd.TimeCode(last)) or []) for positions in prims]
    assert counts == [600, len(drawn.splats(last)) - 600] and counts[1] > 0


def test_a_run_in_one_file_and_a_film_of_it(gasp, run, refused, workplace):
    told = gasp("pack", "scene.gasp")
    assert told.status == 0, told
    assert told.out.startswith("scene.moving.sog: 3 frames, ")
    splat = MovingSplat.open("scene.moving.sog")
    assert splat.header.camera["vertical_angle"] > 0
    moved = splat.gaussians(2).means.mean(axis=0) - splat.gaussians(0).means.mean(axis=0)
    np.testing.assert_allclose(
        moved, run.gaussians(2).means.mean(axis=0) - run.gaussians(0).means.mean(axis=0), atol=1e-4
    )
    refused("pack", "scene.gasp", says=["scene.moving.sog is there already", "--overwrite"])
    refused("pack", "scene.gasp", "-o", "scene.zip", says=["scene.zip", ".sog"])
    refused("pack", "toy.ply", says=["toy.ply", "a recording is a folder"])
    refused("pack", "scene.gasp", "-o", "missing/a.sog", says=["missing/a.sog", "cannot be written"])
    assert gasp("pack", "scene.gasp", "--overwrite", "--error", "1e-3").status == 0
    assert gasp("pack", "scene.gasp", "--html").out.startswith("scene.html: 3 frames, ")
    assert "<canvas" in (workplace / "scene.html").read_text(encoding="utf-8")
    refused("pack", "scene.gasp", "--html", "-o", "scene.sog", says=["scene.sog", ".html"])
    footage = open_footage("scene.moving.sog")
    assert (footage.frame_count, footage.frame_rate) == (3, run.header.frame_rate)
    assert [type(one.shape) for one in footage.colliders] == [type(one.shape) for one in run.scene.colliders]
    np.testing.assert_allclose(footage.drawn(2).means, splat.gaussians(2).means, atol=1e-3)
    assert len(footage.subject(1)) == len(footage.splats(1))
    assert len(read_splat("scene.moving.sog")) == len(run.reference)


def test_export_of_one_frame(gasp, run, workplace):
    plain = gasp("export", "scene.gasp", "--frame", 2)
    assert (plain.out, plain.err) == ("scene_0002.ply\n", "")
    for arguments in (["--frame", "2", "-o", "a.splat"], ["--all", "--format", "splat"]):
        assert "  .splat: opacities and colours are rounded to 1/255" in gasp("export", "scene.gasp", *arguments).err
    assert gasp("export", "scene.gasp", "--frame", 2, "--out", "still.ply").status == 0
    assert (workplace / "still.ply").read_bytes() == (workplace / "scene_0002.ply").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--frame", "3"], ["scene.gasp", "frames 0 to 2"]),
        (["--frame", "0", "--out", "still.spz", "--format", "ply"], ["still.spz", ".ply", "--format"]),
        (["--all", "--out", "scene.toml"], ["scene.toml", "choose another place"]),
        (["--all", "--out", "toy.ply/frames"], ["toy.ply/frames", "choose another place"]),
        (["--all", "--out", "film.splat"], ["film.splat is to be a folder", "without .splat", "--format"]),
        (["--all", "--out", "scene.gasp"], ["lies in the recording itself", "another folder"]),
        (["--all", "--out", "scene.gasp/frames_of_it"], ["lies in the recording itself"]),
        (["--all", "--out", "film.GLB"], ["film.GLB is to be a folder", "without .glb"]),
        (["--all", "--out", "film.usdc", "--format", "ply"], ["film.usdc is to be a folder"]),
    ],
)
def test_export_that_cannot_be(refused, run, arguments, says):
    refused("export", "scene.gasp", *arguments, says=says)


def test_export_that_fails_half_way_takes_its_files_away(refused, run, workplace, monkeypatch):
    from gasp_core import io

    written = io.write_splat

    def full_at_two(path, gaussians):
        if path.stem.endswith("2"):
            raise SplatFormatError(f"{path}: no space is left")
        written(path, gaussians)

    monkeypatch.setattr(io, "write_splat", full_at_two)
    refused("export", "scene.gasp", "--all", says=["0002.ply", "no space"])
    # A folder that was there stays, with what else is in it.
    (workplace / "mine").mkdir()
    (workplace / "mine" / "note.txt").write_text("keep")
    refused("export", "scene.gasp", "--all", "--out", "mine", says=["no space"])


def test_ctrl_c_keeps_the_frames_and_says_how_to_go_on(workplace):
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text().replace("duration = 0.08", "duration = 4000"))
    process = subprocess.Popen(
        [sys.executable, "-m", "gasp_core.cli.main", "run", "scene.toml", "--cores", "0.5", "--precision", "float64"],
        cwd=workplace,
        env=os.environ | {"PYTHONPATH": str(FAKES / "ballistic")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    folder = workplace / "scene.gasp"
    try:
        wait_until(lambda: (folder / "zarr.json").exists() and Recording.open(folder).frame_count >= 3)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130
    # Where it takes long, how far it is as well.
    (told,) = [line for line in err.splitlines() if "so far," not in line and not line.endswith("so far")]
    assert told.startswith("gasp: stopped")
    assert told.endswith("to go on: gasp run scene.toml --resume --precision float64 --cores 0.5")
    assert (out + err).count("--resume") == 1
    recording = Recording.open(folder)
    assert recording.status == "incomplete"
    assert f"{recording.frame_count} frames, incomplete" in out


def wait_until(condition):
    """Poll; the limit only keeps a broken program from hanging the tests."""
    deadline = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < deadline, "the run never wrote its first frames"
        time.sleep(0.02)


def test_an_engine_that_breaks_its_process_says_where_and_the_next_run_how_to_learn_more(gasp_process, workplace):
    def run(*more, **options):
        return gasp_process(
            "run", "scene.toml", "--engine", "segfaults", *more, fakes=("ballistic", "segfaults"), **options
        )

    died = run()
    assert died.returncode == -signal.SIGSEGV
    assert "Segmentation fault" in died.stderr and "in advance_to" in died.stderr
    without_a_word = "the process that wrote it ended without a word (killed, crashed, or the machine stopped)"
    refused = run()
    assert refused.returncode == 2 and f"is there already, and {without_a_word}: resume it" in refused.stderr
    resumed = run("--resume", variables={"SEGFAULTS_IS_GOOD": "1"})
    assert resumed.returncode == 0, resumed.stderr
    assert f"scene.gasp: {without_a_word}; if segfaults has crashed it, gasp run --isolate" in resumed.stdout
    # It ended as it should since.
    again = run("--resume")
    assert again.returncode == 0 and "without a word" not in again.stdout


@pytest.mark.thorough
def test_demo_makes_a_scene_one_can_go_on_with(gasp, workplace):
    outcome = gasp("demo", "--engine", "reference-mpm", "--frames", 2)
    assert (outcome.status, outcome.err) == (0, "")
    folder = workplace / "gasp-demo"
    assert sorted(path.name for path in (folder / "frames").iterdir()) == ["toy_0000.ply", "toy_0001.ply"]
    first, second = (read_splat(path) for path in sorted((folder / "frames").iterdir()))
    # Free fall from rest for 1/25 s, all points alike until they touch: g t^2 / 2, and n steps of first order in time
    # miss at most the n-th part of it; float32 files of lengths of 0.5 leave 1e-5 of 8 mm.
    fallen = (first.means - second.means)[:, 2].mean()
    substeps = Recording.open(folder / "toy.gasp").diagnostics(1)["substeps"]
    assert fallen == pytest.approx(9.81 * 0.04**2 / 2, rel=1 / substeps + 1e-4)
    for hint in (
        f"gasp run {folder.name}/scene.toml",
        f"gasp export {folder.name}/toy.gasp",
        f"gasp view {folder.name}/toy.gasp",
    ):
        assert hint in outcome.out
    again = gasp("run", folder / "scene.toml", "--out", "mine.gasp", "--frames", 1)
    assert (again.status, again.err) == (0, "")
    assert gasp("demo", "--engine", "reference-mpm", "--frames", 1).status == 0
    assert (workplace / "gasp-demo-2" / "toy.ply").exists()


def test_a_dry_run_tells_what_it_would_take_and_keeps_nothing(gasp, workplace):
    before = set(workplace.rglob("*"))
    outcome = gasp("run", "scene.toml", "--dry-run", "--render", "film.mp4", "--render", "sheet.png")
    assert (outcome.status, outcome.err) == (0, "")
    lines = dict(line.split(maxsplit=1) for line in outcome.out.splitlines()[-8:-1])
    assert list(lines) == ["engine", "points", "grid", "substeps", "memory", "disk", "time"]
    assert lines["engine"] == "ballistic on cpu, float64"
    assert lines["points"].endswith("carry 64 Gaussians")
    assert "3 frames and the film" in lines["time"]
    told = json.loads(gasp("run", "scene.toml", "--dry-run", "--json", "--resolution", 12).out)
    assert (told["cells"], told["frames"], told["gaussians"]) == (12, 3, 64)
    assert told["seconds"] > 0
    assert set(workplace.rglob("*")) == before


def test_a_dry_run_says_how_long_it_has_been_trying(gasp, workplace, monkeypatch):
    monkeypatch.setattr(_Lines, "pause", 0.01)
    assert "trying its first moments: " in gasp("run", "scene.toml", "--dry-run").err
    for quiet in ("--json", "--quiet"):
        assert "trying" not in gasp("run", "scene.toml", "--dry-run", quiet).err


def test_a_dry_run_is_about_the_whole_run(gasp, workplace):
    outcome = gasp("run", "scene.toml", "--dry-run", "--frames", 2)
    assert outcome.status == 2
    assert "leave --resume and --frames out" in outcome.err


def test_the_motion_of_an_object_is_a_file_of_moments(gasp, refused, run, workplace):
    outcome = gasp("export", "scene.gasp", "--motion", "toy")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.startswith("scene_toy.csv: 3 moments of the point that was at [")
    lines = (workplace / "scene_toy.csv").read_text().splitlines()
    assert lines[0] == "time,x,y,z,qw,qx,qy,qz,residual"
    assert [float(line.split(",")[0]) for line in lines[1:]] == [0.0, 0.04, 0.08]
    refused("export", "scene.gasp", "--motion", "toy", says=["scene_toy.csv is there already"])
    refused("export", "scene.gasp", "--motion", "ploy", says=['"ploy"', "what moves: toy"])
    refused("export", "scene.gasp", "--motion", "toy", "--up", "-y", says=["--motion", "--up"])
    refused("export", "scene.gasp", "--motion", "toy", "--all", says=["one of"])
