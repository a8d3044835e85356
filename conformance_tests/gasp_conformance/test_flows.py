"""Matter that flows goes where it goes whatever the step, and a liquid keeps its volume."""

from __future__ import annotations

from gasp_conformance import flow_cases
from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Subject
from gasp_core.contract import Fluid, Foam, Material, Plasticine, Sand, Snow

SPREAD = 0.1
"""Blocks end up about a cell high: a tenth is a fifth of what a point is wide."""


def ends_alike(
    ledger: Ledger, subject: Subject, material: Material, friction: float = 0.6, allowed: float = SPREAD
) -> None:
    """A block of four cells falls apart on a floor, in the whole stable step and in a quarter of it."""
    whole, quarter = flow_cases.heights_in_two_steps(subject, material, friction)
    ledger.at_most(
        material.kind, "mean height in a quarter of the step / in the whole one - 1", quarter / whole - 1, allowed
    )


@check("material:sand[steps]", Level.CAPABILITY)
def test_sand_falls_apart_alike_in_smaller_steps(subject: Subject, ledger: Ledger) -> None:
    """A block of sand that falls apart lies as high whatever the step is."""
    ends_alike(ledger, subject, Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2))


@check("material:snow[steps]", Level.CAPABILITY)
def test_snow_falls_alike_in_smaller_steps(subject: Subject, ledger: Ledger) -> None:
    """A block of snow that falls on a floor lies as high whatever the step is."""
    ends_alike(ledger, subject, Snow(density=400.0, youngs_modulus=1.4e5, poissons_ratio=0.2))


@check("material:plasticine[steps]", Level.CAPABILITY)
def test_plasticine_spreads_alike_in_smaller_steps(subject: Subject, ledger: Ledger) -> None:
    """A block of plasticine that spreads on a floor lies as high whatever the step is."""
    soft = Plasticine(density=1000.0, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=1e3)
    ends_alike(ledger, subject, soft)


@check("material:foam[steps]", Level.CAPABILITY)
def test_foam_spreads_alike_in_smaller_steps(subject: Subject, ledger: Ledger) -> None:
    """A block of foam that spreads on a floor lies as high whatever the step is."""
    soft = Foam(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=100.0, plastic_viscosity=50.0)
    ends_alike(ledger, subject, soft)


@check("material:fluid[steps]", Level.CAPABILITY)
def test_fluid_spreads_alike_in_smaller_steps(subject: Subject, ledger: Ledger) -> None:
    """A block of water that spreads on a floor lies as high whatever the step is."""
    # It ends up as thin as the points are apart, twice as near the floor as the others: twice the share.
    water = Fluid(density=1000.0, bulk_modulus=1e5)
    ends_alike(ledger, subject, water, friction=0.0, allowed=2 * SPREAD)


@check("material:fluid[volume]", Level.CAPABILITY)
def test_fluid_keeps_its_volume(subject: Subject, ledger: Ledger) -> None:
    """A column of water that breaks in a closed tank comes to stand there as high as its volume says, inside."""
    slosh = flow_cases.tank_sloshes(subject, Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1.0))
    # A wall is felt to a tenth of a cell by half of the points a cell and a half above it.
    ledger.at_most("tank", "mean height off its volume's [cells]", slosh.level_error, 0.1)
    # Two swings of a metre at sqrt(g H) take 2.6 s; a wave that breaks keeps little.
    ledger.at_most("tank", "kinetic energy / set free", slosh.kinetic_energy, 0.1)
    ledger.at_most("tank", "share of points a third of a cell behind a wall", slosh.outside, 1e-3)
