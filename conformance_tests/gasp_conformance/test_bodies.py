"""What bodies do to each other, and what those do that are rigid: each engine shows what it declares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gasp_conformance import body_cases, rigid_cases, rigid_part_cases
from gasp_conformance.bounds import rounding
from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.subject import Need, Subject
from gasp_conformance.wall_cases import stiff_material
from gasp_core.contract import BodyContact, ContactCondition, Field, Fluid, Material, Quantity, Rigid, Sand


def rides(ledger: Ledger, case: str, ride: body_cases.Ride) -> None:
    """That a block is slowed by friction and rests where that stops it.

    Where bodies touch is known to a share of a cell, so friction acts over as many cells as a block is long but for
    that share: an error of the first order, 0.8 cells of its length. The way to rest has half of what the deceleration
    has, since what is late is made up for.
    """
    bound = 0.8 / body_cases.CELLS + ride.late
    ledger.at_most(case, "deceleration / mu g - 1", ride.deceleration - 1, bound)
    ledger.at_most(case, "way to rest / closed form - 1", ride.way - 1, bound / 2)


def rests(ledger: Ledger, case: str, stack: body_cases.Stack) -> None:
    """A stack stands; what its lowest points sink is below what a grid sees."""
    ledger.at_most(case, "creep / size", stack.creep, 1e-3)
    ledger.at_most(case, "sinking [cells]", stack.sinking, 1 / 3)
    ledger.at_most(case, "height [cells]", stack.height, 1 / 3)
    # Nothing damps it but contact, so it need not fall; it swings with some periods in either half.
    ledger.at_most(case, "kinetic energy, later / earlier", stack.heating, 1.1)


def collides(ledger: Ledger, subject: Subject, case: str, collision: body_cases.Collision) -> None:
    """What one block gives the other gets, and energy does not rise."""
    assert collision.exchanged > 0.3, "they did not meet"
    if Quantity.LINEAR_MOMENTUM in subject.descriptor.capabilities.conserved:
        ledger.at_most(case, "change of momentum", collision.momentum, rounding(subject, collision.substep_count))
    ledger.at_most(case, "kinetic energy / start - 1", max(collision.energy - 1, 0.0), 1e-3)


@pytest.mark.parametrize("friction", [0.3, 0.5])
@check("bodies:separate[slide]", Level.CAPABILITY)
def test_bodies_slide(subject: Subject, ledger: Ledger, need: Need, friction: float) -> None:
    """Coulomb's law between two bodies: mu g, in either direction, and rest."""
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.body_contacts, "that bodies separate")
    for way, ride in zip(("left", "right"), body_cases.blocks_slide(subject, friction, {})):
        rides(ledger, f"friction {friction} to the {way}", ride)


@check("bodies:separate[part]", Level.CAPABILITY)
def test_bodies_part(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A block that leaves another one, or passes it half a cell above, does not feel it."""
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.body_contacts, "that bodies separate")
    leaving = body_cases.blocks_pass(subject, 0.0, (0.0, 0.0, 0.5))
    ledger.at_most("leaving", "way / free - 1", leaving.way - 1, 0.02)
    ledger.at_most("leaving", "way of the other / free", leaving.other, 0.02)
    # No force at a distance at all.
    for gap in (0.5, 1.0, 2.0):
        passing = body_cases.blocks_pass(subject, gap, (1.0, 0.0, 0.0))
        ledger.at_most(f"{gap:g} cells above", "way / free - 1", passing.way - 1, 1e-3)
        ledger.at_most(f"{gap:g} cells above", "way of the other / free", passing.other, 1e-3)


@check("bodies:separate[stack]", Level.CAPABILITY)
def test_bodies_rest_on_each_other(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Three blocks on each other stay where they are."""
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.body_contacts, "that bodies separate")
    rests(ledger, "stack", body_cases.blocks_stack(subject, 0.4))


@check("bodies:separate[collide]", Level.CAPABILITY)
def test_bodies_collide(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Two blocks collide askew, with friction and spin: what one gives the other gets, and energy does not rise."""
    can = subject.descriptor.capabilities
    need(ContactCondition.SEPARATE in can.body_contacts, "that bodies separate")
    need(Field.VELOCITIES in can.output_fields, "that it reports velocities")
    collides(ledger, subject, "collision", body_cases.blocks_collide(subject))


@check("bodies:slip", Level.CAPABILITY)
def test_bodies_slip(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A block that is pulled along another one is not held, and one that is pulled off it is."""
    need(ContactCondition.SLIP in subject.descriptor.capabilities.body_contacts, "that bodies slip")
    along = body_cases.blocks_ride(subject, ContactCondition.SLIP, (1.0, 0.0, 0.0))
    # In 0.1 s at 1 m/s it goes two cells; the two lie flat on each other, and may open by half a cell at most.
    ledger.at_most("slip along", "way [cells] - free", along[0] - 2, 0.1)
    ledger.at_most("slip along", "apart [cells]", along[2], 0.5)
    off = body_cases.blocks_ride(subject, ContactCondition.SLIP, (0.0, 0.0, 1.0))
    ledger.at_most("slip, pulled off", "apart [cells]", off[2], 0.5)


@check("bodies:stick", Level.CAPABILITY)
def test_bodies_stick(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A block is held by another one, whichever way it is pulled."""
    need(ContactCondition.STICK in subject.descriptor.capabilities.body_contacts, "that bodies stick")
    for way in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        apart = body_cases.blocks_ride(subject, ContactCondition.STICK, way)
        ledger.at_most(f"stick, pulled along {way}", "apart [cells]", float(np.linalg.norm(apart)), 0.5)


@check("pair-contacts", Level.CAPABILITY)
def test_pairs_have_their_own(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Of two blocks on two slabs one slides as all bodies do, the other as its pair does."""
    need(subject.descriptor.capabilities.pair_contacts, "that a pair has a contact of its own")
    smooth, usual = body_cases.blocks_slide(subject, 0.4, {(0, 1): BodyContact()})
    rides(ledger, "friction of all", usual)
    ledger.at_most("no friction of its own", "deceleration / mu g", smooth.deceleration, 0.8 / body_cases.CELLS)


# --- rigid bodies ---------------------------------------------------------------------------------------------------


def need_rigid(subject: Subject, need: Need) -> None:
    """Skip where nothing is rigid."""
    need(Rigid in subject.descriptor.capabilities.materials, "that it models rigid")


@pytest.mark.parametrize("shape", ["ball", "cylinder"])
@check("material:rigid[roll]", Level.CAPABILITY)
def test_rigid_bodies_roll(subject: Subject, ledger: Ledger, need: Need, shape: str) -> None:
    """A ball and a cylinder roll down a slope, and slip where it is too steep for their friction."""
    need_rigid(subject, need)
    # What rolls as a polyhedron loses .36 of the angle between its faces for every radian; a step more or less of the
    # time is a step's share of the way, twice.
    for case, slope, friction in (("gentle", 0.1, 0.5), ("steep", 0.3, 0.5), ("slips", 0.6, 0.1)):
        roll = rigid_cases.body_rolls(subject, shape, slope, friction)
        ledger.at_most(f"{shape}, {case}", "way / closed form - 1", roll.way - 1, 0.03 + 2 * roll.stepping)


@check("material:rigid[slide]", Level.CAPABILITY)
def test_rigid_bodies_slide(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A rigid block on a rigid slab, where there is other matter on soft and on heavy, and a soft one on a rigid."""
    need_rigid(subject, need)
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.body_contacts, "that bodies separate")
    rigid, soft = Rigid(density=1000.0), stiff_material(subject)
    cases: dict[str, list[Material]] = {"rigid on rigid": [rigid] * 4}
    if not isinstance(soft, Rigid):
        cases["rigid on soft, soft on rigid"] = [soft, rigid, rigid, soft]
        # Sound is as fast in it, and so are steps; what it gives way by is a thirtieth.
        heavy = replace(stiff_material(subject, 30.0 * 100.0), density=30.0 * soft.density)
        cases["rigid on what is 30 times as heavy"] = [heavy, rigid] * 2
    for name, materials in cases.items():
        for way, ride in zip(("left", "right"), body_cases.blocks_slide(subject, 0.4, {}, materials)):
            rides(ledger, f"{name}, to the {way}", ride)


@check("material:rigid[stack]", Level.CAPABILITY)
def test_rigid_bodies_rest(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Three rigid blocks on each other stay where they are, and so does a rigid one between soft ones."""
    need_rigid(subject, need)
    need(ContactCondition.SEPARATE in subject.descriptor.capabilities.body_contacts, "that bodies separate")
    rigid, soft = Rigid(density=1000.0), stiff_material(subject)
    rests(ledger, "rigid", body_cases.blocks_stack(subject, 0.4, [rigid] * 3))
    if not isinstance(soft, Rigid):
        rests(ledger, "soft, rigid, soft", body_cases.blocks_stack(subject, 0.4, [soft, rigid, soft]))


@check("material:rigid[collide]", Level.CAPABILITY)
def test_rigid_bodies_collide(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A rigid block hits a rigid one, and a soft one: what one gives the other gets, and energy does not rise."""
    need_rigid(subject, need)
    can = subject.descriptor.capabilities
    need(ContactCondition.SEPARATE in can.body_contacts, "that bodies separate")
    need(Field.VELOCITIES in can.output_fields, "that it reports velocities")
    rigid, soft = Rigid(density=1000.0), stiff_material(subject)
    for name, materials in {"rigid": [rigid, rigid], "soft": [soft, rigid]}.items():
        if name == "rigid" or not isinstance(soft, Rigid):
            collides(ledger, subject, f"rigid block and {name} block", body_cases.blocks_collide(subject, materials))


@check("material:rigid[spin]", Level.CAPABILITY)
def test_rigid_bodies_spin_on(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A hundred turns in twenty thousand steps leave a tumbling block as rigid as it was, and as fast."""
    need_rigid(subject, need)
    need(Field.VELOCITIES in subject.descriptor.capabilities.output_fields, "that it reports velocities")
    change, energy, steps = rigid_cases.block_spins_on(subject, 100.0, 20_000)
    # Single precision, which rounds what a step adds, not what a turn has been.
    ledger.at_most(f"{steps} steps", "change of distances / size", change, max(1e-6, rounding(subject, 10)))
    ledger.at_most(f"{steps} steps", "kinetic energy / start - 1", energy, 5e-3)


@check("material:rigid[water]", Level.CAPABILITY)
def test_rigid_bodies_float(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A cube of half the weight of water is half in it."""
    need_rigid(subject, need)
    need(Fluid in subject.descriptor.capabilities.materials, "that it models fluid")
    water = Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1.0)
    lying = rigid_cases.block_lies_in(subject, water, 500.0, 0.8)
    # Where water ends is known to half a cell, and to half of what a point stands for.
    ledger.at_most("water", "deeper than Archimedes has it [cells]", lying.sinking, 0.75)
    ledger.at_most("water", "deepest in the cube [cells]", max(lying.within, 0.0), 1.0)


@check("material:rigid[sand]", Level.CAPABILITY)
def test_rigid_bodies_lie_on_sand(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Sand bears at least what a liquid of its weight does, and stays out of what lies in it."""
    need_rigid(subject, need)
    need(Sand in subject.descriptor.capabilities.materials, "that it models sand")
    sand = Sand(density=1600.0, youngs_modulus=3e5, poissons_ratio=0.2)
    lying = rigid_cases.block_lies_in(subject, sand, 800.0, 0.6)
    # Where sand ends is known to half a cell; a liquid would have it no deeper.
    ledger.at_most("sand", "deeper than in a liquid [cells]", max(lying.sinking, 0.0), 0.5)
    ledger.at_most("sand", "deepest in the cube [cells]", max(lying.within, 0.0), 1.0)


@check("restitution", Level.CAPABILITY)
def test_rigid_bodies_bounce(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A ball comes up with the share of its speed that it says, and of three in a row the last one takes it all."""
    need(subject.descriptor.capabilities.restitution, "restitution of rigid bodies")
    need(Field.VELOCITIES in subject.descriptor.capabilities.output_fields, "that it reports velocities")
    for restitution in (0.0, 0.5, 1.0):
        bounce = rigid_cases.body_bounces(subject, restitution)
        # A step more or less of gravity before and after; the contact a step early, too.
        bound = 0.01 + 4 * bounce.stepping
        ledger.at_most(f"restitution {restitution:g}", "speeds' ratio - e", bounce.ratio - restitution, bound)
    cradle = rigid_cases.balls_hand_on(subject)
    for ball, (speed, closed) in enumerate(zip(cradle.speeds, (0.0, 0.0, 1.0)), start=1):
        ledger.at_most("cradle", f"speed of ball {ball} - closed form", float(speed) - closed, 1e-3)
    ledger.at_most("cradle", "kinetic energy / start - 1", cradle.energy - 1, 1e-3)
    ledger.at_most("cradle", "change of momentum", cradle.momentum, rounding(subject, cradle.substep_count))


@check("rigid-parts[hang]", Level.CAPABILITY)
def test_a_rigid_part_hangs(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A rigid weight at the end of an elastic rod stretches it as its weight does, and swings as its mass does."""
    need(subject.descriptor.capabilities.rigid_parts, "rigid parts of bodies that deform")
    hanging = rigid_part_cases.weight_hangs(subject)
    # What holds the rod is felt to a quarter of a cell, and where it is welded is known to half of one. A frequency
    # goes with the root of the length.
    bound = 0.75 / rigid_part_cases.ROD_CELLS
    ledger.at_most("weight on a rod", "stretch / closed form - 1", hanging.stretch, bound)
    ledger.at_most("weight on a rod", "frequency / closed form - 1", hanging.frequency, bound / 2)


@check("rigid-parts[fly]", Level.CAPABILITY)
def test_a_rigid_part_flies(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A block with a soft handle spins as one: nothing parts them, and what one gets the other gives."""
    need(subject.descriptor.capabilities.rigid_parts, "rigid parts of bodies that deform")
    need(Field.VELOCITIES in subject.descriptor.capabilities.output_fields, "that it reports velocities")
    flight = rigid_part_cases.hammer_flies(subject)
    # What strays goes on straying: a hundredth of a cell in each of two turns would be half of one after fifty.
    ledger.at_most("hammer", "farther apart [cells]", flight.apart, 0.02)
    ledger.at_most("hammer", "change of momentum", flight.momentum, rounding(subject, flight.substep_count))
    # Points do not show what of it is in the affine velocities of the handle, some hundredths of its share.
    ledger.at_most("hammer", "change of angular momentum", flight.spin, 0.02)
    ledger.at_most("hammer", "kinetic energy / start - 1", max(flight.energy - 1, 0.0), 1e-2)
