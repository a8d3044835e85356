"""Elastic matter is damped as it says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gasp_conformance import capability_oracles as exact
from gasp_conformance.checks import Level, check
from gasp_conformance.damping_cases import blocks_fly, column_comes_to_rest, plate_comes_to_rest
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Need, Subject
from gasp_core.contract import ContactCondition, Elastic, HalfSpace, NeoHookean, Quantity

RATIO = 0.1
"""Of the critical damping: of the amplitude half is left after a period."""


@pytest.mark.parametrize("kind", [Elastic, NeoHookean], ids=lambda kind: kind.kind)
@pytest.mark.parametrize("damping", ["mass", "stiffness", "volume"])
@check("material-damping", Level.CAPABILITY)
def test_matter_is_damped(
    subject: Subject, ledger: Ledger, need: Need, kind: type[Elastic] | type[NeoHookean], damping: str
) -> None:
    """A plate that rings dies away at the rate that Rayleigh's two coefficients say, each by itself; and so does what
    is nearly incompressible and changes its volume alone."""
    can = subject.descriptor.capabilities
    need(can.material_damping, "damped materials")
    need(kind in can.materials, kind.kind)
    bare = kind(density=700.0, youngs_modulus=2.3e4, poissons_ratio=0.46 if damping == "volume" else 0.3)
    if damping == "volume":
        need(HalfSpace in can.collider_shapes, "planes")
        need(ContactCondition.SLIP in can.contact_conditions, "smooth walls")
        pulse = math.pi * math.sqrt((bare.lame_lambda + 2 * bare.shear_modulus) / bare.density)
        dying = column_comes_to_rest(subject, replace(bare, stiffness_damping=2 * RATIO / pulse))
    else:
        pulse = 2 * math.pi * exact.lame_frequency(1.0, bare.shear_modulus, bare.density)
        by_mass, by_stiffness = (2 * RATIO * pulse, 0.0) if damping == "mass" else (0.0, 2 * RATIO / pulse)
        dying = plate_comes_to_rest(subject, replace(bare, mass_damping=by_mass, stiffness_damping=by_stiffness))
    ledger.at_most(
        f"{kind.kind}, {damping}", "rate of decay / closed form - 1", dying.error, dying.dispersion + dying.stepping
    )


@pytest.mark.parametrize("kind", [pytest.param(kind, id=f"flight-{kind.kind}") for kind in (Elastic, NeoHookean)])
@check("material-damping", Level.CAPABILITY)
def test_flight_is_damped(subject: Subject, ledger: Ledger, need: Need, kind: type[Elastic] | type[NeoHookean]) -> None:
    """What flies and spins loses momentum and spin at the rate of damping by mass, and none by damping by stiffness."""
    can = subject.descriptor.capabilities
    need(can.material_damping, "damped materials")
    need(kind in can.materials, kind.kind)
    need(Quantity.LINEAR_MOMENTUM in can.conserved, "that it conserves linear momentum")
    bare = kind(density=1000.0, youngs_modulus=1e4, poissons_ratio=0.3)
    # A tenth of what is critical for a wave that goes to and fro in 0.3 m at 4 m/s.
    by_mass, by_stiffness = replace(bare, mass_damping=3.0), replace(bare, stiffness_damping=2 * RATIO / 40)
    for name, body in zip(("mass", "stiffness"), blocks_fly(subject, by_mass, by_stiffness)):
        case = f"{kind.kind}, {name}, flight"
        ledger.at_most(case, "centre - closed form [m]", body.way, body.way_allowed)
        if Quantity.ANGULAR_MOMENTUM in can.conserved:
            ledger.at_most(case, "spin - closed form, of its first", body.spin, body.spin_allowed)
