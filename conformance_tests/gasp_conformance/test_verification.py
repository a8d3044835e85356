"""The verification cases, judged. Each tolerance stands beside the reason for it.

Bounds come from the method's error in the cell, the substep and the precision, never from the engine. Where explicit
material point methods and finite elements are owed different tolerances the wider one, that of the former, is taken:
the suite cannot know which it looks at, and does not ask.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from gasp_conformance import cases, metamorphic, oracles, readout_cases
from gasp_conformance.bounds import unit_roundoff
from gasp_conformance.checks import Level, check
from gasp_conformance.damping_cases import bar_rings_on
from gasp_conformance.ledger import Ledger
from gasp_conformance.metamorphic import Change
from gasp_conformance.scenes import MATERIALS, SharedScene, shared_scene
from gasp_conformance.subject import Need, Subject
from gasp_core.contract import Determinism, Material, Pinned, Quantity

each_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=lambda material: material.kind)


def sizes(scene: str, *, finer: bool = False) -> Callable[[Any], Any]:
    """One check for each resolution of a scene file, or for each of its finer ones."""
    found = shared_scene(scene)
    return pytest.mark.parametrize("cells", found.finer_cells if finer else found.cells, ids=lambda n: f"{n} cells")


@check("V1", Level.VERIFICATION)
@each_material
def test_v1_free_fall(subject: Subject, ledger: Ledger, material: Material) -> None:
    fall = cases.block_falls(subject, material)
    # Symplectic Euler's own error is g t dt/2 exactly; 5 % for substeps that are not all the largest, and float32's
    # rounding of velocities over some hundred steps stays below 1e-5 of the block's metre.
    ledger.at_most(f"V1 {material.kind}", "largest error [m]", fall.error, 1.05 * fall.euler_error + 1e-5)


@check("V2", Level.VERIFICATION)
def test_v2_drift(subject: Subject, ledger: Ledger) -> None:
    drift = cases.block_drifts(subject)
    # Transfers keep affine fields up to rounding; a second is some hundred substeps of ~10 roundings of a coordinate of
    # a few metres (eps 2.2e-16 and 6e-8), uncorrelated between points.
    ledger.at_most("V2", "shape error / size", drift.shape_error, 1e-12 if subject.is_double else 1e-5)
    ledger.at_most("V2", "momentum error", drift.momentum_error, 1e-12 if subject.is_double else 1e-5)


@check("V4", Level.VERIFICATION)
@sizes("v4_fixed_free_bar")
def test_v4_fixed_free_bar(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_held_bar(subject, ledger, cells)


@check("V4", Level.VERIFICATION, full=True)
@sizes("v4_fixed_free_bar", finer=True)
def test_v4_fixed_free_bar_finely(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_held_bar(subject, ledger, cells)


def judge_held_bar(subject: Subject, ledger: Ledger, cells: int) -> None:
    bar = cases.held_bar_rings(subject, cells)
    # A bar that is held at its face is held somewhere within half a cell of it: it is that much longer or shorter. This
    # is 1 % at 49 cells. Frequency goes with 1/L, and what the speeds it starts with carry it to with L.
    half_cell = 0.5 / cells
    ledger.at_most(f"V4 {cells} cells", "frequency error", bar.frequency_error, half_cell)
    ledger.at_most(f"V4 {cells} cells", "peak of the mean error", bar.peak_error, half_cell)


@check("V5", Level.VERIFICATION)
@pytest.mark.parametrize("sides", ["free sides", "slip walls"])
def test_v5_column_under_sudden_weight(subject: Subject, ledger: Ledger, sides: str) -> None:
    judge_column(subject, ledger, sides, finer=False)


@check("V5", Level.VERIFICATION, full=True)
@pytest.mark.parametrize("sides", ["free sides", "slip walls"], ids=lambda sides: f"{sides}, finer")
def test_v5_column_under_sudden_weight_finely(subject: Subject, ledger: Ledger, sides: str) -> None:
    judge_column(subject, ledger, sides, finer=True)


def judge_column(subject: Subject, ledger: Ledger, sides: str, *, finer: bool) -> None:
    scene = shared_scene({"free sides": "v5_column", "slip walls": "v5_confined_column"}[sides])
    (cells,) = scene.finer_cells if finer else scene.cells
    column = cases.column_sinks(subject, scene, cells)
    # The floor is felt a quarter of a cell from where it is at most, and sinking goes with H^2: half a cell, 3 % of 16.
    # The period goes with H; it has the same, for the fit of a damped sine to a motion of parabolas.
    case, half_cell = f"V5 {sides} {cells} cells", 0.5 / cells
    sinking = half_cell * (felt_section(scene, cells) if sides == "slip walls" else 1)
    ledger.at_most(case, "peak of the head error", column.peak_error, sinking)
    ledger.at_most(case, "period error", column.period_error, half_cell)
    ledger.at_most(case, "mean of the head error", column.mean_error, sinking)
    # Before the head hears of the foot only the smearing of the wave front can show: half a cell of it, of 1 = 2 H c/H.
    ledger.at_most(case, "free fall of the head error", column.fall_error, half_cell)


@check("V6", Level.VERIFICATION)
@sizes("v6_cantilever")
def test_v6_cantilever(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_cantilever(subject, ledger, cells)


@check("V6", Level.VERIFICATION, full=True)
@sizes("v6_cantilever", finer=True)
def test_v6_cantilever_finely(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_cantilever(subject, ledger, cells)


def judge_cantilever(subject: Subject, ledger: Ledger, cells: int) -> None:
    beam = cases.cantilever_swings(subject, cells)
    # A grid holds the beam half a cell behind its face at most. The drop goes with L^4 and the frequency with 1/L^2, so
    # 2 dx/L and dx/L; 4 % for what is slender in the closed form and is eight to one here.
    case = f"V6 {cells} cells"
    ledger.at_most(case, "mean drop of the tip error", beam.drop_error, 2 / cells + 0.04)
    ledger.at_most(case, "frequency error", beam.frequency_error, 1 / cells + 0.04)


@check("V7", Level.VERIFICATION)
@pytest.mark.parametrize("scene", ["v7_hanging"], ids=["K=10"])
def test_v7_large_deflection(subject: Subject, ledger: Ledger, scene: str) -> None:
    judge_hanging(subject, ledger, scene, *shared_scene(scene).cells)


@check("V7", Level.VERIFICATION, full=True)
@pytest.mark.parametrize(
    "scene", ["v7_light", "v7_bent", "v7_hanging"], ids=["K=1, finer", "K=2, finer", "K=10, finer"]
)
def test_v7_large_deflection_finely(subject: Subject, ledger: Ledger, scene: str) -> None:
    judge_hanging(subject, ledger, scene, *shared_scene(scene).finer_cells)


@check("V7", Level.VERIFICATION)
@pytest.mark.parametrize("scene", ["v7_bent"], ids=["K=2, clamped between nodes"])
def test_v7_clamp_between_nodes(subject: Subject, ledger: Ledger, scene: str) -> None:
    """However a grid lies, a clamp is felt on its plane: what is held as well shortens what hangs."""
    cells = shared_scene("v7_hanging").cells[0]
    for held in (0.25, 0.5, 0.75):
        beam = cases.beam_hangs(subject, shared_scene(scene), cells, held)
        case = f"V7 bent {cells} cells, {held} of one held"
        ledger.at_most(case, "unrest / length", beam.unrest, 0.01)
        # The same half a cell, and no more for where the plane is.
        ledger.at_most(case, "drop of the tip error", beam.drop_error, 2 / cells + 0.04)


def judge_hanging(subject: Subject, ledger: Ledger, scene: str, cells: int) -> None:
    beam = cases.beam_hangs(subject, shared_scene(scene), cells)
    case = f"V7 {scene.removeprefix('v7_')} {cells} cells"
    # What would move by less than a hundredth of its length in as much time again is at rest.
    ledger.at_most(case, "unrest / length", beam.unrest, 0.01)
    # As V6: the beam is some part of half a cell too long, and the drop of one that hangs grows more slowly than L^4.
    # At six cells thick this is 8 %.
    ledger.at_most(case, "drop of the tip error", beam.drop_error, 2 / cells + 0.04)


@check("V8", Level.VERIFICATION)
@sizes("v8_spin")
def test_v8_rigid_spin(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_spin(subject, ledger, cells)


@check("V8", Level.VERIFICATION, full=True)
@sizes("v8_spin", finer=True)
def test_v8_rigid_spin_finely(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_spin(subject, ledger, cells)


def judge_spin(subject: Subject, ledger: Ledger, cells: int) -> None:
    kept = cases.block_spins(subject, cells)
    conserves = Quantity.ANGULAR_MOMENTUM in subject.descriptor.capabilities.conserved
    # What elastic breathing and the fit of a rigid rotation leave open.
    breathing = 0.005
    # Nothing turns it: no engine may make spin. One that does not declare to keep it may lose what affine fields that
    # start at rest take, and is not to be blamed where it loses less.
    least = 1.0 if conserves else oracles.spin_kept_by_affine_start_at_rest(1.0, 1.0 / cells)
    ledger.at_most(f"V8 {cells} cells", "spin kept", kept, 1 + breathing)
    ledger.at_least(f"V8 {cells} cells", "spin kept", kept, least - breathing)
    if conserves and cells >= 8:
        # An engine that starts with the gradient of the initial velocities loses nothing to its affine fields.
        ledger.at_least(f"V8 {cells} cells", "spin kept", kept, 0.9999)


@check("V10", Level.VERIFICATION)
@sizes("v10_collision")
def test_v10_bars_collide(subject: Subject, ledger: Ledger, need: Need, cells: int) -> None:
    judge_collision(subject, ledger, need, cells)


@check("V10", Level.VERIFICATION, full=True)
@sizes("v10_collision", finer=True)
def test_v10_bars_collide_finely(subject: Subject, ledger: Ledger, need: Need, cells: int) -> None:
    judge_collision(subject, ledger, need, cells)


def judge_collision(subject: Subject, ledger: Ledger, need: Need, cells: int) -> None:
    need(subject.descriptor.capabilities.bodies_meet, "that bodies meet")
    bars = cases.bars_collide(subject, cells)
    # Contact goes through shared nodes, where action is reaction: rounding alone, of one bar's momentum.
    ledger.at_most(f"V10 {cells} cells", "total momentum / one bar's", bars.momentum_error, 1e-6)
    assert bars.touched, f"V10 {cells} cells: the bars did not touch; if bodies do not meet, declare bodies_meet=False"
    # The gap at which bars feel each other is ~1.3 cells, and opens and closes with them: a cell or so in 2 L = 64.
    ledger.at_most(f"V10 {cells} cells", "contact time error", bars.time_error, 0.04)
    # The grid smears the wave front over some cells, and what is smeared comes back too late to push.
    ledger.at_most(f"V10 {cells} cells", "1 - restitution", 1 - bars.restitution, 7.5 / cells)


@check("V11", Level.VERIFICATION)
@sizes("v11_bounce")
def test_v11_drop_and_bounce(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_bounce(subject, ledger, cells)


@check("V11", Level.VERIFICATION, full=True)
@sizes("v11_bounce", finer=True)
def test_v11_drop_and_bounce_finely(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_bounce(subject, ledger, cells)


def judge_bounce(subject: Subject, ledger: Ledger, cells: int) -> None:
    ball = cases.ball_bounces(subject, cells)
    case = f"V11 {cells} cells"
    # The fall and two bounces last 0.45 s + 2 * 0.8 s if nothing is lost; a ball that does not bounce has one flight.
    ledger.at_least(case, "flights", ball.flight_count, 2)
    # Equal steps leave a parabola a parabola. Where a step changes within a flight its end is off by g t dt/2, which a
    # fit takes for a share dt/t of gravity: one substep in the two hundred of a flight.
    ledger.at_most(case, "gravity of a flight error", ball.gravity_error, 0.005)
    # Energy of the centre comes from that of the centre, or from what the last contact left ringing: a hundredth is for
    # the floor, which pushes from as far away as the grid feels it.
    ledger.at_most(case, "peak / peak before", ball.peak_ratio, 1.01)
    ledger.at_most(case, "energy of the centre / start", ball.energy_ratio, 1.01)


@check("V12", Level.VERIFICATION)
def test_v12_incline(subject: Subject, ledger: Ledger) -> None:
    slide = cases.block_slides(subject)
    # Coulomb's law is applied node by node to impulses that add up to the weight: what is left are sways of the block.
    ledger.at_most("V12", "way error", slide.distance_error, 0.01)
    ledger.at_most("V12", "creep where it should stick [m/s]", slide.creep, 1e-3)


@check("V13", Level.VERIFICATION)
@sizes("v13_tank")
def test_v13_hydrostatic_tank(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_tank(subject, ledger, cells)


@check("V13", Level.VERIFICATION, full=True)
@sizes("v13_tank", finer=True)
def test_v13_hydrostatic_tank_finely(subject: Subject, ledger: Ledger, cells: int) -> None:
    judge_tank(subject, ledger, cells)


def judge_tank(subject: Subject, ledger: Ledger, cells: int) -> None:
    tank = cases.tank_settles(subject, cells)
    case = f"V13 {cells} cells"
    # The surface is drawn by points, each of which stands for half a cell around it.
    ledger.at_most(case, "surface error [cells]", tank.surface_error, 0.5)
    # As V5: the floor is felt a quarter of a cell off. Sinking everywhere is off by what that layer sinks, dx/4 rho g
    # H / K, and its mean over the column is rho g H^2 / 3K: three quarters of a cell in H.
    section = felt_section(shared_scene("v13_tank"), cells)
    ledger.at_most(case, "mean sinking error", tank.sinking_error, 0.75 / cells * section)
    # In still air what fell dies away with exp(-k t / 2), k t = 31. Points that find their places go on for longer, at
    # a speed in proportion to that of falling from the water's height: a fiftieth of it is water at rest.
    ledger.at_most(case, "root mean square speed / sqrt(g H)", tank.speed, 0.02)
    # Compression is in the closed form and walls hold the sides: what is left is the sinking of a quarter of a cell,
    # and where within its cells the water's outermost points have come to rest.
    ledger.at_most(case, "volume error", tank.volume_error, 0.02)


def felt_section(scene: SharedScene, cells: int) -> float:
    """Section of a column between walls as a grid may feel it, over what it is.

    Each wall too is felt a quarter of a cell from where it is at most: the layer at the floor carries, per area, what a
    column wider by half a cell would weigh.
    """
    return math.prod(1 + 0.5 / (cells * side) for side in scene.bodies[0].proportions[:2])


def rounding_of(subject: Subject, substeps: int) -> float:
    """Distance over size that rounding, and iterations that end, leave between two runs that are one on paper."""
    # Each substep rounds a coordinate of the order of the body's size some five times (weights, there and back, place),
    # and all of it adds up straight: that covers the tens of times by which a contact magnifies a disturbance. It is
    # 1e-4 after 300 substeps in float32.
    # Where a step is iterated, rounding decides which iteration is the last one. That leaves the tolerance asked for of
    # what the step changes, which is less than the body's size.
    iterated = metamorphic.SOLVER_TOLERANCE if subject.descriptor.capabilities.iterates else 0.0
    return substeps * (5 * unit_roundoff(subject) + iterated)


def judge_departure(subject: Subject, ledger: Ledger, case: str, change: Change, found: metamorphic.Departure) -> None:
    exact = change.name == "second run" and subject.determinism is Determinism.BITWISE
    bound = 0.0 if exact else rounding_of(subject, found.substep_count)
    ledger.at_most(f"V16 {case}", f"{change.name}: distance / size", found.distance, bound)


@check("V16", Level.VERIFICATION)
@pytest.mark.parametrize("change", metamorphic.SMOOTH, ids=lambda change: change.name)
def test_v16_smooth_motion_is_what_it_is(subject: Subject, ledger: Ledger, change: Change) -> None:
    (cells,) = shared_scene("v16_smooth").cells
    judge_departure(subject, ledger, "smooth", change, metamorphic.departure_smooth(subject, change, cells))


@check("V16", Level.VERIFICATION, full=True)
@pytest.mark.parametrize("change", metamorphic.SMOOTH, ids=lambda change: f"{change.name}, finer")
def test_v16_smooth_motion_is_what_it_is_finely(subject: Subject, ledger: Ledger, change: Change) -> None:
    (cells,) = shared_scene("v16_smooth").finer_cells
    judge_departure(subject, ledger, "smooth, finer", change, metamorphic.departure_smooth(subject, change, cells))


@check("V16", Level.VERIFICATION)
@pytest.mark.parametrize("change", metamorphic.AFTER_CONTACT, ids=lambda change: f"{change.name}, on a floor")
def test_v16_contact_is_what_it_is(subject: Subject, ledger: Ledger, change: Change) -> None:
    found = metamorphic.departure_after_contact(subject, change, cells=3)
    judge_departure(subject, ledger, "on a floor", change, found)


@check("V16", Level.VERIFICATION)
@pytest.mark.parametrize("change", [metamorphic.FAR_BODY], ids=lambda change: f"{change.name}, held")
def test_v16_what_is_held_is_what_it_is(subject: Subject, ledger: Ledger, need: Need, change: Change) -> None:
    need(Pinned in subject.descriptor.capabilities.drives, "regions that are pinned")
    (cells,) = shared_scene("v16_smooth").cells
    judge_departure(subject, ledger, "held", change, metamorphic.departure_held(subject, change, cells))


@check("V16", Level.VERIFICATION)
@pytest.mark.parametrize("change", metamorphic.ACROSS_THE_GRID, ids=lambda change: change.name)
def test_v16_grid_does_not_show(subject: Subject, ledger: Ledger, change: Change) -> None:
    judge_across(subject, ledger, change, *shared_scene("v16_modes").cells)


@check("V16", Level.VERIFICATION, full=True)
@pytest.mark.parametrize("change", metamorphic.ACROSS_THE_GRID, ids=lambda change: f"{change.name}, finer")
def test_v16_grid_does_not_show_finely(subject: Subject, ledger: Ledger, change: Change) -> None:
    judge_across(subject, ledger, change, *shared_scene("v16_modes").finer_cells)


def judge_across(subject: Subject, ledger: Ledger, change: Change, cells: int) -> None:
    numbers = shared_scene("v16_modes").numbers
    found = metamorphic.departure_of_modes(subject, change, cells)
    # Either run has the error of V3 in the frequency of its modes, 1.5 (dx/L)^2, and so that share of the angle they
    # have run through in their displacement: twice that, of three axes at once. Free faces that lie obliquely in the
    # grid are off in the first order as well, by little: this is a bound at these resolutions, and no order.
    angle = 2 * math.pi * numbers["periods"]
    bound = 2 * math.sqrt(3) * numbers["amplitude"] * angle * 1.5 / cells**2
    ledger.at_most(f"V16 {cells} cells", f"{change.name}: distance / size", found.distance, bound)


@check("ringing", Level.VERIFICATION)
def test_what_nothing_damps_rings_on(subject: Subject, ledger: Ledger) -> None:
    """A free bar in small steps loses no more of its swing than these and the grid take, and than is declared."""
    ringing, declared = bar_rings_on(subject), subject.descriptor.capabilities.damping
    # Of a rate that is declared as of velocities, half may show in a swing, or all of it.
    undeclared = ringing.decay - min(max(ringing.decay, 0.0), declared)
    ledger.at_most(
        "bar in small steps",
        "rate of decay - declared [1/s]",
        undeclared,
        ringing.stepping + ringing.transfers + ringing.dispersion,
    )


@check("bodies-meet", Level.VERIFICATION)
def test_bodies_that_meet(subject: Subject, ledger: Ledger, need: Need) -> None:
    """A light body that runs into a heavy one is stopped by it, does not go through it, and takes nothing from both."""
    need(bool(subject.descriptor.capabilities.body_contacts), "that bodies meet")
    bodies = readout_cases.bodies_collide(subject)
    # One that does not bounce at all from three times its mass loses all of its own: none would be no collision.
    ledger.at_least("bodies meet", "velocity exchanged, relative", bodies.exchanged, 0.3)
    ledger.at_least("bodies meet", "nearest / width", bodies.nearest / readout_cases.COLLIDING_WIDTH, 0.5)
    if Quantity.LINEAR_MOMENTUM in subject.descriptor.capabilities.conserved:
        bound = 1e-12 if subject.is_double else 1e-5
        ledger.at_most("bodies meet", "centre off a straight line / way", bodies.center_error, bound)


@check("momentum", Level.VERIFICATION)
def test_momentum_of_a_tumbling_block(subject: Subject, ledger: Ledger) -> None:
    judge_momentum(subject, ledger, 1_000)


@check("momentum", Level.VERIFICATION, full=True)
@pytest.mark.parametrize("substeps", [10_000], ids=lambda count: f"{count} substeps")
def test_momentum_of_a_tumbling_block_for_long(subject: Subject, ledger: Ledger, substeps: int) -> None:
    judge_momentum(subject, ledger, substeps)


def judge_momentum(subject: Subject, ledger: Ledger, substeps: int) -> None:
    tumble = cases.block_tumbles(subject, substeps)
    # Internal forces add up to nothing on the grid. What points round when they take their velocities is not biased:
    # over 1e4 substeps a random walk of 100 steps, divided by the many points it is a mean of.
    case = f"momentum {substeps} substeps"
    ledger.at_least(case, "substeps", tumble.substep_count, substeps)
    ledger.at_most(case, "change / sum of m |v|", tumble.momentum_error, 1e-12 if subject.is_double else 1e-5)


@check("kinetic-energy", Level.VERIFICATION)
@each_material
def test_kinetic_energy_comes_from_somewhere(subject: Subject, ledger: Ledger, material: Material) -> None:
    ratio = cases.energy_after_throw(subject, material, cells=3)
    # Nothing drives the block: it has what it was thrown with and what gravity gave. 2 % for energies that symplectic
    # Euler conserves up to a wobble of the order of the step.
    ledger.at_most(f"kinetic energy {material.kind}", "largest / (start + released)", ratio, 1.02)
