from __future__ import annotations

import pytest
from gasp_genesis_mpm.material_mapping import law_of

from gasp_core.contract import Elastic, Fluid, FrictionCone, Metal, NeoHookean, Sand, Snow

SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}


@pytest.mark.parametrize(
    ("material", "name", "own"),
    [
        (Elastic(**SOLID), "Elastic", {"model": "corotation"}),
        (NeoHookean(**SOLID), "Elastic", {"model": "neohooken"}),
        (
            Sand(**SOLID, friction_angle=30.0, cone=FrictionCone.TRIAXIAL_COMPRESSION),
            "Sand",
            {"friction_angle": pytest.approx(30.0)},
        ),
        # M = sqrt(3) tan(25 degrees) is that of 3 M / (6 + M) = sin(20.85 degrees) in triaxial compression.
        (Sand(**SOLID, friction_angle=25.0), "Sand", {"friction_angle": pytest.approx(20.85, abs=0.01)}),
        (
            Snow(**SOLID, critical_compression=0.03, critical_stretch=0.01, hardening=6.0),
            "HardeningSnow",
            {"yield_lower": 0.03, "yield_higher": 0.01, "hardening": 6.0},
        ),
        (
            Metal(**SOLID, yield_stress=300.0, hardening=20.0),
            "HardeningMetal",
            {"yield_stress": 600.0, "hardening": 40.0},
        ),
    ],
)
def test_what_is_a_stress_is_scaled_and_nothing_else(material, name, own) -> None:
    law = law_of(material, 2.0)
    assert law.name == name
    assert dict(law.parameters) == {"E": 2e5, "nu": 0.3, **own}


def test_a_fluid_has_its_bulk_modulus_and_no_viscosity_is_compiled() -> None:
    thick = law_of(Fluid(density=1000.0, bulk_modulus=1e4, viscosity=3.0), 3.0)
    assert dict(thick.parameters)["E"] == 3e4
    assert thick == law_of(Fluid(density=1000.0, bulk_modulus=1e4), 3.0)
