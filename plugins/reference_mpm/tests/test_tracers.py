"""Massless points: that they change nothing, go with matter, stay where none is, and survive a restart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from gasp_reference_mpm.engine import ReferenceMpm

from gasp_core.contract import (
    Collider,
    Domain,
    DomainPolicy,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    PointCloud,
    PointProblem,
    Precision,
)

ACCURACY = EngineAccuracy(spacing=0.1)


def falling_block(tracers: Any, **scene: Any) -> PointProblem:
    cells = np.stack(np.meshgrid(*[np.arange(6)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    positions = (cells + 0.5) * 0.05 + [0.0, 0.0, 0.02]
    count = len(positions)
    cloud = PointCloud(
        reference_positions=positions,
        initial_velocities=np.tile([0.3, 0.0, -2.0], (count, 1)),
        reference_volumes=np.full(count, 0.05**3),
        material_ids=np.zeros(count, dtype=int),
        body_ids=np.zeros(count, dtype=int),
        tracer_positions=tracers,
    )
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    soft = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
    return PointProblem(points=cloud, materials=(soft,), colliders=(floor,), **scene)


def opened(problem: PointProblem, restart: Any = None) -> Any:
    return ReferenceMpm().open(
        problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=ACCURACY, restart=restart
    )


INSIDE = np.random.default_rng(0).uniform([0.05, 0.05, 0.07], [0.25, 0.25, 0.27], (9, 3))
AWAY = np.array([[3.0, 3.0, 3.0], [-1e9, 0.0, 0.0]])


def test_tracers_change_nothing_and_those_far_away_rest() -> None:
    problem = falling_block(np.concatenate([INSIDE, AWAY]))
    with opened(problem) as marked, opened(replace(problem, points=falling_block(None).points)) as plain:
        marked.advance_to(0.1)
        plain.advance_to(0.1)
        state = marked.read(frozenset(Field))
        assert np.array_equal(state.positions, plain.read(frozenset()).positions)
        assert plain.read(frozenset(Field)).tracer_positions is None
        # The grid's origin is not the scene's: a rounding there and one back.
        np.testing.assert_allclose(state.tracer_positions[-2:], AWAY, rtol=1e-15, atol=0)
        assert (np.linalg.norm(state.tracer_positions[:-2] - INSIDE, axis=1) > 0.01).all()


def test_a_restart_is_bitwise() -> None:
    problem = falling_block(INSIDE)
    with opened(problem) as whole:
        whole.advance_to(0.03)
        kept = whole.checkpoint()
        whole.advance_to(0.06)
        with opened(problem, kept) as resumed:
            resumed.advance_to(0.06)
            fields = frozenset(Field)
            assert np.array_equal(whole.read(fields).tracer_positions, resumed.read(fields).tracer_positions)


def test_the_edge_holds_tracers_too() -> None:
    lower, upper = (-0.05, -1.0, -1.0), (0.4, 1.0, 1.0)
    domain = Domain(lower=lower, upper=upper, policy=DomainPolicy.CLAMP)
    with opened(falling_block(np.concatenate([INSIDE, AWAY]), domain=domain)) as session:
        session.advance_to(0.5)
        found = session.read(frozenset(Field)).tracer_positions
        assert (found[:-2] >= lower).all()
        assert (found[:-2] <= upper).all()
        np.testing.assert_allclose(found[-2:], AWAY, rtol=1e-15, atol=0)
