"""Elastic matter is damped as it says."""

from __future__ import annotations

import math

import pytest

from gasp_conformance import capability_oracles as exact
from gasp_conformance.checks import Level, check
from gasp_conformance.damping_cases import plate_comes_to_rest
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Need, Subject
from gasp_core.contract import Elastic, NeoHookean

RATIO = 0.1
"""Of the critical damping: of the amplitude half is left after a period."""


@pytest.mark.parametrize("kind", [Elastic, NeoHookean], ids=lambda kind: kind.kind)
@pytest.mark.parametrize("damping", ["mass", "stiffness"])
@check("material-damping", Level.CAPABILITY)
def test_matter_is_damped(
    subject: Subject, ledger: Ledger, need: Need, kind: type[Elastic] | type[NeoHookean], damping: str
) -> None:
    """A plate that rings dies away at the rate that Rayleigh's two coefficients say, each by itself."""
    can = subject.descriptor.capabilities
    need(can.material_damping, "damped materials")
    need(kind in can.materials, kind.kind)
    plain = {"density": 700.0, "youngs_modulus": 2.3e4, "poissons_ratio": 0.3}
    bare = kind(**plain)
    pulse = 2 * math.pi * exact.lame_frequency(1.0, bare.shear_modulus, bare.density)
    material = (
        kind(**plain, mass_damping=2 * RATIO * pulse)
        if damping == "mass"
        else kind(**plain, stiffness_damping=2 * RATIO / pulse)
    )
    dying = plate_comes_to_rest(subject, material)
    ledger.at_most(
        f"{kind.kind}, {damping}", "rate of decay / closed form - 1", dying.error, dying.dispersion + dying.stepping
    )
