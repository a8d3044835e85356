"""However a worker comes to its end, it is the right error, soon, and nothing is left but its log."""

import gc
import os
import signal
import sys
import time

import numpy as np
import psutil
import pytest

from gasp_core import EngineChoice, Gaussians, Recording, RecordingChoice, Scene, SplatObject, simulate
from gasp_core.contract import Elastic, Field
from gasp_core.engines.held_session import held
from gasp_core.engines.opening import open_engine, open_worker
from gasp_core.engines.worker.process import WorkerProcess
from gasp_core.engines.worker.shared_memory import Block
from gasp_core.errors import EngineCrashedError, EngineDivergedError, EngineEnvironmentError, SceneError

SOON = 5.0
"""Seconds within which each has to be told, from when it happens; two of them are the limit of a frame."""

DEATHS = [
    ("segfault", "was killed by SIGSEGV while", "about to fall"),
    ("kill", "was killed by SIGKILL, perhaps for lack of memory while", ""),
    ("hang", "was given up after 2 s while", ""),
    ("hang in C", "was given up after 2 s while", ""),
    ("exit", "failed while", "SystemExit: 3"),
    ("exit at once", "ended by itself with status 3 while", ""),
    ("orphans", "was killed by SIGKILL", ""),
    ("error", "failed while", "ZeroDivisionError: the engine fell over"),
    ("import", "failed while", "No module named 'fake_backend_that_nobody_has'"),
]


@pytest.fixture
def scene():
    """A scene of the frail engine."""

    def make(**engine):
        rng = np.random.default_rng(1)
        cloud = Gaussians(
            means=rng.normal(size=(30, 3)),
            quaternions=rng.normal(size=(30, 4)),
            scales=np.full((30, 3), 0.1),
            opacities=np.full(30, 0.5),
            harmonics=np.zeros((30, 1, 3), dtype=np.float32),
        )
        material = Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3)
        return Scene(
            duration=0.4,
            frame_rate=25,
            objects=(SplatObject(name="thing", splat=cloud, material=material),),
            engine=EngineChoice(name="frail", **engine),
            recording=RecordingChoice(checkpoint_frames=1),
        )

    return make


@pytest.mark.parametrize(
    ("fault", "words", "more"),
    [
        pytest.param(*death, id=death[0], marks=[pytest.mark.thorough] if death[0].startswith("hang") else [])
        for death in DEATHS
    ],
)
def test_a_dying_worker_is_an_error_and_leaves_nothing_but_its_log(
    isolated, opened, problem, told, gone, logs, fault, words, more
):
    note, read = told
    with opened(isolated, problem, fault=fault, note=note) as session:
        pid = read()["pid"]
        session.advance_to(0.05)
        begun = time.monotonic()
        with pytest.raises(EngineCrashedError) as caught:
            session.advance_to(0.1)
        assert time.monotonic() - begun < SOON
        assert words in str(caught.value)
        assert "advancing to 0.1 s" in str(caught.value)
        assert more in str(caught.value)
        # Where it printed something, that is kept.
        kept = logs()
        assert str(kept[0]) in str(caught.value) if kept else "its worker printed nothing" in str(caught.value)
        # It stays dead, and says the same of it.
        with pytest.raises(EngineCrashedError, match="frail"):
            session.read(frozenset({Field.POSITIONS}))
    assert gone(pid, *(process.pid for process in psutil.process_iter() if _group(process.pid) == pid))
    assert logs() == kept


def _group(pid):
    try:
        return os.getpgid(pid)
    except ProcessLookupError:
        return None


@pytest.mark.parametrize("fault", ["segfault", "kill", pytest.param("hang", marks=pytest.mark.thorough), "error"])
def test_the_same_while_the_scene_is_set_up(registry, opened, problem, fault, gone, told, logs):
    from gasp_core.engines.worker.session import Limits

    note, read = told
    with pytest.raises(EngineCrashedError, match="while opening the scene") as caught:
        opened(open_worker(registry.offer("frail"), Limits(opening=3.0)), problem, fault=f"open:{fault}", note=note)
    assert gone(read()["pid"])
    assert len(logs()) == int("its worker printed nothing" not in str(caught.value))


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("no report", "reports None, which is no StepReport with a Status, while advancing to 0.2 s: "),
        ("too few", "gives positions of shape (49, 3) and type float64, expected (50, 3) of float64"),
        ("late", "gives a state of -0.8 s, where the session is at 0.2 s, while reading positions: "),
        ("half", "gives positions of shape (50, 3) and type float16, expected (50, 3) of float64"),
    ],
)
def test_what_breaks_the_contract_is_told_in_the_same_words_wherever_the_engine_runs(
    registry, isolated, opened, problem, gone, told, fault, words
):
    note, read = told

    def sentence(engine):
        session = held(lambda: opened(engine, problem, fault=fault, note=note), "frail", problem)
        with session, pytest.raises(EngineCrashedError) as caught:
            session.advance_to(0.2)
            session.read(frozenset({Field.POSITIONS}))
        return str(caught.value)

    here = sentence(open_engine(registry.offer("frail")))
    assert here.startswith(f"frail {words}") and here.endswith(": this is a fault of the engine")
    assert sentence(isolated) == f'engine "{here}; its worker printed nothing'.replace("frail", 'frail"', 1)
    # It is of no more use.
    assert gone(read()["pid"])


def test_a_fork_of_this_process_ends_nobody_elses_worker(isolated, opened, problem):
    with opened(isolated, problem) as session:
        child = os.fork()
        if child == 0:
            session._worker.end()  # as its finalizer does at exit
            os._exit(0)
        assert os.waitpid(child, 0) == (child, 0)
        session.advance_to(0.1)


def test_killed_between_two_questions(isolated, opened, problem, told):
    note, read = told
    with opened(isolated, problem, note=note) as session:
        session.advance_to(0.05)
        os.kill(read()["pid"], signal.SIGKILL)
        begun = time.monotonic()
        with pytest.raises(EngineCrashedError, match="was killed by SIGKILL"):
            session.advance_to(0.1)
        assert time.monotonic() - begun < SOON


def test_a_crash_at_closing_spoils_nothing(isolated, opened, problem, told, gone, logs):
    note, read = told
    with opened(isolated, problem, fault="close", note=note) as session:
        session.advance_to(0.1)
    assert gone(read()["pid"])
    assert logs() == []
    with opened(isolated, problem) as session:
        session.advance_to(0.1)


def test_a_worker_goes_with_its_engine(registry, opened, problem, told, gone, logs):
    note, read = told
    engine = open_worker(registry.offer("frail"))
    opened(engine, problem, note=note).close()
    assert psutil.pid_exists(read()["pid"])
    del engine
    gc.collect()
    assert gone(read()["pid"])
    assert logs() == []


def test_a_forgotten_session_takes_its_worker_along(registry, opened, problem, told, gone, logs):
    note, read = told
    session = opened(open_worker(registry.offer("frail")), problem, note=note)
    session.advance_to(0.1)
    del session
    gc.collect()
    assert gone(read()["pid"])
    assert logs() == []


# What a worker might say in the place of a greeting.
@pytest.mark.parametrize(
    ("says", "kind", "words"),
    [
        (
            "print('{\"protocol\": 0}', flush=True)",
            EngineEnvironmentError,
            "speaks protocol 0, this GASP 1: ",
        ),
        ("print('{}', flush=True)", EngineEnvironmentError, "speaks protocol None"),
        ("print('hello', flush=True)", EngineCrashedError, "sent what is no message while starting"),
        ("print('[1]', flush=True)", EngineCrashedError, "sent what is no message while starting"),
        ("pass", EngineCrashedError, "ended by itself with status 0 while starting"),
        ("import nothing_of_that_name", EngineCrashedError, "No module named 'nothing_of_that_name'"),
        ("", EngineCrashedError, "was given up after 1 s while starting"),
    ],
)
def test_a_worker_that_does_not_speak_as_we_do(says, kind, words, gone):
    code = says if says == "pass" else f"import time\n{says}\ntime.sleep(3600)"
    worker = WorkerProcess("frail", [sys.executable, "-c", code], os.environ, Block.make())
    begun = time.monotonic()
    # An interpreter takes a while to come up; the last one of these shall not.
    with pytest.raises(kind, match=words):
        worker.greet(SOON if says else 1.0)
    assert time.monotonic() - begun < SOON
    worker.end()
    assert gone(worker.pid)


def test_an_interpreter_that_is_not_there(tmp_path, logs):
    block = Block.make()
    with pytest.raises(EngineEnvironmentError, match="cannot be run: No such file"):
        WorkerProcess("frail", [str(tmp_path / "python")], os.environ, block)
    block.close()
    assert logs() == []


@pytest.mark.parametrize("fault", ["segfault", "kill", pytest.param("hang", marks=pytest.mark.thorough), "error"])
def test_the_frames_before_a_crash_are_kept(registry, scene, tmp_path, fault):
    out = tmp_path / "run.gasp"
    chosen = scene(isolate=True, frame_limit=2.0, options={"fault": fault, "fault_time": 0.2})
    with pytest.raises(EngineCrashedError, match=r"the frames so far are kept in .*run\.gasp") as caught:
        simulate(chosen, out=out)
    assert caught.value.recording == out
    recording = Recording.open(out)
    assert (recording.status, recording.frame_count) == ("incomplete", 5)
    assert "advancing to 0.2 s" in recording.reason
    # And it can be gone on from.
    whole = simulate(scene(), out=tmp_path / "whole.gasp")
    assert np.array_equal(recording.points(4), whole.points(4))


def test_a_nan_from_a_worker_is_found(registry, scene, tmp_path):
    out = tmp_path / "run.gasp"
    with pytest.raises(EngineDivergedError, match=r"1 of .* points are no longer finite, first 3") as caught:
        simulate(scene(isolate=True, options={"fault": "nan", "fault_time": 0.2}), out=out)
    assert caught.value.recording == out
    recording = Recording.open(out)
    assert recording.frame_count == 5
    assert all(np.isfinite(recording.points(frame)).all() for frame in range(5))


def test_a_crash_at_the_start_leaves_no_recording(registry, scene, tmp_path):
    with pytest.raises(EngineCrashedError, match="opening the scene"):
        simulate(scene(options={"fault": "open:kill"}), out=tmp_path / "run.gasp", isolate=True)
    assert not (tmp_path / "run.gasp").exists()


def test_isolated_or_not_the_recording_is_the_same(registry, scene, tmp_path):
    here = simulate(scene(), out=tmp_path / "here.gasp")
    there = simulate(scene(), out=tmp_path / "there.gasp", isolate=True)
    assert (there.status, there.frame_count) == ("complete", 11)
    for frame in range(11):
        assert np.array_equal(here.points(frame), there.points(frame))
    # Where it runs decides nothing: one goes on where the other stopped.
    part = simulate(scene(), out=tmp_path / "part.gasp", frames=4, isolate=True)
    assert part.frame_count == 4
    again = simulate(scene(), out=tmp_path / "part.gasp", resume=True)
    assert np.array_equal(again.points(10), here.points(10))


def test_a_limit_needs_a_process_of_its_own(registry, scene, tmp_path):
    with pytest.raises(SceneError, match=r"frame_limit .* needs isolate = true"):
        simulate(scene(frame_limit=2.0), out=tmp_path / "run.gasp")
    engine = (registry.descriptor("frail"), open_engine(registry.offer("frail")))
    with pytest.raises(SceneError, match="cannot be isolated"):
        simulate(scene(), engine, out=tmp_path / "run.gasp", isolate=True)
    assert not (tmp_path / "run.gasp").exists()
