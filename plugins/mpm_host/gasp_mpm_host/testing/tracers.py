"""Tracers: that they change nothing, go with matter, rest where none is, and are kept."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from gasp_core.contract import Domain, DomainPolicy, EngineSession, Field, PointProblem, PointState, Status
from gasp_core.errors import SceneError
from gasp_mpm_host.testing.kit import falling, same

__all__ = ["TracerTests", "go_alike", "traced"]

_ALL = frozenset(Field)
_AWAY = np.array([[3.0, 3.0, 3.0], [-1e9, 0.0, 0.0], [0.2, 0.2, 1e300]])


def traced(problem: PointProblem, count: int = 200) -> PointProblem:
    """The problem with tracers in and around its cloud, the last three of them out of all reach."""
    places = problem.points.reference_positions
    low, high = places.min(axis=0), places.max(axis=0)
    near = np.random.default_rng(2).uniform(low - 0.1, high + 0.1, (count, 3))
    return replace(problem, points=replace(problem.points, tracer_positions=np.concatenate([near, _AWAY])))


def go_alike(problem: PointProblem, sessions: Iterable[EngineSession]) -> None:
    """Sessions of a problem that is `traced`, one after the other: points and tracers go, and to the same places."""
    ends: list[PointState] = []
    for session in sessions:
        with session:
            assert session.advance_to(0.02).status is Status.OK
            ends.append(session.read(_ALL))
    first = ends[0]
    begun = problem.points.tracer_positions
    assert begun is not None and first.tracer_positions is not None
    away = len(_AWAY)
    assert np.median(np.abs(first.tracer_positions - begun)[:-away].max(axis=1)) > 0.005
    for other in ends[1:]:
        assert other.tracer_positions is not None
        # Some tens of steps of rounding in another order.
        assert np.abs(first.positions - other.positions).max() <= 1e-12
        assert np.abs(first.tracer_positions - other.tracer_positions)[:-away].max() <= 1e-12


class TracerTests:
    """What an engine for explicit MPM owes that carries tracers; a subclass finds the fixture `kit` beside it."""

    @pytest.mark.parametrize("precision", ["float32", "float64"])
    def test_they_change_no_motion_and_rest_where_nothing_is(self, kit, precision):
        plain = falling(kit)
        with (
            kit.open(plain, precision=precision, spacing=0.05) as alone,
            kit.open(traced(plain), precision=precision, spacing=0.05) as marked,
        ):
            for session in (alone, marked):
                assert session.advance_to(0.2).status is Status.OK
            expected, found = alone.read(_ALL), marked.read(_ALL)
            assert expected.tracer_positions is None
            # Points are sorted when a point or a tracer has gone far, and add up in another order from then on:
            # rounding, which a crash magnifies some tens of times (`AgreementTests`).
            apart = np.abs(found.positions - expected.positions).max() / 0.4
            assert apart <= (1e-5 if precision == "float32" else 1e-10)
            start = traced(plain).points.tracer_positions
            # Cells and back: two roundings of where they are.
            np.testing.assert_allclose(found.tracer_positions[-3:], _AWAY, rtol=1e-15, atol=1e-12)
            moved = np.linalg.norm(found.tracer_positions - start, axis=1)
            inside = np.abs(start - plain.points.reference_positions.mean(axis=0)).max(axis=1) < 0.2
            assert inside.sum() > 50
            assert (moved[inside] > 0.01).all()

    @pytest.mark.parametrize("spacing", [0.1, 0.05])
    def test_in_a_uniform_flow_they_keep_their_place_among_the_points(self, kit, spacing):
        """Those near the surface, and beside it, too."""
        velocity, time = np.array([0.7, -0.3, 0.4]), 0.5
        problem = traced(kit.problem(kit.block(), kit.materials["elastic"], velocity=velocity, gravity=(0, 0, 0)))
        with kit.open(problem, precision="float64", spacing=spacing) as session:
            substeps = session.advance_to(time).substep_count
            found = session.read(_ALL).tracer_positions
        start = problem.points.tracer_positions
        carried = np.linalg.norm(found - start, axis=1) > 0
        low, high = problem.points.reference_positions.min(axis=0), problem.points.reference_positions.max(axis=0)
        apart = np.maximum(0, np.maximum(low - start, start - high)).max(axis=1)
        assert carried[apart < spacing / 2].all()
        assert not carried[apart > 3 * spacing].any()
        # One that something reaches once goes with it from then on. Velocities are means of equal numbers: some
        # roundings of them a step, and of the place.
        error = np.abs(found - start - velocity * time)[apart < spacing / 2].max()
        assert error <= substeps * 30 * np.finfo(float).eps

    @pytest.mark.parametrize(
        ("array", "damage"),
        [
            ("tracer_ids", lambda ids: ids + 10**6),
            ("tracer_homes", lambda homes: homes + 10**6),
            ("tracer_cells", lambda cells: cells * np.nan),
        ],
    )
    def test_a_checkpoint_that_no_run_has_written_is_refused(self, kit, array, damage):
        problem = traced(falling(kit))
        with kit.open(problem, spacing=0.05) as session:
            kept = session.checkpoint()
        with pytest.raises(SceneError, match=r"tracers are not those of a run|not finite for tracer_cells"):
            kit.open(problem, spacing=0.05, restart={**kept, array: damage(np.array(kept[array]))})

    @pytest.mark.parametrize("precision", ["float32", "float64"])
    def test_restart_is_bitwise(self, kit, precision):
        problem = traced(falling(kit))
        with kit.open(problem, precision=precision, spacing=0.05) as whole:
            whole.advance_to(0.03)
            kept = {name: np.array(array) for name, array in whole.checkpoint().items()}
            whole.advance_to(0.06)
            expected = whole.read(_ALL)
        with kit.open(problem, precision=precision, spacing=0.05, restart=kept) as resumed:
            resumed.advance_to(0.06)
            found = resumed.read(_ALL)
        assert same(found, expected)
        assert np.array_equal(found.tracer_positions, expected.tracer_positions)
        with pytest.raises(SceneError, match="tracer_"):
            kit.open(traced(falling(kit), 100), precision=precision, spacing=0.05, restart=kept)

    def test_any_number_of_threads_gives_the_same_bits(self, kit, monkeypatch):
        monkeypatch.setattr("gasp_core.stepping.threads.processors", lambda: 4)
        problem, found = traced(falling(kit), 3000), []
        for threads in (1, 2, 4):
            with kit.open(problem, spacing=0.05, threads=threads) as session:
                session.advance_to(0.05)
                found.append(session.read(_ALL).tracer_positions)
        assert np.array_equal(found[0], found[1])
        assert np.array_equal(found[0], found[2])

    def test_the_edge_of_a_domain_holds_them(self, kit):
        domain = Domain(lower=(-0.05, -1, -1), upper=(0.5, 1, 1), policy=DomainPolicy.CLAMP)
        problem = falling(kit, domain=domain)
        inside = problem.points.reference_positions[::3]
        problem = replace(problem, points=replace(problem.points, tracer_positions=np.concatenate([inside, _AWAY])))
        with kit.open(problem, spacing=0.05) as session:
            assert session.advance_to(0.6).status is Status.OK
            found = session.read(_ALL).tracer_positions
        assert (found[:-3] >= np.array(domain.lower) - 1e-12).all()
        assert (found[:-3] <= np.array(domain.upper) + 1e-12).all()
        np.testing.assert_allclose(found[-3:], _AWAY, rtol=1e-15, atol=1e-12)
