"""A body of two materials, or of numbers that vary from point to point, has in either half what is asked for there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Need, Subject
from gasp_conformance.two_part_cases import TwoParts, bar_of_two_rings
from gasp_core.contract import Elastic, NeoHookean

SOFT = {"density": 700.0, "youngs_modulus": 2.3e4, "poissons_ratio": 0.0}


def rings_in_two(ledger: Ledger, case: str, bar: TwoParts) -> None:
    """Either half of a bar is as stiff and as heavy, and gets as much thinner, as its own numbers say."""
    ledger.at_most(case, "frequency error", bar.frequency, bar.frequency_allowed)
    ledger.at_most(case, "stretch of the second half by the first's, error", bar.stretch, bar.stretch_allowed)
    for half, error, allowed in zip(("first", "second"), bar.narrowing, bar.narrowing_allowed):
        ledger.at_most(case, f"narrowing by stretch of the {half} half - Poisson's ratio", error, allowed)


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=check(f"material:{kind.kind}[two stiffnesses]", Level.CAPABILITY))
        for kind in (Elastic, NeoHookean)
    ],
    ids=lambda kind: kind.kind,
)
def test_two_materials_in_one_body(
    subject: Subject, ledger: Ledger, need: Need, kind: type[Elastic] | type[NeoHookean]
) -> None:
    """A bar whose second half is of another material rings as its two stiffnesses and Poisson's ratios say."""
    need(kind in subject.descriptor.capabilities.materials, kind.kind)
    soft = kind(**SOFT)
    stiff = replace(soft, youngs_modulus=4 * soft.youngs_modulus, poissons_ratio=0.4)
    rings_in_two(ledger, f"{kind.kind} bar of two", bar_of_two_rings(subject, soft, stiff, columns=False))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param(name, value, marks=check(f"material-column:{name}", Level.CAPABILITY), id=name)
        for name, value in (("density", 2800.0), ("youngs_modulus", 9.2e4), ("poissons_ratio", 0.4))
    ],
)
def test_columns(subject: Subject, ledger: Ledger, need: Need, name: str, value: float) -> None:
    """A bar of one material, one number of which is another in its second half, point by point, rings as that says."""
    can = subject.descriptor.capabilities
    need(name in can.material_columns, f"{name} that varies from point to point")
    kind: Any = next((kind for kind in (Elastic, NeoHookean) if kind in can.materials), None)
    need(kind is not None, "an elastic material")
    first = kind(**SOFT)
    bar = bar_of_two_rings(subject, first, replace(first, **{name: value}), columns=True)
    rings_in_two(ledger, f"{kind.kind} bar, {name} of points", bar)
