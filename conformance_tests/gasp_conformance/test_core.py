"""The contract itself, judged. Nothing here depends on what an engine declares, and nothing may be left out.

What is compared with a closed form may be off by what symplectic Euler with the reported substeps is off by, and by
rounding (`gasp_conformance.bounds`); what is compared with itself, by nothing or by rounding, as the engine declares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_conformance.bounds import place_rounding
from gasp_conformance.checks import Level, check
from gasp_conformance.core_cases import (
    FRAME,
    SPACING,
    block_falls,
    difference,
    lone_points_fly,
    read_fields,
    states_differ,
    swaying_block,
    undeclared_and_accepted,
)
from gasp_conformance.elsewhere import run_elsewhere
from gasp_conformance.ledger import Ledger
from gasp_conformance.plugin_imports import plugin_imports, plugin_modules
from gasp_conformance.specimens import NO_GRAVITY, block_problem, plain_material
from gasp_conformance.subject import Subject, finite_state
from gasp_core.contract import (
    ContactCondition,
    Determinism,
    DomainPolicy,
    Drive,
    EngineAccuracy,
    EngineSession,
    Field,
    ForceField,
    Material,
    PointProblem,
    PointState,
    Precision,
    Quantity,
    Status,
    StepReport,
)
from gasp_core.contract.options import build_options
from gasp_core.discovery.plugins import offer_fault
from gasp_core.discovery.registry import discover
from gasp_core.errors import GaspError
from gasp_core.processes.exit_report import ending
from gasp_core.stepping.time_step import rest_bound

Array = NDArray[Any]

ACCURACY = EngineAccuracy(spacing=SPACING)
TIMES = (FRAME, 2 * FRAME, 3 * FRAME)


def advanced(session: EngineSession, time: float) -> StepReport:
    """Advance a session that has no reason to stop."""
    report = session.advance_to(time)
    assert report.status is Status.OK, f"ended with {report.status.value} before {time:.6g} s: {report.warnings}"
    return report


def final(subject: Subject, problem: PointProblem) -> tuple[PointState, int]:
    """The last of the usual frames, with everything that can be read, and how many substeps it took to get there."""
    with subject.open(problem, ACCURACY, read_fields(subject)) as session:
        count = sum(advanced(session, time).substep_count for time in TIMES)
        return finite_state(session, read_fields(subject)), count


def agree(subject: Subject, ledger: Ledger, case: str, one: PointState, other: PointState, substeps: int) -> None:
    """Two runs of one problem are equal as far as the engine promises runs on this device to be."""
    if subject.determinism is Determinism.BITWISE:
        differing = states_differ(one, other)
        ledger.at_most(case, "arrays that are not equal bit for bit", len(differing), 0)
        return
    # A block of a few tenths of a metre, less than a metre from the origin, smooth motion: nothing magnifies rounding.
    reach = float(np.abs(one.positions).max())
    bound = place_rounding(subject, substeps, reach, reach)
    ledger.at_most(case, "largest distance [m]", difference(one, other), bound)


@check("discovery", Level.CORE)
def test_discovery(subject: Subject, ledger: Ledger) -> None:
    """The descriptor is well formed, and listing engines imports no backend."""
    descriptor, can = subject.descriptor, subject.descriptor.capabilities
    assert offer_fault(descriptor) is None, offer_fault(descriptor)
    assert descriptor.summary.strip() and "\n" not in descriptor.summary, "the summary has to be one line"
    members: list[tuple[str, Any, type[Any]]] = [
        ("contact_conditions", can.contact_conditions, ContactCondition),
        ("output_fields", can.output_fields, Field),
        ("conserved", can.conserved, Quantity),
        ("precisions", can.precisions, Precision),
        ("domain_policies", can.domain_policies, DomainPolicy),
        ("devices", can.devices, str),
    ]
    for name, declared, kind in members:
        assert all(isinstance(item, kind) for item in declared), f"{name} may hold {kind.__name__} alone: {declared!r}"
    classes: list[tuple[str, Any, type[Any]]] = [
        ("materials", can.materials, Material),
        ("drives", can.drives, Drive),
        ("force_fields", can.force_fields, ForceField),
    ]
    for name, declared, kind in classes:
        assert all(issubclass(item, kind) and item.kind for item in declared), f"{name}: {declared!r}"
    assert can.materials, "an engine without a material can move nothing"
    for name, ordered in (("devices", can.devices), ("precisions", can.precisions)):
        assert ordered and len(set(ordered)) == len(ordered), f"{name} has to name each choice once: {ordered!r}"
    assert isinstance(can.determinism, Determinism)
    assert math.isfinite(can.temporal_order) and can.temporal_order > 0, f"temporal_order is {can.temporal_order!r}"
    if descriptor.options is not None:
        descriptor.options()

    modules = plugin_modules(discover().offer(subject.name).distribution)
    found = plugin_imports(modules)
    assert subject.name in found.engines, f"{', '.join(modules)} offers {sorted(found.engines)} in a fresh interpreter"
    factory = descriptor.factory.partition(":")[0]
    assert factory not in found.modules, f"importing the plugin imports {factory}: name it in `factory`, and no more"
    foreign = found.foreign(modules)
    assert not foreign, f"importing the plugin imports {', '.join(foreign)}: import it in the engine's own modules"
    ledger.at_most("discovery", "packages imported with the plugin", len(foreign), 0)


@check("lifecycle", Level.CORE)
def test_lifecycle(subject: Subject, ledger: Ledger) -> None:
    """A session starts at 0 with what it was given, goes forward alone, and is a context manager."""
    problem = swaying_block(subject)
    reference = problem.points.reference_positions
    with subject.open(problem, ACCURACY) as session:
        assert session.time == 0.0
        first = finite_state(session, frozenset({Field.POSITIONS}))
        assert first.time == 0.0
        assert first.positions.shape == reference.shape
        # Stored and scaled back: no step was taken.
        away = float(np.abs(first.positions - reference).max())
        bound = place_rounding(subject, 0, float(np.abs(reference).max()), 0.0)
        ledger.at_most("lifecycle", "start from reference [m]", away, bound)

        for now in (0.0, FRAME):
            advanced(session, now)
            before = finite_state(session, frozenset({Field.POSITIONS}))
            still = advanced(session, now)
            assert still.substep_count == 0, "advancing to the present takes no substeps"
            assert session.time == now
            assert not states_differ(before, session.read(frozenset({Field.POSITIONS})))
        for wrong in (0.0, math.nextafter(FRAME, 0), -1.0, math.nan, math.inf):
            with pytest.raises(ValueError):
                session.advance_to(wrong)
            assert session.time == FRAME
        assert not states_differ(before, session.read(frozenset({Field.POSITIONS})))
        advanced(session, 2 * FRAME)
        assert states_differ(before, finite_state(session, frozenset({Field.POSITIONS}))) == ["positions"]

    class Interrupted(Exception): ...

    with pytest.raises(Interrupted), subject.open(problem, ACCURACY):
        raise Interrupted


@check("lands-on-time", Level.CORE)
def test_lands_on_time(subject: Subject, ledger: Ledger) -> None:
    """Asked for a time, however awkward, a session is at that very number, and its points are where they are then."""
    velocity = np.array([0.9, -0.4, 0.2])
    problem = block_problem(subject, (0.3, 0.1, -0.2), 1, SPACING, velocity, gravity=NO_GRAVITY)
    reference = problem.points.reference_positions
    times = [1e-9, math.nextafter(1e-9, 1), 1e-6, 1e-3 / 3, 0.1 + 0.2, 1 / 3, math.nextafter(1 / 3, 1), 2 / 3, 4.0]
    substeps, shortest = 0, math.inf
    with subject.open(problem, ACCURACY) as session:
        for time in times:
            report = advanced(session, time)
            substeps += report.substep_count
            shortest = min(shortest, report.smallest_substep)
            state = finite_state(session, frozenset({Field.POSITIONS}))
            assert session.time == time, f"asked for {time!r} s, it is at {session.time!r} s"
            assert state.time == time, f"asked for {time!r} s, the state is of {state.time!r} s"
            exact = reference + velocity * time
            # Of what each time's own substeps may have rounded.
            travel = float(np.linalg.norm(velocity)) * time
            bound = place_rounding(subject, substeps, float(np.abs(exact).max()), travel)
            case = f"lands-on-time, at {time!r} s, after steps down to {shortest:.2g} s"
            ledger.at_most(case, "largest error [m]", float(np.abs(state.positions - exact).max()), bound)


@check("row-identity", Level.CORE)
def test_row_identity(subject: Subject, ledger: Ledger) -> None:
    """Rows come back in the order in which they were given, whatever that was."""
    flight, positions = lone_points_fly(subject)
    # Points with nothing near them move uniformly in whatever way steps are taken.
    ledger.at_most("row-identity", "row from where it flies to [m]", flight.error, flight.rounding)
    order = np.random.default_rng(5).permutation(len(positions))
    shuffled, again = lone_points_fly(subject, order)
    apart = float(np.linalg.norm(again - positions, axis=1).max())
    ledger.at_most("row-identity", "shuffled rows from their own [m]", apart, flight.rounding + shuffled.rounding)


@check("owned-buffers", Level.CORE)
def test_owned_buffers(subject: Subject) -> None:
    """What is read belongs to the reader: it is a plain array that nobody writes to again."""
    problem = swaying_block(subject)
    given = list(_arrays(problem.points).values())
    copies = [array.copy() for array in given]
    session = subject.open(problem, ACCURACY, read_fields(subject))
    shown = read_fields(subject)
    states = [session.read(shown), session.read(shown)]
    advanced(session, FRAME)
    states += [session.read(shown), session.read(shown)]
    held = [{name: (array, array.copy()) for name, array in _arrays(state).items()} for state in states]
    for name, array in ((name, array) for state in held for name, (array, _) in state.items()):
        assert array.dtype == np.float64, f"{name} is {array.dtype}, not float64"
        assert array.flags.c_contiguous, f"{name} is not C-contiguous"
        assert not array.flags.writeable, f"{name} can be written to"
    for number, state in enumerate(held):
        for other in held[number + 1 :]:
            for name, (array, _) in state.items():
                shared = np.shares_memory(array, other[name][0])
                assert not shared, f"two reads share the memory of {name}"
    assert set(held[0]) == {field.value for field in shown}, f"asked for {shown}, got {sorted(held[0])}"
    bare = session.read(frozenset())
    assert set(_arrays(bare)) == {"positions"}, f"asked for no field, got {sorted(_arrays(bare))}"
    advanced(session, 2 * FRAME)
    session.close()
    for state in held:
        for name, (array, copy) in state.items():
            assert np.array_equal(array, copy), f"{name} changed after it was read"
    for array, copy in zip(given, copies):
        assert np.array_equal(array, copy), "the problem's own arrays were changed"


def _arrays(owner: object) -> dict[str, Array]:
    """The arrays of a dataclass with slots, by name."""
    values = {name: getattr(owner, name) for name in type(owner).__slots__}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


@check("split-advance", Level.CORE)
def test_split_advance(subject: Subject, ledger: Ledger) -> None:
    """Many short advances end where one long one does."""
    problem = swaying_block(subject)
    # Frames at whole numbers of a fixed substep: the very same steps, but for the last digit of a step's size.
    step = _stable_substep(subject)
    count = 40
    accuracy = replace(ACCURACY, substep=step)
    ends = list(subject.states(problem, accuracy, [count * step]))
    ends += list(subject.states(problem, accuracy, [number * step for number in range(1, count + 1)]))[-1:]
    reach = float(np.abs(ends[0].positions).max())
    apart = difference(*ends)
    bound = place_rounding(subject, count, reach, reach)
    ledger.at_most("split-advance", "1 advance from 40, fixed substep [m]", apart, bound)

    # Substeps of the engine's own choice differ with the frames they land on: each run has its own error against free
    # fall, that of its own largest substep.
    whole = block_falls(subject, (3.1, -4.3, -8.2), [0.4], step)
    split = block_falls(subject, (3.1, -4.3, -8.2), np.linspace(0, 0.4, 33)[1:].tolist(), step)
    for name, fall in (("1 advance", whole), ("32 advances", split)):
        bound = 1.05 * fall.stepping + fall.rounding
        ledger.at_most("split-advance", f"{name} from free fall [m]", fall.error, bound)


def _stable_substep(subject: Subject) -> float:
    """A fixed substep [s] well below what any explicit scheme bears on the plainest material; 1 ms where all do."""
    bound = rest_bound(plain_material(subject.descriptor.capabilities), SPACING)
    return min(0.05 * bound, 1e-3)


@check("free-fall", Level.CORE)
def test_free_fall(subject: Subject, ledger: Ledger) -> None:
    """Under a gravity that points nowhere in particular, matter falls as Galilei says."""
    step, gravity = 1e-3, (3.1, -4.3, -8.2)
    fall = block_falls(subject, gravity, np.linspace(0, 0.4, 9)[1:].tolist(), step)
    # Symplectic Euler's own error is g t dt/2 exactly, 0.25 % of the fall; 5 % for substeps that are not all the
    # largest.
    ledger.at_most("free-fall", "largest error [m]", fall.error, 1.05 * fall.stepping + fall.rounding)
    up = block_falls(subject, tuple(-component for component in gravity), [0.2], step)
    ledger.at_most("free-fall", "largest error upwards [m]", up.error, 1.05 * up.stepping + up.rounding)


@check("drift", Level.CORE)
def test_drift(subject: Subject, ledger: Ledger) -> None:
    """Without weight, matter goes on straight and keeps its shape."""
    flight = block_falls(subject, NO_GRAVITY, np.linspace(0, 1.0, 5)[1:].tolist(), 5e-3)
    ledger.at_most("drift", "largest error [m]", flight.error, flight.rounding)


@check("substep-obeyed", Level.CORE)
def test_substep_obeyed(subject: Subject) -> None:
    """A fixed substep is taken, and what a report says of substeps adds up."""
    step = _stable_substep(subject)
    problem = swaying_block(subject)
    # A hair for the last digit of step sizes that are quotients.
    hair = 1 + 1e-9
    with subject.open(problem, replace(ACCURACY, substep=step)) as session:
        begin = 0.0
        for end in (10.5 * step, 21.0 * step, 22.0 * step):
            report = advanced(session, end)
            span = end - begin
            expected = math.ceil(span / step / hair)
            assert report.substep_count == expected, f"{span / step:g} substeps of time in {report.substep_count}"
            assert 0 < report.smallest_substep <= report.largest_substep <= step * hair
            _adds_up(report, span)
            begin = end
    with subject.open(problem, ACCURACY) as session:
        _adds_up(advanced(session, FRAME), FRAME)
        _adds_up(advanced(session, 3 * FRAME), 2 * FRAME)


def _adds_up(report: StepReport, span: float) -> None:
    count = report.substep_count
    assert count >= 1, "time went by in no substeps"
    low, high = count * report.smallest_substep * (1 - 1e-9), count * report.largest_substep * (1 + 1e-9)
    assert low <= span <= high, (
        f"{count} substeps between {low / count:.6g} and {high / count:.6g} s are not {span:.6g} s"
    )


@check("refusals", Level.CORE)
def test_refusals(subject: Subject, ledger: Ledger) -> None:
    """What is not declared is refused before anything is opened; what is impossible, on opening."""
    asked, accepted = undeclared_and_accepted(subject)
    assert asked > 0
    assert not accepted, f"not declared, and not refused: {', '.join(accepted)}"
    ledger.at_most("refusals", f"accepted of {asked} undeclared", len(accepted), 0)
    for what, attempt in _impossible(subject).items():
        assert _refusal(attempt) is not None, f"{what} is accepted"
    # A step that no explicit scheme bears: refused, or borne by an engine that has no bound.
    problem = swaying_block(subject)
    step = 100 * rest_bound(plain_material(subject.descriptor.capabilities), SPACING)
    if math.isfinite(step):
        bold = replace(ACCURACY, substep=step)
        if _refusal(lambda: subject.open(problem, bold)) is None:
            with subject.open(problem, bold) as session:
                report = advanced(session, step)
                assert report.substep_count == 1, "a fixed substep far above the bound was accepted, and not taken"
                wide = float(np.ptp(finite_state(session, frozenset()).positions, axis=0).max())
            size = problem.points.size
            velocities = problem.points.initial_velocities
            apart = float(np.linalg.norm(velocities - velocities.mean(axis=0), axis=1).max())
            # Farther than points that nothing holds together it does not go.
            bound = size + 2 * apart * step
            ledger.at_most("refusals", "size of a block after a step far above the bound [m]", wide, bound)


def _refusal(attempt: Callable[[], object]) -> Exception | None:
    """The error that an attempt at opening a session ends with; None, and the session closed again, if it opens."""
    try:
        opened = attempt()
    except Exception as error:
        return error
    close = getattr(opened, "close", None)
    if close is not None:
        close()
    return None


def _impossible(subject: Subject) -> Mapping[str, Callable[[], object]]:
    """Ways of opening a session that have to be refused."""
    descriptor = subject.descriptor
    problem = swaying_block(subject)
    attempts: dict[str, Callable[[], object]] = {
        "an unknown option": lambda: build_options(descriptor, {"no_such_option": 1}),
    }
    for name in descriptor.option_names():
        attempts[f"option {name} of no type that exists"] = lambda name=name: build_options(
            descriptor, {name: object()}
        )
    if descriptor.capabilities.checkpoints:
        other = block_problem(subject, (0.0, 0.0, 0.0), 1, SPACING, (0.0, 0.0, 0.0))
        with subject.open(other, ACCURACY) as session:
            foreign = dict(session.checkpoint())
        attempts |= {
            "an empty checkpoint": lambda: _restarted(subject, problem, {}),
            "a checkpoint of nothing known": lambda: _restarted(subject, problem, {"garbage": np.zeros(3)}),
            "a checkpoint of another cloud": lambda: _restarted(subject, problem, foreign),
        }
        with subject.open(problem, ACCURACY) as session:
            own = dict(session.checkpoint())
        for name in own:
            torn = {key: value for key, value in own.items() if key != name}
            attempts[f"a checkpoint without its {name}"] = lambda torn=torn: _restarted(subject, problem, torn)
            for what, array in _spoilt(own[name]).items():
                spoilt = {**own, name: array}
                attempts[f"a checkpoint whose {name} {what}"] = lambda spoilt=spoilt: _restarted(
                    subject, problem, spoilt
                )
    return attempts


def _spoilt(array: Array) -> Mapping[str, Array]:
    """What may stand in a file in the place of an array of a checkpoint, and what is wrong with it."""
    spoilt = {"has another shape": np.zeros((2, *np.shape(array)))}
    if np.size(array):
        spoilt["is text"] = np.asarray(array).astype(str)
        broken = np.array(array, dtype=np.float64)
        # NaN may say something in an engine's own array, such as that nothing holds a point; infinite says nothing.
        broken.reshape(-1)[-1] = np.nan if np.isfinite(broken).all() else np.inf
        spoilt["is not finite"] = broken
    return spoilt


def _restarted(subject: Subject, problem: PointProblem, checkpoint: Mapping[str, Array]) -> EngineSession:
    options = subject.descriptor.options
    return subject.engine.open(
        problem,
        device=subject.device,
        precision=subject.precision,
        seed=0,
        accuracy=ACCURACY,
        options=None if options is None else options(),
        restart=checkpoint,
    )


def _one_line(what: str, error: BaseException) -> None:
    text = str(error)
    assert text.strip(), f"{what}: refused without a word"
    assert "\n" not in text, f"{what}: the message has more than one line: {text!r}"


@check("error-kinds", Level.CORE)
def test_error_kinds(subject: Subject, capfd: pytest.CaptureFixture[str]) -> None:
    """Errors are of the contract's kinds and in one line, verdicts have reasons, and nothing is printed."""
    problem = swaying_block(subject)
    attempts = dict(_impossible(subject))
    unstable = replace(ACCURACY, substep=1e6)
    attempts["a substep of eleven days"] = lambda: subject.open(problem, unstable)
    for what, attempt in attempts.items():
        error = _refusal(attempt)
        if error is None:
            continue
        assert isinstance(error, GaspError), f"{what} ends with a bare {type(error).__name__}: {error}"
        _one_line(what, error)
    # A frame of a thousand substeps where ten are allowed ends with a verdict, not with an exception.
    step = _stable_substep(subject)
    with subject.open(problem, replace(ACCURACY, substep=step, substep_limit=10)) as session:
        report = session.advance_to(1000 * step)
        assert report.status is Status.SUBSTEP_LIMIT, f"1000 substeps, 10 allowed: {report.status.value}"
        assert report.substep_count <= 10
        assert report.warnings, "a verdict has to have a reason"
        for warning in report.warnings:
            assert warning.strip() and "\n" not in warning, f"not one line: {warning!r}"
        finite_state(session, frozenset())
        with pytest.raises(ValueError) as past:
            session.advance_to(-1.0)
        _one_line("an advance into the past", past.value)
    # What was refused has left nothing behind that would stand in the way.
    with subject.open(problem, ACCURACY, read_fields(subject)) as session:
        advanced(session, FRAME)
        finite_state(session, read_fields(subject))
    printed = capfd.readouterr().out
    assert not printed, f"standard output belongs to the caller; printed was {printed[:200]!r}"


@check("determinism", Level.CORE)
def test_determinism(subject: Subject, ledger: Ledger) -> None:
    """A second run, and one in another process, agree with the first as declared."""
    problem = swaying_block(subject)
    first, substeps = final(subject, problem)
    second, _ = final(subject, problem)
    agree(subject, ledger, "determinism in one process", first, second, substeps)
    fresh = _in_process(subject, problem, in_thread=False)
    agree(subject, ledger, "determinism in a fresh process", first, fresh, substeps)


@check("determinism-of-many", Level.CORE, full=True)
def test_determinism_of_many_points(subject: Subject, ledger: Ledger) -> None:
    """As determinism, with so many points that it pays to share them out among processors."""
    problem = swaying_block(subject, cells=15)
    ends: list[PointState] = []
    substeps = 0
    for _ in range(3):
        with subject.open(problem, ACCURACY, read_fields(subject)) as session:
            substeps = advanced(session, FRAME).substep_count
            ends.append(finite_state(session, read_fields(subject)))
    agree(subject, ledger, "determinism of 27000 points, 2nd run", ends[0], ends[1], substeps)
    agree(subject, ledger, "determinism of 27000 points, 3rd run", ends[0], ends[2], substeps)


@check("side-by-side", Level.CORE)
def test_side_by_side(subject: Subject, ledger: Ledger) -> None:
    """Sessions that are open at once do not disturb each other."""
    one, other = swaying_block(subject), swaying_block(subject, cells=2, seed=8, heaviness=3.0)
    other = replace(other, gravity=(1.0, 2.0, 3.0))
    alone = [final(subject, problem) for problem in (one, other)]
    shown = read_fields(subject)
    left = subject.open(one, ACCURACY, shown)
    advanced(left, TIMES[0])
    with subject.open(other, ACCURACY, shown) as right:
        advanced(right, TIMES[0])
        advanced(left, TIMES[1])
        advanced(right, TIMES[1])
        advanced(right, TIMES[2])
        together = finite_state(right, shown)
    # One goes on when the other has closed.
    advanced(left, TIMES[2])
    pair = (finite_state(left, shown), together)
    left.close()
    for name, (lone, substeps), accompanied in zip(("first", "second"), alone, pair):
        agree(subject, ledger, f"side-by-side {name} session", lone, accompanied, substeps)


@check("close-twice", Level.CORE)
def test_close_twice(subject: Subject) -> None:
    """Closing again does nothing, to this session or to another; a closed session says so."""
    problem = swaying_block(subject)
    with subject.open(problem, ACCURACY) as bystander, subject.open(problem, ACCURACY) as session:
        advanced(session, FRAME)
        for _ in range(3):
            session.close()
        with pytest.raises(ValueError) as reading:
            session.read(frozenset({Field.POSITIONS}))
        _one_line("reading a closed session", reading.value)
        for time in (FRAME, 2 * FRAME):
            with pytest.raises(ValueError):
                session.advance_to(time)
        advanced(bystander, FRAME)
        finite_state(bystander, frozenset())
    with subject.open(problem, ACCURACY) as session:
        session.close()


@check("own-process", Level.CORE)
def test_own_process(subject: Subject, ledger: Ledger) -> None:
    """Isolated in a process of its own, outside its main thread, an engine does the same, and goes when it is done."""
    problem = swaying_block(subject)
    here, substeps = final(subject, problem)
    there = _in_process(subject, problem, in_thread=True)
    agree(subject, ledger, "own-process, not in its main thread", here, there, substeps)


def _in_process(subject: Subject, problem: PointProblem, *, in_thread: bool) -> PointState:
    """The last of the usual frames from a fresh interpreter, which has to end cleanly."""
    run = run_elsewhere(
        subject.name,
        subject.precision.value,
        subject.device,
        problem,
        ACCURACY,
        TIMES,
        read_fields(subject),
        in_thread=in_thread,
    )
    assert run.ended, f"the process hangs; it said: {run.complaints[-500:]}"
    assert run.state is not None and run.status == 0, f"it {ending(run.status)}: {run.complaints[-2000:]}"
    assert not run.printed, f"standard output belongs to the caller; printed was {run.printed[:200]!r}"
    assert not run.left_behind, "processes that it started outlive it"
    return run.state
