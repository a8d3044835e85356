"""What every stepping session shares, shown on matter that only falls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Domain,
    DomainPolicy,
    Drive,
    Elastic,
    EngineAccuracy,
    Field,
    Impulse,
    PointCloud,
    PointProblem,
    PointState,
    Status,
)
from gasp_core.stepping.session import SteppedSession, StoppedError, impulse_change
from gasp_core.stepping.time_step import substeps_to

Array = NDArray[Any]

_STEP = 0.01


class _Falling(SteppedSession[list[Array]]):
    """Points and velocities; steps of _STEP; fails where asked."""

    def __init__(self, problem: PointProblem, accuracy: EngineAccuracy, *, fails_at: float = np.inf) -> None:
        held = [problem.points.reference_positions.copy(), problem.points.initial_velocities.copy()]
        super().__init__(problem, held, engine="falling", accuracy=accuracy, notes=["once"])
        self.fails_at = fails_at
        self.looks: list[float] = []
        self.released = 0

    def step_toward(self, landing: float, end: float) -> None:
        self.refuse_too_many(_STEP, end)
        positions, velocities = self.held()
        count, step = substeps_to(landing - self._time, _STEP)
        velocities += step * np.asarray(self._problem.gravity)
        positions += step * velocities
        self.record_steps(1, step, landing if count == 1 else self._time + step)
        if self._time >= self.fails_at:
            positions[1] = np.nan

    def check_state(self, step: float) -> None:
        self.looks.append(step)
        positions, velocities = self.held()
        self.refuse_lost(step, positions, velocities)
        self.refuse_outside(positions)

    def apply_impulse(self, impulse: Impulse) -> None:
        positions, velocities = self.held()
        given = impulse_change(impulse, positions, self._problem.masses)
        if given is not None:
            velocities[given[0]] += given[1]

    def warnings(self) -> list[str]:
        return ["told"]

    def release(self, held: list[Array]) -> None:
        self.released += 1

    def read(self, fields: frozenset[Field]) -> PointState:
        return PointState(time=self._time, positions=self.held()[0].copy())

    def checkpoint(self) -> Mapping[str, Array]:
        return {"time": np.array(self._time)}


def _problem(*, drives: tuple[Drive, ...] = (), domain: Domain | None = None) -> PointProblem:
    positions = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.zeros((3, 3)),
            reference_volumes=np.array([1e-3, 2e-3, 3e-3]),
            material_ids=np.zeros(3, dtype=np.int32),
            body_ids=np.zeros(3, dtype=np.int32),
        ),
        materials=(Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),),
        gravity=(0.0, 0.0, -10.0),
        drives=drives,
        domain=domain,
    )


def _impulse(start: float) -> Impulse:
    return Impulse(
        region=BoxShape(center=(1.5, 0.0, 0.0), half_extents=(1.0, 1.0, 5.0)), impulse=(0.0, 10.0, 0.0), start=start
    )


def _session(accuracy: EngineAccuracy | None = None, **problem: Any) -> _Falling:
    return _Falling(_problem(**problem), accuracy or EngineAccuracy())


def test_a_session_lands_on_the_asked_number_and_on_what_starts_on_the_way() -> None:
    session = _session(drives=(_impulse(0.025),))
    report = session.advance_to(0.1)
    # 3 steps to 0.025, 8 to 0.1.
    assert session.time == 0.1
    assert (report.status, report.substep_count) == (Status.OK, 11)
    assert report.smallest_substep == pytest.approx(0.025 / 3)
    assert report.largest_substep == pytest.approx(0.075 / 8)
    # After an impulse nothing has been stepped yet, so what is judged by a step's length is judged anew.
    assert [index for index, step in enumerate(session.looks) if step == 0] == [0, 4]


def test_an_impulse_is_shared_in_proportion_to_mass_and_given_once() -> None:
    session = _session(drives=(_impulse(0.0),))
    session.advance_to(0.05)
    session.advance_to(0.1)
    moved = session.read(frozenset()).positions[:, 1]
    # 10 N s on 5 kg for 0.1 s; the first point is outside.
    np.testing.assert_allclose(moved, [0.0, 0.2, 0.2], rtol=1e-12)


def test_an_impulse_that_strikes_nothing_is_none() -> None:
    problem = _problem()
    missing = Impulse(region=BoxShape(center=(9, 9, 9), half_extents=(1, 1, 1)), impulse=(0, 1, 0), start=0.0)
    assert impulse_change(missing, problem.points.reference_positions, problem.masses) is None


def test_notes_are_told_with_the_first_step_and_once() -> None:
    session = _session()
    assert session.advance_to(0.0).warnings == ("told",)
    assert session.advance_to(0.01).warnings == ("once", "told")
    assert session.advance_to(0.02).warnings == ("told",)


def test_what_is_not_finite_ends_the_advance_where_it_happened() -> None:
    session = _Falling(_problem(), EngineAccuracy(), fails_at=0.03)
    report = session.advance_to(0.1)
    assert report.status is Status.NON_FINITE
    assert "1 point(s) are no longer finite, first 1, with substeps of 0.01 s" in report.warnings[1]
    assert (report.substep_count, session.time) == (3, pytest.approx(0.03))


def test_too_many_substeps_are_refused_before_any_is_taken() -> None:
    session = _session(EngineAccuracy(substep_limit=9))
    report = session.advance_to(0.1)
    assert (report.status, report.substep_count, session.time) == (Status.SUBSTEP_LIMIT, 0, 0.0)
    assert "10 substeps of 0.01 s, more than the limit of 9: raise substep_limit" in report.warnings[0]
    assert session.advance_to(0.09).status is Status.OK


def test_a_domain_that_ends_the_run_names_the_farthest_point() -> None:
    domain = Domain(lower=(-1.0, -1.0, -0.1), upper=(3.0, 1.0, 1.0), policy=DomainPolicy.STOP)
    session = _session(domain=domain)
    report = session.advance_to(1.0)
    assert report.status is Status.OUT_OF_DOMAIN
    assert "3 point(s) left the domain, farthest point 0 at (0, 0, -0.1" in report.warnings[1]
    # g t (t + dt) / 2 passes 0.1 m with the 14th step.
    assert report.substep_count == 14


def test_a_domain_that_grows_ends_nothing() -> None:
    domain = Domain(lower=(-1.0, -1.0, -0.1), upper=(3.0, 1.0, 1.0), policy=DomainPolicy.EXPAND)
    assert _session(domain=domain).advance_to(1.0).status is Status.OK


@pytest.mark.parametrize("time", [-0.1, 0.01, float("nan"), float("inf")])
def test_the_past_and_no_time_are_refused_and_the_session_goes_on(time: float) -> None:
    session = _session()
    session.advance_to(0.02)
    with pytest.raises(ValueError, match="cannot advance to"):
        session.advance_to(time)
    assert session.advance_to(0.03).status is Status.OK


def test_a_closed_session_has_given_back_once_and_says_so() -> None:
    with _session() as session:
        session.advance_to(0.01)
    session.close()
    assert session.released == 1
    for ask in (lambda: session.advance_to(0.02), lambda: session.read(frozenset())):
        with pytest.raises(ValueError, match="falling: the session is closed"):
            ask()


def test_a_verdict_keeps_its_status_and_reason() -> None:
    stopped = StoppedError(Status.NOT_CONVERGED, "why")
    assert (stopped.status, stopped.reason, str(stopped)) == (Status.NOT_CONVERGED, "why", "why")


def test_a_body_of_which_a_tenth_is_crushed_ends_the_run() -> None:
    session = _session()
    elastic = len(session.read(frozenset()).positions)
    session.refuse_crushed(elastic // 10, 0.01)
    with pytest.raises(StoppedError, match=f"{elastic // 10 + 1} of {elastic} elastic points are flat") as stopped:
        session.refuse_crushed(elastic // 10 + 1, 0.01)
    assert stopped.value.status is Status.CRUSHED


def test_a_session_that_cannot_be_read_is_none_and_knobs_and_state_have_public_names() -> None:
    class Unread(SteppedSession[int]):
        def step_toward(self, landing: float, end: float) -> None:
            self.hold(self.held() + 1)
            self.record_steps(1, landing - self.time, landing)

        def apply_impulse(self, impulse: Impulse) -> None: ...

    accuracy = EngineAccuracy(spacing=0.1)
    with pytest.raises(TypeError, match="read"):
        Unread(_problem(), 0, engine="unread", accuracy=accuracy)  # type: ignore[abstract]

    class Read(Unread):
        def read(self, fields: frozenset[Field]) -> PointState:
            raise AssertionError

    session = Read(_problem(), 0, engine="read", accuracy=accuracy)
    assert session.accuracy is accuracy
    session.advance_to(0.1)
    assert session.held() == 1
    session.close()
    with pytest.raises(ValueError, match="closed"):
        session.hold(2)
