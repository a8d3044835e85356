"""Whatever becomes of a run is an outcome; nothing of it is left behind, and no other run notices."""

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import MappingProxyType

import joblib
import numpy as np
import pytest

from gasp_core import GaspError, Recording
from gasp_core.errors import RecordingError, SceneError
from gasp_core.processes.scratch import Scratch
from gasp_core.studies.runs import RunStatus, carry_out
from gasp_core.studies.runs.timing import split_times


def endings(outcomes):
    return {outcome.key: outcome.ending for outcome in outcomes}


def test_a_run_that_ends_well_says_what_it_took(run_of):
    (outcome,) = carry_out([run_of("good")])
    assert (outcome.ending, outcome.reason, outcome.frame_count) == (RunStatus.COMPLETE, "", 5)
    recording = Recording.open(outcome.recording)
    assert recording.status == "complete"
    # The engine steps in milliseconds: 0.16 s.
    assert outcome.substeps == 160
    assert 0 < outcome.run_seconds < outcome.wall_seconds
    assert 0 < outcome.start_seconds < outcome.wall_seconds
    assert outcome.start_seconds + outcome.run_seconds <= outcome.wall_seconds
    # NumPy and zarr alone take more than this to import, in time and in memory.
    assert outcome.cpu_seconds > 0.05
    assert outcome.peak_bytes > 20e6
    assert 0 < outcome.run_cpu_seconds < outcome.cpu_seconds


@pytest.mark.thorough
def test_fewer_frames_where_fewer_are_asked_for(run_of):
    two, one = carry_out([run_of("two", frames=2), run_of("one", frames=1)])
    assert (two.ending, two.frame_count, two.substeps) == (RunStatus.COMPLETE, 2, 40)
    assert (one.ending, one.frame_count, one.substeps, one.run_seconds) == (RunStatus.COMPLETE, 1, 0, 0.0)
    assert one.run_cpu_seconds == 0.0


CRASHES = {
    "segfault": "SIGSEGV",
    "exit at once": "status 3",
    "error": "ZeroDivisionError",
    "orphans": "SIGKILL",
}


@pytest.mark.parametrize(
    ("isolate", "faults"),
    [
        (False, ["segfault"]),
        pytest.param(False, [name for name in CRASHES if name != "segfault"], marks=pytest.mark.thorough),
        pytest.param(True, ["segfault", "orphans"], marks=pytest.mark.thorough),
    ],
)
def test_crashes_are_outcomes_and_take_nobody_along(run_of, tmp_path, left_behind, isolate, faults):
    runs = [run_of(fault, fault=fault, isolate=isolate) for fault in faults]
    told = []
    outcomes = carry_out([*runs, run_of("good")], at_once=2, finished=told.append)
    assert [outcome.key for outcome in outcomes] == [*faults, "good"]
    assert sorted(told, key=lambda outcome: outcome.key) == sorted(outcomes, key=lambda outcome: outcome.key)
    assert outcomes[-1].ending is RunStatus.COMPLETE
    for outcome in outcomes[:-1]:
        assert outcome.ending is RunStatus.CRASHED, outcome
        assert CRASHES[outcome.key] in outcome.reason
        # The fault is at 0.1 s: frames 0, 1, 2 at 0, 0.04, 0.08 s are there.
        assert outcome.frame_count == Recording.open(outcome.recording).frame_count == 3
        assert outcome.substeps == 80
        assert outcome.peak_bytes > 20e6
        if outcome.key == "segfault":
            # Where it fell, not how it came there.
            assert "faults.py" in outcome.reason
    assert left_behind(tmp_path) == []
    assert not list(tmp_path.glob(".runs-*"))


@pytest.mark.thorough
def test_an_engine_that_cannot_or_is_not_there_is_unable(run_of):
    runs = [
        run_of("sand", engine="ballistic", sand=True),
        run_of("unknown", engine="balistic"),
        run_of("away", engine="away"),
        run_of("import", fault="open:import"),
        run_of("refuse", fault="open:refuse"),
    ]
    outcomes = carry_out(runs)
    assert set(endings(outcomes).values()) == {RunStatus.UNABLE}, outcomes
    said = {outcome.key: outcome.reason for outcome in outcomes}
    assert "sand" in said["sand"]
    assert 'did you mean "ballistic"' in said["unknown"]
    assert "gasp engines install away" in said["away"]
    assert "fake_backend_that_nobody_has" in said["import"]
    for outcome in outcomes:
        assert (outcome.recording, outcome.frame_count, outcome.run_seconds) == (None, 0, 0.0)
        assert outcome.start_seconds == outcome.wall_seconds > 0


@pytest.mark.thorough
def test_divergence_and_other_errors_are_told_apart(run_of, tmp_path):
    taken = tmp_path / "taken.gasp"
    taken.mkdir()
    (taken / "mine").write_text("precious")
    broken = run_of("splat")
    thing = dataclasses.replace(broken.scene.objects[0], splat=tmp_path / "nowhere.ply")
    runs = [
        run_of("nan", fault="nan"),
        run_of("taken"),
        dataclasses.replace(broken, scene=dataclasses.replace(broken.scene, objects=(thing,))),
        run_of("option", no_such_option=3),
    ]
    nan, *others = carry_out(runs)
    assert (nan.ending, nan.frame_count) == (RunStatus.DIVERGED, 3)
    assert "non_finite" in nan.reason
    assert {outcome.ending for outcome in others} == {RunStatus.FAILED}
    assert all(outcome.recording is None and outcome.reason for outcome in others)
    assert (taken / "mine").read_text() == "precious"


@pytest.mark.thorough
def test_a_run_that_hangs_is_given_up(run_of, tmp_path, left_behind):
    outcomes = carry_out([run_of("hangs", fault="hang in C")], time_limit=6.0)
    assert endings(outcomes) == {"hangs": RunStatus.CRASHED}
    assert "given up after 6 s" in outcomes[0].reason
    assert outcomes[0].frame_count == 3
    assert left_behind(tmp_path) == []


@pytest.mark.parametrize(
    ("backend", "at_once"),
    [
        (None, 1),
        pytest.param("loky", 2, marks=pytest.mark.thorough),
        pytest.param("threading", 2, marks=pytest.mark.thorough),
        pytest.param("sequential", 1, marks=pytest.mark.thorough),
    ],
)
def test_endings_and_frames_are_the_same_wherever_and_however_many(run_of, backend, at_once):
    runs = [run_of("good", spin=2.0), run_of("killed", fault="kill")]
    context = joblib.parallel_config(backend=backend) if backend else contextlib.nullcontext()
    with context:
        outcomes = carry_out(runs, at_once=at_once)
    assert [(outcome.key, outcome.ending, outcome.frame_count, outcome.substeps) for outcome in outcomes] == [
        ("good", RunStatus.COMPLETE, 5, 160),
        ("killed", RunStatus.CRASHED, 3, 80),
    ]


def test_results_are_those_of_a_run_in_this_process(run_of, tmp_path):
    from gasp_core import simulate

    run = run_of("there", spin=2.0)
    (there,) = carry_out([run])
    here = simulate(run.scene, out=tmp_path / "here.gasp", progress=False)
    for frame in range(5):
        assert np.array_equal(Recording.open(there.recording).points(frame), here.points(frame))


@pytest.mark.thorough
def test_relative_paths_mean_the_folder_one_is_in(run_of, tmp_path, monkeypatch):
    # joblib keeps its processes: they are in the folder that was the current one when they were started.
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        # Two, as joblib does a single one here.
        runs = [dataclasses.replace(run_of(key, frames=1), out=Path(f"{key}.gasp")) for key in "ab"]
        assert {outcome.ending for outcome in carry_out(runs, at_once=2)} == {RunStatus.COMPLETE}
        assert sorted(path.name for path in (tmp_path / name).iterdir()) == ["a.gasp", "b.gasp"]


def test_what_cannot_be_is_refused_before_anything_is_started(run_of, tmp_path):
    good = run_of("good")
    shy = dataclasses.replace(
        good,
        scene=dataclasses.replace(
            good.scene, engine=dataclasses.replace(good.scene.engine, options=MappingProxyType({}))
        ),
    )
    file = tmp_path / "file"
    file.write_text("")
    for arguments, options, kind, words in [
        ([good, good], {}, SceneError, 'the same key "good"'),
        ([good, dataclasses.replace(good, key="other")], {}, SceneError, "the same recording"),
        ([good], {"at_once": 0}, SceneError, "at_once"),
        ([good], {"time_limit": float("nan")}, SceneError, "time_limit"),
        ([good], {"time_limit": 0}, SceneError, "time_limit"),
        ([shy], {}, SceneError, "cannot be sent"),
        ([dataclasses.replace(good, out=file / "run.gasp")], {}, RecordingError, "cannot be written"),
    ]:
        with pytest.raises(kind, match=words) as caught:
            carry_out(arguments, **options)
        assert isinstance(caught.value, GaspError)
    assert carry_out([]) == []
    assert not good.out.exists()


INTERRUPTED = """
import sys
import joblib
from gasp_core import EngineChoice, Elastic, Scene, SplatObject
from gasp_core.studies.runs import Run, carry_out
from gasp_core.toy import make_toy
from pathlib import Path

def run(key):
    item = SplatObject(
        name="toy", splat=make_toy(64), height=0.3,
        material=Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3),
    )
    scene = Scene(duration=0.16, frame_rate=25, objects=(item,),
                  engine=EngineChoice(name="frail", options={"fault": "hang"}))
    return Run(key=key, scene=scene, out=Path(key + ".gasp"))

if __name__ == "__main__":
    with joblib.parallel_config(backend=sys.argv[1]):
        try:
            carry_out([run("a"), run("b"), run("c")], at_once=2)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
"""


@pytest.mark.parametrize(
    ("backend", "number"),
    [
        ("loky", signal.SIGINT),
        pytest.param("threading", signal.SIGINT, marks=pytest.mark.thorough),
        pytest.param("sequential", signal.SIGINT, marks=pytest.mark.thorough),
        pytest.param("loky", signal.SIGKILL, marks=pytest.mark.thorough),
        pytest.param("sequential", signal.SIGKILL, marks=pytest.mark.thorough),
    ],
)
def test_ctrl_c_or_death_ends_them_all(tmp_path, left_behind, backend, number):
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    process = subprocess.Popen(
        [sys.executable, str(script), backend],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    waited_for = tmp_path / "a.gasp" / "commits" / "00000002" / "zarr.json"
    while not waited_for.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert waited_for.exists()
    if number == signal.SIGINT:
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does it: joblib's own processes too
    else:
        process.kill()
    process.wait(30)
    assert left_behind(tmp_path) == []
    # joblib's own processes linger for minutes after the death of whoever started them.
    with contextlib.suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)
    out, err = process.communicate()
    if number == signal.SIGINT:
        assert (process.returncode, out) == (0, "interrupted\n"), err
        assert not list(tmp_path.glob(".runs-*"))
    assert not (tmp_path / "c.gasp").exists()


def test_what_killed_runs_left_the_next_ones_remove(run_of, tmp_path):
    left = Scratch(".runs-", tmp_path)
    (left.path / "notes").mkdir()
    os.close(left._descriptor)  # as the death of whoever held it does
    (tmp_path / ".runs-of-mine").mkdir()
    (outcome,) = carry_out([run_of("good", frames=2)])
    assert outcome.ending is RunStatus.COMPLETE
    assert [path.name for path in tmp_path.glob(".runs-*")] == [".runs-of-mine"]


def test_start_and_stride_are_told_apart():
    # Begun at 10, frame 0 at 13; the first frame compiles for 4 s, each takes 0.5 s; half a second to end.
    start, run = split_times(10.0, [13.0, 17.5, 18.0, 18.5], 19.0)
    assert (start, run) == (7.0, 1.5)
    assert split_times(0.0, [], 2.0) == (2.0, 0.0)
    assert split_times(0.0, [1.0], 2.0) == (1.0, 0.0)
    assert split_times(0.0, [1.0, 4.0], 5.0) == (1.0, 3.0)
    # A first frame quicker than the others hides nothing.
    assert split_times(0.0, [1.0, 1.5, 2.5, 3.5], 4.0) == (1.0, 2.5)


def test_the_child_writes_nothing_but_what_it_is_asked_for(run_of, tmp_path):
    carry_out([run_of("good", fault="prints")])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["good.gasp", "logs"]
    assert not list((tmp_path / "logs").iterdir())
    assert json.loads((tmp_path / "good.gasp" / "zarr.json").read_text())["node_type"] == "group"
