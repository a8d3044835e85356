"""Two engines of one method, the same scene: `--gasp-engine=X --gasp-oracle=Y`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.scenes import MATERIALS, thrown_block
from gasp_conformance.subject import Subject
from gasp_core.contract import Field, Material, PointProblem


@check("agreement", Level.AGREEMENT)
@pytest.mark.parametrize("name", MATERIALS)
def test_equals_the_oracle(subject: Subject, oracle: Subject, ledger: Ledger, name: str) -> None:
    _compare(subject, oracle, ledger, f"agreement {name}", MATERIALS[name])


@check("agreement", Level.AGREEMENT)
@pytest.mark.parametrize("name", ["elastic", "neo-hookean"], ids=lambda name: f"{name}, nearly incompressible")
def test_equals_the_oracle_at_constant_volume(subject: Subject, oracle: Subject, ledger: Ledger, name: str) -> None:
    rubber: Any = replace(MATERIALS[name], poissons_ratio=0.49)  # type: ignore[call-arg]
    _compare(subject, oracle, ledger, f"agreement {name}, nearly incompressible", rubber)


def _compare(subject: Subject, oracle: Subject, ledger: Ledger, case: str, material: Material) -> None:
    throw = thrown_block(material)
    problem, wanted = throw.problem, frozenset[Field]()
    if all(engine.descriptor.capabilities.carries_tracers for engine in (subject, oracle)):
        problem, wanted = _traced(problem), frozenset({Field.TRACER_POSITIONS})
    (own,) = subject.states(problem, throw.accuracy, [throw.end], wanted)
    (other,) = oracle.states(problem, throw.accuracy, [throw.end], wanted)
    # The scenes magnify a disturbance at the start some tens of times in their 500 substeps (measured by disturbing
    # one by 6e-8): rounding of 6e-8 a step that adds up like a random walk ends at a few 1e-6, that of 1e-16 at 1e-14.
    allowed = 1e-10 if subject.is_double else 1e-5
    ledger.at_most(case, "largest distance / size", _apart(own.positions, other.positions) / throw.size, allowed)
    if wanted:
        distance = _apart(own.tracer_positions, other.tracer_positions) / throw.size
        ledger.at_most(case, "largest distance of tracers / size", distance, allowed)


def _apart(own: Any, other: Any) -> float:
    return float(np.linalg.norm(own - other, axis=1).max())


def _traced(problem: PointProblem) -> PointProblem:
    """The problem with tracers in and around its points, some of them out of reach."""
    points = problem.points
    low, high = points.reference_positions.min(axis=0), points.reference_positions.max(axis=0)
    margin = 0.2 * (high - low)
    places = np.random.default_rng(8).uniform(low - margin, high + margin, (60, 3))
    return replace(problem, points=replace(points, tracer_positions=places))
