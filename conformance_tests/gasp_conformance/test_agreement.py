"""Two engines of one method, the same scene: `--gasp-engine=X --gasp-oracle=Y`."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.scenes import MATERIALS, thrown_block
from gasp_conformance.subject import Subject


@check("agreement", Level.AGREEMENT)
@pytest.mark.parametrize("name", MATERIALS)
def test_equals_the_oracle(subject: Subject, oracle: Subject, ledger: Ledger, name: str) -> None:
    throw = thrown_block(MATERIALS[name])
    (own,) = subject.states(throw.problem, throw.accuracy, [throw.end])
    (other,) = oracle.states(throw.problem, throw.accuracy, [throw.end])
    distance = float(np.linalg.norm(own.positions - other.positions, axis=1).max()) / throw.size
    # The scenes magnify a disturbance at the start some tens of times in their 500 substeps (measured by disturbing
    # one by 6e-8): rounding of 6e-8 a step that adds up like a random walk ends at a few 1e-6, that of 1e-16 at 1e-14.
    ledger.at_most(f"agreement {name}", "largest distance / size", distance, 1e-10 if subject.is_double else 1e-5)
