from __future__ import annotations

import math

import numpy as np
import pytest
from gasp_genesis_mpm.laws import law_of, refuse_unknown

from gasp_core.engine.materials import Elastic, Fluid, Metal, NeoHookean, Sand, Snow
from gasp_core.errors import SceneError

SOLID = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}


@pytest.mark.parametrize(
    ("material", "name", "own"),
    [
        (Elastic(**SOLID), "Elastic", {"model": "corotation"}),
        (NeoHookean(**SOLID), "Elastic", {"model": "neohooken"}),
        (Sand(**SOLID, friction_angle=30.0), "Sand", {"friction_angle": 30.0}),
        (
            Snow(**SOLID, critical_compression=0.03, critical_stretch=0.01),
            "Snow",
            {"yield_lower": 0.03, "yield_higher": 0.01},
        ),
        (
            Metal(**SOLID, yield_stress=300.0),
            "ElastoPlastic",
            {"use_von_mises": True, "von_mises_yield_stress": 600.0 * math.sqrt(2 / 3)},
        ),
    ],
)
def test_solids_keep_their_moduli_times_the_scale(material, name, own) -> None:
    law = law_of(material, 2.0, 1e-3)
    assert law.name == name
    assert dict(law.parameters) == {"E": 2e5, "nu": 0.3, **own}


def test_a_fluid_without_viscosity_has_its_bulk_modulus_alone() -> None:
    parameters = dict(law_of(Fluid(density=1000.0, bulk_modulus=1e4), 3.0, 1e-3).parameters)
    assert (parameters["lam"], parameters["mu"], parameters["viscous"]) == (3e4, 0.0, False)


@pytest.mark.parametrize("step", [1e-3, 4e-5])
def test_a_viscous_fluid_shears_and_dilates_as_it_should_within_a_substep(step: float) -> None:
    """Genesis: 2 mu (F - R) F^T + lambda J (J - 1), of F = J^(1/3) (1 + dt grad v) and J of the whole of it."""
    fluid = Fluid(density=1000.0, bulk_modulus=1e4, viscosity=7.0)
    parameters = dict(law_of(fluid, 1.0, step).parameters)

    def stress(strain):
        left, stretches, right = np.linalg.svd(np.eye(3) + strain)
        volume_ratio = stretches.prod()
        stretch = np.eye(3) + strain
        shear = 2 * parameters["mu"] * (stretch - left @ right) @ stretch.T
        return shear + parameters["lam"] * volume_ratio * (volume_ratio - 1) * np.eye(3)

    rate = 1e-3
    sheared = stress(step * rate * (np.eye(3)[:, [1, 0, 2]] * [1, 1, 0]))
    # To first order in the strain of a substep.
    assert sheared[0, 1] == pytest.approx(2 * fluid.viscosity * rate, rel=10 * step * rate)
    small = 1e-7
    pressed = stress(-small / 3 * np.eye(3))
    # Both moduli are differences of numbers near 1; their parts of second order are small^2 times mu.
    uncertain = 8 * parameters["mu"] * (np.finfo(float).eps + small**2)
    assert np.trace(pressed) / 3 == pytest.approx(-fluid.bulk_modulus * small, rel=1e-5, abs=uncertain)


@pytest.mark.parametrize(
    ("material", "word"),
    [(Snow(**SOLID, hardening=6.0), "snow by 10"), (Metal(**SOLID, yield_stress=1.0, hardening=2.0), "hardens")],
)
def test_what_genesis_has_no_parameter_for_is_refused(material, word: str) -> None:
    with pytest.raises(SceneError, match=word) as refusal:
        refuse_unknown(material)
    assert "\n" not in str(refusal.value)
