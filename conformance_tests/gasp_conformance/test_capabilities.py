"""What an engine declares, shown: for every material, collider, contact, drive, field ... at least one check.

A check is undeclared for an engine that does not declare what it is about. What an engine declares and no check here is
about fails as such: nothing is believed unseen.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_conformance import capability_oracles as exact
from gasp_conformance import forcing_cases, material_cases, readout_cases, wall_cases
from gasp_conformance.bounds import place_rounding, rounding
from gasp_conformance.checks import Level, check
from gasp_conformance.core_cases import block_falls, difference, states_differ, swaying_block
from gasp_conformance.declarations import ABSENT, declared
from gasp_conformance.ledger import Ledger
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Need, Subject, find_subject
from gasp_core.contract import (
    BoxShape,
    ContactCondition,
    Determinism,
    DomainPolicy,
    Driven,
    Elastic,
    Field,
    Fluid,
    Foam,
    HalfSpace,
    Impulse,
    Material,
    Metal,
    NeoHookean,
    Pinned,
    Plasticine,
    Precision,
    Quantity,
    Rigid,
    Sand,
    Side,
    SignedDistanceField,
    Snow,
    SphereShape,
    Status,
    Wind,
    device_class,
)
from gasp_core.errors import EngineEnvironmentError

Array = NDArray[Any]

SHOWN = {
    *(f"material:{kind.kind}" for kind in (Elastic, NeoHookean, Sand, Fluid, Snow, Metal, Plasticine, Foam, Rigid)),
    *(f"collider:{shape.kind}" for shape in (HalfSpace, BoxShape, SphereShape, SignedDistanceField)),
    *(f"{kind}:{contact.value}" for kind in ("walls", "bodies") for contact in ContactCondition),
    *(f"drive:{drive.kind}" for drive in (Pinned, Driven, Impulse)),
    f"force-field:{Wind.kind}",
    *(f"field:{field.value}" for field in Field),
    *(f"conserved:{quantity.value}" for quantity in Quantity),
    *(f"domain:{policy.value}" for policy in DomainPolicy),
    *(f"precision:{precision.value}" for precision in Precision),
    *(f"material-column:{name}" for name in ("density", "youngs_modulus", "poissons_ratio")),
    *(f"view:{field.value}" for field in (Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS)),
    "checkpoints",
    "pair-contacts",
    "moving-colliders",
    "restitution",
    "rigid-parts",
    "material-damping",
    "cohesion",
    "trajectories",
    "device-indices",
    "tracers",
}
"""Names of the checks below, in `test_bodies`, `test_damping`, `test_leading`, `test_parts` and `test_sand`; devices
have theirs by their names."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A check for each device the engine declares, and a failing one for each declaration that has no check."""
    argument = next((one for one in ("device", "unknown") if one in metafunc.fixturenames), None)
    if argument is None:
        return
    name = metafunc.config.getoption("--gasp-engine", default=None)
    items: list[str] = []
    if name:
        subject = find_subject(name, None, None)
        can = subject.descriptor.capabilities
        if argument == "device":
            items = list(can.devices)
        else:
            items = [one for one in declared(can, subject.precision) if one not in SHOWN and one[:7] != "device:"]
    names = {item: f"device:{item}" if argument == "device" else item for item in items}
    nothing = {"": "device" if argument == "device" else "nothing-unseen"}
    metafunc.parametrize(
        argument,
        [pytest.param(item, marks=check(name, Level.CAPABILITY), id=name) for item, name in (names or nothing).items()],
    )


# --- materials ------------------------------------------------------------------------------------------------------

STRESSES: Mapping[type[Material], Callable[[Array], Array]] = {
    # P / E of a stretch F with nu = 0, so mu = E/2 and lambda = 0; the laws are in `gasp_core.contract.materials`.
    Elastic: lambda stretch: stretch - 1,
    NeoHookean: lambda stretch: (stretch - 1 / stretch) / 2,
    Snow: lambda stretch: stretch - 1,
}
Solid = Elastic | NeoHookean | Snow


def stretches(ledger: Ledger, subject: Subject, material: Solid) -> None:
    """Density and Young's modulus, by how a free bar with nu = 0 rings; the bound is as for shear."""
    stretch = material_cases.bar_stretches_and_returns(subject, material)
    ledger.at_most(f"{material.kind} bar along itself", "frequency error", stretch.error, stretch.dispersion)


def shears(ledger: Ledger, subject: Subject, material: Solid) -> None:
    """Density and shear modulus, by how a free plate rings; half as much again as grids of the second order leave."""
    shear = material_cases.block_shears_and_returns(subject, material)
    ledger.at_most(f"{material.kind} plate in shear", "frequency error", shear.error, shear.dispersion)


def breathes(ledger: Ledger, subject: Subject, material: Solid) -> None:
    """Density and bulk modulus, by how a free ball rings; as for shear, and for a ball that is not quite round."""
    breath = material_cases.ball_breathes(subject, material)
    ledger.at_most(f"{material.kind} ball that breathes", "frequency error", breath.error, breath.dispersion)


def stretches_far(ledger: Ledger, subject: Subject, material: Solid) -> None:
    """The law itself, by a bar with nu = 0 that swings so far that laws part."""
    kind = type(material)
    other = Elastic if kind is NeoHookean else NeoHookean
    error, apart = material_cases.bar_stretches_far(subject, material, STRESSES[kind], STRESSES[other])
    # After half a period a frequency that is off by e has put the bar off by pi e of its amplitude; twice that for the
    # harmonics that large stretches bring.
    allowed = 2 * math.pi * exact.grid_dispersion(math.pi, 1 / 16)
    ledger.at_most(f"{kind.kind} bar stretched far", "distance from its own law", error, allowed)
    # That the other law would not pass: the closed forms' own business, and the same for every engine.
    assert apart > 3 * allowed


RINGING = {"density": 700.0, "youngs_modulus": 2.3e4, "poissons_ratio": 0.42}
FIBRES = RINGING | {"poissons_ratio": 0.0}


@check("material:elastic[stretch]", Level.CAPABILITY)
def test_elastic_in_stretch(subject: Subject, ledger: Ledger) -> None:
    """A bar rings along itself as its density and stiffness say."""
    stretches(ledger, subject, Elastic(**FIBRES))


@check("material:elastic[shear]", Level.CAPABILITY)
def test_elastic_in_shear(subject: Subject, ledger: Ledger) -> None:
    """A plate rings as its density, stiffness and Poisson's ratio say."""
    shears(ledger, subject, Elastic(**RINGING))


@check("material:elastic[bulk]", Level.CAPABILITY)
def test_elastic_in_bulk(subject: Subject, ledger: Ledger) -> None:
    """A ball breathes as its density, stiffness and Poisson's ratio say."""
    breathes(ledger, subject, Elastic(**RINGING))


@check("material:elastic[large strain]", Level.CAPABILITY)
def test_elastic_at_large_strain(subject: Subject, ledger: Ledger) -> None:
    """It stays fixed-corotated where it stretches far."""
    stretches_far(ledger, subject, Elastic(**FIBRES))


@check("material:neo-hookean[stretch]", Level.CAPABILITY)
def test_neo_hookean_in_stretch(subject: Subject, ledger: Ledger) -> None:
    """A bar rings along itself as its density and stiffness say."""
    stretches(ledger, subject, NeoHookean(**FIBRES))


@check("material:neo-hookean[shear]", Level.CAPABILITY)
def test_neo_hookean_in_shear(subject: Subject, ledger: Ledger) -> None:
    """A plate rings as its density, stiffness and Poisson's ratio say."""
    shears(ledger, subject, NeoHookean(**RINGING))


@check("material:neo-hookean[bulk]", Level.CAPABILITY)
def test_neo_hookean_in_bulk(subject: Subject, ledger: Ledger) -> None:
    """A ball breathes as its density, stiffness and Poisson's ratio say."""
    breathes(ledger, subject, NeoHookean(**RINGING))


@check("material:neo-hookean[large strain]", Level.CAPABILITY)
def test_neo_hookean_at_large_strain(subject: Subject, ledger: Ledger) -> None:
    """It stays neo-Hookean where it stretches far."""
    stretches_far(ledger, subject, NeoHookean(**FIBRES))


@check("material:sand[no tension]", Level.CAPABILITY)
def test_sand_bears_no_tension(subject: Subject, ledger: Ledger) -> None:
    """A block of sand that is pulled apart does not pull back."""
    sand = Sand(density=1600.0, youngs_modulus=1e5, poissons_ratio=0.2)
    off, surface = material_cases.loose_block_parts(subject, sand, np.diag([1.0, 0.3, 0.0]), 0.2)
    # And a substep of tension before it is found to be loose: (c dt / L)^2 with dt half a cell over c.
    ledger.at_most("sand", "way not gone where nothing holds", off, surface + 1 / 36)


def stays_on_a_floor(ledger: Ledger, subject: Subject, material: Material) -> None:
    """A wall is felt to a share of a cell: matter at rest on it is where it is to a third of one."""
    mean, lowest = material_cases.spreads_on_a_floor(subject, material)
    ledger.at_most(f"{material.kind} on a floor", "surface below it [cells]", max(mean, 0.0), 1 / 3)
    ledger.at_most(f"{material.kind} on a floor", "lowest percent below it [cells]", max(lowest, 0.0), 1 / 3)


@check("material:sand[floor]", Level.CAPABILITY)
def test_sand_stays_on_a_floor(subject: Subject, ledger: Ledger) -> None:
    """A block of sand that falls apart on a floor does not sink into it."""
    stays_on_a_floor(ledger, subject, Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2))


@check("material:fluid[floor]", Level.CAPABILITY)
def test_fluid_stays_on_a_floor(subject: Subject, ledger: Ledger) -> None:
    """A block of water that spreads on a floor does not sink into it."""
    stays_on_a_floor(ledger, subject, Fluid(density=1000.0, bulk_modulus=1e5))


@check("material:sand[compression]", Level.CAPABILITY)
def test_sand_has_its_stiffness_and_density(subject: Subject, ledger: Ledger) -> None:
    """A column between frictionless walls swings and sinks under its weight as its stiffness and density say."""
    cells = 8
    # Walls bear nu / (1 - nu) of the weight: a quarter, too little for sand of more than 37 degrees to give way.
    sand = Sand(density=700.0, youngs_modulus=3e6, poissons_ratio=0.2, friction_angle=50.0)
    column = material_cases.confined_column_sinks(subject, sand, cells)
    # Walls are felt within half a cell.
    ledger.at_most("sand column", "period error", column.period_error, 0.5 / cells)
    ledger.at_most("sand column", "depth error", column.depth_error, 0.5 / cells)


@check("material:fluid[compression]", Level.CAPABILITY)
def test_fluid_has_its_bulk_modulus_and_density(subject: Subject, ledger: Ledger) -> None:
    """A column between frictionless walls swings and sinks under its weight as its bulk modulus and density say."""
    cells = 8
    column = material_cases.confined_column_sinks(subject, Fluid(density=700.0, bulk_modulus=3e6), cells)
    # Walls are felt within half a cell.
    ledger.at_most("fluid column", "period error", column.period_error, 0.5 / cells)
    ledger.at_most("fluid column", "depth error", column.depth_error, 0.5 / cells)


@check("material:fluid[no tension]", Level.CAPABILITY)
def test_fluid_bears_no_tension(subject: Subject, ledger: Ledger) -> None:
    """A block of fluid that is pulled apart does not pull back."""
    fluid = Fluid(density=700.0, bulk_modulus=1e5)
    off, surface = material_cases.loose_block_parts(subject, fluid, np.diag([1.0, 0.3, 0.0]), 0.2)
    ledger.at_most("fluid", "way not gone where nothing holds", off, surface)


@check("material:fluid[shear]", Level.CAPABILITY)
def test_fluid_bears_no_shear(subject: Subject, ledger: Ledger) -> None:
    """Without viscosity nothing stops a fluid from shearing on; with it, a flow dies away at its rate."""
    ideal = Fluid(density=700.0, bulk_modulus=1e5)
    off, surface = material_cases.loose_block_parts(subject, ideal, [[0, 0, 2.0], [0, 0, 0], [0, 0, 0]], 0.2)
    ledger.at_most("ideal fluid", "way not gone where nothing holds", off, surface)
    decay = material_cases.shear_flow_dies(subject, Fluid(density=700.0, bulk_modulus=1e3, viscosity=500.0))
    allowed = decay.dispersion + decay.transfers + decay.stepping
    ledger.at_most("viscous fluid", "rate of decay error", decay.error, allowed)


def yields(ledger: Ledger, subject: Subject, material: Metal | Plasticine | Foam) -> None:
    """A plate swings back from below its yield stress, and stays where it was sheared to far beyond it."""
    elastic = material_cases.block_swings(subject, material, 0.3)
    # It goes to its elastic amplitude and as far the other way, but for what a coarse grid takes of it.
    ledger.at_most(f"{material.kind} below yield", "amplitude / elastic - 1", elastic.highest - 1, 0.2)
    ledger.at_most(f"{material.kind} below yield", "back swing / elastic + 1", elastic.lowest_after + 1, 0.3)
    # With four times the strain at yield to spend, 4^2/2 = 1/2 + (s - 1) takes a plastic plate 8.5 strains at yield
    # far, of which it springs back one, and swings about that by one: to three quarters of where it was.
    plastic = material_cases.block_swings(subject, material, 4.0)
    ledger.at_least(
        f"{material.kind} beyond yield", "lowest after / highest", plastic.lowest_after / plastic.highest, 0.5
    )


def flows(ledger: Ledger, subject: Subject, case: str, material: Metal | Plasticine | Foam) -> None:
    """A bar between walls, far beyond yield, loses the work that its law takes, both ways."""
    flowed = material_cases.bar_between_walls_flows(subject, material)
    # At either end of the bar's eight cells there is half a one that is partly cap: an eighth of its length. What of
    # that is stiffness, the swing below yield says; as much may flow more or less than the rest, and work is lost where
    # it flows.
    ledger.at_most(case, "length by its swing - 1", flowed.length_error, 1 / 8)
    ledger.at_most(case, "work lost when pressed / its law's - 1", flowed.pressing_error, 1 / 8)
    ledger.at_most(case, "work lost on the way back / its law's - 1", flowed.return_error, 1 / 8)


SHEARED = {"density": 400.0, "youngs_modulus": 2e4, "poissons_ratio": 0.0}
"""Of solids, this one bears as much of what presses it in shear as any: what flows shows."""


@check("material:metal[yield]", Level.CAPABILITY)
def test_metal(subject: Subject, ledger: Ledger) -> None:
    """Springs back from below its yield stress, and keeps what goes beyond."""
    yields(ledger, subject, Metal(density=700.0, youngs_modulus=2.3e4, poissons_ratio=0.3, yield_stress=100.0))


@check("material:metal[hardening]", Level.CAPABILITY)
def test_metal_hardens(subject: Subject, ledger: Ledger) -> None:
    """A bar that is pressed between walls, and swings back, yields at its stress, and at more the more it flowed."""
    flows(ledger, subject, "metal that does not harden", Metal(**SHEARED, yield_stress=400.0))
    flows(ledger, subject, "metal that hardens", Metal(**SHEARED, yield_stress=400.0, hardening=6e3))


@check("material:plasticine[yield]", Level.CAPABILITY)
def test_plasticine(subject: Subject, ledger: Ledger) -> None:
    """Springs back from below its yield stress, and keeps what goes beyond."""
    yields(ledger, subject, Plasticine(density=700.0, youngs_modulus=2.3e4, poissons_ratio=0.3, yield_stress=100.0))


@check("material:plasticine[softening]", Level.CAPABILITY)
def test_plasticine_softens(subject: Subject, ledger: Ledger) -> None:
    """A bar that is pressed between walls yields at less and less, and on its way back at what is never lost."""
    flows(ledger, subject, "plasticine", Plasticine(**SHEARED, yield_stress=1100.0, softening=6.5, residual=0.4))


@check("material:foam[yield]", Level.CAPABILITY)
def test_foam(subject: Subject, ledger: Ledger) -> None:
    """Without viscosity, springs back from below its yield stress, and keeps what goes beyond."""
    yields(ledger, subject, Foam(density=700.0, youngs_modulus=2.3e4, poissons_ratio=0.3, yield_stress=100.0))


@check("material:foam[relaxation]", Level.CAPABILITY)
def test_foam_relaxes(subject: Subject, ledger: Ledger) -> None:
    """What is above its yield stress flows off with the time eta / (2 mu), and what is below stays."""
    # Both ways to come to rest, flying on and creeping, take a quarter of a period.
    shear, density = 1e4, 400.0
    relaxation = 1 / (4 * exact.lame_frequency(1.0, shear, density))
    relaxing = Foam(**SHEARED, yield_stress=1e-3 * shear * 0.005, plastic_viscosity=2 * shear * relaxation)
    time = material_cases.shear_relaxes(subject, relaxing)
    allowed = time.dispersion + time.transfers + time.stepping + time.unyielding
    ledger.at_most("foam that yields to anything", "relaxation time error", time.error, allowed)
    # A twentieth of a period of the bar's: it is felt, and yields.
    flows(ledger, subject, "foam", Foam(**SHEARED, yield_stress=400.0, plastic_viscosity=3e3))


@check("material:snow[elastic]", Level.CAPABILITY)
def test_snow_is_elastic_within_its_box(subject: Subject, ledger: Ledger) -> None:
    """Where its box of stretches is wide, rings as its density, stiffness and Poisson's ratio say, and stays
    fixed-corotated where it stretches far."""
    wide = material_cases.unyielding(Snow(**RINGING))
    shears(ledger, subject, wide)
    breathes(ledger, subject, wide)
    stretches_far(ledger, subject, replace(wide, poissons_ratio=0.0))


PRESSED = {"critical_compression": 0.05, "critical_stretch": 0.2, "hardening": 6.0}
"""Far from snow's defaults; it swings back through its length at rest without tearing."""


def compacts(ledger: Ledger, case: str, pressed: material_cases.Pressed) -> None:
    """Snow that was pressed far beyond yield is where its law says, and as stiff as that says."""
    # At either end of the bar's eight cells there is half a one that is partly cap: an eighth of its length. What of
    # that is stiffness, the swing below yield says; as much may yield later or sooner than the rest.
    ledger.at_most(case, "length by its swing - 1", pressed.length_error, 1 / 8)
    ledger.at_most(case, "set / the work's - 1", pressed.set_error, 1 / 8)
    # The frequency goes with the root of the stiffness.
    ledger.at_most(case, "frequency / exp(xi (1 - J) / 2) / J - 1", pressed.frequency_error, 1 / 16)
    # Frames miss the turning points, and a coarse grid takes some of the swing, as of a plate's below yield.
    ledger.at_most(case, "swing / critical compression - 1", pressed.swing_error, 0.2)


@check("material:snow[compaction]", Level.CAPABILITY)
def test_snow_is_compacted_and_hardens(subject: Subject, ledger: Ledger) -> None:
    """A bar pressed beyond its critical compression stays as short as the work says, and as much stiffer."""
    snow = Snow(density=400.0, youngs_modulus=2e4, poissons_ratio=0.0, **PRESSED)
    compacts(ledger, "snow, free sides", material_cases.snow_is_pressed(subject, snow))


@check("material:snow[confined]", Level.CAPABILITY)
def test_confined_snow_is_compacted_and_hardens(subject: Subject, ledger: Ledger) -> None:
    """Between walls, where Poisson's ratio counts, all of its stiffness hardens."""
    snow = Snow(density=400.0, youngs_modulus=2e4, poissons_ratio=0.3, **PRESSED)
    compacts(ledger, "snow, held sides", material_cases.snow_between_walls_is_pressed(subject, snow))


@check("material:snow[tearing]", Level.CAPABILITY)
def test_snow_tears(subject: Subject, ledger: Ledger) -> None:
    """A bar springs back from below its critical stretch, and comes apart beyond."""
    snow = Snow(
        density=400.0,
        youngs_modulus=2e4,
        poissons_ratio=0.0,
        critical_compression=0.4,
        critical_stretch=0.02,
        hardening=6.0,
    )
    swing = material_cases.snow_is_pulled_and_swings(subject, snow, 0.6)
    # As metal below yield: it goes to its elastic amplitude and as far the other way, but for what a coarse grid takes.
    ledger.at_most("snow below its critical stretch", "amplitude / elastic - 1", swing.highest - 1, 0.2)
    ledger.at_most("snow below its critical stretch", "back swing / elastic + 1", swing.lowest_after + 1, 0.3)
    # Of twice the energy that tears all of it evenly, half is left at least, and flies on: sqrt(1/2) of the speed.
    left = material_cases.snow_is_torn(subject, snow, 2.0)
    ledger.at_least("snow beyond its critical stretch", "speed left", left, math.sqrt(0.5))


@check("material:rigid", Level.CAPABILITY)
def test_rigid(subject: Subject, ledger: Ledger) -> None:
    """Keeps its shape, falls and turns."""
    spin = material_cases.rigid_block_spins(subject, Rigid(density=700.0))
    # Six numbers move all points: what is left is the rounding of places, which does not add up.
    ledger.at_most("rigid", "change of distances / size", spin.distance_change, rounding(subject, 10))
    ledger.at_most("rigid", "place error / size", spin.place_error, 1.05 * spin.stepping + rounding(subject, 500))


# --- colliders ------------------------------------------------------------------------------------------------------


def holds(ledger: Ledger, subject: Subject, kind: type[Any], side: Side) -> None:
    """Matter thrown at a collider is stopped there, and nowhere else."""
    for number, impact in enumerate(wall_cases.impacts(subject, kind, side), start=1):
        case = f"{kind.kind} {side.value} {number}"
        # A quadratic spline feels a node from a cell and a half away: early or late, matter is stopped within that.
        ledger.at_most(case, "deepest point [cells]", max(impact.depth, 0.0), 1.5)
        ledger.at_most(case, "stopped before it [cells]", max(impact.gap, 0.0), 1.5)
        ledger.at_most(case, "free flight error / rounding", impact.free_error, 1)
        # That there was something to stop.
        assert impact.reach > 3


@pytest.mark.parametrize("side", list(Side), ids=lambda side: side.value)
@check("collider:plane", Level.CAPABILITY)
def test_plane(subject: Subject, ledger: Ledger, side: Side) -> None:
    """Blocks thrown at a tilted plane, either way round, and along it."""
    holds(ledger, subject, HalfSpace, side)


@pytest.mark.parametrize("side", list(Side), ids=lambda side: side.value)
@check("collider:box", Level.CAPABILITY)
def test_box(subject: Subject, ledger: Ledger, side: Side) -> None:
    """Blocks thrown at a box, or at its walls from within, from opposite sides; and past it."""
    holds(ledger, subject, BoxShape, side)


@pytest.mark.parametrize("side", list(Side), ids=lambda side: side.value)
@check("collider:sphere", Level.CAPABILITY)
def test_sphere(subject: Subject, ledger: Ledger, side: Side) -> None:
    """Blocks thrown at a ball, or at its wall from within, from opposite sides; and past it."""
    holds(ledger, subject, SphereShape, side)


@pytest.mark.parametrize("side", list(Side), ids=lambda side: side.value)
@check("collider:signed distance field", Level.CAPABILITY)
def test_signed_distance_field(subject: Subject, ledger: Ledger, side: Side) -> None:
    """Blocks thrown at the same planes, box and ball, given as distances on a grid."""
    holds(ledger, subject, SignedDistanceField, side)


@check("collider:signed distance field[slope]", Level.CAPABILITY)
def test_signed_distance_field_as_a_slope(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A block slides down a plane that is given as a field as down the plane itself: Coulomb's law."""
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.contact_conditions, "friction at colliders")
    coulombs(ledger, "slope of a field", subject, field=True)


@check("walls:stick", Level.CAPABILITY)
def test_stick(subject: Subject, ledger: Ledger) -> None:
    """A block stays on a slope of 30 degrees, and hangs from it when that is a ceiling."""
    floor = wall_cases.on_slope(subject, ContactCondition.STICK, 0.0, 30.0, 0.0)
    # It sways by some rho g H^2 / E, a thousandth of what it would go; the rest is for materials softer in shear.
    ledger.at_most("stick", "way on a slope / free", floor.way / floor.free_way, 0.05)
    ceiling = wall_cases.on_slope(subject, ContactCondition.STICK, 0.0, 30.0, 0.0, ceiling=True)
    ledger.at_most("stick", "fall from a ceiling / free", ceiling.rise / ceiling.free_rise, 0.05)
    ledger.at_most("stick", "way on a ceiling / free", ceiling.way / ceiling.free_way, 0.05)


@check("walls:slip", Level.CAPABILITY)
def test_slip(subject: Subject, ledger: Ledger) -> None:
    """A block slides down a slope of 30 degrees as if it fell along it, and does not leave it for being pulled."""
    for ceiling in (False, True):
        slope = wall_cases.on_slope(subject, ContactCondition.SLIP, 0.0, 30.0, 0.2, ceiling=ceiling)
        case = "slip on a ceiling" if ceiling else "slip on a slope"
        # Nothing acts along the surface, so the centre falls as symplectic Euler says.
        ledger.at_most(case, "way - free fall along it [m]", slope.way - slope.free_way, 1.05 * slope.stepping)
        ledger.at_most(case, "way off it / free", slope.rise / slope.free_rise, 0.05)


@check("walls:separate", Level.CAPABILITY)
def test_separate(subject: Subject, ledger: Ledger) -> None:
    """Coulomb's law, sliding and at rest; free to leave."""
    smooth = wall_cases.on_slope(subject, ContactCondition.SEPARATE, 0.0, 24.0, 1.0)
    ledger.at_most("separate, no friction", "way - free [m]", smooth.way - smooth.free_way, 1.05 * smooth.stepping)
    coulombs(ledger, "separate, sliding", subject, field=False)
    held = wall_cases.on_slope(subject, ContactCondition.SEPARATE, math.tan(math.radians(35)), 24.0, 0.0)
    # It slides until its weight has arrived at the foot, some hundredths of the time, and sways by rho g H^2 / E.
    ledger.at_most("separate, held", "way / free", held.way / held.free_way, 0.05)
    leaving = wall_cases.on_slope(subject, ContactCondition.SEPARATE, 0.5, 24.0, 0.0, ceiling=True)
    ledger.at_most("separate, leaving", "fall - free [m]", leaving.rise - leaving.free_rise, 1.05 * leaving.stepping)
    ledger.at_most("separate, leaving", "way - free [m]", leaving.way - leaving.free_way, 1.05 * leaving.stepping)


def coulombs(ledger: Ledger, case: str, subject: Subject, *, field: bool) -> None:
    """A block that slides down a slope of 24 degrees with the friction of one of 15."""
    gravity, time, tilt = wall_cases.GRAVITY, 0.4, math.radians(24)
    friction = math.tan(math.radians(15))
    slide = wall_cases.on_slope(subject, ContactCondition.SEPARATE, friction, 24.0, 1.0, field=field)
    slowed = slide.free_way - friction * gravity * math.cos(tilt) * time**2 / 2
    # Friction follows the weight that has arrived at the foot, which swings with twice the period of settling or more:
    # the impulse of a quarter of a swing may be missing.
    late = friction * gravity * math.cos(tilt) * slide.settling * time
    ledger.at_most(case, "way - Coulomb's [m]", slide.way - slowed, late + 1.05 * slide.stepping)


@check("moving-colliders", Level.CAPABILITY)
def test_moving_colliders(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A floor that glides takes a block along by friction, a wall pushes one, a turntable turns one."""
    need(subject.descriptor.capabilities.moving_colliders, "colliders that move")
    carried = wall_cases.carried(subject)
    # A swing of the pressure under a block of two cells shifts the way by a hundredth.
    bound = carried.late + 0.02 * carried.closed_form
    ledger.at_most("gliding floor", "way - closed form [m]", carried.way - carried.closed_form, bound)
    # A quadratic spline feels a node from a cell and a half away: early or late, matter is stopped within that.
    ledger.at_most("moving wall", "depth [cells]", carried.depth, 1.5)
    ledger.at_most("moving wall", "way of what it pushes / its own - 1", min(carried.pushed - 1, 0.0), 0.1)
    # It goes round with the turntable from the start; what it lacks is the shear of starting to be pulled inwards.
    ledger.at_most("turntable", "angle / its own - 1", carried.turn - 1, 0.03)


# --- bodies ---------------------------------------------------------------------------------------------------------


# --- drives, forces, the domain -------------------------------------------------------------------------------------


def keeps(ledger: Ledger, case: str, what: str, deviation: forcing_cases.Deviation) -> None:
    """A deviation within what substeps and rounding leave."""
    ledger.at_most(case, f"{what} [m]", deviation.error, deviation.allowed)


def grips(ledger: Ledger, case: str, grip: forcing_cases.Grip) -> None:
    """Before, during and after its time, and beside its region."""
    keeps(ledger, case, "error before its time", grip.before)
    keeps(ledger, case, "error in its time", grip.during)
    keeps(ledger, case, "error after its time", grip.after)
    keeps(ledger, case, "error of matter elsewhere", grip.bystander)


@check("drive:pinned", Level.CAPABILITY)
def test_pinned(subject: Subject, ledger: Ledger) -> None:
    """A falling block is held in its region and time, falls anew afterwards; another falls on."""
    grips(ledger, "pinned", forcing_cases.pinned_block(subject))


@check("drive:driven", Level.CAPABILITY)
def test_driven(subject: Subject, ledger: Ledger) -> None:
    """A block is shifted and turned as a rigid body in its time, round and round too, and goes on straight afterwards;
    later drives win."""
    grips(ledger, "driven", forcing_cases.driven_block(subject))
    keeps(ledger, "driven round", "error after turns", forcing_cases.driven_round(subject))
    keeps(ledger, "driven twice", "error of what two drives hold", forcing_cases.driven_twice(subject))


@check("drive:impulse", Level.CAPABILITY)
def test_impulse(subject: Subject, ledger: Ledger) -> None:
    """A struck body has exactly the impulse given, from its time on, and nothing else has any."""
    push = forcing_cases.pushed_block(subject)
    keeps(ledger, "impulse", "error before", push.before)
    keeps(ledger, "impulse", "error of the centre after", push.after)
    ledger.at_most("impulse", "error of the velocity given, relative", push.gained.error, push.gained.allowed)
    keeps(ledger, "impulse", "error of matter elsewhere", push.bystander)
    keeps(ledger, "impulse", "error of points of unequal mass", forcing_cases.pushed_points(subject))


@check("force-field:wind", Level.CAPABILITY)
def test_wind(subject: Subject, ledger: Ledger) -> None:
    """dv/dt = k (u - v) in its region and time, and uniform motion before, afterwards and elsewhere."""
    grips(ledger, "wind", forcing_cases.wind_on_block(subject))


@check("domain:expand", Level.CAPABILITY)
def test_domain_expands(subject: Subject, ledger: Ledger) -> None:
    """Matter passes the edge of a first guess as if it were not there."""
    keeps(ledger, "expand", "error of free fall", forcing_cases.expanding_domain(subject))


@check("domain:stop", Level.CAPABILITY)
def test_domain_stops(subject: Subject, ledger: Ledger) -> None:
    """A run ends where a point leaves, says which one, and keeps what can be read."""
    edge, row = forcing_cases.stopped_at_edge(subject)
    *earlier, last = edge.reports
    assert last.status is Status.OUT_OF_DOMAIN, f"a point left the domain, and the run ended {last.status.value}"
    assert all(report.status is Status.OK for report in earlier)
    assert edge.stopped_at >= edge.crossed_at, "it stopped before anything left"
    text = " ".join(last.warnings)
    assert re.search(rf"\b{row}\b", text), f"point {row} left, which the reason does not name: {text!r}"
    assert edge.finite
    # A frame of 0.05 s at 2 m/s beyond the edge at most: the frame in which it left was not reported OK.
    ledger.at_most("stop", "way beyond the edge [m]", max(edge.outside, 0.0), 0.1)
    keeps(ledger, "stop", "error of points within", edge.free_error)


@check("domain:clamp", Level.CAPABILITY)
def test_domain_clamps(subject: Subject, ledger: Ledger) -> None:
    """A point that meets the edge stays within and is told of; others do not notice."""
    edge, _ = forcing_cases.clamped_at_edge(subject)
    assert all(report.status is Status.OK for report in edge.reports)
    assert edge.reach > 0.3, "nothing met the edge"
    # Held at the edge itself; a place is stored to rounding.
    ledger.at_most("clamp", "way beyond the edge [m]", max(edge.outside, 0.0), place_rounding(subject, 0, 3.0, 0.0))
    keeps(ledger, "clamp", "error of points within", edge.free_error)
    assert any(report.warnings for report in edge.reports), "what the edge held back has to be told"


# --- what is read, kept and taken up again --------------------------------------------------------------------------


@check("field:velocities", Level.CAPABILITY)
def test_velocities(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Velocities are those given, those of free fall, and those of the positions."""
    need(Field.VELOCITIES in subject.descriptor.capabilities.output_fields, "velocities")
    found = readout_cases.flown_velocities(subject)
    ledger.at_most("velocities", "from those given [m/s]", found.start, found.start_allowed)
    ledger.at_most("velocities", "from free fall [m/s]", found.fall, found.fall_allowed)
    ledger.at_most("velocities", "from differences of places [m/s]", found.sway, found.sway_allowed)


@check("field:deformation_gradients", Level.CAPABILITY)
def test_deformation_gradients(subject: Subject, ledger: Ledger) -> None:
    """F is I at the start, and I + A t where matter flies apart with v = A x."""
    found = readout_cases.affine_gradients(subject)
    ledger.at_most("deformation gradients", "from I at the start", found.start, found.start_allowed)
    ledger.at_most("deformation gradients", "from I + A t", found.flow, found.flow_allowed)


@check("field:tracer_positions", Level.CAPABILITY)
def test_tracer_positions(subject: Subject, ledger: Ledger) -> None:
    """Tracers are shown where a uniform flow takes them."""
    found = readout_cases.tracers_carried(subject)
    ledger.at_most("tracers", "error in a uniform flow [m]", found.uniform, found.uniform_allowed)


@check("tracers", Level.CAPABILITY)
def test_tracers(subject: Subject, ledger: Ledger) -> None:
    """Tracers go with the matter around them, straight and in a circle."""
    found = readout_cases.tracers_carried(subject)
    ledger.at_most("tracers", "error in a uniform flow [m]", found.uniform, found.uniform_allowed)
    ledger.at_most("tracers", "error in a turning block [m]", found.turning, found.turning_allowed)


@check("view:positions", Level.CAPABILITY)
def test_view_of_positions(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Positions seen on the device are those that are read."""
    _seen_as_read(subject, ledger, need, Field.POSITIONS)


@check("view:velocities", Level.CAPABILITY)
def test_view_of_velocities(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Velocities seen on the device are those that are read."""
    _seen_as_read(subject, ledger, need, Field.VELOCITIES)


@check("view:deformation_gradients", Level.CAPABILITY)
def test_view_of_deformation_gradients(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Deformation gradients seen on the device are those that are read."""
    _seen_as_read(subject, ledger, need, Field.DEFORMATION_GRADIENTS)


def _seen_as_read(subject: Subject, ledger: Ledger, need: Need, field: Field) -> None:
    need(field in subject.descriptor.capabilities.views, f"a view of {field.value}")
    found = readout_cases.viewed(subject, field)
    ledger.at_most("view", "rows or numbers too few or too many", found.misshapen, 0)
    # The same numbers in the session's precision, or rounded to it once more.
    ledger.at_most("view", f"distance of {field.value} from what is read, relative", found.apart, rounding(subject, 1))


def center_bound(subject: Subject) -> float:
    """Of linear momentum, in either precision: verification's figures."""
    return 1e-12 if subject.is_double else 1e-5


@check("conserved:mass", Level.CAPABILITY)
def test_mass(subject: Subject, ledger: Ledger, need: Need) -> None:
    """No point is lost, and each has its own mass: the centre of a body of unequal points goes straight."""
    need(Quantity.MASS in subject.descriptor.capabilities.conserved, "that it conserves mass")
    body = readout_cases.unequal_body_sways(subject)
    ledger.at_most("mass", "centre off a straight line / way", body.center_error, center_bound(subject))
    # That its parts did not just fly on.
    ledger.at_least("mass", "velocity its heavy half changes by, relative", body.exchanged, 0.1)


@check("conserved:linear_momentum", Level.CAPABILITY)
def test_linear_momentum(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Whatever the halves of a body do to each other, its centre goes straight."""
    need(Quantity.LINEAR_MOMENTUM in subject.descriptor.capabilities.conserved, "that it conserves linear momentum")
    body = readout_cases.block_sways(subject)
    ledger.at_most("linear momentum", "centre off a straight line / way", body.center_error, center_bound(subject))
    # That its halves did not just fly on.
    ledger.at_least("linear momentum", "velocity its one half changes by, relative", body.exchanged, 0.1)


@check("conserved:angular_momentum", Level.CAPABILITY)
def test_angular_momentum(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A plate that spins, stretches and shrinks keeps its spin, from its first substep on."""
    need(Quantity.ANGULAR_MOMENTUM in subject.descriptor.capabilities.conserved, "that it conserves angular momentum")
    plate = readout_cases.spinning_plate(subject)
    ledger.at_most("angular momentum", "relative change", plate.change, plate.hidden + rounding(subject, 200))


@check("checkpoints", Level.CAPABILITY)
def test_checkpoints(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A run taken up from a checkpoint that has been through a file is the run that went on."""
    need(subject.descriptor.capabilities.checkpoints, "checkpoints")
    scenes = {"checkpoints": swaying_block(subject)}
    if subject.descriptor.capabilities.drives:
        scenes["checkpoints, driven"] = readout_cases.driven_block(subject)
    for name, problem in scenes.items():
        found = readout_cases.resumed_run(subject, problem)
        assert found.begun_at == 0.07, f"{name}: taken up at {found.begun_at!r} s, written at 0.07 s"
        assert found.untouched.time == 0.07
        if subject.determinism is Determinism.BITWISE:
            differing = states_differ(found.whole, found.resumed)
            ledger.at_most(name, "arrays that are not equal bit for bit", len(differing), 0)
        else:
            reach = float(np.abs(found.whole.positions).max())
            apart = difference(found.whole, found.resumed)
            bound = place_rounding(subject, found.substeps, reach, reach)
            ledger.at_most(name, "distance [m]", apart, bound)


# --- devices and precisions -----------------------------------------------------------------------------------------


def falls(ledger: Ledger, subject: Subject, case: str) -> None:
    """Free fall, and drift to rounding."""
    fall = block_falls(subject, (3.1, -4.3, -8.2), [0.1, 0.2], 1e-3)
    ledger.at_most(case, "free fall error [m]", fall.error, 1.05 * fall.stepping + fall.rounding)
    drift = block_falls(subject, NO_GRAVITY, [0.25, 0.5], 5e-3)
    ledger.at_most(case, "drift error [m]", drift.error, drift.rounding)


def test_device(subject: Subject, ledger: Ledger, device: str) -> None:
    """On each device that is declared, and is there, matter falls freely."""
    try:
        falls(ledger, replace(subject, device=device), f"device {device}")
    except EngineEnvironmentError as error:
        if device == subject.device:
            raise
        pytest.skip(f"{ABSENT}: {error}")


@check("device-indices", Level.CAPABILITY)
def test_device_indices(subject: Subject, ledger: Ledger, need: Need) -> None:
    """The first device of the class that this run is on, named by its index, is the same device."""
    need(subject.descriptor.capabilities.device_indices, "devices by their index")
    falls(ledger, replace(subject, device=f"{device_class(subject.device)}:0"), "device by its index")


@check("precision:float32", Level.CAPABILITY)
def test_float32(subject: Subject, ledger: Ledger, need: Need) -> None:
    """In float32 matter falls and drifts as its digits allow."""
    _in_precision(subject, ledger, need, Precision.FLOAT32)


@check("precision:float64", Level.CAPABILITY)
def test_float64(subject: Subject, ledger: Ledger, need: Need) -> None:
    """In float64 matter drifts with all of its digits: float32 in disguise is a thousand million times as far off."""
    _in_precision(subject, ledger, need, Precision.FLOAT64)


def _in_precision(subject: Subject, ledger: Ledger, need: Need, precision: Precision) -> None:
    need(precision in subject.descriptor.capabilities.precisions, precision.value)
    falls(ledger, replace(subject, precision=precision), precision.value)


def test_declared_without_a_check(subject: Subject, unknown: str) -> None:
    """Whatever is declared and has no check in this suite: it cannot be believed."""
    assert not unknown, f"the suite has no check for {unknown} yet: do not declare it, or ask for a check"
