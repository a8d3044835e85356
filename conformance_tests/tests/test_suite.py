"""The suite as users run it, on engines made for the purpose: a right one, a wrong one, one that can do little."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from gasp_conformance import cases, scenes, subject

from gasp_core.engine.contract import (
    Determinism,
    EngineAccuracy,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    PointProblem,
    PointState,
    Precision,
    Quantity,
    Status,
    StepReport,
)
from gasp_core.engine.materials import Elastic
from gasp_core.engine.registry import discover
from gasp_core.errors import UnknownEngineError

pytest_plugins = ["pytester"]

# A nested run forgets the modules it was first to import, and compiled ones cannot be imported twice: import them here.
IMPORTED_FIRST = (cases, scenes)

STEP = 1e-3


class Ballistic:
    """Free flight of every point for itself, as symplectic Euler does it; `gravity_factor` makes it wrong."""

    def __init__(self, gravity_factor: float = 1.0, status: Status = Status.OK) -> None:
        self.gravity_factor = gravity_factor
        self.status = status

    def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, **_: Any) -> BallisticSession:
        return BallisticSession(problem, self.gravity_factor, self.status)


class BallisticSession:
    def __init__(self, problem: PointProblem, gravity_factor: float, status: Status) -> None:
        self.time = 0.0
        self.problem = problem
        self.status = status
        self.gravity = np.array(problem.gravity) * gravity_factor

    def advance_to(self, time: float) -> StepReport:
        count = round((time - self.time) / STEP)
        self.time = time
        return StepReport(
            status=self.status,
            substep_count=count,
            smallest_substep=STEP,
            largest_substep=STEP,
            warnings=() if self.status is Status.OK else ("it was not to be",),
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        points, time = self.problem.points, self.time
        fall = self.gravity * time * (time + STEP) / 2
        return PointState(
            time=time,
            positions=points.reference_positions + points.initial_velocities * time + fall,
            velocities=points.initial_velocities + self.gravity * time,
        )

    def close(self) -> None: ...

    def __enter__(self) -> BallisticSession:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Shelf:
    """A registry with nothing but these engines."""

    def __init__(self, engines: Mapping[str, Ballistic]) -> None:
        self.engines = engines

    def descriptor(self, name: str) -> EngineDescriptor:
        if name not in self.engines:
            raise UnknownEngineError(f'no engine named "{name}"')
        return EngineDescriptor(
            name=name,
            summary="flies",
            contract_version=(1, 0),
            capabilities=EngineCapabilities(
                materials=frozenset({Elastic}),
                collider_shapes=frozenset(),
                contact_conditions=frozenset(),
                drives=frozenset(),
                force_fields=frozenset(),
                output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
                conserved=frozenset({Quantity.LINEAR_MOMENTUM}),
                devices=("cpu",),
                precisions=(Precision.FLOAT64,),
                determinism=Determinism.BITWISE,
            ),
            factory="nowhere:Nothing",
        )

    def load(self, name: str) -> Ballistic:
        return self.engines[name]


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Any:
    shelf = Shelf(
        {
            "right": Ballistic(),
            "light": Ballistic(gravity_factor=0.9),
            "lost": Ballistic(status=Status.NON_FINITE),
        }
    )
    monkeypatch.setattr(subject, "discover", lambda: shelf)

    def run(*options: str) -> pytest.RunResult:
        return pytester.runpytest_inprocess(
            "--pyargs", "gasp_conformance", "--import-mode=importlib", "-p", "no:cacheprovider", "-rs", *options
        )

    return run


def test_without_an_engine_everything_is_skipped_and_says_how_to_name_one(suite: Any) -> None:
    result = suite()
    outcomes = result.parseoutcomes()
    assert set(outcomes) == {"skipped"}
    result.stdout.fnmatch_lines(["*run with --gasp-engine=NAME*"])


def test_an_unknown_engine_is_one_line(suite: Any) -> None:
    result = suite("--gasp-engine=wrong")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(['ERROR: no engine named "wrong"'])


def test_a_precision_the_engine_has_not_is_one_line(suite: Any) -> None:
    result = suite("--gasp-engine=right", "--gasp-precision=float32")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: right does not run in float32; it runs in float64"])


def test_what_is_not_declared_is_skipped_and_what_is_right_passes(suite: Any) -> None:
    result = suite("--gasp-engine=right", "-k", "v1_ or v2_ or v12_")
    result.assert_outcomes(passed=2, skipped=4)
    result.stdout.fnmatch_lines(["*figures*", "V1 elastic*largest error*0.0049*<= 0.00516*", "*does not model sand*"])


def test_wrong_physics_fails_and_shows_its_figure(suite: Any) -> None:
    result = suite("--gasp-engine=light", "-k", "v1_ or v2_")
    result.assert_outcomes(failed=1, passed=1, skipped=3)
    result.stdout.fnmatch_lines(["*V1 elastic: largest error*bound 0.00516*"])


def test_an_engine_that_gives_up_fails_with_its_own_reason(suite: Any) -> None:
    result = suite("--gasp-engine=lost", "-k", "v2_")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*lost ended with non_finite before 0.1 s: it was not to be*"])


def test_bodies_that_pass_through_each_other_and_bars_that_do_not_ring_fail(suite: Any) -> None:
    result = suite("--gasp-engine=right", "-k", "v3_ or v10_")
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(["*V10 32 cells: contact time error is -1*"])


def test_a_comparison_beyond_what_an_engine_declares_is_skipped(suite: Any) -> None:
    result = suite("--gasp-engine=right", "--gasp-oracle=light", "-k", "oracle")
    result.assert_outcomes(skipped=4)
    result.stdout.fnmatch_lines(["*knows no plane as a collider*"])


def test_the_registry_it_asks_is_the_real_one() -> None:
    assert subject.discover is discover
