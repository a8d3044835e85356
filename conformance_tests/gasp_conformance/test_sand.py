"""What is special about sand: how far it runs, on which slope it stays, and what cohesion holds."""

from __future__ import annotations

import math

from gasp_conformance import capability_oracles as exact
from gasp_conformance import sand_cases
from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Need, Subject
from gasp_core.contract import FrictionCone, Sand


@check("material:sand[heap]", Level.CAPABILITY)
def test_sand_makes_a_heap(subject: Subject, ledger: Ledger) -> None:
    """A block of sand that falls apart on a rough floor comes to rest, and has not run farther than sand does."""
    sand = Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2)
    speed, runout = sand_cases.heap_stops(subject, sand)
    # Columns are at rest after 3.3 times sqrt(H/g), here 0.6 s, and run 1.24 H/R (Lajeunesse et al. 2005, H/R < 3, in
    # the round; 10.1063/1.2087459): a quarter more is allowed.
    ledger.at_most("heap", "speed / that of its fall", speed, 0.02)
    ledger.at_most("heap", "way of its edge / half its side", runout, 1.25 * 1.24 * 2)


def flows_as_it_should(ledger: Ledger, case: str, slope: float, way: float, flows: float, felt: float) -> None:
    """Ways over that of a frictionless block: `flows` should be and `felt` is what the floor may take of it, or give.

    The ends of a layer have nothing to lean on: at most the pressure of a fluid of its depth H is lacking, of its
    weight down the slope the share H / (2 L tan(slope)), and that only makes it faster.
    """
    ends = sand_cases.LAYER_DEPTH / (2 * sand_cases.LAYER_LENGTH * math.tan(math.radians(slope)))
    ledger.at_most(case, "way / frictionless - flow of a layer", max(way - flows, 0.0), felt + ends)
    ledger.at_most(case, "flow of a layer - way / frictionless", max(flows - way, 0.0), felt)


@check("material:sand[friction]", Level.CAPABILITY)
def test_sand_has_its_friction_angle(subject: Subject, ledger: Ledger) -> None:
    """On a rough slope sand stays or flows as its angle says, and what the angle was measured in."""
    for cone, angle, slope in (
        (FrictionCone.SIMPLE_SHEAR, 40.0, 22.0),
        (FrictionCone.SIMPLE_SHEAR, 10.0, 22.0),
        (FrictionCone.PLANE_STRAIN, 30.0, 38.0),
        (FrictionCone.TRIAXIAL_COMPRESSION, 30.0, 38.0),
    ):
        sand = Sand(density=1600.0, youngs_modulus=3e5, poissons_ratio=0.2, friction_angle=angle, cone=cone)
        way = sand_cases.layer_on_slope(subject, sand, slope)
        flows = max(0.0, 1 - exact.drucker_prager_friction(angle, cone) / math.tan(math.radians(slope)))
        # A rough floor is felt up to half a cell above it, a quarter of the layer.
        felt = 0.25 * max(flows, 0.4)
        flows_as_it_should(ledger, f"sand of {angle:g} degrees ({cone.value}) on {slope:g}", slope, way, flows, felt)


@check("cohesion", Level.CAPABILITY)
def test_sand_coheres(subject: Subject, ledger: Ledger, need: Need) -> None:
    """On a rough slope that is too steep for dry sand, moist sand stays or flows as its cohesion says."""
    can = subject.descriptor.capabilities
    need(can.cohesion, "sand that coheres")
    need(Sand in can.materials, "sand")
    angle, slope, density = 10.0, 40.0, 1600.0
    weight = density * sand_cases.GRAVITY * math.sin(math.radians(slope)) * sand_cases.LAYER_DEPTH
    for held in (0.4, 1.2):
        cohesion = held * weight
        sand = Sand(density=density, youngs_modulus=3e5, poissons_ratio=0.2, friction_angle=angle, cohesion=cohesion)
        way = sand_cases.layer_on_slope(subject, sand, slope)
        flows = max(0.0, 1 - exact.drucker_prager_friction(angle) / math.tan(math.radians(slope)) - held)
        # As above, and of the layer cohesion has a quarter less to hold.
        felt = 0.25 * (max(flows, 0.4) + held)
        flows_as_it_should(ledger, f"cohesion that holds {held:g} of a layer's weight", slope, way, flows, felt)
