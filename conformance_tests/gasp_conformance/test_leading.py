"""Points that are led along trajectories, and what hangs on them."""

from __future__ import annotations

from gasp_conformance import leading_cases
from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.specimens import plain_material
from gasp_conformance.subject import Need, Subject
from gasp_core.contract import Elastic, NeoHookean


@check("trajectories", Level.CAPABILITY)
def test_led_points_go_where_they_are_led(subject: Subject, ledger: Ledger, need: Need) -> None:
    """At the moments to rounding, in between along a cubic; what hangs on them is taken along, all else is not."""
    can = subject.descriptor.capabilities
    need(can.trajectories, "points that are led")
    found = leading_cases.led_block(subject)
    ledger.at_most("swung block", "distance at the moments", found.at_moments, found.at_moments_allowed)
    ledger.at_most("swung block", "distance between moments", found.between, found.between_allowed)
    ledger.at_most("block beside it", "distance from its fall", found.bystander, found.bystander_allowed)
    material = plain_material(can)
    if not isinstance(material, Elastic | NeoHookean):
        return
    lag = leading_cases.shaken_bar(subject, material.youngs_modulus, material.density)
    ledger.at_least("bar that hangs on what is led", "deflection / length", lag.deflection / _LENGTH, 0.03)
    # Where the led end lies is known to half a cell, a quarter to either side, and a tip sinks with the fourth power of
    # the length.
    allowed = (1 + 0.25 / leading_cases.FREE_CELLS) ** 4 - 1
    ledger.at_most("bar that is lifted", "difference from one that weighs", lag.difference / lag.deflection, allowed)


_LENGTH = leading_cases.FREE_CELLS * leading_cases.SPACING
