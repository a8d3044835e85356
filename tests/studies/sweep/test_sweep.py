"""A sweep: a row a run, whatever becomes of it; what is there stays there."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
from object_store import object_store

from gasp_core import Swing, load_scene, simulate
from gasp_core.errors import AccuracyError, BackendError, RecordingError, SceneError
from gasp_core.studies.runs import Limits, chosen_backend
from gasp_core.studies.sweep import Measures, load_observable, planned, settings_of, sweep
from gasp_core.studies.sweep.alone import alone_in
from gasp_core.studies.sweep.table import Ledger

TWO = chosen_backend(at_once=2)


def rows_of(folder):
    with (folder / "sweep.csv").open() as stream:
        return list(csv.DictReader(stream))


class Nobody:
    """Makes no run."""

    class Ended(Exception):
        pass

    @contextmanager
    def made(self, runs, limits):
        def ended():
            raise Nobody.Ended
            yield

        yield ended() if runs else iter(())


def test_rows_are_what_runs_by_hand_come_to(scene, tmp_path, measured):
    """To the bit, through processes and text; with distances from a run that is named."""
    observable, _ = measured
    simulate(load_scene(scene, ["engine.options.spin=1"]), "frail", tmp_path / "reference.gasp", progress=False)
    measures = Measures(observables=(observable,), reference=tmp_path / "reference.gasp")
    plan = planned(scene, settings_of(["engine.options.spin=1,2", "object.toy.height=0.3,0.4"]))
    found = sweep(plan, tmp_path / "out", measures=measures, backend=TWO, progress=False)
    assert [row.status for row in found.rows] == ["complete"] * 4 and found.kept == 0
    for row, each in zip(found.rows, plan):
        here = simulate(each.scene, out=tmp_path / "here.gasp", overwrite=True, progress=False)
        points = here.points(here.frame_count - 1)
        columns = row.columns
        assert columns["tip"] == points[:, 2].max() == columns["toy.highest"]
        assert columns["toy.lowest"] == points[:, 2].min()
        assert [columns[f"toy.centre_{axis}"] for axis in "xyz"] == points.mean(axis=0).tolist()
        gone = max(np.linalg.norm(here.points(k) - here.points(0), axis=1).max() for k in range(here.frame_count))
        assert columns["toy.moved"] == pytest.approx(gone, rel=1e-12)
        assert (columns["frames"], columns["substeps"], columns["points"]) == (5, 160, len(points))
    same, other = found.rows[0].columns, found.rows[2].columns
    assert (same["rms_share"], same["apart_at"]) == (0.0, None)
    assert other["rms_share"] > 0.01 and 0 < other["apart_at"] <= 0.16
    assert "not_compared" not in same and "rms_share" not in found.rows[1].columns
    assert found.rows[1].columns["not_compared"], "of another size: nothing to measure a distance by"
    table = rows_of(tmp_path / "out")
    assert [(row["engine.options.spin"], row["object.toy.height"]) for row in table] == [
        ("1", "0.3"), ("1", "0.4"), ("2", "0.3"), ("2", "0.4"),
    ]  # fmt: skip
    assert float(table[3]["tip"]) == found.rows[3].columns["tip"]
    assert not list((tmp_path / "out" / "runs").iterdir()), "recordings that nobody asked to keep"


@pytest.mark.thorough
def test_parquet_is_the_same_table(scene, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    plan = planned(scene, settings_of(["engine.options.spin=1,x,2.5"]))
    found = sweep(plan, tmp_path / "out", backend=TWO, progress=False)
    table = parquet.read_table(tmp_path / "out" / "sweep.parquet").to_pydict()
    assert found.parquet
    assert table["engine.options.spin"] == ["1", "x", "2.5"]
    assert table["status"] == ["complete", "failed", "complete"]
    assert table["toy.highest"] == [row.columns.get("toy.highest") for row in found.rows]


def test_whatever_becomes_of_a_run_is_a_row(scene, tmp_path):
    """Refused by the scene in one row alone, beyond the engine, crashed, too large: one line each."""
    settings = [
        *settings_of(["object.toy.height=0.3,-1"]),
        *settings_of(['engine.options.fault=kill,"nan",open:import']),
        *settings_of(["object.toy.splat=nowhere.ply"]),
    ]
    plan = planned(scene, settings)
    found = sweep(plan, tmp_path / "out", backend=TWO, limits=Limits(threads=1), progress=False)
    status = [row.status for row in found.rows]
    assert status == ["complete", "refused", "crashed", "diverged", "unable", "refused"]
    reasons = [row.columns["reason"] for row in found.rows]
    for reason, said in zip(reasons[1:], ["height", "SIGKILL", "non_finite", "backend", "nowhere"]):
        assert said in reason and "\n" not in reason
    assert len(found.completed) == 1
    # Three frames of what crashed were there to be measured.
    assert found.rows[2].columns["frames"] == 3 and found.rows[2].columns["toy.moved"] > 0


def test_one_that_hangs_is_given_up(scene, tmp_path):
    plan = planned(scene, settings_of(["engine.options.fault=hang"]))
    found = sweep(plan, tmp_path / "out", limits=Limits(seconds=2.0), progress=False)
    assert found.rows[0].status == "crashed"
    assert "given up after 2 s" in found.rows[0].columns["reason"] and "\n" not in found.rows[0].columns["reason"]


def test_one_that_takes_too_much_memory_is_given_up(scene, tmp_path):
    plan = planned(scene, settings_of(["engine.options.fault=hang"]))
    found = sweep(plan, tmp_path / "out", limits=Limits(memory=20_000_000), progress=False)
    assert found.rows[0].status == "crashed"
    assert "took more memory than 20 MB" in found.rows[0].columns["reason"]


def test_rows_that_are_there_stay_and_the_rest_is_done(scene, tmp_path, measured):
    observable, told = measured
    measures, out = Measures(observables=(observable,)), tmp_path / "out"
    first = planned(scene, settings_of(["engine.options.spin=1,2"]))
    before = sweep(first, out, measures=measures, backend=TWO, progress=False)
    more = planned(scene, settings_of(["engine.options.spin=3,2,1"]))
    found = sweep(more, out, measures=measures, backend=TWO, progress=False)
    assert sorted(told()) == ["1", "2", "3"]
    assert found.kept == 2 and found.rows[1:] == before.rows[::-1] and found.others == 0
    assert [row["engine.options.spin"] for row in rows_of(out)] == ["3", "2", "1"]
    # Fewer are asked for: the others stay where they can be had again.
    fewer = sweep(planned(scene, settings_of(["engine.options.spin=3"])), out, measures=measures, progress=False)
    assert fewer.others == 2 and len(rows_of(out)) == 1
    assert sweep(more, out, measures=measures, progress=False).kept == 3


def test_a_table_of_rows_that_are_no_more_goes_with_them(scene, tmp_path):
    """Whoever ends a sweep that makes all anew finds no table of the one before."""
    out, plan = tmp_path / "out", planned(scene, settings_of(["engine.options.spin=1"]))
    sweep(plan, out, progress=False)
    assert (out / "sweep.csv").exists()

    with pytest.raises(Nobody.Ended):
        sweep(plan, out, backend=Nobody(), overwrite=True, progress=False)
    assert [path.name for path in out.iterdir() if path.suffix in (".csv", ".parquet", ".jsonl")] == []


def test_what_failed_is_made_again_and_what_was_refused_is_not(scene, tmp_path):
    out = tmp_path / "out"
    settings = settings_of(["engine.options.note=" + str(tmp_path / "no" / "folder"), "object.toy.height=0.3,-1"])
    first = sweep(planned(scene, settings), out, progress=False)
    assert [row.status for row in first.rows] == ["crashed", "refused"]
    (tmp_path / "no").mkdir()
    again = sweep(planned(scene, settings), out, progress=False)
    assert [row.status for row in again.rows] == ["complete", "refused"] and again.kept == 1


def test_a_scene_that_has_changed_is_noticed(scene, tmp_path):
    """In what it says, and in a file that it names; what is told leaves the table as it was."""
    from gasp_core.io import write_splat
    from gasp_core.toy import make_toy

    out, settings, before = tmp_path / "out", settings_of(["engine.options.spin=1"]), scene.read_text()
    sweep(planned(scene, settings), out, progress=False)

    def refused():
        with pytest.raises(RecordingError, match=r"1 of its rows are of another scene.*spin=1"):
            sweep(planned(scene, settings), out, progress=False)

    scene.write_text(before.replace("height = 0.3", "height = 0.31"))
    refused()
    scene.write_text(before)
    assert sweep(planned(scene, settings), out, progress=False).kept == 1
    write_splat(scene.parent / "toy.ply", make_toy(65))
    refused()
    assert sweep(planned(scene, settings), out, overwrite=True, progress=False).kept == 0


def test_a_comment_is_no_change(scene, tmp_path):
    out, settings = tmp_path / "out", settings_of(["engine.options.spin=1"])
    sweep(planned(scene, settings), out, progress=False)
    scene.write_text("# A remark.\n" + scene.read_text())
    assert sweep(planned(scene, settings), out, progress=False).kept == 1


def test_other_measures_are_noticed_and_an_engine_that_comes_later(scene, tmp_path, measured):
    observable, _ = measured
    out = tmp_path / "out"
    sweep(planned(scene, settings_of(["engine.options.spin=1"])), out, progress=False)
    with pytest.raises(
        RecordingError, match=r"1 of its rows were asked for other observables.*no recordings lie beside it"
    ):
        sweep(
            planned(scene, settings_of(["engine.options.spin=1"])),
            out,
            measures=Measures(observables=(observable,)),
            progress=False,
        )
    # Refused while there was no such engine, and made once there is.
    later = tmp_path / "later"
    missing = planned(scene, settings_of(["engine.name=frail,nobody"]))
    assert [row.status for row in sweep(missing, later, progress=False).rows] == ["complete", "refused"]
    import dataclasses

    there = [missing[0], dataclasses.replace(missing[1], scene=missing[0].scene, digest="1", reason="")]
    again = sweep(there, later, progress=False)
    assert [row.status for row in again.rows] == ["complete", "complete"] and again.kept == 1


def test_another_reference_of_the_same_name_is_noticed(scene, tmp_path):
    """And the same one is the same at another place, or with another camera."""
    reference, out = tmp_path / "reference.gasp", tmp_path / "out"
    measures, plan = Measures(reference=reference), planned(scene, settings_of(["engine.options.spin=1"]))

    def made(*changes):
        simulate(load_scene(scene, changes), out=reference, overwrite=True, progress=False)

    def swept(measures=measures, **how):
        return sweep(plan, out, measures=measures, progress=False, **how)

    made("engine.options.spin=1")
    assert swept().rows[0].columns["rms_share"] == 0
    elsewhere = Measures(reference=shutil.copytree(reference, tmp_path / "elsewhere.gasp"))
    assert swept(elsewhere).kept == 1
    made("engine.options.spin=1", "camera.view=top")
    assert swept().kept == 1
    for changes in (["engine.options.spin=2"], ["engine.options.spin=1", "scene.duration=0.08"]):
        made(*changes)
        with pytest.raises(RecordingError, match="asked for other observables, or distances from another reference"):
            swept()
    made("engine.options.spin=2")
    assert swept(overwrite=True).rows[0].columns["rms_share"] > 0.01
    (reference / "commits" / "00000001" / "zarr.json").write_bytes(b"torn")
    with pytest.raises(RecordingError, match=r"commits/00000001/zarr\.json is damaged"):
        swept()


def test_an_earlier_table_stays_where_nobody_can_make_another(scene, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from gasp_core.studies.runs.backends import dask_cluster

    monkeypatch.setattr(dask_cluster, "_PATIENCE", 0.5)
    plan = planned(scene, settings_of(["engine.options.spin=1", "object.toy.height=0.3,-1"]))
    sweep(plan, tmp_path / "out", keep=True, progress=False)

    def everything():
        return {file: file.read_bytes() for file in (tmp_path / "out").rglob("*") if file.is_file()}

    before, nobody = everything(), chosen_backend("dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(BackendError):
        sweep(plan, tmp_path / "out", keep=True, overwrite=True, backend=nobody, progress=False)
    assert everything() == before
    with pytest.raises(BackendError):
        sweep(plan, tmp_path / "new", backend=nobody, progress=False)
    assert not (tmp_path / "new").exists()
    again = sweep(plan, tmp_path / "out", overwrite=True, progress=False)
    assert again.kept == 0 and [row.status for row in again.rows] == ["complete", "refused"]
    assert not list((tmp_path / "out" / "runs").iterdir())


def test_two_into_one_folder_are_kept_apart(scene, tmp_path):
    plan = planned(scene, settings_of(["engine.options.spin=1"]))
    with alone_in(tmp_path / "out"):
        with pytest.raises(RecordingError, match="another sweep is at work there"):
            sweep(plan, tmp_path / "out", progress=False)
        with pytest.raises(RecordingError, match="another sweep"):
            sweep(plan, tmp_path / "out", overwrite=True, progress=False)
    assert len(sweep(plan, tmp_path / "out", progress=False).completed) == 1


def test_recordings_that_are_kept(scene, tmp_path):
    from gasp_core import Recording

    plan = planned(scene, settings_of(["engine.options.spin=1"]))
    found = sweep(plan, tmp_path / "out", keep=True, progress=False)
    recording = Recording.open(tmp_path / "out" / found.rows[0].columns["recording"])
    assert recording.status == "complete" and recording.frame_count == 5


def test_what_is_asked_later_is_asked_of_the_recordings(scene, tmp_path, measured):
    """And no run is made: once more for what came first, and a row for which there is no recording is told of."""
    observable, told = measured
    out, plan = tmp_path / "out", planned(scene, settings_of(["engine.options.spin=1,2"]))
    before = sweep(plan, out, keep=True, progress=False)
    found = sweep(plan, out, measures=Measures(observables=(observable,)), backend=Nobody(), progress=False)
    assert found.kept == 2 and len(told()) == 2
    for row, earlier in zip(found.rows, before.rows):
        assert row.columns["tip"] == row.columns["toy.highest"]
        assert {name: value for name, value in row.columns.items() if name != "tip"} == earlier.columns
    assert [float(row["tip"]) for row in rows_of(out)] == [row.columns["tip"] for row in found.rows]
    again = sweep(plan, out, backend=Nobody(), progress=False)
    assert [row.columns for row in again.rows] == [row.columns for row in before.rows]
    shutil.rmtree(out / before.rows[1].columns["recording"])
    with pytest.raises(RecordingError, match=r"1 of its rows were asked for other observables.*spin=2: choose"):
        sweep(plan, out, measures=Measures(observables=(observable,)), progress=False)


@pytest.mark.thorough
def test_a_row_whose_recording_is_not_there_is_made_again_where_it_is_to_be_kept(scene, tmp_path, capsys):
    """What has no frame, or no scene, has none; where nobody asks for recordings those that are there stay."""
    from gasp_core import Recording

    out = tmp_path / "out"
    settings = [*settings_of(["engine.options.spin=1,2"]), *settings_of(['engine.options.fault="nan"'])]
    plan = planned(scene, [*settings, *settings_of(["object.toy.height=-1"])])
    before = sweep(plan, out, progress=False)
    assert [row.status for row in before.rows] == ["complete", "complete", "diverged", "refused"]
    found = sweep(plan, out, keep=True, progress="log")
    assert found.kept == 1 and [row.status for row in found.rows] == [row.status for row in before.rows]
    assert "rows without the recordings that are to be kept, which are made anew: 3" in capsys.readouterr().err
    for row in found.rows[:3]:
        assert Recording.open(out / row.columns["recording"]).frame_count == row.columns["frames"] > 0
    again = sweep(plan, out, keep=True, progress=False)
    assert again.kept == 4 and again.rows == found.rows
    shutil.rmtree(out / found.rows[1].columns["recording"])
    assert sweep(plan, out, progress=False).kept == 4
    mended = sweep(plan, out, keep=True, progress=False)
    assert mended.kept == 3 and mended.rows[0] == found.rows[0]
    assert Recording.open(out / mended.rows[1].columns["recording"]).status == "complete"
    with object_store() as bucket:
        moved = sweep(plan[:1], out, keep_at=f"{bucket}/sweep", progress=False)
        assert moved.kept == 0 and Recording.open(moved.rows[0].columns["recording"]).status == "complete"
        assert sweep(plan[:1], out, keep_at=f"{bucket}/sweep", progress=False).kept == 1
    assert Recording.open(out / found.rows[0].columns["recording"]).status == "complete"


@pytest.mark.thorough
def test_recordings_at_an_address(scene, tmp_path):
    """Workers bring them there; nothing of them stays here."""
    from gasp_core import Recording

    plan = planned(scene, settings_of(["engine.options.spin=1,2"]))
    with object_store() as bucket:
        found = sweep(plan, tmp_path / "out", keep_at=f"{bucket}/sweep", backend=TWO, progress=False)
        for row, each in zip(found.rows, plan):
            assert (row.status, row.columns["reason"]) == ("complete", "")
            here = simulate(each.scene, out=tmp_path / "here.gasp", overwrite=True, progress=False)
            there = Recording.open(row.columns["recording"])
            assert np.array_equal(there.points(4), here.points(4)) and there.status == "complete"
        elsewhere = sweep(plan, tmp_path / "other", keep_at="s3://no-such-bucket/sweep", backend=TWO, progress=False)
    assert [row.status for row in elsewhere.rows] == ["failed", "failed"]
    assert "s3://no-such-bucket/sweep" in elsewhere.rows[0].columns["reason"]
    assert not list((tmp_path / "out" / "runs").iterdir())


KILLED = """
import sys
from contextlib import contextmanager
from pathlib import Path
from gasp_core.studies.runs import chosen_backend
from gasp_core.studies.sweep import Measures, load_observable, planned, settings_of, sweep

if __name__ == "__main__":
    spins = ",".join(map(str, range(1, 6)))
    plan = planned(sys.argv[1], settings_of(["engine.options.pause=0.1", "engine.options.spin=" + spins]))
    measures = Measures(observables=(load_observable(sys.argv[3]),))
    try:
        found = sweep(plan, Path(sys.argv[2]), measures=measures, backend=chosen_backend(at_once=2), progress=False)
        print(found.kept, len(found.completed), flush=True)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.thorough)])
def test_killed_in_the_middle_and_called_again(scene, tmp_path, measured, number):
    """What was done is not done again; the table is that of a sweep that nobody ended."""
    observable, told = measured
    script, out = tmp_path / "script.py", tmp_path / "out"
    script.write_text(KILLED)
    command = [sys.executable, str(script), str(scene), str(out), f"{observable.file}:tip"]
    others = {"env": os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, start_new_session=True, **others)
    deadline = time.monotonic() + 60

    def rows_there():
        # As it lies there: a ledger that is opened takes off what is torn.
        return (out / "sweep.jsonl").read_bytes().count(b"\n") - 1 if (out / "sweep.jsonl").exists() else 0

    while rows_there() < 1 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, number)
    process.communicate(timeout=30)
    there = len(Ledger(out / "sweep.jsonl").rows)
    assert 1 <= there < 5
    done = subprocess.run(command, check=True, **others)
    assert done.stdout.split() == [str(there), "5"]
    # One that was being measured when it ended is measured again.
    assert len(set(told())) == 5 and len(told()) <= 5 + 2
    plan = planned(scene, settings_of(["engine.options.pause=0.1", "engine.options.spin=1,2,3,4,5"]))
    rows = rows_of(out)
    for row, each in zip(rows, plan, strict=True):
        here = simulate(each.scene, out=tmp_path / "here.gasp", overwrite=True, progress=False)
        assert float(row["tip"]) == here.points(here.frame_count - 1)[:, 2].max()


def test_a_torn_line_is_taken_off(scene, tmp_path):
    out, settings = tmp_path / "out", settings_of(["engine.options.spin=1,2"])
    sweep(planned(scene, settings), out, backend=TWO, progress=False)
    path = out / "sweep.jsonl"
    content = path.read_bytes()
    lines = content.split(b"\n")
    for cut in (1, 30, len(lines[-2]) - 1):
        path.write_bytes(content[:-cut])
        assert len(Ledger(path).rows) == 1
        assert path.read_bytes() == b"\n".join(lines[:-2]) + b"\n"
    path.write_bytes(content[:9])
    assert Ledger(path).rows == []


@pytest.mark.parametrize(
    "content", [b"{}\n", b"hello\n", b'{"gasp sweep": 1}\n{"setting": 3}\n', b'{"gasp sweep": 2}\n', b"\xff\n"]
)
def test_what_is_no_ledger_stays(tmp_path, content):
    path = tmp_path / "sweep.jsonl"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"sweep\.jsonl: is no table that gasp sweep wrote"):
        Ledger(path)
    assert path.read_bytes() == content


def test_a_ledger_of_any_words(tmp_path):
    from gasp_core.studies.sweep import Row, Setting

    ledger = Ledger(tmp_path / "sweep.jsonl")
    row = Row(setting=Setting(values={"a": "\u2028\nx\u00e4"}), scene="", status="refused", columns={"reason": "\x85"})
    ledger.add(row)
    assert Ledger(ledger.path).rows == [row]
    assert json.loads(ledger.path.read_bytes().split(b"\n")[1])["status"] == "refused"


def test_what_no_run_can_be_made_of(scene, tmp_path):
    with pytest.raises(SceneError, match="unknown key"):
        planned(scene, settings_of(["object.toy.colour=1,2"]))
    with pytest.raises(SceneError, match="no such scene file"):
        planned(tmp_path / "none.toml", settings_of(["a=1"]))
    with pytest.raises(AccuracyError, match=r"FILE\.py:FUNCTION"):
        load_observable("mine")
    (tmp_path / "bad.py").write_text("1 / 0")
    with pytest.raises(AccuracyError, match="fails: ZeroDivisionError"):
        load_observable(f"{tmp_path / 'bad.py'}:tip")
    with pytest.raises(AccuracyError, match="cannot be read"):
        load_observable(f"{tmp_path / 'none.py'}:tip")
    (tmp_path / "good.py").write_text("tip = 3")
    with pytest.raises(AccuracyError, match="has no function tip"):
        load_observable(f"{tmp_path / 'good.py'}:tip")


def test_an_observable_that_fails_is_told_in_its_row(scene, tmp_path):
    (tmp_path / "mine.py").write_text(
        "def tip(recording):\n    return {}['a']\ndef top(recording):\n    1 / 0\n"
        "def mean(recording):\n    return float('nan')\n"
    )
    names = ("tip", "top", "mean")
    measures = Measures(observables=tuple(load_observable(f"{tmp_path / 'mine.py'}:{name}") for name in names))
    found = sweep(planned(scene, settings_of(["engine.options.spin=1"])), tmp_path / "out", measures=measures)
    row = found.rows[0]
    assert (row.status, row.columns["not_observed"]) == (
        "complete",
        "tip fails: KeyError: 'a'; top fails: ZeroDivisionError: division by zero; mean is nan",
    )
    assert row.columns["tip"] is None and row.columns["mean"] is None and row.columns["toy.moved"] > 0
    with pytest.raises(AccuracyError, match='a column "points" already'):
        (tmp_path / "mine.py").write_text("def points(recording):\n    return 1\n")
        Measures(observables=(load_observable(f"{tmp_path / 'mine.py'}:points"),))


def test_backends_that_are_not_there(tmp_path):
    with pytest.raises(BackendError, match='no backend "slurm"'):
        chosen_backend("slurm")
    with pytest.raises(BackendError, match="a scheduler is of dask or ray"):
        chosen_backend(scheduler="tcp://a:1")
    with pytest.raises(SceneError, match="at_once"):
        chosen_backend("dask", at_once=0)


@pytest.mark.parametrize(("told", "most"), [("1", 1), ("0", None), ("many", None), ("", None), ("100000", None)])
def test_each_run_has_its_share_of_threads(monkeypatch, told, most):
    """What libraries, and GASP's own engines, are told; what is no number tells nothing."""
    from gasp_core.stepping.threads import processors
    from gasp_core.studies.runs.supervisor import surroundings

    there = processors()
    around = surroundings().with_threads(3)
    assert around.environment["GASP_THREADS"] == around.environment["OMP_NUM_THREADS"] == "3"
    assert surroundings().with_threads(None) == surroundings()
    monkeypatch.setenv("GASP_THREADS", told)
    assert processors() == (most or there)


def test_what_moves_by_itself_is_measured_where_it_is_seen(scene_of, run, tmp_path):
    swing = Swing(axis=(0, 1, 0), pivot=(0.4, 0, 0), amplitude=30, frequency=1.0)
    recording = run(scene_of(motion=swing, gravity=(0, 0, 0)), tmp_path / "a.gasp")
    seen = [recording.gaussians(frame).means for frame in range(recording.frame_count)]
    found = Measures()(recording)
    gone = max(np.linalg.norm(means - recording.reference.means, axis=1).max() for means in seen)
    # Places of a recording are float32.
    assert found["thing.moved"] == pytest.approx(gone, rel=1e-5) and gone > 0.1
    assert [found[f"thing.centre_{axis}"] for axis in "xyz"] == pytest.approx(seen[-1].mean(axis=0), abs=1e-6)
    assert found["thing.highest"] == pytest.approx(seen[-1][:, 2].max(), abs=1e-6)
