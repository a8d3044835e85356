"""The core and capability checks themselves: on small engines that are right by closed form, and on wrong ones.

A right engine passes whatever its method; an engine that declares everything and only flies fails what it cannot do.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gasp_conformance import capability_oracles as exact
from gasp_conformance import (
    elsewhere,
    specimens,
    test_bodies,
    test_capabilities,
    test_core,
    test_damping,
    test_leading,
    test_parts,
    test_sand,
)
from gasp_conformance.declarations import base_name, declared
from gasp_conformance.ledger import Figure, Ledger
from gasp_conformance.plugin_imports import PluginImports, plugin_imports
from gasp_conformance.subject import Subject, Undeclared
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from gasp_core.contract import (
    MATERIALS,
    BoxShape,
    ContactCondition,
    Determinism,
    DomainPolicy,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    Foam,
    FrictionCone,
    HalfSpace,
    Impulse,
    Material,
    Metal,
    Pinned,
    Plasticine,
    PointProblem,
    PointState,
    Precision,
    Quantity,
    SignedDistanceField,
    Snow,
    SphereShape,
    Status,
    StepReport,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.time_step import refuse_unstable_substep, substeps_to

Place = Callable[[PointProblem, float], np.ndarray]

LITTLE = EngineCapabilities(
    materials=frozenset({Elastic}),
    collider_shapes=frozenset(),
    contact_conditions=frozenset(),
    drives=frozenset(),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    conserved=frozenset({Quantity.LINEAR_MOMENTUM}),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
)
EVERYTHING = EngineCapabilities(
    materials=frozenset(MATERIALS.values()),
    collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
    contact_conditions=frozenset(ContactCondition),
    body_contacts=frozenset(ContactCondition),
    pair_contacts=True,
    moving_colliders=True,
    restitution=True,
    rigid_parts=True,
    material_damping=True,
    cohesion=True,
    trajectories=True,
    drives=frozenset({Pinned, Driven, Impulse}),
    force_fields=frozenset({Wind}),
    output_fields=frozenset(Field),
    conserved=frozenset(Quantity),
    devices=("cpu",),
    precisions=(Precision.FLOAT64, Precision.FLOAT32),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset(DomainPolicy),
    carries_tracers=True,
    checkpoints=True,
    device_indices=True,
    views=frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}),
    material_columns=frozenset({"density", "youngs_modulus", "poissons_ratio"}),
)


def straight(problem: PointProblem, time: float) -> np.ndarray:
    """Every point for itself."""
    points = problem.points
    return points.reference_positions + points.initial_velocities * time


class Flyer:
    """Moves points by a closed form, and lets them fall as symplectic Euler does; exact, so with no bound on steps."""

    def __init__(self, capabilities: EngineCapabilities = LITTLE, place: Place = straight) -> None:
        self.capabilities = capabilities
        self.place = place

    def open(self, problem: PointProblem, *, restart: Any = None, accuracy: EngineAccuracy, **_: Any) -> Flight:
        refuse_unstable_substep(problem, accuracy.spacing_for(problem.points.size), accuracy)
        if restart is not None and np.shape(restart.get("fallen", ())) != (3,):
            raise SceneError("the checkpoint belongs to another engine: start the run anew")
        return Flight(self, problem, accuracy, restart)

    def subject(self) -> Subject:
        descriptor = EngineDescriptor(
            name="flyer",
            summary="flies",
            contract_version=(1, 0),
            capabilities=self.capabilities,
            factory="nowhere:Flyer",
        )
        return Subject(descriptor=descriptor, engine=self, device="cpu", precision=Precision.FLOAT64)


class Flight:
    def __init__(self, engine: Flyer, problem: PointProblem, accuracy: EngineAccuracy, restart: Any) -> None:
        self.engine, self.problem, self.accuracy = engine, problem, accuracy
        self.time = 0.0 if restart is None else float(restart["time"])
        self.fallen = np.zeros(3) if restart is None else np.array(restart["fallen"])
        self.closed = False

    def _open(self) -> None:
        if self.closed:
            raise ValueError("the session is closed")

    def advance_to(self, time: float) -> StepReport:
        self._open()
        if not (math.isfinite(time) and time >= self.time):
            raise ValueError("cannot advance there")
        if time == self.time:
            return StepReport(status=Status.OK, substep_count=0, smallest_substep=0.0, largest_substep=0.0)
        count, step = substeps_to(time - self.time, self.accuracy.substep or 1e-3)
        if count > self.accuracy.substep_limit:
            return StepReport(
                status=Status.SUBSTEP_LIMIT,
                substep_count=0,
                smallest_substep=0.0,
                largest_substep=0.0,
                warnings=("too many substeps: raise substep_limit",),
            )
        # Symplectic Euler from a speed g t on: sum of (t + k dt) dt.
        gravity = np.array(self.problem.gravity)
        self.fallen = self.fallen + gravity * (self.time * count * step + step**2 * count * (count + 1) / 2)
        self.time = time
        return StepReport(status=Status.OK, substep_count=count, smallest_substep=step, largest_substep=step)

    def read(self, fields: frozenset[Field]) -> PointState:
        self._open()
        points = self.problem.points
        tracers = points.tracer_positions
        carried = None
        if tracers is not None:
            # Tracers are moved as one more body of points would be, found by the nearest point.
            nearest = np.linalg.norm(points.reference_positions[:, None] - tracers, axis=2).argmin(axis=0)
            carried = tracers + points.initial_velocities[nearest] * self.time
        return PointState(
            time=self.time,
            positions=self.engine.place(self.problem, self.time) + self.fallen,
            velocities=points.initial_velocities + np.array(self.problem.gravity) * self.time
            if Field.VELOCITIES in fields
            else None,
            deformation_gradients=np.tile(np.eye(3), (len(points), 1, 1))
            if Field.DEFORMATION_GRADIENTS in fields
            else None,
            tracer_positions=carried if Field.TRACER_POSITIONS in fields else None,
        )

    def view(self, field: Field) -> np.ndarray:
        return np.array(getattr(self.read(frozenset({field})), field.value))

    def checkpoint(self) -> Mapping[str, np.ndarray]:
        self._open()
        return {"time": np.array(self.time), "fallen": self.fallen.copy()}

    def close(self) -> None:
        self.closed = True

    def __enter__(self) -> Flight:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@pytest.fixture
def figures() -> list[Figure]:
    return []


@pytest.fixture
def ledger(figures: list[Figure]) -> Ledger:
    return Ledger(lambda _, figure: figures.append(figure))


def ask(has: bool, what: str) -> None:
    if not has:
        raise Undeclared(what)


# --- core -----------------------------------------------------------------------------------------------------------

ALONE = [
    test_core.test_lifecycle,
    test_core.test_lands_on_time,
    test_core.test_row_identity,
    test_core.test_split_advance,
    test_core.test_free_fall,
    test_core.test_drift,
    test_core.test_refusals,
    test_core.test_side_by_side,
]


@pytest.mark.parametrize("judge", ALONE, ids=lambda judge: judge.__name__)
@pytest.mark.parametrize("capabilities", [LITTLE, replace(LITTLE, determinism=Determinism.TOLERANCE)])
def test_core_asks_for_no_method_in_particular(judge: Any, capabilities: EngineCapabilities, ledger: Ledger) -> None:
    """A closed form with no grid, no wall and no stress passes."""
    judge(Flyer(capabilities).subject(), ledger)


def test_core_checks_without_figures_pass_too(capfd: pytest.CaptureFixture[str]) -> None:
    subject = Flyer().subject()
    test_core.test_owned_buffers(subject)
    test_core.test_substep_obeyed(subject)
    test_core.test_close_twice(subject)
    test_core.test_error_kinds(subject, capfd)


class Changed(Flyer):
    """A flyer whose sessions are of a class that does one thing wrong."""

    def __init__(self, session: type[Flight]) -> None:
        super().__init__()
        self.session = session

    def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, restart: Any = None, **_: Any) -> Flight:
        return self.session(self, problem, accuracy, restart)


class BackInTime(Flight):
    def advance_to(self, time: float) -> StepReport:
        if math.isfinite(time) and time < self.time:
            self.time = time
            return StepReport(status=Status.OK, substep_count=1, smallest_substep=1.0, largest_substep=1.0)
        return super().advance_to(time)


class SumOfSteps(Flight):
    def advance_to(self, time: float) -> StepReport:
        begin = self.time
        report = super().advance_to(time)
        self.time = begin + sum([report.largest_substep] * report.substep_count)
        return report


class Writeable(Flight):
    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        state.positions.flags.writeable = True
        return state


class Shared(Flight):
    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        if not hasattr(self, "memory"):
            self.memory = state.positions.copy()
        self.memory.flags.writeable = True
        self.memory[:] = state.positions
        return PointState(time=state.time, positions=self.memory[:], velocities=state.velocities)


class Immortal(Flight):
    def close(self) -> None: ...


class Miscounting(Flight):
    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        return replace(report, substep_count=report.substep_count + 1)


class Talkative(Flight):
    def advance_to(self, time: float) -> StepReport:
        print("advancing")
        return super().advance_to(time)


@pytest.mark.parametrize(
    ("session", "judge", "complaint"),
    [
        (BackInTime, test_core.test_lifecycle, "DID NOT RAISE"),
        (SumOfSteps, test_core.test_lands_on_time, "asked for"),
        (Writeable, test_core.test_owned_buffers, "can be written to"),
        (Shared, test_core.test_owned_buffers, "share the memory"),
        (Immortal, test_core.test_close_twice, "DID NOT RAISE"),
        (Miscounting, test_core.test_substep_obeyed, "substeps"),
        (Talkative, test_core.test_error_kinds, "belongs to the caller"),
    ],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_core_tells_what_is_wrong(
    session: type[Flight], judge: Any, complaint: str, ledger: Ledger, capfd: pytest.CaptureFixture[str]
) -> None:
    given = {"subject": Changed(session).subject(), "ledger": ledger, "capfd": capfd}
    names = judge.__code__.co_varnames[: judge.__code__.co_argcount]
    with pytest.raises((AssertionError, pytest.fail.Exception), match=complaint):
        judge(**{name: given[name] for name in names})


def test_a_substep_beyond_any_bound_may_be_borne_but_not_ignored(ledger: Ledger) -> None:
    class Bold(Flyer):
        def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, restart: Any = None, **_: Any) -> Flight:
            return Flight(self, problem, accuracy, restart)

    class Timid(Bold):
        def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, restart: Any = None, **_: Any) -> Flight:
            return Flight(self, problem, replace(accuracy, substep=1e-3), restart)

    test_core.test_refusals(Bold().subject(), ledger)
    with pytest.raises(AssertionError, match="accepted, and not taken"):
        test_core.test_refusals(Timid().subject(), ledger)


def test_an_undeclared_thing_that_is_not_refused_is_named(monkeypatch: pytest.MonkeyPatch, ledger: Ledger) -> None:
    monkeypatch.setattr("gasp_conformance.core_cases.check_supported", lambda *_, **__: None)
    with pytest.raises(AssertionError, match=r"material snow.*contact stick.*drive pinned.*force field wind.*tracers"):
        test_core.test_refusals(Flyer().subject(), ledger)


# --- fresh interpreters ---------------------------------------------------------------------------------------------


def test_a_plugin_that_imports_its_backend_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = (
        "from gasp_core.discovery.hookspecs import hookimpl\n"
        "import fractions\n"
        "{}\n"
        "@hookimpl\n"
        "def gasp_point_engines():\n"
        "    return []\n"
    )
    (tmp_path / "light_plugin.py").write_text(plugin.format(""))
    (tmp_path / "heavy_plugin.py").write_text(plugin.format("import scipy.linalg"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    light, heavy = plugin_imports(["light_plugin"]), plugin_imports(["heavy_plugin"])
    assert "light_plugin" in light.modules
    assert light.foreign(["light_plugin"]) == []
    assert "scipy" in heavy.foreign(["heavy_plugin"])
    with pytest.raises(AssertionError, match=r"importing missing_plugin in a fresh interpreter fails.*No module named"):
        plugin_imports(["missing_plugin"])


def test_own_packages_and_the_standard_library_are_no_strangers() -> None:
    found = PluginImports(
        engines=frozenset(), modules=frozenset({"my_engine.plugin", "json", "gasp_core.io", "torch.nn"})
    )
    assert found.foreign(["my_engine.plugin"]) == ["torch"]


def run_child(monkeypatch: pytest.MonkeyPatch, code: str, patience: float = 60.0) -> elsewhere.Elsewhere:
    """`run_elsewhere` with a child that does something else than run an engine."""
    real = subprocess.Popen

    def started(command: list[str], **options: Any) -> Any:
        return real([sys.executable, "-c", code, *command[3:]], **options)

    monkeypatch.setattr(elsewhere.subprocess, "Popen", started)
    monkeypatch.setattr(elsewhere, "_PATIENCE", patience)
    monkeypatch.setattr(elsewhere, "_LINGER", 0.2)
    subject = Flyer().subject()
    problem = specimens.resting_block(subject, (0, 0, 0), 1, 0.1)
    shown = frozenset({Field.POSITIONS})
    return elsewhere.run_elsewhere("any", "float64", "cpu", problem, EngineAccuracy(), [0.1], shown)


def test_a_process_that_hangs_is_ended_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_child(monkeypatch, "import time; time.sleep(600)", patience=1.0)
    assert (run.ended, run.state) == (False, None)
    assert run.status < 0


def test_a_process_that_leaves_a_child_behind_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])"
    run = run_child(monkeypatch, code)
    assert run.ended
    assert run.left_behind


def test_what_a_process_says_and_how_it_ends_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_child(monkeypatch, "import sys; print('hello'); sys.exit('no engine')")
    assert (run.ended, run.status, run.printed.strip(), run.left_behind) == (True, 1, "hello", False)
    assert "no engine" in run.complaints


def test_an_engine_that_is_not_installed_fails_in_a_process_with_its_message() -> None:
    subject = Flyer().subject()
    with pytest.raises(AssertionError, match='no engine named "flyer"'):
        test_core.test_own_process(subject, Ledger(lambda *_: None))


# --- capabilities ---------------------------------------------------------------------------------------------------


def judges() -> dict[str, Any]:
    """Every capability check by the name of its function, but those that pytest makes for an engine."""
    made = {"test_device", "test_declared_without_a_check"}
    modules = (test_capabilities, test_bodies, test_damping, test_leading, test_parts, test_sand)
    found = {name: judge for module in modules for name, judge in vars(module).items()}
    return {name: judge for name, judge in found.items() if name.startswith("test_") and name not in made}


def run_judge(judge: Any, subject: Subject, ledger: Ledger) -> None:
    given: dict[str, Any] = {
        "subject": subject,
        "ledger": ledger,
        "need": ask,
        "device": "cpu",
        "friction": 0.3,
        "shape": "ball",
        "kind": Elastic,
        "damping": "mass",
    }
    names = judge.__code__.co_varnames[: judge.__code__.co_argcount]
    sides = list(test_capabilities.Side) if "side" in names else [None]
    for side in sides:
        judge(**{name: side if name == "side" else given[name] for name in names})


CANNOT_TELL = {
    # What needs no force.
    "test_sand_bears_no_tension",
    "test_fluid_bears_no_tension",
    "test_domain_expands",
    "test_bodies_part",
    "test_float32",
    "test_float64",
    "test_checkpoints",
    "test_tracer_positions",
    "test_velocities",
    # What it shows on its device is what it reads out, right or wrong.
    *(f"test_view_of_{name}" for name in ("positions", "velocities", "deformation_gradients")),
    "test_device_indices",
    # And straight flight turns about nothing.
    "test_angular_momentum",
}


@pytest.mark.parametrize("name", sorted(set(judges()) - CANNOT_TELL))
def test_an_engine_that_declares_everything_and_only_flies_fails(name: str, ledger: Ledger) -> None:
    with pytest.raises(AssertionError):
        run_judge(judges()[name], Flyer(EVERYTHING).subject(), ledger)


@pytest.mark.parametrize("name", sorted(CANNOT_TELL))
def test_what_needs_no_force_passes_by_flight(name: str, ledger: Ledger) -> None:
    run_judge(judges()[name], Flyer(EVERYTHING).subject(), ledger)


@pytest.mark.parametrize(
    "name", sorted(set(judges()) - {"test_velocities", "test_linear_momentum", "test_float64", "test_domain_expands"})
)
def test_what_is_not_declared_is_left_out(name: str, ledger: Ledger) -> None:
    nothing = replace(LITTLE, materials=frozenset({Unobtainium}), conserved=frozenset(), precisions=())
    with pytest.raises(Undeclared):
        run_judge(judges()[name], Flyer(nothing).subject(), ledger)


class Unobtainium(Material):
    kind = "unobtainium"


def test_every_declaration_has_a_check_that_is_called_after_it() -> None:
    marks = [mark for judge in judges().values() for mark in judge.pytestmark if mark.name == "gasp_check"]
    names = {base_name(mark.args[0].name) for mark in marks}
    assert names == test_capabilities.SHOWN - {"field:positions"}
    assert set(declared(EVERYTHING, Precision.FLOAT64)) - {"device:cpu"} <= names


def test_what_has_no_check_fails_by_name() -> None:
    with pytest.raises(AssertionError, match="no check for material:unobtainium yet"):
        test_capabilities.test_declared_without_a_check(Flyer().subject(), "material:unobtainium")


# Engines of one degree of freedom, or six, that are right.


def plate_mode(problem: PointProblem) -> tuple[np.ndarray, float, float]:
    """Lame's mode of a plate a metre wide, the speed it is thrown with in it, and its angular frequency."""
    points, (material,) = problem.points, problem.materials
    low, high = points.reference_positions.min(axis=0), points.reference_positions.max(axis=0)
    margin = (1.0 - (high[0] - low[0])) / 2
    shape = exact.lame_shape(points.reference_positions - (low - margin), 1.0)
    speed = float((points.initial_velocities * shape).sum() / (shape**2).sum())
    return shape, speed, 2 * math.pi * exact.lame_frequency(1.0, material.shear_modulus, material.density)


def yielding(strength: float) -> Place:
    """Lame's mode as an oscillator that yields at `strength` times what its material says."""

    def place(problem: PointProblem, time: float) -> np.ndarray:
        shape, speed, omega = plate_mode(problem)
        (material,) = problem.materials
        limit = strength * exact.von_mises_yield_strain(material.yield_stress, material.shear_modulus) / math.pi
        moved, plastic = 0.0, 0.0
        for _ in range(steps := max(1, math.ceil(time * omega / 0.02))):
            speed -= omega**2 * (moved - plastic) * time / steps
            moved += speed * time / steps
            plastic = min(max(plastic, moved - limit), moved + limit)
        return problem.points.reference_positions + moved * shape

    return place


KINDS = ["test_metal", "test_plasticine", "test_foam"]


@pytest.mark.parametrize("name", KINDS)
def test_what_yields_at_its_stress_passes(name: str, ledger: Ledger) -> None:
    run_judge(judges()[name], Flyer(EVERYTHING, yielding(1.0)).subject(), ledger)


@pytest.mark.parametrize("strength", [0.1, 100.0], ids=["far too weak", "does not yield"])
@pytest.mark.parametrize("name", KINDS)
def test_what_yields_elsewhere_fails(name: str, strength: float, ledger: Ledger) -> None:
    with pytest.raises(AssertionError, match="yield"):
        run_judge(judges()[name], Flyer(EVERYTHING, yielding(strength)).subject(), ledger)


@dataclass(frozen=True, kw_only=True)
class BarAndCaps:
    """A bar of matter between heavy caps as one mass on a spring: its length, its cross-section, the reduced mass of
    the caps and the bar, the speed of one cap from the other, and how much of their way each point goes."""

    length: float
    area: float
    mass: float
    speed: float
    share: np.ndarray

    @classmethod
    def of(cls, problem: PointProblem) -> BarAndCaps:
        points = problem.points
        x = points.reference_positions[:, 0]
        bar = points.material_ids == 0
        low, high = x[~bar & (x < x[bar].min())].max(), x[~bar & (x > x[bar].max())].min()
        # A layer of points stands for as much of the bar as lies between two of them.
        layer = np.unique(x)[1] - np.unique(x)[0]
        length = high - low - layer
        speed = float(np.ptp(points.initial_velocities[:, 0]))
        return cls(
            length=length,
            area=points.reference_volumes[bar].sum() / length,
            mass=problem.masses[~bar].sum() / 4 + problem.masses[bar].sum() / 12,
            speed=speed * float(np.sign(points.initial_velocities[np.argmax(x), 0])),
            share=np.clip((x - low - layer / 2) / length, 0, 1) - 0.5,
        )

    def place(self, problem: PointProblem, time: float, modulus: float, stress: Callable[[float, float], float]) -> Any:
        """Where points are at `time` [s]; `stress` is the force per area at rest [Pa] of a stretch, after a step."""
        speed, gap = self.speed, 0.0
        pulse = math.sqrt(modulus * self.area / self.length / self.mass)
        steps = max(1, math.ceil(time * pulse / 0.01))
        for _ in range(steps):
            speed -= stress(1 + gap / self.length, time / steps) * self.area / self.mass * time / steps
            gap += speed * time / steps
        return problem.points.reference_positions + gap * self.share[:, None] * np.array([1.0, 0.0, 0.0])


def evenly(change: Callable[[Snow], Snow]) -> Place:
    """Caps on a bar of snow that yields, the snow being what `change` makes of it."""

    def place(problem: PointProblem, time: float) -> np.ndarray:
        snow = change(problem.materials[0])
        modulus = snow.lame_lambda + 2 * snow.shear_modulus if problem.colliders else snow.youngs_modulus
        plastic = 1.0

        def stress(stretch: float, _: float) -> float:
            nonlocal plastic
            elastic = stretch / plastic
            held = min(max(elastic, 1 - snow.critical_compression), 1 + snow.critical_stretch)
            plastic *= elastic / held
            return math.exp(snow.hardening * (1 - plastic)) * modulus * (held - 1) / plastic

        return BarAndCaps.of(problem).place(problem, time, modulus, stress)

    return place


SNOWS = ["test_snow_is_compacted_and_hardens", "test_confined_snow_is_compacted_and_hardens", "test_snow_tears"]
PRESSES = SNOWS[:2]


@pytest.mark.parametrize("name", SNOWS)
def test_snow_of_its_law_passes(name: str, ledger: Ledger, figures: list[Figure]) -> None:
    run_judge(judges()[name], Flyer(EVERYTHING, evenly(lambda snow: snow)).subject(), ledger)
    # The closed forms are all there is to it here: 50 frames a period miss the top of a swing by (pi / 50)^2 / 2.
    off = {figure.figure: figure.value for figure in figures if figure.sense == "<="}
    assert all(abs(value) < 2e-3 for value in off.values()), off


WRONG_SNOW = {
    "no hardening": (lambda snow: replace(snow, hardening=0.0), SNOWS),
    "no set": (lambda snow: replace(snow, critical_compression=0.9, critical_stretch=9.0), SNOWS),
    "hardens half as much": (lambda snow: replace(snow, hardening=snow.hardening / 2), PRESSES),
    "yields at twice its compression": (
        lambda snow: replace(snow, critical_compression=2 * snow.critical_compression),
        PRESSES,
    ),
    "tears at half its stretch": (
        lambda snow: replace(snow, critical_stretch=snow.critical_stretch / 2),
        ["test_snow_tears"],
    ),
    "a quarter too stiff": (lambda snow: replace(snow, youngs_modulus=1.25 * snow.youngs_modulus), PRESSES),
}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        pytest.param(name, change, id=f"{what}, {name}")
        for what, (change, names) in WRONG_SNOW.items()
        for name in names
    ],
)
@pytest.mark.thorough
def test_snow_of_another_law_fails(name: str, change: Callable[[Snow], Snow], ledger: Ledger) -> None:
    with pytest.raises(AssertionError, match="snow"):
        run_judge(judges()[name], Flyer(EVERYTHING, evenly(change)).subject(), ledger)


@pytest.mark.parametrize("name", ["test_snow_is_elastic_within_its_box", *SNOWS])
def test_snow_that_stands_still_or_is_nowhere_fails(name: str, ledger: Ledger) -> None:
    def still(problem: PointProblem, time: float) -> np.ndarray:
        return problem.points.reference_positions

    def flung(problem: PointProblem, time: float) -> np.ndarray:
        return straight(problem, time + (10 * time) ** 4)

    for place in (still, flung):
        with pytest.raises(AssertionError, match="snow"):
            run_judge(judges()[name], Flyer(EVERYTHING, place).subject(), ledger)


def flowing(change: Callable[[Any], Any]) -> Place:
    """Caps on a bar between walls, and Lame's mode of a plate, the matter being what `change` makes of it."""

    def place(problem: PointProblem, time: float) -> np.ndarray:
        material = change(problem.materials[0])
        mu = material.shear_modulus
        if not problem.colliders:
            return relaxing_plate(problem, time, getattr(material, "plastic_viscosity", math.inf) / (2 * mu))
        bulk = material.lame_lambda + 2 / 3 * mu
        flowed, plastic = 0.0, 0.0

        def stress(stretch: float, step: float) -> float:
            nonlocal flowed, plastic
            strain = math.log(stretch)
            trial = 2 * mu * (strain - 1.5 * plastic)
            flow = flow_of(material, abs(trial), flowed, step)
            flowed += flow
            plastic += math.copysign(flow, trial)
            return (bulk * strain + 2 / 3 * 2 * mu * (strain - 1.5 * plastic)) / stretch

        return BarAndCaps.of(problem).place(problem, time, bulk + 4 / 3 * mu, stress)

    return place


def flow_of(material: Any, trial: float, flowed: float, step: float) -> float:
    """Plastic strain of a step that begins with `flowed` and would end at an equivalent stress of `trial`."""
    mu, strength = material.shear_modulus, material.yield_stress
    if isinstance(material, Elastic):
        return 0.0
    if isinstance(material, Foam):
        rate = 2 / 3 / material.plastic_viscosity if material.plastic_viscosity else math.inf
        share = 1 / (1 / (rate * step) + 3 * mu)
        return max(0.0, trial - strength) * share
    hardening = -material.softening * strength if isinstance(material, Plasticine) else material.hardening
    residual = material.residual * strength if isinstance(material, Plasticine) else 0.0
    on_line = (trial - strength - hardening * flowed) / (3 * mu + hardening)
    return max(0.0, min(on_line, (trial - residual) / (3 * mu)))


def relaxing_plate(problem: PointProblem, time: float, relaxation: float) -> np.ndarray:
    """Lame's mode as an oscillator whose spring relaxes."""
    shape, speed, omega = plate_mode(problem)
    moved, elastic = 0.0, 0.0
    steps = max(1, math.ceil(time * omega / 2e-3))
    for _ in range(steps):
        speed -= omega**2 * elastic * time / steps
        moved += speed * time / steps
        elastic = (elastic + speed * time / steps) / (1 + time / steps / relaxation) if relaxation else 0.0
    return problem.points.reference_positions + moved * shape


FLOWS = ["test_metal_hardens", "test_plasticine_softens", "test_foam_relaxes"]


@pytest.mark.parametrize("name", FLOWS)
def test_what_flows_by_its_law_passes(name: str, ledger: Ledger, figures: list[Figure]) -> None:
    run_judge(judges()[name], Flyer(EVERYTHING, flowing(lambda material: material)).subject(), ledger)
    # The closed forms are all there is to it here: symplectic Euler is ahead by half a step, which is 0.01 / w at most.
    off = {(figure.case, figure.figure): figure.value for figure in figures}
    assert all(abs(value) < 5e-3 for value in off.values()), off


def as_metal(hardening: float) -> Callable[[Any], Material]:
    def change(given: Any) -> Material:
        return Metal(
            density=given.density,
            youngs_modulus=given.youngs_modulus,
            poissons_ratio=given.poissons_ratio,
            yield_stress=given.yield_stress,
            hardening=hardening,
        )

    return change


def as_softening(softening: float, residual: float) -> Callable[[Any], Material]:
    def change(given: Any) -> Material:
        return Plasticine(
            density=given.density,
            youngs_modulus=given.youngs_modulus,
            poissons_ratio=given.poissons_ratio,
            yield_stress=given.yield_stress,
            softening=softening,
            residual=residual,
        )

    return change


WRONG_FLOW = {
    "metal that does not harden": (as_metal(0.0), "test_metal_hardens"),
    "metal that hardens as much whatever is said": (as_metal(2e4), "test_metal_hardens"),
    "metal that softens": (as_softening(10.0, 0.1), "test_metal_hardens"),
    "metal that yields at a length of its deviator": (
        lambda given: replace(given, yield_stress=math.sqrt(3 / 2) * given.yield_stress),
        "test_metal_hardens",
    ),
    "metal that yields by the root of 2/3 too early": (
        lambda given: replace(given, yield_stress=math.sqrt(2 / 3) * given.yield_stress),
        "test_metal_hardens",
    ),
    "plasticine that does not soften": (as_metal(0.0), "test_plasticine_softens"),
    "plasticine that softens half as much": (
        lambda given: replace(given, softening=given.softening / 2),
        "test_plasticine_softens",
    ),
    "plasticine that keeps nothing": (lambda given: replace(given, residual=1e-3), "test_plasticine_softens"),
    "plasticine that keeps half as much": (
        lambda given: replace(given, residual=given.residual / 2),
        "test_plasticine_softens",
    ),
    "foam that flows at once": (lambda given: replace(given, plastic_viscosity=0.0), "test_foam_relaxes"),
    "foam that flows twice as fast": (
        lambda given: replace(given, plastic_viscosity=given.plastic_viscosity / 2),
        "test_foam_relaxes",
    ),
    "foam that flows half as fast": (
        lambda given: replace(given, plastic_viscosity=2 * given.plastic_viscosity),
        "test_foam_relaxes",
    ),
    "foam that has no yield stress": (
        lambda given: replace(given, yield_stress=1e-3 * given.yield_stress),
        "test_foam_relaxes",
    ),
    "foam that is elastic": (
        lambda given: Elastic(
            density=given.density, youngs_modulus=given.youngs_modulus, poissons_ratio=given.poissons_ratio
        ),
        "test_foam_relaxes",
    ),
}


@pytest.mark.parametrize(("change", "name"), WRONG_FLOW.values(), ids=WRONG_FLOW)
@pytest.mark.thorough
def test_what_flows_by_another_law_fails(change: Callable[[Any], Any], name: str, ledger: Ledger) -> None:
    def unless_unyielding(given: Any) -> Any:
        return given if given.yield_stress == given.youngs_modulus else change(given)

    with pytest.raises(AssertionError, match=r"work lost|relaxation time"):
        run_judge(judges()[name], Flyer(EVERYTHING, flowing(unless_unyielding)).subject(), ledger)


@pytest.mark.parametrize("name", FLOWS)
def test_what_should_flow_and_stands_still_or_is_nowhere_fails(name: str, ledger: Ledger) -> None:
    def still(problem: PointProblem, time: float) -> np.ndarray:
        return problem.points.reference_positions

    def flung(problem: PointProblem, time: float) -> np.ndarray:
        return straight(problem, time + (10 * time) ** 4)

    for place in (still, flung):
        with pytest.raises(AssertionError, match=r"metal|plasticine|foam"):
            run_judge(judges()[name], Flyer(EVERYTHING, place).subject(), ledger)


def test_a_rigid_body_passes(ledger: Ledger) -> None:
    def place(problem: PointProblem, time: float) -> np.ndarray:
        points = problem.points
        center, velocity = points.reference_positions.mean(axis=0), points.initial_velocities.mean(axis=0)
        arm, relative = points.reference_positions - center, points.initial_velocities - velocity
        spin = np.array([0, 0, np.sum(arm[:, 0] * relative[:, 1]) / np.sum(arm[:, 0] ** 2)])
        return exact.rigid_motion(points.reference_positions, center, velocity, spin, time)

    run_judge(judges()["test_rigid"], Flyer(EVERYTHING, place).subject(), ledger)


def test_tracers_that_turn_with_their_block_pass(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(self: Flight, _: frozenset[Field]) -> PointState:
        points = self.problem.points
        center, velocity = points.reference_positions.mean(axis=0), points.initial_velocities.mean(axis=0)
        arm, relative = points.reference_positions - center, points.initial_velocities - velocity
        # relative = spin x arm, by least squares.
        crossed = np.concatenate([np.cross(np.eye(3), one).T for one in arm])
        spin = np.linalg.lstsq(crossed, relative.ravel(), rcond=None)[0]
        places = exact.rigid_motion(points.tracer_positions, center, velocity, spin, self.time)
        return PointState(time=self.time, positions=points.reference_positions, tracer_positions=places)

    monkeypatch.setattr(Flight, "read", read)
    run_judge(judges()["test_tracers"], Flyer(EVERYTHING).subject(), ledger)


# --- specimens and closed forms -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", MATERIALS.values(), ids=MATERIALS)
def test_there_is_a_specimen_of_every_material(kind: type[Material]) -> None:
    assert specimens.specimen(kind).density == 1000.0


def test_the_plainest_material_is_elastic() -> None:
    assert specimens.plain_material(EVERYTHING).kind == "elastic"
    assert specimens.plain_material(replace(EVERYTHING, materials=frozenset({Metal}))).kind == "metal"


def strains(shape: Callable[[np.ndarray], np.ndarray], places: np.ndarray, h: float = 1e-5) -> np.ndarray:
    """Symmetric gradients (N, 3, 3) of a displacement field, by central differences."""
    steps = h * np.eye(3)
    gradient = np.stack([(shape(places + step) - shape(places - step)) / (2 * h) for step in steps], axis=2)
    return (gradient + gradient.transpose(0, 2, 1)) / 2


def quadrature(side: float, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points (N, 3) and weights (N,) of a square."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x, y = np.meshgrid((nodes + 1) * side / 2, (nodes + 1) * side / 2, indexing="ij")
    places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return places, np.outer(weights, weights).ravel() * (side / 2) ** 2


def test_lames_mode_has_no_traction_and_the_frequency_of_its_energies() -> None:
    side, mu, rho = 1.3, 8e3, 700.0

    def shape(places: np.ndarray) -> np.ndarray:
        return exact.lame_shape(places, side)

    places, weights = quadrature(side)
    strain = strains(shape, places)
    np.testing.assert_allclose(np.trace(strain, axis1=1, axis2=2), 0, atol=1e-9)
    # Rayleigh's quotient: elastic energy 2 mu |e|^2 over rho u^2.
    elastic = weights @ (2 * mu * np.sum(strain**2, axis=(1, 2)))
    kinetic = weights @ (rho * np.sum(shape(places) ** 2, axis=1))
    omega = math.sqrt(elastic / kinetic)
    assert omega / (2 * math.pi) == pytest.approx(exact.lame_frequency(side, mu, rho), rel=1e-8)
    # Viscous dissipation 2 eta |D|^2 over twice the kinetic energy.
    eta = 5.0
    decay = weights @ (2 * eta * np.sum(strain**2, axis=(1, 2))) / kinetic
    assert decay == pytest.approx(exact.lame_viscous_decay(side, eta, rho), rel=1e-8)
    edge = np.linspace(0, side, 11)
    for fixed in (0.0, side):
        wall = np.stack([np.full_like(edge, fixed), edge, 0 * edge], axis=1)
        np.testing.assert_allclose(strains(shape, wall)[:, 0], 0, atol=1e-8)
        np.testing.assert_allclose(strains(shape, wall[:, [1, 0, 2]])[:, 1], 0, atol=1e-8)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_the_breathing_ball_is_that_of_its_energies(nu: float) -> None:
    radius, rho = 0.5, 700.0
    material = Elastic(density=rho, youngs_modulus=2.3e4, poissons_ratio=nu)
    mu, lame = material.shear_modulus, material.lame_lambda
    # Linear elements in r: strains u', u/r, u/r; u(0) = 0.
    count = 400
    r = np.linspace(0, radius, count + 1)
    stiffness, mass = np.zeros((count + 1,) * 2), np.zeros((count + 1,) * 2)
    for left in range(count):
        h = r[left + 1] - r[left]
        for node in (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6):
            middle = r[left] + node * h
            value, slope = np.array([1 - node, node]), np.array([-1, 1]) / h
            swell = slope + 2 * value / middle
            energy = lame * np.outer(swell, swell) + 2 * mu * (
                np.outer(slope, slope) + 2 * np.outer(value, value) / middle**2
            )
            rows = slice(left, left + 2)
            stiffness[rows, rows] += energy * middle**2 * h / 2
            mass[rows, rows] += rho * np.outer(value, value) * middle**2 * h / 2
    squares, modes = eigh(stiffness[1:, 1:], mass[1:, 1:], subset_by_index=[0, 0])
    frequency, root = exact.radial_frequency(radius, mu, lame, rho)
    assert math.sqrt(squares[0]) / (2 * math.pi) == pytest.approx(frequency, rel=1e-4)
    places = np.stack([r[1:], 0 * r[1:], 0 * r[1:]], axis=1)
    expected = exact.radial_shape(places, radius, root)[:, 0]
    np.testing.assert_allclose(modes[:, 0] / modes[-1, 0], expected / expected[-1], atol=1e-4)


def test_the_large_wave_is_linear_where_its_law_is_and_solves_its_equation_where_not() -> None:
    speed, places = 5.7, np.linspace(0.02, 0.98, 49)
    linear = exact.large_wave(lambda stretch: stretch - 1, speed, places, 0.1, 0.3 / speed)
    closed = 0.1 * np.cos(math.pi * places) * math.sin(0.3 * math.pi)
    # Second order in 1/400, and the interpolation between masses.
    np.testing.assert_allclose(linear, closed, atol=1e-5)

    def law(stretch: np.ndarray) -> np.ndarray:
        return (stretch - 1 / stretch) / 2

    # Chebyshev collocation of x_tt = c^2 P(x_X)_X, P = 0 at the ends: nothing in common with masses and springs.
    count = 24
    theta = math.pi * np.arange(count + 1) / count
    x = np.cos(theta)
    scale = np.array([2.0, *[1.0] * (count - 1), 2.0]) * (-1.0) ** np.arange(count + 1)
    spread = x[:, None] - x[None, :] + np.eye(count + 1)
    derivative = np.outer(scale, 1 / scale) / spread
    derivative -= np.diag(derivative.sum(axis=1))
    derivative *= -2  # of X = (1 - x) / 2
    at = (1 - x) / 2

    def motion(_: float, state: np.ndarray) -> np.ndarray:
        stress = law(1 + derivative @ state[: count + 1])
        stress[[0, -1]] = 0
        return np.concatenate([state[count + 1 :], speed**2 * derivative @ stress])

    start = np.concatenate([np.zeros(count + 1), math.pi * 0.1 * speed * np.cos(math.pi * at)])
    run = solve_ivp(motion, (0, 0.5 / speed), start, rtol=1e-8, atol=1e-10)
    found = exact.large_wave(law, speed, at[1:-1], 0.1, 0.5 / speed)
    # Interpolation at the ends is flat within half a cell.
    np.testing.assert_allclose(found, run.y[1:count, -1], atol=5e-4)


def test_sands_friction_is_that_of_the_cone_it_is_fitted_to() -> None:
    # Simple shear tau under pressure p: q^2 = 3/2 dev : dev = 3 tau^2.
    shear = np.array([[0, 1.0, 0], [1.0, 0, 0], [0, 0, 0]])
    q = math.sqrt(1.5 * float(np.sum(shear**2)))
    for angle in (10.0, 40.0):
        sine = math.sin(math.radians(angle))
        # Mohr and Coulomb: (s1 - s3) / (s1 + s3) = sin phi, the third stress being the least, or the mean.
        s1, s3 = 1 + sine, 1 - sine
        for cone, s2 in ((FrictionCone.TRIAXIAL_COMPRESSION, s3), (FrictionCone.PLANE_STRAIN, 1.0)):
            stresses = np.array([s1, s2, s3])
            pressure = stresses.mean()
            slope = math.sqrt(1.5) * np.linalg.norm(stresses - pressure) / pressure
            assert exact.drucker_prager_friction(angle, cone) == pytest.approx(slope / q, rel=1e-12)
        assert exact.drucker_prager_friction(angle) == pytest.approx(math.tan(math.radians(angle)), rel=1e-12)


def test_yield_strain_is_where_von_mises_stress_is_the_yield_stress() -> None:
    mu, yield_stress = 8e3, 100.0
    e = exact.von_mises_yield_strain(yield_stress, mu)
    s = 2 * mu * np.diag([-e, e, 0])
    squares = (s[0, 0] - s[1, 1]) ** 2 + (s[1, 1] - s[2, 2]) ** 2 + (s[2, 2] - s[0, 0]) ** 2
    assert math.sqrt(squares / 2) == pytest.approx(yield_stress, rel=1e-12)


def snow_stress(snow: Snow, elastic: np.ndarray, plastic: np.ndarray) -> float:
    """Along x: dPsi/dF = h(J_P) dPsi_0/dF_E F_P^-T, with dPsi_0/dF_E by central differences of the energy."""

    def energy(deformation: np.ndarray) -> float:
        left, stretches, right = np.linalg.svd(deformation)
        mismatch, swell = deformation - left @ right, np.prod(stretches) - 1
        return snow.shear_modulus * float((mismatch**2).sum()) + snow.lame_lambda / 2 * swell**2

    h = 1e-6
    nudges = [h * np.outer(np.eye(3)[0], axis) for axis in np.eye(3)]
    row = np.array([energy(elastic + nudge) - energy(elastic - nudge) for nudge in nudges]) / (2 * h)
    hardened = math.exp(snow.hardening * (1 - np.linalg.det(plastic)))
    return float(hardened * (row @ np.linalg.inv(plastic).T)[0])


def pressed_work(snow: Snow, end: float, steps: int) -> tuple[float, float]:
    """Work, per volume at rest, of stretching snow along x to `end`, and the J_P it has then.

    The law as it is written down, in three dimensions and small steps: trial, box, remainder to F_P.
    """
    plastic, work, before = np.eye(3), 0.0, 0.0
    for number in range(1, steps + 1):
        total = np.diag([1 + (end - 1) * number / steps, 1.0, 1.0])
        left, stretches, right = np.linalg.svd(total @ np.linalg.inv(plastic))
        elastic = left @ np.diag(np.clip(stretches, 1 - snow.critical_compression, 1 + snow.critical_stretch)) @ right
        plastic = np.linalg.inv(elastic) @ total
        now = snow_stress(snow, elastic, plastic)
        work += (before + now) / 2 * (end - 1) / steps
        before = now
    return work, float(np.linalg.det(plastic))


@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.parametrize("hardening", [0.0, 6.0])
def test_the_work_on_snow_is_that_of_its_law_in_small_steps(nu: float, hardening: float) -> None:
    # With nu = 0 what holds the sides has nothing to hold: a free bar and a confined one are the same.
    snow = Snow(
        density=400.0,
        youngs_modulus=2e4,
        poissons_ratio=nu,
        critical_compression=0.05,
        critical_stretch=0.02,
        hardening=hardening,
    )
    modulus = snow.lame_lambda + 2 * snow.shear_modulus
    # Of a trapezium the kink at yield may leave half a step by the stress that a step adds: 1e-8 of the modulus, and of
    # the rest less. Differences of energies are good to 1e-9.
    work, ratio = pressed_work(snow, 0.86 * 0.95, 2000)
    assert ratio == pytest.approx(0.86, rel=1e-9)
    closed = exact.snow_pressing_work(ratio, 0.05, hardening)
    assert closed == pytest.approx(work / modulus, abs=1e-7)
    assert exact.snow_volume_ratio(closed, 0.05, hardening) == pytest.approx(ratio, rel=1e-9)
    if hardening > 0:
        # Beyond J_P = 3 there is less than exp(-12) / 18 of the modulus to come. Steps are twelve times as long.
        work, ratio = pressed_work(snow, 3.06, 2000)
        assert ratio == pytest.approx(3.0, rel=1e-9)
        assert exact.snow_tearing_work(0.02, hardening) == pytest.approx(work / modulus, abs=2e-6)


def test_snow_that_does_not_yield_keeps_its_volume_and_no_work_presses_it_to_nothing() -> None:
    assert exact.snow_volume_ratio(0.05**2 / 2 * 0.999, 0.05, 6.0) == 1.0
    assert exact.snow_volume_ratio(0.05**2 / 2 * 1.001, 0.05, 6.0) < 1.0
    assert exact.snow_volume_ratio(1e9, 0.05, 6.0) == pytest.approx(1e-3)
    # Where the limit of no hardening is a logarithm.
    assert exact.snow_pressing_work(0.8, 0.05, 1e-7) == pytest.approx(
        exact.snow_pressing_work(0.8, 0.05, 0.0), rel=1e-6
    )


def test_pressed_snow_is_a_spring_of_the_stiffness_that_is_said() -> None:
    snow = Snow(density=400.0, youngs_modulus=2e4, poissons_ratio=0.3, hardening=6.0)
    modulus, ratio, strain = snow.lame_lambda + 2 * snow.shear_modulus, 0.86, 1e-3
    plastic = np.diag([ratio, 1.0, 1.0])
    pulled, pushed = (snow_stress(snow, np.diag([1 + e, 1.0, 1.0]), plastic) for e in (strain, -strain))
    # dF is J_P dF_E, and the stress linear in F.
    found = (pulled - pushed) / (2 * strain * ratio)
    assert found == pytest.approx(exact.snow_stiffening(ratio, 6.0) * modulus / ratio**2, rel=1e-6)


def sheared_work(material: Any, start: float, end: float, flow: np.ndarray, steps: int) -> tuple[float, np.ndarray]:
    """Work, per volume at rest, from one logarithm of the stretch along x to another, the sides held.

    The law as it is written down, in three dimensions and small steps: trial, length of the deviator, radial return.
    `flow` are the plastic strains along the axes and p; given as they are at the start, returned as at the end.
    """
    mu, lame = material.shear_modulus, material.lame_lambda
    work, before = 0.0, None
    for total in np.linspace(start, end, steps + 1):
        strain = np.array([total, 0.0, 0.0]) - flow[:3]
        deviator = 2 * mu * (strain - strain.mean())
        size = float(np.linalg.norm(deviator))
        slip = math.sqrt(3 / 2) * flow_of(material, math.sqrt(3 / 2) * size, float(flow[3]), math.inf)
        if slip > 0:
            flow = flow + [*(slip * deviator / size), math.sqrt(2 / 3) * slip]
            strain = np.array([total, 0.0, 0.0]) - flow[:3]
        now = 2 * mu * strain[0] + lame * strain.sum()
        work += 0.0 if before is None else (before + now) / 2 * (end - start) / steps
        before = now
    return work, flow


@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.parametrize(
    "law",
    [
        Metal(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0, yield_stress=0.02),
        Metal(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0, yield_stress=0.02, hardening=0.3),
        Plasticine(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0, yield_stress=0.05, softening=6, residual=0.4),
        # Still on its way to the residual where it turns.
        Plasticine(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0, yield_stress=0.05, softening=3, residual=0.4),
    ],
    ids=["perfect", "hardening", "softened", "softening"],
)
def test_a_bar_turns_where_its_law_in_small_steps_has_done_the_work(law: Any, nu: float) -> None:
    material = replace(law, poissons_ratio=nu)
    mu = material.shear_modulus
    bulk, strength = material.lame_lambda + 2 / 3 * mu, material.yield_stress
    slope, residual = getattr(material, "hardening", 0.0), strength
    if isinstance(material, Plasticine):
        slope, residual = -material.softening * strength, material.residual * strength
    turns = exact.turns_of_a_yielding_bar(0.01, bulk, mu, strength, slope, residual)
    work, flow = sheared_work(material, 0.0, -turns.pressed, np.zeros(4), 4000)
    # Kinks leave a trapezium half a step of 5e-5 times what the stress of a step is, a modulus of 1 times 5e-5.
    assert work == pytest.approx(0.01, abs=1e-8)
    back, _ = sheared_work(material, -turns.pressed, turns.stretched, flow, 8000)
    assert back == pytest.approx(0.0, abs=1e-8)


def test_a_viscoplastic_bar_is_between_one_that_flows_at_once_and_one_that_does_not() -> None:
    bulk, mu, strength, mass = 1 / 3, 1 / 2, 0.02, 7.0
    at_once = exact.turns_of_a_yielding_bar(0.01, bulk, mu, strength, 0.0, strength)
    # The overstress is eta times the rate, 0.14 / sqrt(7) at most: 3e-5 of the yield stress.
    found = exact.turns_of_a_viscoplastic_bar(0.01, bulk, mu, strength, 1e-5, mass)
    assert found.pressed == pytest.approx(at_once.pressed, rel=1e-4)
    assert found.stretched == pytest.approx(at_once.stretched, rel=1e-3)
    # In the 15 s that it takes, 2 mu / eta of the stress flows off a second: 1.5e-5 in all.
    found = exact.turns_of_a_viscoplastic_bar(0.01, bulk, mu, strength, 1e6, mass)
    assert found.pressed == pytest.approx(math.sqrt(0.02), rel=1e-4)
    assert found.stretched == pytest.approx(math.sqrt(0.02), rel=1e-4)


@pytest.mark.parametrize("relaxation", [0.02, 0.3, 5.0], ids=["creeps", "swings", "hardly relaxes"])
def test_lames_mode_relaxes_as_its_equation_says(relaxation: float) -> None:
    omega, times = 7.0, np.linspace(0.01, 2, 30)

    def motion(_: float, state: np.ndarray) -> np.ndarray:
        _, speed, elastic = state
        return np.array([speed, -(omega**2) * elastic, speed - elastic / relaxation])

    run = solve_ivp(motion, (0, 2), [0, 1, 0], t_eval=times, rtol=1e-10, atol=1e-12, method="LSODA")
    np.testing.assert_allclose(
        exact.lame_relaxing(times, omega / (2 * math.pi), relaxation), run.y[0], rtol=1e-6, atol=1e-9
    )


def test_wind_and_rigid_motion_solve_their_equations() -> None:
    velocity, air, drag = np.array([0.1, 0.4, -0.3]), np.array([1.0, -0.6, 0.5]), 3.0

    def blown(_: float, state: np.ndarray) -> np.ndarray:
        return np.concatenate([state[3:], drag * (air - state[3:])])

    run = solve_ivp(blown, (0, 0.4), np.concatenate([np.zeros(3), velocity]), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run.y[:3, -1], exact.carried_by_wind(velocity, air, drag, 0.4), rtol=1e-8)

    places = np.random.default_rng(1).normal(size=(5, 3))
    center, spin = np.array([0.2, -0.1, 0.4]), np.array([0.4, -0.8, 1.6])
    turned = Rotation.from_rotvec(spin * 0.7).apply(places - center) + center + velocity * 0.7
    np.testing.assert_allclose(exact.rigid_motion(places, center, velocity, spin, 0.7), turned, atol=1e-14)
    np.testing.assert_allclose(exact.rigid_motion(places, center, velocity, np.zeros(3), 0.0), places, atol=1e-15)


def test_no_source_of_these_checks_names_an_engine() -> None:
    folder = Path(test_core.__file__).parent
    for name in (
        "core_cases",
        "elsewhere",
        "forcing_cases",
        "material_cases",
        "plugin_imports",
        "readout_cases",
        "wall_cases",
    ):
        assert not re.search(
            r"taichi|reference.mpm|warp|mujoco|genesis|blender", (folder / f"{name}.py").read_text(), re.I
        )
