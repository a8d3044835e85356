"""What is said of engines is what they did; who cannot, crashes or diverges is a row."""

import json
import math

import av
import numpy as np
import pytest
from object_store import object_store

import gasp_core as gasp
from gasp_core.errors import RecordingError, RenderingError, SceneError, UnknownEngineError
from gasp_core.simulation.splat_sources import prepare
from gasp_core.studies.comparison import filming
from gasp_core.studies.comparison.curves import curves_of
from gasp_core.studies.runs import RunStatus, chosen_backend

GRAVITY = 9.81
STEP = 1e-3
"""Of the frail engine, which adds to the speed first: at t it is g t STEP / 2 below the ballistic one's parabola."""


def endings(comparison):
    return {row.engine: row.outcome.ending for row in comparison.rows}


def test_distances_are_those_of_the_two_formulas(whole):
    assert endings(whole) == {"ballistic": RunStatus.COMPLETE, "frail": RunStatus.COMPLETE, "away": RunStatus.UNABLE}
    (pair,) = whole.pairs
    apart = pair.distance
    assert (pair.first, pair.second, apart.frames) == ("ballistic", "frail", tuple(range(21)))
    expected = GRAVITY * apart.times * STEP / 2
    # Displacements are kept as float32 about their mean, which is kept as float64: here all move alike.
    for measured in (apart.per_frame.rms, apart.per_frame.p95, apart.per_frame.centre_of_mass):
        assert np.allclose(measured, expected, rtol=1e-6, atol=1e-9)
    assert math.isclose(apart.rms, np.sqrt(np.mean(expected**2)), rel_tol=1e-6)
    assert apart.shape_rms < 1e-7
    assert math.isclose(apart.rms_share * apart.diagonal, apart.rms)


def test_pictures_are_those_of_the_same_places(whole):
    (pair,) = whole.pairs
    assert len(pair.likeness.frames) == 16
    assert 0 not in pair.likeness.frames
    # Millimetres apart in a picture metres wide: alike, and not the same.
    assert 30 < pair.likeness.psnr < 200
    assert 0.9 < pair.likeness.ssim <= 1
    for row in whole.rows[:2]:
        with av.open(str(row.film)) as film:
            stream = film.streams.video[0]
            assert (stream.width, stream.height, float(stream.average_rate)) == (96, 72, 25.0)
            assert sum(1 for _ in film.decode(video=0)) == 21
    assert whole.rows[2].film is None


@pytest.mark.thorough
def test_the_report_says_the_same_as_the_comparison(whole):
    report = json.loads((whole.folder / "comparison.json").read_text(encoding="utf-8"))
    assert report == whole.to_json()
    assert [row["status"] for row in report["engines"]] == ["complete", "complete", "unable"]
    assert "gasp engines install away" in report["engines"][2]["reason"]
    for row in report["engines"][:2]:
        assert row["run_seconds"] > 0
        assert row["start_seconds"] > 0
        assert row["peak_bytes"] > 20e6
        assert (whole.folder / row["recording"]).is_dir()
        assert (whole.folder / row["film"]).is_file()
    assert report["engines"][1]["substeps"] == 800
    (pair,) = report["pairs"]
    assert pair["distance"]["rms"] == whole.pairs[0].distance.rms
    assert len(pair["distance"]["per_frame"]["rms"]) == 21
    assert sorted(path.name for path in whole.folder.iterdir()) == [
        "ballistic.gasp",
        "ballistic.mp4",
        "comparison.html",
        "comparison.json",
        "frail.gasp",
        "frail.mp4",
    ]


def test_curves_are_those_of_a_fall(whole, scene_of):
    problem = prepare(scene_of()).assembly.problem
    masses = problem.masses
    curves = curves_of(gasp.Recording.open(whole.rows[0].outcome.recording), masses)
    total, time = masses.sum(), curves.times
    (height,) = curves.heights.values()
    start = masses @ problem.points.reference_positions[:, 2] / total
    # Means are kept in float64; the rest, which is nothing here, in float32.
    assert np.allclose(height, start - GRAVITY * time**2 / 2, atol=1e-7)
    assert np.allclose(curves.momentum_times, (np.arange(20) + 0.5) / 25)
    # Between two frames the mean velocity of a parabola is that in the middle of the two.
    assert np.allclose(curves.momentum[:, 2], -total * GRAVITY * curves.momentum_times, rtol=1e-5, atol=1e-6 * total)
    assert np.allclose(curves.momentum[:, 0], total * 0.5, rtol=1e-5)
    assert np.allclose(curves.momentum[:, 1], 0, atol=1e-6 * total)
    # What falls freely keeps its energy, that of its start.
    assert np.allclose(curves.energy, total * 0.5**2 / 2, rtol=1e-5)
    with pytest.raises(RecordingError, match="points"):
        curves_of(gasp.Recording.open(whole.rows[0].outcome.recording), masses[1:])


@pytest.mark.thorough
def test_who_diverges_is_compared_as_far_as_it_came(scene_of, tmp_path, size):
    found = gasp.compare(scene_of(fault="nan"), ["frail", "ballistic"], tmp_path / "out", size=size)
    assert endings(found) == {"frail": RunStatus.DIVERGED, "ballistic": RunStatus.COMPLETE}
    assert [row.outcome.frame_count for row in found.rows] == [3, 6]
    (pair,) = found.pairs
    assert pair.distance.frames == (0, 1, 2)
    assert pair.likeness.frames == (1, 2)
    with av.open(str(found.rows[0].film)) as film:
        assert sum(1 for _ in film.decode(video=0)) == 3
    assert "ends at 0.08 s" in found.page.read_text(encoding="utf-8")


@pytest.mark.thorough
def test_who_crashes_takes_nobody_along_and_what_was_there_can_be_replaced(scene_of, tmp_path, size):
    out = tmp_path / "out"
    for name in ("frail.gasp", "away.gasp"):
        gasp.simulate(scene_of(), "ballistic", out / name, frames=1, progress=False)
    (out / "away.mp4").write_text("a film of an engine that is not asked for now")
    (out / "comparison.json").write_text('{"engines": [{"engine": "away"}, {"engine": "../../mine"}]}')
    (tmp_path / "mine.gasp").mkdir()
    (out / "mine.txt").write_text("precious")
    scene, engines = scene_of(fault="segfault"), ["frail", "ballistic"]
    with pytest.raises(RecordingError, match="--overwrite"):
        gasp.compare(scene, engines, out, size=size)
    assert gasp.Recording.open(out / "frail.gasp").frame_count == 1
    found = gasp.compare(scene, engines, out, size=size, at_once=2, overwrite=True)
    assert endings(found) == {"frail": RunStatus.CRASHED, "ballistic": RunStatus.COMPLETE}
    assert "SIGSEGV" in found.rows[0].outcome.reason
    assert found.pairs[0].distance.frames == (0, 1, 2)
    assert (out / "mine.txt").read_text() == "precious"
    assert (tmp_path / "mine.gasp").is_dir()
    assert not (out / "away.gasp").exists()
    assert not (out / "away.mp4").exists()


def test_where_there_is_nothing_to_compare_that_is_told(scene_of, tmp_path, size):
    found = gasp.compare(scene_of(), ["ballistic"], tmp_path / "one", size=size)
    assert found.pairs == () and any("one engine was asked for" in note for note in found.notes)
    found = gasp.compare(scene_of(), ["ballistic", "away"], tmp_path / "two", size=size)
    assert found.pairs == () and "nothing is compared: only ballistic has frames to show" in found.notes


def test_what_is_nobody_s_recording_is_not_replaced(scene_of, tmp_path):
    (tmp_path / "frail.gasp").mkdir()
    (tmp_path / "frail.gasp" / "mine").write_text("precious")
    with pytest.raises(RecordingError, match="is no recording"):
        gasp.compare(scene_of(), ["frail"], tmp_path, overwrite=True)
    assert (tmp_path / "frail.gasp" / "mine").read_text() == "precious"


@pytest.mark.thorough
def test_recordings_at_an_address(scene_of, tmp_path, size, monkeypatch):
    """They are brought there, compared as they are there, and replaced where that is asked for alone."""
    monkeypatch.setenv("GASP_CACHE", str(tmp_path / "cache"))
    scene, engines = scene_of(spin=2), ["frail", "ballistic"]
    with object_store() as bucket:
        here = gasp.compare(scene, engines, tmp_path / "here", size=size)
        there = gasp.compare(scene, engines, tmp_path / "out", keep_at=f"{bucket}/runs", size=size)
        assert endings(there) == endings(here)
        assert there.pairs[0].distance.rms_share == here.pairs[0].distance.rms_share > 0
        assert not list((tmp_path / "out").glob("*.gasp")) and len(list((tmp_path / "out").glob("*.mp4"))) == 2
        assert gasp.Recording.open(f"{bucket}/runs/frail.gasp").frame_count == 6
        with pytest.raises(RecordingError, match=r"frail\.gasp: is there already.*--keep-at"):
            gasp.compare(scene, engines, tmp_path / "more", keep_at=f"{bucket}/runs", size=size)
        assert not (tmp_path / "more").exists()
        nowhere = gasp.compare(scene, ["frail"], tmp_path / "more", keep_at="s3://no-such-bucket/runs", size=size)
        assert nowhere.rows[0].outcome.ending is RunStatus.FAILED
        assert "s3://no-such-bucket/runs" in nowhere.rows[0].outcome.reason
        again = scene_of(spin=3)
        gasp.compare(again, engines, tmp_path / "out", keep_at=f"{bucket}/runs", size=size, overwrite=True)
        assert gasp.Recording.open(f"{bucket}/runs/frail.gasp").header.engine.options["spin"] == 3


def test_an_earlier_one_stays_where_nobody_can_make_another(scene_of, tmp_path, monkeypatch, size):
    pytest.importorskip("distributed")
    from gasp_core.studies.runs.backends import dask_cluster

    monkeypatch.setattr(dask_cluster, "_PATIENCE", 0.5)
    kept = gasp.simulate(scene_of(), "ballistic", tmp_path / "frail.gasp", frames=2, progress=False)
    backend = chosen_backend("dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(gasp.errors.BackendError):
        gasp.compare(scene_of(), ["frail"], tmp_path, overwrite=True, backend=backend, size=size)
    assert kept.frame_count == 2 and len(kept.points(1))


def test_bad_choices_are_refused_before_anything_is_made(scene_of, tmp_path):
    out = tmp_path / "out"
    for engines, options, kind, words in [
        (["frail", "balistic"], {}, UnknownEngineError, 'did you mean "ballistic"'),
        (["frail", "frail"], {}, SceneError, "twice"),
        ([], {}, SceneError, "no engine was named"),
        (["frail"], {"resolution": 0}, SceneError, "resolution"),
        (["frail"], {"at_once": 0}, SceneError, "at_once"),
        (["frail"], {"time_limit": -1.0}, SceneError, "time_limit"),
        (["frail"], {"size": (0, 5)}, RenderingError, "width"),
    ]:
        with pytest.raises(kind, match=words):
            gasp.compare(scene_of(), engines, out, **options)
    assert not out.exists()
    # Nor is anything removed that would be replaced.
    kept = gasp.simulate(scene_of(), "ballistic", out / "frail.gasp", frames=1, progress=False)
    for options in ({"at_once": 0}, {"time_limit": -1.0}, {"size": (0, 5)}):
        with pytest.raises(gasp.GaspError):
            gasp.compare(scene_of(), ["frail"], out, overwrite=True, **options)
    assert kept.frame_count == 1
    file = tmp_path / "file"
    file.write_text("precious")
    with pytest.raises(RecordingError):
        gasp.compare(scene_of(), ["frail"], file)
    assert file.read_text() == "precious"


@pytest.fixture
def recordings(whole):
    return {row.engine: gasp.Recording.open(row.outcome.recording) for row in whole.rows[:2]}


def refusing(*_):
    raise RenderingError("this measure needs something: pip install something")


@pytest.mark.thorough
def test_without_a_measure_of_pictures_there_are_films_all_the_same(recordings, tmp_path, monkeypatch, size):
    monkeypatch.setattr(filming, "psnr", refusing)
    filmed = filming.film_all(recordings, tmp_path, size, progress=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ballistic.mp4", "frail.mp4"]
    assert filmed.likenesses == {}
    assert "pip install something" in filmed.notes[0]


def test_without_a_renderer_there_is_a_note_and_no_film(recordings, tmp_path, monkeypatch, size):
    monkeypatch.setattr(filming, "open_renderer", refusing)
    filmed = filming.film_all(recordings, tmp_path, size, progress=False)
    assert (filmed.films, filmed.likenesses, list(tmp_path.iterdir())) == ({}, {}, [])
    assert filmed.notes[0].startswith("not filmed: ")
