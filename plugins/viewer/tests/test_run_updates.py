import shutil

import numpy as np
import pytest
from gasp_viewer.run_updates import FileNews, RunNews, figure

from gasp_core import Recording
from gasp_core.io import write_splat
from gasp_core.rendering.footage import RecordedFootage, open_footage
from gasp_core.rendering.framing import motion_of


@pytest.fixture
def copied(tmp_path, toy_run):
    """The toy's run, to be spoilt."""
    shutil.copytree(toy_run, tmp_path / "run.gasp")
    return tmp_path / "run.gasp"


def test_a_finished_run(toy_footage):
    news = RunNews(toy_footage).look()
    assert (news.count, news.status, news.growing, news.problem) == (6, "complete", False, "")


def test_a_run_that_goes_on_and_one_that_was_killed(gated_run):
    gated_run.let(2)
    source = RunNews(open_footage(gated_run.path))
    news = source.look()
    assert (news.count, news.growing) == (3, True)
    assert news.status == "running, 6 frames in the end"
    gated_run.let(4)
    assert source.look().count == 5
    gated_run.kill()
    news = source.look()
    assert not news.growing
    assert news.status.startswith("incomplete: the process that wrote it ended")


def test_frames_that_are_taken_back(copied):
    source = RunNews(open_footage(copied))
    assert source.look().count == 6
    for frame in (5, 4):
        shutil.rmtree(copied / "commits" / f"{frame:08d}")
    assert source.look().count == 4
    assert dict(source.facts(5))["substeps"] == "–"


def test_a_run_that_vanishes(copied):
    source = RunNews(open_footage(copied))
    shutil.rmtree(copied)
    news = source.look()
    assert news.count == 0 and not news.growing
    assert str(copied) in news.problem
    assert dict(source.facts(3))["time"] == "–"


def test_a_run_that_loses_its_status_only(copied):
    source = RunNews(open_footage(copied))
    shutil.rmtree(copied / "status")
    news = source.look()
    assert news.count == 6
    assert "status" in news.problem


def test_another_run_in_its_place(copied, toy, scene_of, record):
    source = RunNews(open_footage(copied))
    record(scene_of(toy.select(np.arange(500))), copied, overwrite=True)
    news = source.look()
    assert news.count == 0
    assert news.problem == "Another run is here now: start gasp view again."


def test_facts_are_the_recordings_diagnostics(toy_footage):
    facts = dict(RunNews(toy_footage).facts(3))
    known = Recording.open(toy_footage.path).diagnostics(3)
    assert facts["time"] == "0.12 s"
    assert facts["engine"] == "falling (cpu, float64)"
    assert facts["Gaussians"] == "2,000, all simulated"
    assert facts["points"] == "8,000"
    assert facts["substeps"] == "1"
    assert facts["smallest substep"] == "0.04 s"
    assert facts["kinetic energy"] == f"{known['kinetic_energy']:.4g} J" if known["kinetic_energy"] else "–"
    assert facts["potential energy"] == f"{known['potential_energy']:.4g} J"
    assert facts["degenerate"] == "0"


def test_warnings_are_facts(copied):
    import json

    from gasp_core.recording.nodes import sealed

    commit = copied / "commits" / "00000002" / "zarr.json"
    node = json.loads(commit.read_text())
    node["attributes"]["diagnostics"]["warnings"] = ["<b>too</b> fast"]
    commit.write_bytes(sealed(node))
    assert ("warning", "<b>too</b> fast") in RunNews(open_footage(copied)).facts(2)


def test_the_motion_grows_by_the_frame(toy_footage):
    start = motion_of(toy_footage, [0])
    source = RunNews(toy_footage)
    both = source.extended(start, 5)
    assert both.lower[2] < start.lower[2]
    expected = motion_of(RecordedFootage(Recording.open(toy_footage.path)), [0, 5])
    np.testing.assert_array_equal(both.lower, expected.lower)
    np.testing.assert_array_equal(both.upper, expected.upper)
    assert source.extended(start, 99) is start


def test_a_file(tmp_path, toy):
    write_splat(tmp_path / "toy.ply", toy)
    source = FileNews(open_footage(tmp_path / "toy.ply", "+z"))
    assert source.look().count == 1 and not source.look().growing
    assert source.facts(0) == [("file", "toy.ply"), ("Gaussians", "2,000"), ("SH degree", "1")]


def test_figures():
    assert [figure(None), figure(0), figure(12345), figure(0.000236686, "s"), figure(1e-9, "J")] == [
        "–",
        "0",
        "12,345",
        "0.0002367 s",
        "1e-09 J",
    ]
