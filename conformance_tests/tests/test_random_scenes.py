"""The random scenes themselves, and whether what watches over them sees what it has to see."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gasp_conformance.random_batch import run_batch, run_scene
from gasp_conformance.random_scenes import CLOUDS, RandomScene, describe, random_scene
from gasp_conformance.subject import Subject, find_subject
from gasp_conformance.watched_runs import WatchedRun, watch_run

from gasp_core.contract import (
    MATERIALS,
    BoxShape,
    ContactCondition,
    Determinism,
    Domain,
    DomainPolicy,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    HalfSpace,
    Impulse,
    Material,
    Pinned,
    PointCloud,
    PointProblem,
    PointState,
    Precision,
    SphereShape,
    Status,
    StepReport,
    Wind,
)
from gasp_core.contract.capabilities import needs, unmet
from gasp_core.discovery.registry import discover
from gasp_core.errors import SceneError

LITTLE = EngineCapabilities(
    materials=frozenset({Elastic}),
    collider_shapes=frozenset(),
    contact_conditions=frozenset(),
    drives=frozenset(),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    conserved=frozenset(),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
)
EVERYTHING = replace(
    LITTLE,
    materials=frozenset(MATERIALS.values()),
    collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
    contact_conditions=frozenset(ContactCondition),
    drives=frozenset({Pinned, Driven, Impulse}),
    force_fields=frozenset({Wind}),
    domain_policies=frozenset(DomainPolicy),
)
NUMBERS = range(200)

# The scenes -----------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_number_is_a_scene_in_every_process() -> None:
    told = [describe(random_scene(number, EVERYTHING)) for number in range(30)]
    code = (
        "import importlib.util, sys\n"
        f"spec = importlib.util.spec_from_file_location('again', {__file__!r})\n"
        "again = importlib.util.module_from_spec(spec)\nspec.loader.exec_module(again)\n"
        "for number in range(30):\n    print(again.describe(again.random_scene(number, again.EVERYTHING)))\n"
    )
    for seed in ("1", "2"):
        # Sets are in another order there.
        child = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        )
        assert child.stdout.splitlines() == told
    assert len(set(told)) == len(told)


@pytest.mark.parametrize("capabilities", [LITTLE, EVERYTHING], ids=["little", "everything"])
def test_scenes_ask_for_what_is_declared_and_for_nothing_else(capabilities: EngineCapabilities) -> None:
    for number in NUMBERS:
        scene = random_scene(number, capabilities)
        assert not unmet(needs(scene.problem), capabilities)
        assert 1 <= len(scene.problem.points) <= 60
        assert (np.diff([0.0, *scene.times]) > 0).all()
        domain = scene.problem.domain
        if domain is not None and domain.policy is DomainPolicy.CLAMP:
            # Else what a clamping domain does at the start would be a jump, and right.
            positions = scene.problem.points.reference_positions
            assert (positions >= domain.lower).all() and (positions <= domain.upper).all()
        line = describe(scene)
        assert line.startswith(f"scene {number} (seed ") and "\n" not in line


def test_a_material_that_the_suite_does_not_know_is_tried_too() -> None:
    class Dough(Material):
        kind = "dough"

    capabilities = replace(LITTLE, materials=frozenset({Dough}))
    assert isinstance(random_scene(3, capabilities).problem.materials[0], Dough)


def _range(values: list[float]) -> tuple[float, float]:
    return min(values), max(values)


def test_two_hundred_scenes_go_to_the_extremes() -> None:
    scenes = [random_scene(number, EVERYTHING) for number in NUMBERS]
    problems = [scene.problem for scene in scenes]
    assert {scene.cloud for scene in scenes} == set(CLOUDS)
    assert {type(one) for problem in problems for one in problem.materials} == EVERYTHING.materials
    colliders = [one for problem in problems for one in problem.colliders]
    assert {(type(one.shape), one.side.value, one.contact) for one in colliders} == {
        (shape, side, contact)
        for shape in EVERYTHING.collider_shapes
        for side in ("outside", "inside")
        for contact in ContactCondition
    }
    assert {type(one) for problem in problems for one in problem.drives} == EVERYTHING.drives
    assert any(problem.force_fields for problem in problems)
    assert {problem.domain.policy for problem in problems if problem.domain} == set(DomainPolicy)
    assert {1, 2, 3} <= {len(problem.points) for problem in problems}
    assert any(scene.accuracy.substep for scene in scenes) and any(
        scene.accuracy.substep_limit < 10 for scene in scenes
    )

    # The ends of every range, not its middle alone.
    used = [one for problem in problems for one in problem.materials]
    low, high = _range([one.youngs_modulus for one in used if isinstance(one, Elastic)])
    assert low < 10**3 and high > 10**8
    low, high = _range([one.density for one in used])
    assert low < 10**-1.9 and high > 10**4.9
    assert {0.0, 0.49, 0.499} <= {one.poissons_ratio for one in used if hasattr(one, "poissons_ratio")}
    low, high = _range([math.hypot(*problem.gravity) for problem in problems])
    assert low == 0 and high > 10**2.9
    assert max(float(np.abs(problem.points.reference_positions).max()) for problem in problems) > 5e3
    low, high = _range([problem.points.size for problem in problems if problem.points.size > 0])
    assert low < 10**-2.5 and high > 10**2.5
    touched = [
        any((one.shape.signed_distance(problem.points.reference_positions) < 0).any() for one in problem.colliders)
        for problem in problems
    ]
    assert sum(touched) > 20, "colliders that start inside the matter"


# What watches over them: a right engine, and engines that each do one thing they must not -----------------------------


STEP = 1e-3


class Flight:
    """Free flight of every point for itself, as symplectic Euler does it."""

    def __init__(self, problem: PointProblem) -> None:
        self.time = 0.0
        self.problem = problem
        self.flown = 0.0

    def advance_to(self, time: float) -> StepReport:
        span, self.time = time - self.time, time
        self.flown += span
        count = max(1, round(span / STEP))
        return StepReport(
            status=Status.OK, substep_count=count, smallest_substep=span / count, largest_substep=span / count
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        points, gravity = self.problem.points, np.array(self.problem.gravity)
        way = gravity * self.flown * (self.flown + STEP) / 2
        return PointState(
            time=self.time,
            positions=points.reference_positions + points.initial_velocities * self.flown + way,
            velocities=points.initial_velocities + gravity * self.flown,
        )

    def close(self) -> None: ...

    def __enter__(self) -> Flight:
        return self

    def __exit__(self, *_: object) -> None: ...


class OneNan(Flight):
    """positions are not finite in 1 of 3 points, first 1"""

    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        positions = state.positions.copy()
        positions[1, 2] = math.nan if self.time > 0.25 else positions[1, 2]
        return replace(state, positions=positions)


class NanVelocity(Flight):
    """velocities are not finite in 3 of 3 points"""

    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        return replace(state, velocities=state.velocities * (math.inf if self.time > 0.25 else 1))


class LosesAPoint(Flight):
    """positions are those of 2 points, not of 3"""

    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        return replace(state, positions=state.positions[:2].copy())


class Heats(Flight):
    """the detector says energy_grew"""

    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        return replace(state, velocities=state.velocities * (1 + 2 * self.time))


class Resets(Flight):
    """the detector says not_converged: 3 points jumped"""

    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        points = self.problem.points
        far = points.reference_positions - 50 * np.sign(points.initial_velocities)
        return replace(state, positions=far) if self.time > 0.25 else state


class StopsShort(Flight):
    """it landed on 0.0999 s, not on 0.1 s"""

    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        self.time = time - 1e-4
        return report


class ReadsLate(Flight):
    """the state is that of 0.0 s, not of 0.1 s"""

    def read(self, fields: frozenset[Field]) -> PointState:
        return replace(super().read(fields), time=0.0)


class Miscounts(Flight):
    """substeps of 0.001 to 0.001 s do not make 0.1 s"""

    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        return replace(report, substep_count=report.substep_count + 7)


class TakesMore(Flight):
    """100 substeps were taken where at most 20 were allowed"""


class Speechless(Flight):
    """not_converged comes without a reason"""

    def advance_to(self, time: float) -> StepReport:
        return replace(super().advance_to(time), status=Status.NOT_CONVERGED)


class Mumbles(Flight):
    """a warning gives no reason"""

    def advance_to(self, time: float) -> StepReport:
        return replace(super().advance_to(time), status=Status.NOT_CONVERGED, warnings=(" ",))


class Rambles(Flight):
    """a warning says it in 2 lines: 'it was'"""

    def advance_to(self, time: float) -> StepReport:
        return replace(super().advance_to(time), warnings=("it was\nnot to be",))


class Overshoots(Flight):
    """it stopped at 1.1 s, which is not between 0.0 s and 0.1 s"""

    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        self.time = time + 1
        return replace(report, status=Status.NON_FINITE, warnings=("lost",))


class RaisesAnything(Flight):
    """raised ZeroDivisionError instead of a GaspError: in a kernel"""

    def advance_to(self, time: float) -> StepReport:
        raise ZeroDivisionError("in a\nkernel")


class RaisesAtLength(Flight):
    """SceneError says it in 2 lines: 'no'"""

    def advance_to(self, time: float) -> StepReport:
        raise SceneError("no\nreally")


class LeavesTheDomain(Flight):
    """2 points are outside a domain with policy "stop", first 1"""


WRONG = [
    *(OneNan, NanVelocity, LosesAPoint, Heats, Resets, StopsShort, ReadsLate, Miscounts, TakesMore, Speechless),
    *(Mumbles, Rambles, Overshoots, RaisesAnything, RaisesAtLength, LeavesTheDomain),
]


class Engine:
    def __init__(self, session: Callable[[PointProblem], Flight]) -> None:
        self.session = session

    def open(self, problem: PointProblem, **_: Any) -> Flight:
        return self.session(problem)


def subject_of(session: Callable[[PointProblem], Flight]) -> Subject:
    descriptor = EngineDescriptor(
        name="flies",
        summary="flies",
        contract_version=(1, 0),
        capabilities=replace(LITTLE, domain_policies=frozenset(DomainPolicy)),
        factory="nowhere:Nothing",
    )
    return Subject(descriptor=descriptor, engine=Engine(session), device="cpu", precision=Precision.FLOAT64)


def watched(session: Callable[[PointProblem], Flight], *, limit: int = 500, room: float = 100.0) -> WatchedRun:
    positions = np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.0], [0.1, 0.2, 0.4]])
    problem = PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.full((3, 3), 3.0),
            reference_volumes=np.ones(3),
            material_ids=np.zeros(3),
            body_ids=np.zeros(3),
        ),
        materials=(Elastic(density=1.0, youngs_modulus=1e3, poissons_ratio=0.3),),
        domain=Domain(lower=(-room,) * 3, upper=(room,) * 3, policy=DomainPolicy.STOP),
    )
    return watch_run(subject_of(session), problem, EngineAccuracy(substep_limit=limit), [0.1, 0.2, 0.5, 0.7])


def test_a_right_run_has_no_faults() -> None:
    run = watched(Flight)
    assert run.faults == () and run.finished and run.ending == "ok"
    assert [state.time for state in run.states] == [0.0, 0.1, 0.2, 0.5, 0.7]
    assert len(run.reports) == 4


@pytest.mark.parametrize("session", WRONG, ids=lambda session: session.__name__)
def test_what_must_not_be_is_seen(session: type[Flight]) -> None:
    options: dict[str, Any] = {TakesMore: {"limit": 20}, LeavesTheDomain: {"room": 0.5}}.get(session, {})
    run = watched(session, **options)
    assert any((session.__doc__ or "") in fault for fault in run.faults), run.faults


def test_a_stop_with_a_reason_and_a_refusal_are_no_faults() -> None:
    class Gives(Flight):
        def advance_to(self, time: float) -> StepReport:
            return replace(super().advance_to(time), status=Status.NOT_CONVERGED, warnings=("it was not to be",))

    def refuses(_: PointProblem) -> Flight:
        raise SceneError("no place for it")

    gave = watched(Gives)
    assert gave.faults == () and not gave.finished and gave.ending == "not_converged"
    refused = watched(refuses)
    assert refused.faults == () and not refused.finished
    assert (refused.ending, refused.refusal) == ("refused", "no place for it")


def test_an_imposed_step_may_be_found_out_a_frame_late_and_no_later() -> None:
    scene = random_scene(0, LITTLE)

    class HeatsInTheEnd(Flight):
        beginning = 0.6

        def read(self, fields: frozenset[Field]) -> PointState:
            state = super().read(fields)
            return replace(state, velocities=state.velocities * (9 if self.time > self.beginning else 1))

    points = replace(scene.problem.points, initial_velocities=np.ones_like(scene.problem.points.reference_positions))
    problem = replace(scene.problem, points=points, gravity=(0.0, 0.0, 0.0), domain=None)
    for beginning, faulty in ((0.6, False), (0.3, True)):
        HeatsInTheEnd.beginning = beginning
        run = watch_run(subject_of(HeatsInTheEnd), problem, EngineAccuracy(), [0.2, 0.5, 0.7], grace=1)
        assert bool(run.faults) is faulty


# A process of their own -----------------------------------------------------------------------------------------------


SICK = """
import os, time
from dataclasses import replace
from gasp_core.contract import EngineDescriptor
from gasp_core.discovery.hookspecs import hookimpl
from gasp_reference_mpm.engine import ReferenceMpm
from gasp_reference_mpm.plugin import CAPABILITIES

class Engine(ReferenceMpm):
    def open(self, problem, *, device, **choices):
        if device == "moon":
            raise KeyError("nobody has been there")
        what = SICK_AT.get(float(problem.points.reference_volumes[0]))
        if what == "hangs":
            time.sleep(3600)
        if what == "crashes":
            os.write(2, b"Segmentation\\nfault\\n")
            os._exit(139)
        if what == "raises":
            raise KeyError("grid")
        return super().open(problem, device=device, **choices)

if os.environ.get("SICK_AT_THE_START") == "1":
    os._exit(3)

@hookimpl
def gasp_point_engines():
    capabilities = replace(CAPABILITIES, devices=("cpu", "moon"))
    return [EngineDescriptor(name="sick", summary="sick", contract_version=(1, 0), capabilities=capabilities,
                             factory="sick:Engine")]
"""
HUNG_AFTER = 20.0
"""[s]; what a process takes to begin on a busy machine, some times over."""


@pytest.fixture
def sick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Subject]:
    """An engine that hangs in scene 1, crashes in 3, raises in 4 and on the moon, installed as every engine is."""
    capabilities = discover().descriptor("reference-mpm").capabilities

    def mark(number: int) -> float:
        scene: RandomScene = random_scene(number, capabilities)
        return float(scene.problem.points.reference_volumes[0])

    sick_at = {mark(1): "hangs", mark(3): "crashes", mark(4): "raises"}
    (tmp_path / "sick.py").write_text(f"SICK_AT = {sick_at!r}\n{SICK}")
    home = tmp_path / "gasp_sick-1.0.dist-info"
    home.mkdir()
    (home / "METADATA").write_text("Metadata-Version: 2.1\nName: gasp-sick\nVersion: 1.0\n")
    (home / "entry_points.txt").write_text("[gasp]\nsick = sick\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    discover.cache_clear()
    yield find_subject("sick", None, None)
    discover.cache_clear()


@pytest.mark.thorough
def test_a_hang_and_a_crash_are_told_by_number_and_the_rest_goes_on(sick: Subject) -> None:
    outcomes = run_batch(sick, 0, 5, hung_after=HUNG_AFTER)
    assert [outcome.number for outcome in outcomes] == [0, 1, 2, 3, 4, 5]
    right, hung, _, crashed, raised, _ = outcomes
    assert right == run_scene(find_subject("reference-mpm", None, None), 0)
    assert hung.ending == "hung" and hung.faults[0] == f"hung for {HUNG_AFTER:g} s"
    assert crashed.ending == "crashed"
    assert (
        crashed.faults[0]
        == "took its process down, which ended by itself with status 139; its output ends: Segmentation | fault"
    )
    assert raised.faults[0] == "raised KeyError instead of a GaspError: 'grid'"
    for outcome in (hung, crashed, raised):
        assert outcome.scene.startswith(f"scene {outcome.number} (seed ")
    assert not outcomes[2].faults and not outcomes[5].faults


def test_a_process_that_cannot_begin_says_so(sick: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SICK_AT_THE_START", "1")
    with pytest.raises(
        RuntimeError, match="sick: the process of its own ended by itself with status 3 outside any scene"
    ):
        run_batch(sick, 0, 1)


def test_the_process_of_its_own_runs_on_the_same_device(sick: Subject) -> None:
    (outcome,) = run_batch(replace(sick, device="moon"), 0, 0, hung_after=HUNG_AFTER)
    assert outcome.faults[0] == "raised KeyError instead of a GaspError: 'nobody has been there'"


def test_a_scene_can_be_seen_again(sick: Subject) -> None:
    command = [sys.executable, "-m", "gasp_conformance.random_batch", "sick", "float64", "cpu", "4", "5"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert told[0].split() == ["4", "not", "begun"]
    assert told[1].strip() == "raised KeyError instead of a GaspError: 'grid'"
    assert told[2].strip().startswith("scene 4 (seed ")
    assert told[3].split()[0] == "5"
