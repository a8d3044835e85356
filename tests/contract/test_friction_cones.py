"""A cone passes through the state of stress in which its angle was measured."""

import math

import numpy as np
import pytest

from gasp_core.contract import FrictionCone, Sand


def sand(angle, cone, cohesion=0.0):
    return Sand(
        density=1600, youngs_modulus=1e6, poissons_ratio=0.3, friction_angle=angle, cone=cone, cohesion=cohesion
    )


def at_failure(cone, angle, cohesion):
    """Principal pressures [Pa] at which Coulomb's law, shear = c + tan(phi) pressure, is met, so that it flows."""
    phi = math.radians(angle)
    if cone is FrictionCone.SIMPLE_SHEAR:
        # On the plane that shears; at constant volume normal stresses are alike.
        pressure = 1000.0
        shear = cohesion + math.tan(phi) * pressure
        return np.array([pressure + shear, pressure, pressure - shear])
    least = 500.0
    flow = (1 + math.sin(phi)) / (1 - math.sin(phi))
    largest = flow * least + 2 * cohesion * math.sqrt(flow)
    if cone is FrictionCone.TRIAXIAL_COMPRESSION:
        return np.array([largest, least, least])
    return np.array([largest, (largest + least) / 2, least])


@pytest.mark.parametrize("cone", list(FrictionCone))
@pytest.mark.parametrize("cohesion", [0.0, 300.0])
@pytest.mark.parametrize("angle", [5.0, 31.0, 50.0])
def test_it_passes_through_what_was_measured(cone, angle, cohesion):
    material = sand(angle, cone, cohesion)
    stresses = at_failure(cone, angle, cohesion)
    pressure = stresses.mean()
    deviator = math.sqrt(1.5) * float(np.linalg.norm(stresses - pressure))
    bulk_modulus = material.lame_lambda + 2 / 3 * material.shear_modulus
    tension = bulk_modulus * material.loosest_strain
    assert deviator == pytest.approx(material.friction_slope * (pressure + tension), rel=1e-12)


def test_31_degrees_of_a_cylinder_are_46_in_plane_strain():
    steep = math.degrees(math.asin(sand(31, FrictionCone.TRIAXIAL_COMPRESSION).friction_slope / math.sqrt(3)))
    assert steep == pytest.approx(46, abs=0.5)
