"""A body of two materials, or of numbers that vary from point to point, has in either half what is asked for there."""

from __future__ import annotations

from dataclasses import replace

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


def of_two_materials(subject: Subject, ledger: Ledger, need: Need, kind: type[Elastic] | type[NeoHookean]) -> None:
    """A bar whose second half is of another material rings as two stiffnesses and two Poisson's ratios say."""
    need(kind in subject.descriptor.capabilities.materials, kind.kind)
    soft = kind(**SOFT)
    stiff = replace(soft, youngs_modulus=4 * soft.youngs_modulus, poissons_ratio=0.4)
    rings_in_two(ledger, f"{kind.kind} bar of two", bar_of_two_rings(subject, soft, stiff, columns=False))


def by_columns(subject: Subject, ledger: Ledger, need: Need, name: str, value: float) -> None:
    """A bar of one material, one number of which is `value` in its second half, point by point."""
    can = subject.descriptor.capabilities
    need(name in can.material_columns, f"{name} that varies from point to point")
    kinds = [kind for kind in (Elastic, NeoHookean) if kind in can.materials]
    need(bool(kinds), "an elastic material")
    first = kinds[0](**SOFT)
    bar = bar_of_two_rings(subject, first, replace(first, **{name: value}), columns=True)
    rings_in_two(ledger, f"{first.kind} bar, {name} of points", bar)


@check("material:elastic[two stiffnesses]", Level.CAPABILITY)
def test_two_elastic_materials_in_one_body(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Each half of a bar has the stiffness and the Poisson's ratio of its own material."""
    of_two_materials(subject, ledger, need, Elastic)


@check("material:neo-hookean[two stiffnesses]", Level.CAPABILITY)
def test_two_neo_hookean_materials_in_one_body(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Each half of a bar has the stiffness and the Poisson's ratio of its own material."""
    of_two_materials(subject, ledger, need, NeoHookean)


@check("material-column:density", Level.CAPABILITY)
def test_column_of_densities(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A bar whose points are four times as heavy in its second half rings as that says."""
    by_columns(subject, ledger, need, "density", 2800.0)


@check("material-column:youngs_modulus", Level.CAPABILITY)
def test_column_of_youngs_moduli(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A bar whose points are four times as stiff in its second half rings as that says."""
    by_columns(subject, ledger, need, "youngs_modulus", 9.2e4)


@check("material-column:poissons_ratio", Level.CAPABILITY)
def test_column_of_poissons_ratios(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A bar gets thinner as it gets longer in its second half alone, where its points have a Poisson's ratio."""
    by_columns(subject, ledger, need, "poissons_ratio", 0.4)
