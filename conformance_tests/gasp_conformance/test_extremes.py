"""Inputs far from what is usual, judged: right, or refused or ended with a reason; never a NaN, a hang, a crash.

Where a closed form or another run says what is right, it has to be so; bounds stand beside their reasons. Where none
does, reports and states must not contradict each other (`gasp_conformance.watched_runs`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

import numpy as np
import pytest

from gasp_conformance import extreme_cases as cases
from gasp_conformance import impact_cases, slow_cases, splat_cases
from gasp_conformance.bounds import rounding, unit_roundoff
from gasp_conformance.checks import Level, check
from gasp_conformance.ledger import Ledger
from gasp_conformance.random_batch import run_batch
from gasp_conformance.subject import Need, Subject, Undeclared
from gasp_conformance.watched_runs import WatchedRun
from gasp_core.contract import DomainPolicy, Elastic, EngineAccuracy, Metal, NeoHookean, PointCloud, Status
from gasp_core.errors import SceneError

QUICK_SCENES = 40
ALL_SCENES = 200


def _sound(what: str, run: WatchedRun) -> None:
    """Refuse a run that contradicts itself."""
    assert not run.faults, f"{what}: {'; '.join(run.faults)}"


def _done(what: str, run: WatchedRun) -> None:
    """Refuse a run that did not come to its end as well."""
    _sound(what, run)
    told = run.refusal or "; ".join(warning for report in run.reports[-1:] for warning in report.warnings)
    assert run.finished, f"{what}: ended with {run.ending}: {told}"


def _preserved(subject: Subject) -> float:
    """How far a shape that nothing deforms may be off, over the largest coordinate (verification.md, V2)."""
    return 1e-12 if subject.is_double else 1e-5


@check("stiffness", Level.EXTREMES)
def test_stiffness(subject: Subject, ledger: Ledger) -> None:
    """Matter of any stiffness bears its weight as it should, or says what it would cost."""
    for modulus in (2e5, 1e6, 1e7, 1e8, 1e9):
        column = cases.column_under_weight(subject, modulus)
        case = f"stiffness {modulus:g} Pa"
        # Smoothing over a cell is half a cell of the 8 of its height; the strain, 5 % at most, adds to that.
        ledger.at_most(case, "peak of the head error", column.peak_error, 0.10)
        ledger.at_most(case, "mean of the head error", column.mean_error, 0.10)
    for modulus in (1e2, 1e3, 1e4):
        _sound(f"a column of {modulus:g} Pa", cases.column_collapses(subject, modulus))
    limit = 10
    costly = cases.frame_beyond_budget(subject, 1e9, limit)
    _sound("a frame beyond the budget", costly)
    if not costly.finished:
        assert costly.status is Status.SUBSTEP_LIMIT, f"a frame beyond the budget ended with {costly.ending}"
        told = " ".join(costly.reports[-1].warnings)
        needed = max((float(number.replace(",", "")) for number in re.findall(r"\d[\d,]*", told)), default=0.0)
        # Whatever the engine's own step, it is more than what was allowed, or it would have been enough.
        assert needed > limit, f"how many substeps it would take is not said: {told!r}"


def _beam(subject: Subject, ledger: Ledger, poissons_ratio: float) -> None:
    cells = 3
    usual, usual_frequency = cases.beam_swings(subject, 0.3, cells)
    drop, frequency = cases.beam_swings(subject, poissons_ratio, cells)
    # In slender bending Poisson's ratio has no part but at the clamp, where it is hindered over a thickness of the
    # four; what a grid adds is locking.
    case = f"Poisson's ratio {poissons_ratio:g}"
    ledger.at_most(case, "mean drop, over that at 0.3, - 1", drop / usual - 1, 0.15)
    ledger.at_most(case, "frequency, over that at 0.3, - 1", frequency / usual_frequency - 1, 0.15)


@check("near-incompressible", Level.EXTREMES)
def test_near_incompressible(subject: Subject, ledger: Ledger) -> None:
    """A beam with Poisson's ratio 0.49 bends as one with 0.3 does."""
    _beam(subject, ledger, 0.49)


@check("near-incompressible[0.499]", Level.EXTREMES, full=True)
def test_very_near_incompressible(subject: Subject, ledger: Ledger) -> None:
    """A beam with Poisson's ratio 0.499 bends as one with 0.3 does."""
    _beam(subject, ledger, 0.499)


@check("density-ratio", Level.EXTREMES)
def test_density_ratio(subject: Subject, ledger: Ledger, need: Need) -> None:
    """Matter ten thousand times as dense as what it meets."""
    need(subject.descriptor.capabilities.bodies_meet, "that bodies meet")
    meeting = cases.heavy_meets_light(subject, 1e4)
    # Contact goes through what both share, where action is reaction: rounding alone. Each substep stores each velocity,
    # to half a unit in its last place, and in thousands of substeps that adds up; the few of an implicit engine leave
    # more as they are solved.
    least = 1e-12 if subject.is_double else 1e-5
    bound = max(least, meeting.substeps * unit_roundoff(subject))
    ledger.at_most("density-ratio", "momentum error", meeting.momentum_error, bound)
    # (1 + e) M / (M + m) with a restitution e from 0 to 1, and 2 % for the swaying of both.
    ledger.at_least("density-ratio", "speed of the light one / the heavy one's", meeting.light_speed, 0.98)
    ledger.at_most("density-ratio", "speed of the light one / the heavy one's", meeting.light_speed, 2.02)
    _sound("a heavy cube on a light one", cases.heavy_on_light(subject, 1e4))


@check("speed", Level.EXTREMES)
def test_speed(subject: Subject, ledger: Ledger) -> None:
    """Ten times its own speed of sound does not carry matter out of a cage; it may be crushed there, and say so."""
    missing: list[str] = []
    for name, cage in cases.cages().items():
        try:
            run, beyond = cases.block_storms_about(subject, 10.0, cage)
        except Undeclared as error:
            missing.append(str(error))
            continue
        _sound(f"a block in {name}", run)
        if run.status is not Status.CRUSHED:
            _done(f"a block in {name}", run)
        # Walls act at nodes: matter is held where the nodes within its reach, a cell and a half of a quadratic spline,
        # are all beyond the wall; less than a cell beyond it. A domain's edge is where points themselves are held.
        room = 0.5 if name == "walls" else rounding(subject, 1) * cases.CAGE_HIGH
        ledger.at_most(f"speed, {name}", "points beyond [m]", max(0.0, float(beyond.max())), room)
    if len(missing) == len(cases.cages()):
        raise Undeclared("; ".join(missing))


@check("impact", Level.EXTREMES)
@pytest.mark.parametrize("kind", [Elastic, NeoHookean, Metal], ids=lambda kind: kind.kind)
def test_impact(subject: Subject, ledger: Ledger, kind: type[Elastic] | type[NeoHookean] | type[Metal]) -> None:
    """What meets a floor at 1, 3 and 10 times the speed of sound comes back, or ends the run: never well, and flat."""
    plain = {"density": 1000.0, "youngs_modulus": 1e5, "poissons_ratio": 0.3}
    material = Metal(**plain, yield_stress=2e3, hardening=1e4) if kind is Metal else kind(**plain)
    for mach in (1.0, 3.0, 10.0):
        impact, case = impact_cases.block_meets_floor(subject, material, mach), f"{kind.kind} at {mach:g} c"
        _sound(case, impact.run)
        ledger.at_most(case, "kinetic energy / that of throw and fall", impact.energy, 1 + rounding(subject, 100))
        if impact.run.finished:
            # A twentieth of its side is a fifth of a cell: it is there, and seen.
            ledger.at_least(case, "thickness / side", impact.thickness, 0.05)
            ledger.at_most(case, "share of points crushed", impact.crushed, 0.1)


@check("slow-load", Level.EXTREMES)
def test_slow_load(subject: Subject, ledger: Ledger) -> None:
    """A bar that is drawn out next to nothing in every step is strained all the same, and swings back when let go."""
    drawn = slow_cases.bar_is_drawn_slowly(subject)
    # Where it is held is known to half a cell, and it is strained unevenly around there.
    if not np.isnan(drawn.by_gradients):
        ledger.at_most("slow load", "strain by F / by places - 1", drawn.by_gradients - 1, 0.5 / slow_cases.CELLS)
    ledger.at_least("slow load", "swing to the other side / way drawn", drawn.swing, 1 - 0.5 / slow_cases.CELLS)


@check("scale", Level.EXTREMES)
def test_scale(subject: Subject, ledger: Ledger) -> None:
    """A millimetre and a kilometre move alike, at the same Froude and Cauchy numbers."""
    usual = cases.tossed_block(subject)
    for scale in (1e-3, 1e3):
        apart = float(np.linalg.norm(cases.tossed_block(subject, scale) - usual, axis=1).max())
        # Rounding of all lengths, which smooth motion does not magnify.
        ledger.at_most(f"scale {scale:g}", "distance / size", apart, 1e-9 if subject.is_double else 1e-4)


@check("offset", Level.EXTREMES)
def test_offset(subject: Subject, ledger: Ledger) -> None:
    """Ten kilometres from the origin matter moves as it does at it."""
    here = cases.tossed_block(subject)
    there = cases.tossed_block(subject, offset=(1e4, -1e4, 9876.54321))
    apart = float(np.linalg.norm(there - here, axis=1).max())
    # The places themselves are given to 2e-12 m. A state in float32 without an origin of its own would stand on a
    # lattice of 1e-3 m.
    ledger.at_most("offset", "distance / size", apart, 1e-9 if subject.is_double else 1e-5)


def _falls(subject: Subject, ledger: Ledger, case: str, fall: cases.Fall) -> None:
    _done(case, fall.run)
    # Symplectic Euler's own error, V1; 5 % for substeps that are not all the largest.
    ledger.at_most(case, "distance from free fall [m]", fall.error, 1.05 * fall.euler_error + 1e-5 * fall.reach)
    ledger.at_most(case, "distortion [m]", fall.distortion, _preserved(subject) * fall.reach)


@check("few-points", Level.EXTREMES)
def test_few_points(subject: Subject, ledger: Ledger) -> None:
    """One, two, three points fall as points do; one without a volume is nobody's."""
    for name, positions in cases.few_points():
        fall = cases.cloud_falls(subject, positions, EngineAccuracy(resolution=16))
        _falls(subject, ledger, name, fall)
    with pytest.raises(SceneError, match="reference_volumes must be > 0"):
        PointCloud(
            reference_positions=np.zeros((1, 3)),
            initial_velocities=np.zeros((1, 3)),
            reference_volumes=np.zeros(1),
            material_ids=np.zeros(1),
            body_ids=np.zeros(1),
        )


@check("coincident-points", Level.EXTREMES)
def test_coincident_points(subject: Subject, ledger: Ledger) -> None:
    """A point and three thirds of it at its place are the same."""
    once, _ = cases.crowded_block(subject, crowd=False)
    thrice, spread = cases.crowded_block(subject, crowd=True)
    apart = float(np.linalg.norm(thrice - once, axis=1).max())
    # Sums in another order: rounding, which smooth motion does not magnify.
    ledger.at_most("coincident-points", "distance from one point each [m]", apart, 1e-10 if subject.is_double else 1e-5)
    ledger.at_most("coincident-points", "copies apart [m]", float(spread.max()), _preserved(subject))


@check("degenerate-clouds", Level.EXTREMES)
def test_degenerate_clouds(subject: Subject, ledger: Ledger) -> None:
    """Clouds without a volume fall like any other, or are refused where they are too wide for a grid."""
    spacing = 0.25
    for name, positions in cases.clouds_without_volume(spacing):
        fall = cases.cloud_falls(subject, positions, EngineAccuracy(spacing=spacing))
        if fall.run.refusal and name == "one far away":
            _sound(name, fall.run)
            continue
        _falls(subject, ledger, name, fall)


@check("slivers", Level.EXTREMES)
def test_slivers(subject: Subject, ledger: Ledger) -> None:
    """A splat's points, most of them in slivers and of very unequal volume, cost no more steps than even ones."""
    dropped = splat_cases.slivers_fall(subject)
    _done(f"slivers in at most {dropped.limit} substeps a frame", dropped.run)
    # All points start and fall alike, whatever they stand for.
    ledger.at_most(
        "slivers", "distance from free fall [m]", dropped.flight_error, 1.05 * dropped.euler_error + _preserved(subject)
    )


@check("inversion", Level.EXTREMES)
def test_inversion(subject: Subject, ledger: Ledger) -> None:
    """Matter that crushes itself recovers, or the run ends; what was turned inside out is told."""
    # Down to a sixteenth of its volume, and far beyond what its stiffness can take up: evenly, flat, and unevenly.
    for rates in ((2, 2, 2), (5, 5, 5), (20, 20, 20), (20, 0, 0), (20, -5, -5)):
        crush = cases.block_crushes_itself(subject, rates)
        case = f"inversion {rates}"
        _sound(case, crush.run)
        ledger.at_most(case, "frames with inverted points untold", crush.untold, 0)
        if not crush.stopped:
            # Ringing about its old size: what the crushing took from it is at most a half, and it stretches no further
            # than the energy of the crushing bears, if none of it is lost.
            ledger.at_least(case, "size after / before", crush.size_after, 0.5)
            ledger.at_most(case, "size after / before", crush.size_after, crush.size_of_all_energy)
    mild = cases.block_crushes_itself(subject, (1, 1, 1))
    # Half of its energy is kinetic when it has two fifths of its volume: no reason to give up.
    _done("a block pressed to two fifths", mild.run)
    assert not mild.stopped, f"a block pressed to two fifths of its volume is given up: {mild.stopped}"
    ledger.at_most("inversion, pressed", "smallest volume ratio", mild.smallest_ratio, 0.6)
    ledger.at_most("inversion, pressed", "size after - before, relative", mild.size_after - 1, 0.5)


@check("domain-edge", Level.EXTREMES)
def test_domain_edge(subject: Subject, ledger: Ledger) -> None:
    """Matter that flies out of its domain: the domain follows, ends the run, or holds it and says so."""
    declared = subject.descriptor.capabilities.domain_policies
    for policy in sorted(declared, key=lambda one: one.value):
        edge = cases.block_leaves_domain(subject, policy)
        case = f"domain-edge {policy.value}"
        substeps = sum(report.substep_count for report in edge.run.reports)
        round_off = edge.reach * rounding(subject, substeps)
        _sound(case, edge.run)
        ledger.at_most(case, "distance from free flight [m]", edge.error, round_off)
        if policy is DomainPolicy.STOP:
            assert edge.run.status is Status.OUT_OF_DOMAIN, f"{case}: ended with {edge.run.ending}"
            last = edge.run.states[-1].time
            # The frame in which it happens: the next one after the last that was well inside.
            frame = edge.run.states[1].time
            ledger.at_most(case, "frames from leaving to the end", (last - edge.touched) / frame, 1.0 + 1e-6)
            continue
        _done(case, edge.run)
        if policy is DomainPolicy.CLAMP:
            ledger.at_most(case, "points beyond the edge [m]", max(0.0, edge.beyond), round_off)
            assert edge.warned, f"{case}: what the edge held back is not reported"


def _long_run(subject: Subject, ledger: Ledger, substeps: int, drift: float) -> None:
    run = cases.ringing_flight(subject, substeps)
    case = f"long-run {substeps:g} substeps"
    # Nothing drives it. 2 % for what frames miss of the top of a sway, and for energy below the cell that shows itself.
    ledger.at_most(case, "inner energy / at the start", run.energy, 1.02)
    ledger.at_most(case, "inner energy / a tenth of the run before", run.energy_rise, 1.02)
    ledger.at_most(case, "momentum error", run.momentum_error, 1e-12 if subject.is_double else drift)
    assert not run.ended, f"{case}: {run.ended}"


@check("long-run", Level.EXTREMES)
def test_long_run(subject: Subject, ledger: Ledger) -> None:
    """After ten thousand substeps energy has not risen and momentum is what it was."""
    _long_run(subject, ledger, 10_000, 1e-5)


@check("long-run[1e5 substeps]", Level.EXTREMES, full=True)
def test_very_long_run(subject: Subject, ledger: Ledger) -> None:
    """After a hundred thousand substeps energy has not risen and momentum is what it was."""
    _long_run(subject, ledger, 100_000, 1e-4)


@check("unstable-substep", Level.EXTREMES)
def test_unstable_substep(subject: Subject, ledger: Ledger) -> None:
    """A step that is too large is refused, borne, or ends the run; nonsense is never called good."""
    for name, unstable in cases.unstable_runs(subject).items():
        _sound(name, unstable.run)
        # Whatever becomes of it, no force from outside acts on it.
        ledger.at_most(name, "centre of mass from uniform motion [m]", unstable.drift, unstable.rounding)
        ledger.at_most(name, "frames of nonsense untold", unstable.untold, 0)


def _random_scenes(subject: Subject, ledger: Ledger, numbers: Iterable[int]) -> None:
    first, last = min(numbers), max(numbers)
    outcomes = run_batch(subject, first, last)
    case = f"random-scenes {first} to {last}"
    count = last - first + 1
    assert [outcome.number for outcome in outcomes] == list(range(first, last + 1))
    for outcome in outcomes:
        if outcome.faults or outcome.ending != "ok":
            said = "; ".join(part for part in (outcome.ending, outcome.reason, *outcome.faults) if part)
            ledger.note(f"{outcome.scene}: {said}")
    faulty = [f"{'; '.join(outcome.faults)}: {outcome.scene}" for outcome in outcomes if outcome.faults]
    endings = Counter(outcome.ending for outcome in outcomes)
    told = ", ".join(f"{number} {ending}" for ending, number in endings.most_common())
    assert not faulty, f"{len(faulty)} of {count} scenes ({told})\n" + "\n".join(faulty)
    # A quarter may end as their domain wants it, a sixth has a fixed substep, a twentieth a limit of three substeps:
    # an engine that gives up half of them gives up more than it has to.
    ledger.at_least(case, f"share run to the end ({told})", endings["ok"] / count, 0.5)


@check("random-scenes", Level.EXTREMES)
def test_random_scenes(subject: Subject, ledger: Ledger) -> None:
    """Scenes nobody would build, from a seeded generator, in a process that is watched from outside."""
    _random_scenes(subject, ledger, range(QUICK_SCENES))


@check(f"random-scenes[to {ALL_SCENES}]", Level.EXTREMES, full=True)
def test_more_random_scenes(subject: Subject, ledger: Ledger) -> None:
    """The rest of two hundred scenes nobody would build."""
    _random_scenes(subject, ledger, range(QUICK_SCENES, ALL_SCENES))
