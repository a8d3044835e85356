"""A session in a worker is a session: same results, same refusals, and nothing of the backend's gets through."""

import dataclasses
import math
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from gasp_core import EngineAccuracy, Precision
from gasp_core.contract import Field, PointState, Status
from gasp_core.engines.opening import open_engine
from gasp_core.errors import EngineDivergedError, PluginLoadError, SceneError, UnsupportedSceneError

ALL = frozenset(Field)


def equal(one: PointState, other: PointState):
    for field in dataclasses.fields(PointState):
        ours, theirs = getattr(one, field.name), getattr(other, field.name)
        if not isinstance(ours, np.ndarray):
            assert ours == theirs
            continue
        assert ours.dtype == theirs.dtype
        assert ours.flags.c_contiguous
        assert not ours.flags.writeable
        assert np.array_equal(ours, theirs, equal_nan=True)


def test_results_are_those_of_the_engine_bit_for_bit(registry, isolated, opened, problem):
    with (
        opened(open_engine(registry.offer("frail")), problem, fault="warn", spin=3.0) as here,
        opened(isolated, problem, fault="warn", spin=3.0) as there,
    ):
        equal(here.read(ALL), there.read(ALL))
        for time in (0.1, 1 / 3, 0.5):
            report = here.advance_to(time)
            assert report.warnings == ("so so",)
            assert report == there.advance_to(time)
            assert here.time == there.time == time
            equal(here.read(ALL), there.read(ALL))
        kept, same = here.checkpoint(), there.checkpoint()
        assert list(kept) == list(same)
        for name, array in kept.items():
            assert np.asarray(array).dtype == same[name].dtype
            assert np.array_equal(array, same[name])
        with opened(isolated, problem, restart=same, spin=3.0) as again:
            assert again.time == 0.5
            here.advance_to(0.7)
            again.advance_to(0.7)
            equal(here.read(ALL), again.read(ALL))


def test_only_what_is_asked_for_comes_back_and_is_ours(isolated, opened, problem):
    with opened(isolated, problem) as session:
        first = session.read(frozenset())
        assert first.velocities is None
        assert first.deformation_gradients is None
        kept = first.positions.copy()
        session.advance_to(0.2)
        second = session.read(frozenset({Field.VELOCITIES}))
        assert second.deformation_gradients is None
        assert not np.array_equal(second.positions, kept)
    assert np.array_equal(first.positions, kept)
    assert not np.shares_memory(first.positions, second.positions)


def test_tracers_that_a_problem_does_not_have_are_none(isolated, opened, problem):
    without = dataclasses.replace(problem, points=dataclasses.replace(problem.points, tracer_positions=None))
    with opened(isolated, without) as session:
        state = session.read(ALL)
        assert state.tracer_positions is None and state.velocities is not None
        session.advance_to(0.2)


def test_what_the_engine_is_given_is_what_was_asked_for(isolated, opened, problem, told, frail):
    from gasp_core.contract import (
        BoxShape,
        Collider,
        ContactCondition,
        Domain,
        DomainPolicy,
        Driven,
        HalfSpace,
        Impulse,
        SphereShape,
        Wind,
    )

    # Normalised twice, some of these would change in the last digit.
    normals = np.random.default_rng(0).normal(size=(20, 3))
    planes = [HalfSpace(point=(0, 0, 0.1), normal=tuple(normal)) for normal in normals]
    rich = dataclasses.replace(
        problem,
        colliders=(
            *(Collider(shape=plane, friction=1 / 3) for plane in planes),
            Collider(shape=SphereShape(center=(1, 2, 3), radius=0.1), contact=ContactCondition.STICK),
        ),
        drives=(
            Driven(region=planes[0], velocity=(0.1, 0.2, 0.3), start=0.5),
            Impulse(region=BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1)), impulse=(0, 0, np.float64(0.1))),
        ),
        force_fields=(Wind(velocity=(1, 0, 0), drag=np.float32(0.1)),),
        domain=Domain(lower=(-9, -9, -9), upper=(9, 9, 9), policy=DomainPolicy.STOP),
    )
    note, read = told
    mood = type(frail.options().mood).WILD
    with opened(isolated, rich, note=note, mood=mood, weights=(0.1, math.inf)):
        got, device, precision, seed, accuracy, options, restart = read()["given"]
    assert (device, precision, seed, restart) == ("cpu", Precision.FLOAT64, 5, None)
    assert accuracy == EngineAccuracy(substep_fraction=0.3)
    assert options == frail.options(note=note, mood=mood, weights=(0.1, math.inf))
    for name in ("materials", "colliders", "drives", "force_fields", "gravity", "domain"):
        assert getattr(got, name) == getattr(rich, name), name
    for field in dataclasses.fields(rich.points):
        assert np.array_equal(getattr(got.points, field.name), getattr(rich.points, field.name))


def test_the_worker_imports_the_contract_and_its_plugin_alone(isolated, opened, problem, told):
    note, read = told
    with opened(isolated, problem, note=note) as session:
        session.advance_to(0.1)
        session.read(ALL)
    assert read()["pid"] != os.getpid()
    assert read()["folder"] == str(Path.cwd())
    assert read()["prefix"] == sys.prefix
    modules = read()["modules"]
    roots = {name.partition(".")[0] for name in modules} - set(sys.stdlib_module_names)
    # What a system has every Python begin with is not ours: Debian's has a sitecustomize.
    assert {name for name in roots if not name.startswith("_")} - {"cython_runtime", "sitecustomize"} == {
        "gasp_core",
        "numpy",
        "pluggy",
        "flying_points",
        "fake_frail",
    }
    ours = {name for name in modules if name.startswith("gasp_core.")}
    rooms = {".".join(name.split(".")[:2]) for name in ours}
    within = ("contract", "discovery", "engines", "errors", "processes", "stepping")
    assert rooms == {f"gasp_core.{room}" for room in within}


@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        ("refuse", UnsupportedSceneError, "of that I know nothing: ask another"),
        ("refuse oddly", SceneError, "odd"),
        ("value", ValueError, "not so"),
        ("diverged", EngineDivergedError, "gone"),
    ],
)
@pytest.mark.parametrize("where", ["", "open:"])
def test_refusals_come_back_as_they_are_and_the_worker_goes_on(isolated, opened, problem, fault, kind, words, where):
    with pytest.raises(kind) as caught, opened(isolated, problem, fault=where + fault, fault_time=0.2) as session:
        session.advance_to(0.1)
        session.advance_to(0.2)
    assert type(caught.value) is kind
    assert str(caught.value) == words
    if kind is EngineDivergedError:
        assert caught.value.report.status is Status.NOT_CONVERGED
    with opened(isolated, problem) as session:
        session.advance_to(0.1)


def test_a_time_in_the_past_is_refused_and_the_session_goes_on(isolated, opened, problem):
    with opened(isolated, problem) as session:
        session.advance_to(0.2)
        for time in (0.1, math.nan, -math.inf):
            with pytest.raises(ValueError):
                session.advance_to(time)
        assert session.time == 0.2
        session.advance_to(0.3)


def test_a_closed_session_is_closed(isolated, opened, problem, logs):
    session = opened(isolated, problem)
    session.close()
    session.close()
    for call in (lambda: session.advance_to(1.0), lambda: session.read(ALL), session.checkpoint):
        with pytest.raises(ValueError, match="closed"):
            call()


def test_a_missing_backend_says_what_to_do(registry, opened, problem, monkeypatch):
    import gasp_core.engines.worker.engine as worker

    without = dataclasses.replace(registry.descriptor("frail"), factory="flying_points.nowhere:Ballistic")
    engine = worker.WorkerEngine(without, worker.own_interpreter(), "mend it so")
    with pytest.raises(PluginLoadError, match=r"flying_points\.nowhere.* cannot be loaded.*; mend it so"):
        opened(engine, problem)


def test_prints_go_to_the_log(isolated, opened, problem, logs, capfd):
    with opened(isolated, problem, fault="prints") as session:
        session.advance_to(0.2)
        assert session.time == 0.2
        (log,) = logs()
        text = log.read_bytes()
    assert b'{"done": {"time": 7.0}}' in text
    assert b"not even text" in text
    assert b"from a program" in text
    assert capfd.readouterr() == ("", "")


def test_sessions_side_by_side_and_one_after_the_other(isolated, opened, problem, told, logs):
    note, read = told
    with opened(isolated, problem, note=note) as one:
        first = read()["pid"]
        with opened(isolated, problem, note=note) as other:
            second = read()["pid"]
            assert second != first
            one.advance_to(0.2)
            assert other.time == 0.0
    # Whoever keeps the engine keeps a worker, as backends are slow to import.
    with opened(isolated, problem, note=note) as again:
        assert again.time == 0.0
        assert read()["pid"] in (first, second)
    assert len(logs()) == 2


def test_a_session_opened_in_a_thread_outlives_it(isolated, opened, problem):
    sessions = []
    thread = threading.Thread(target=lambda: sessions.append(opened(isolated, problem)))
    thread.start()
    thread.join()
    with sessions[0] as session:
        session.advance_to(0.1)
