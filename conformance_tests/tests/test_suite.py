"""The suite as pytest runs it, on engines made for the purpose: a right one, a wrong one, one that can do little.

What is asked of the frame alone is asked with checks made for the purpose, too.
"""

from __future__ import annotations

import importlib.metadata
import pkgutil
import sys
import textwrap
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import gasp_conformance
import numpy as np
import pytest
from gasp_conformance import collection, deviations, subject
from gasp_conformance.checks import Level
from gasp_conformance.deviations import read_deviations
from gasp_conformance.matrix import Column
from gasp_conformance.report import Outcome, Report, VerdictOutcome, read_report

from gasp_core.contract import (
    Determinism,
    Elastic,
    EngineAccuracy,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    PointProblem,
    PointState,
    Precision,
    Quantity,
    Status,
    StepReport,
)
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.discovery.plugins import FoundPlugin, installed_plugins
from gasp_core.discovery.registry import Registry, discover

pytest_plugins = ["pytester"]

# A nested run forgets the modules it was first to import, and compiled ones cannot be imported twice: import them here.
HELPERS = [
    import_module(f"gasp_conformance.{module.name}")
    for module in pkgutil.iter_modules(gasp_conformance.__path__)
    if not module.name.startswith(("test_", "__"))
]

STEP = 1e-3


class Ballistic:
    """Free flight of every point for itself, as symplectic Euler does it; `gravity_factor` makes it wrong."""

    def __init__(self, gravity_factor: float = 1.0, status: Status = Status.OK) -> None:
        self.gravity_factor = gravity_factor
        self.status = status

    def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, **_: Any) -> BallisticSession:
        return BallisticSession(problem, self.gravity_factor, self.status)


class BallisticSession:
    def __init__(self, problem: PointProblem, gravity_factor: float, status: Status) -> None:
        self.time = 0.0
        self.problem = problem
        self.status = status
        self.gravity = np.array(problem.gravity) * gravity_factor

    def advance_to(self, time: float) -> StepReport:
        count = round((time - self.time) / STEP)
        self.time = time
        return StepReport(
            status=self.status,
            substep_count=count,
            smallest_substep=STEP,
            largest_substep=STEP,
            warnings=() if self.status is Status.OK else ("it was not to be",),
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        points, time = self.problem.points, self.time
        fall = self.gravity * time * (time + STEP) / 2
        return PointState(
            time=time,
            positions=points.reference_positions + points.initial_velocities * time + fall,
            velocities=points.initial_velocities + self.gravity * time,
        )

    def close(self) -> None: ...

    def __enter__(self) -> BallisticSession:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def shelf() -> ModuleType:
    """A plugin module that offers these engines."""
    module = ModuleType("shelf")
    engines = {
        "right": Ballistic(),
        "light": Ballistic(gravity_factor=0.9),
        "lost": Ballistic(status=Status.NON_FINITE),
    }
    capabilities = EngineCapabilities(
        materials=frozenset({Elastic}),
        collider_shapes=frozenset(),
        contact_conditions=frozenset(),
        drives=frozenset(),
        force_fields=frozenset(),
        output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
        conserved=frozenset({Quantity.LINEAR_MOMENTUM}),
        devices=("cpu", "moon"),
        precisions=(Precision.FLOAT64,),
        determinism=Determinism.BITWISE,
    )
    for name, engine in engines.items():
        setattr(module, name, lambda engine=engine: engine)
    module.gasp_point_engines = hookimpl(  # type: ignore[attr-defined]
        lambda: [
            EngineDescriptor(
                name=name, summary="flies", contract_version=(1, 0), capabilities=capabilities, factory=f"shelf:{name}"
            )
            for name in engines
        ]
    )
    return module


@pytest.fixture
def run(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Any:
    module = shelf()
    monkeypatch.setitem(sys.modules, "shelf", module)
    registry = Registry.of([FoundPlugin(name="shelf", distribution="gasp-shelf", load=lambda: module)])
    monkeypatch.setattr(subject, "discover", lambda: registry)
    monkeypatch.setattr(deviations, "deviations_of", lambda descriptor, distribution: ())

    def run(package: str, *options: str) -> pytest.RunResult:
        return pytester.runpytest_inprocess(
            "--pyargs", package, "--import-mode=importlib", "-p", "no:cacheprovider", "-rs", *options
        )

    return run


@pytest.fixture
def suite(run: Any) -> Any:
    """The suite that is shipped."""
    return lambda *options: run("gasp_conformance", *options)


def test_without_an_engine_everything_is_skipped_and_says_how_to_name_one(suite: Any) -> None:
    result = suite()
    outcomes = result.parseoutcomes()
    outcomes.pop("warnings", None)
    assert set(outcomes) == {"skipped"}
    result.stdout.fnmatch_lines(["*run with --gasp-engine=NAME*"])


def test_an_unknown_engine_is_one_line(suite: Any) -> None:
    result = suite("--gasp-engine=wrong")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(['ERROR: no engine named "wrong"*'])


def test_a_precision_the_engine_has_not_is_one_line(suite: Any) -> None:
    result = suite("--gasp-engine=right", "--gasp-precision=float32")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: right does not run in float32; it runs in float64"])


def test_a_device_the_engine_has_not_is_one_line(suite: Any) -> None:
    result = suite("--gasp-engine=right", "--gasp-device=mars")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(['ERROR: right does not run on device "mars"; it runs on cpu, moon'])


def test_what_is_not_declared_is_skipped_and_what_is_right_passes(suite: Any) -> None:
    result = suite("--gasp-engine=right", "-k", "v1_ or v2_")
    outcomes = result.parseoutcomes()
    assert outcomes["passed"] == 2 and "failed" not in outcomes
    result.stdout.fnmatch_lines(
        ["*figures*", "V1 elastic*largest error*0.0049*<= 0.00516*", "*V1?sand?*undeclared*does not model sand*"]
    )


def test_wrong_physics_fails_and_shows_its_figure(suite: Any) -> None:
    result = suite("--gasp-engine=light", "-k", "v1_ or v2_")
    outcomes = result.parseoutcomes()
    assert outcomes["passed"] == outcomes["failed"] == 1
    result.stdout.fnmatch_lines(["*V1?elastic? failed: V1 elastic: largest error*bound 0.00516*"])


def test_an_engine_that_gives_up_fails_with_its_own_reason(suite: Any) -> None:
    result = suite("--gasp-engine=lost", "-k", "v2_")
    assert result.parseoutcomes()["failed"] == 1
    result.stdout.fnmatch_lines(["*lost ended with non_finite before 0.1 s: it was not to be*"])


def test_a_check_is_selected_by_the_name_that_reports_give_it(suite: Any) -> None:
    result = suite("--gasp-engine=light", "-k", "V1[elastic]")
    assert result.parseoutcomes()["failed"] == 1
    assert "passed" not in result.parseoutcomes()


def test_a_comparison_beyond_what_an_engine_declares_is_skipped(suite: Any) -> None:
    result = suite("--gasp-engine=right", "--gasp-oracle=light", "-k", "oracle")
    assert set(result.parseoutcomes()) - {"warnings", "deselected"} == {"skipped"}
    result.stdout.fnmatch_lines(["*knows no plane as a collider*"])


def test_the_registry_it_asks_is_the_real_one() -> None:
    assert subject.discover is discover


def test_every_test_of_the_suite_is_a_check_and_core_comes_first(suite: Any) -> None:
    # A test without @check, or two of one name, are errors of this run.
    result = suite("--gasp-engine=right", "--gasp-list", "-q")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED, result.stdout.str()
    levels = [line.split()[0] for line in result.outlines if line.split()[0:1] and line.split()[0] in LEVELS]
    assert levels and levels == sorted(levels, key=LEVELS.index)


LEVELS = [level.value for level in Level]


def test_the_suite_names_no_engine() -> None:
    names = set(Registry.of(installed_plugins()).offers)
    assert names, "nothing is installed that could be named"
    names |= _engine_packages()
    for file in Path(gasp_conformance.__path__[0]).rglob("*"):
        if file.suffix in (".py", ".toml"):
            text = file.read_text()
            assert not [name for name in names if name in text], file


def _engine_packages() -> set[str]:
    registry = Registry.of(installed_plugins())
    return {offer.descriptor.factory.partition(".")[0] for offers in registry.offers.values() for offer in offers}


# What follows is asked with checks of the test's own.

CORE = """
@check("lifecycle", Level.CORE)
def test_lifecycle(subject):
    pass
"""
CAPABILITIES = """
@check("shows", Level.CAPABILITY)
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=check(name, Level.CAPABILITY))
    for name in ("material:elastic", "field:velocities", "conserved:linear_momentum", "device:cpu", "domain:expand")
])
def test_shows(subject, name):
    pass


@check("device:moon", Level.CAPABILITY)
def test_moon(subject):
    pytest.skip("not on this machine: no moon")
"""
PHYSICS = """
@check("V99", Level.VERIFICATION)
@pytest.mark.parametrize("cells", [4, 8], ids=lambda cells: f"{cells} cells")
def test_v99(ledger, cells):
    ledger.at_most(f"V99 {cells} cells", "small", 0.5, 1.0)
    ledger.at_most(f"V99 {cells} cells", "length", 0.25 * cells, 1.5)
"""
PHYSICS_REPAIRED = PHYSICS.replace("0.25", "0.125")


@pytest.fixture
def examine(run: Any, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A run of a suite of these modules, and its report."""
    monkeypatch.setattr(collection, "SUITE", "little_suite")

    def examine(
        *options: str, listed: str = "", engine: str = "right", **modules: str
    ) -> tuple[pytest.RunResult, Report]:
        package = pytester.mkpydir("little_suite")
        for name, text in ({"core": CORE, "capabilities": CAPABILITIES} | modules).items():
            (package / f"test_{name}.py").write_text(
                "import pytest\nfrom gasp_conformance.checks import Level, check\n"
                "from gasp_conformance.subject import Undeclared\n" + textwrap.dedent(text)
            )
        pytester.syspathinsert(pytester.path)
        monkeypatch.setattr(
            deviations, "deviations_of", lambda descriptor, distribution: read_deviations(listed, "its file")
        )
        path = pytester.path / "report.json"
        result = run("little_suite", f"--gasp-engine={engine}", f"--gasp-report={path}", *options)
        return result, read_report(path)

    return examine


def outcomes(report: Report) -> dict[str, Outcome]:
    return {result.name: result.outcome for result in report.checks}


def test_an_engine_passes(examine: Any) -> None:
    result, report = examine(physics=PHYSICS_REPAIRED)
    assert result.ret == pytest.ExitCode.OK
    assert report.verdict.outcome is VerdictOutcome.PASSES and report.finished
    assert [check.level for check in report.checks] == sorted(
        (check.level for check in report.checks), key=list(Level).index
    )
    assert outcomes(report)["V99[4 cells]"] is Outcome.PASSED
    assert [figure.value for figure in report.checks[-1].figures] == [0.5, 1.0]
    assert report.engine.distribution == "gasp-shelf" and report.engine.precision == "float64"
    assert report.suite_version == importlib.metadata.version("gasp-conformance")
    result.stdout.fnmatch_lines(["right (float64, cpu, full): passes*"])


def test_a_report_says_on_which_device(examine: Any) -> None:
    result, report = examine("--gasp-device=moon", physics=PHYSICS_REPAIRED)
    assert report.engine.device == "moon" and Column.of(report).title == "right float64, moon"
    result.stdout.fnmatch_lines(["right (float64, moon, full): passes*"])


def test_a_failed_check_fails_the_engine_and_leaves_its_figures(examine: Any) -> None:
    result, report = examine(physics=PHYSICS)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    assert report.verdict.reasons == ("failed: V99[8 cells]",)
    assert report.checks[-1].worst.value == 2.0
    result.stdout.fnmatch_lines(["verification*V99?8 cells?*failed*length 2 <= 1.5", "*: fails*", "- failed: V99*"])


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ('assert 1 == 2, "one is not two"', "one is not two"),
        ('raise ValueError("first:\\n\\n  second")', "ValueError: first: second"),
        ('raise ValueError("word " * 1000)', "ValueError: " + ("word " * 1000)[:388]),
    ],
)
def test_a_reason_is_one_line(examine: Any, body: str, reason: str) -> None:
    _, report = examine(physics=f'@check("V93", Level.VERIFICATION)\ndef test_v93():\n    {body}\n')
    assert report.checks[-1].reason == reason


def test_what_raises_before_a_check_is_an_error(examine: Any) -> None:
    broken = """
    @pytest.fixture
    def broken():
        raise RuntimeError("no room")

    @check("V98", Level.VERIFICATION)
    def test_v98(broken):
        pass
    """
    _, report = examine(physics=broken)
    assert outcomes(report)["V98"] is Outcome.ERROR
    assert "no room" in report.checks[-1].reason
    assert report.verdict.reasons == ("ended in an error: V98",)


@pytest.mark.parametrize(
    "body",
    [
        'pytest.skip("not today")',
        'pytest.xfail("not today")',
        'raise Undeclared("not today")',
    ],
)
def test_a_core_check_cannot_be_left_out(examine: Any, body: str) -> None:
    result, report = examine(core=f'@check("drift", Level.CORE)\ndef test_drift(subject):\n    {body}\n')
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    assert outcomes(report)["drift"] is Outcome.FAILED
    word = "excused" if "xfail" in body else "left out"
    assert report.checks[0].reason == f"drift may not be {word}: not today"


def test_nor_by_a_mark_or_from_a_fixture(examine: Any) -> None:
    core = """
    @check("drift", Level.CORE)
    @pytest.mark.skip(reason="not today")
    def test_drift(subject):
        pass

    @pytest.fixture
    def needy():
        raise Undeclared("not today")

    @check("free-fall", Level.CORE)
    def test_fall(needy):
        pass

    @check("lifecycle", Level.CORE)
    @pytest.mark.xfail(reason="not today")
    def test_lifecycle(subject):
        assert False
    """
    _, report = examine(core=core)
    assert {outcomes(report)[name] for name in ("drift", "free-fall", "lifecycle")} == {Outcome.FAILED}


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        ("assert 2 < 1", Outcome.DEVIATES),
        ('raise GaspError("refused")', Outcome.DEVIATES),
        ('raise RuntimeError("out of memory")', Outcome.FAILED),
        ('raise EngineCrashedError("its process died")', Outcome.FAILED),
    ],
)
def test_a_list_excuses_a_figure_and_no_crash(examine: Any, end: str, outcome: Outcome) -> None:
    _, report = examine(
        physics="from gasp_core.errors import EngineCrashedError, GaspError\n"
        f'@check("V94", Level.VERIFICATION)\ndef test_v94():\n    {end}\n',
        listed='[[deviation]]\ncheck = "V94"\nreason = "springs"',
    )
    assert report.checks[-1].outcome is outcome
    if outcome is Outcome.FAILED:
        assert "V94 may deviate, but not break" in report.checks[-1].reason


def test_only_the_engine_s_own_list_excuses(examine: Any) -> None:
    _, report = examine(physics='@check("V94", Level.VERIFICATION)\ndef test_v94():\n    pytest.xfail("known")\n')
    assert report.checks[-1].outcome is Outcome.FAILED
    assert report.checks[-1].reason == "V94 may not be excused: known"


def test_a_suite_without_core_checks_passes_nobody(examine: Any) -> None:
    _, report = examine(core='@check("V97", Level.VERIFICATION)\ndef test_v97(subject):\n    pass\n')
    assert report.verdict.reasons == ("no core check ran",)


def test_what_is_declared_has_to_be_shown(examine: Any) -> None:
    without = CAPABILITIES.replace('"conserved:linear_momentum", ', "")
    result, report = examine(capabilities=without)
    assert result.parseoutcomes()["passed"] and "failed" not in result.parseoutcomes()
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    assert report.verdict.reasons == ("declared, but no check shows it: conserved:linear_momentum",)
    assert {one.capability: one.excused for one in report.unproven} == {
        "conserved:linear_momentum": False,
        "device:moon": True,
    }


def test_a_check_beyond_what_is_declared_shows_nothing(examine: Any) -> None:
    undeclared = CAPABILITIES.replace("    pass", '    if name == "domain:expand":\n        raise Undeclared("cannot")')
    _, report = examine(capabilities=undeclared)
    assert outcomes(report)["domain:expand"] is Outcome.UNDECLARED
    assert report.verdict.reasons == ("declared, but its check needs what is not declared: domain:expand",)


def test_only_a_device_may_be_missing(examine: Any) -> None:
    skipped = CAPABILITIES.replace(
        "    pass", '    if name == "domain:expand":\n        pytest.skip("not on this machine")'
    )
    _, report = examine(capabilities=skipped)
    assert report.verdict.reasons == ("declared, but not on this machine: domain:expand",)


def test_quick_leaves_out_what_takes_long(examine: Any) -> None:
    long = CAPABILITIES.replace(
        "marks=check(name, Level.CAPABILITY)", 'marks=check(name, Level.CAPABILITY, full="v" in name)'
    )
    result, report = examine("--gasp-quick", capabilities=long)
    assert result.ret == pytest.ExitCode.OK
    assert result.parseoutcomes()["deselected"] == 3
    assert report.verdict.outcome is VerdictOutcome.PASSES
    assert {one.reason for one in report.unproven} == {"left to a full run", "not on this machine: no moon"}


@pytest.mark.parametrize("selection", [("-k", "not moon"), ("--deselect", "little_suite/test_core.py"), ("-m", "no")])
def test_a_selection_never_passes(examine: Any, selection: tuple[str, str]) -> None:
    result, report = examine(*selection)
    assert report.verdict.outcome is VerdictOutcome.PARTIAL
    result.stdout.fnmatch_lines(["*partial, no verdict*"])


def test_a_selection_can_fail(examine: Any) -> None:
    _, report = examine("-k", "V99", physics=PHYSICS)
    assert report.verdict.outcome is VerdictOutcome.FAILS


def test_a_run_that_is_stopped_fails(examine: Any) -> None:
    _, report = examine("-x", physics=PHYSICS.replace("[4, 8]", "[8, 4]"))
    assert report.verdict.reasons == ("failed: V99[8 cells]", "1 checks did not run, the first is V99[4 cells]")


def test_checks_that_cannot_be_imported_fail(examine: Any) -> None:
    _, report = examine(physics="import nothing_of_that_name\n")
    assert report.verdict.outcome is VerdictOutcome.FAILS
    assert any("could not be collected" in reason and "test_physics" in reason for reason in report.verdict.reasons)


def test_a_test_without_a_name_is_refused(run: Any, examine: Any) -> None:
    result, _ = examine(physics="def test_something(subject):\n    pass\n")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: *test_something is part of the suite, but no check: put @check above it"])


def test_two_checks_of_one_name_are_refused(examine: Any) -> None:
    result, _ = examine(physics=CORE)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(['ERROR: *test_physics.py*test_core.py*are both called "lifecycle"'])


def test_tests_of_others_are_left_alone(examine: Any, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_other="import pytest\n\ndef test_mine():\n    pytest.skip('mine')\n")
    result, report = examine("test_other.py")
    assert result.ret == pytest.ExitCode.OK
    assert report.verdict.outcome is VerdictOutcome.PASSES and "mine" not in str(report)


def deviation(check: str, extra: str = "") -> str:
    return f'[[deviation]]\ncheck = "{check}"\nreason = "a known weakness"\n{extra}\n'


def test_a_deviation_is_expected_and_shown_with_its_figures(examine: Any) -> None:
    result, report = examine(physics=PHYSICS, listed=deviation("V99[8 cells]"))
    assert result.ret == pytest.ExitCode.OK
    assert report.verdict.outcome is VerdictOutcome.PASSES
    last = report.checks[-1]
    assert (last.outcome, last.reason, last.worst.value) == (Outcome.DEVIATES, "a known weakness", 2.0)
    result.stdout.fnmatch_lines(["*V99?8 cells?*deviates*length 2 <= 1.5", "V99?8 cells? deviates: a known weakness"])


def test_a_deviation_that_passes_is_stale(examine: Any) -> None:
    result, report = examine(physics=PHYSICS_REPAIRED, listed=deviation("V99[8 cells]"))
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    assert report.checks[-1].outcome is Outcome.STALE
    assert "passes: remove the entry" in report.checks[-1].reason
    assert report.verdict.reasons[0].endswith(": V99[8 cells]")


def test_a_deviation_that_does_not_apply_is_stale(examine: Any) -> None:
    physics = '@check("V96", Level.VERIFICATION)\ndef test_v96(subject):\n    raise Undeclared("cannot")\n'
    _, report = examine(physics=physics, listed=deviation("V96"))
    assert report.checks[-1].outcome is Outcome.STALE
    assert "not declared" in report.checks[-1].reason


@pytest.mark.parametrize("name", ["V99", "V99[5 cells]", "V12"])
def test_a_deviation_that_names_no_check_is_stale(examine: Any, name: str) -> None:
    result, report = examine(physics=PHYSICS_REPAIRED, listed=deviation(name))
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    assert report.verdict.reasons == (f"listed as deviations, but no check is called so: {name}",)


def test_a_core_check_cannot_be_excused(examine: Any) -> None:
    result, _ = examine(listed=deviation("lifecycle"))
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(['ERROR: *"lifecycle" is a core check*mend the engine'])


def test_a_deviation_shows_no_capability(examine: Any) -> None:
    failing = CAPABILITIES.replace("    pass", '    assert name != "material:elastic"')
    _, report = examine(capabilities=failing, listed=deviation("material:elastic"))
    assert outcomes(report)["material:elastic"] is Outcome.DEVIATES
    assert report.verdict.reasons == ("declared, but its check deviates: material:elastic",)


def test_a_deviation_of_another_precision_is_not_this_run_s(examine: Any) -> None:
    result, _ = examine(physics=PHYSICS_REPAIRED, listed=deviation("V99[8 cells]", 'precision = "float32"'))
    assert result.ret == pytest.ExitCode.OK


@pytest.mark.parametrize(
    ("device", "physics", "outcome"),
    [("cpu", PHYSICS_REPAIRED, Outcome.PASSED), ("cpu", PHYSICS, Outcome.FAILED), ("moon", PHYSICS, Outcome.DEVIATES)],
)
def test_nor_is_one_of_another_device(examine: Any, device: str, physics: str, outcome: Outcome) -> None:
    listed = deviation("V99[8 cells]", 'device = "moon"')
    _, report = examine(f"--gasp-device={device}", physics=physics, listed=listed)
    assert outcomes(report)["V99[8 cells]"] is outcome


def test_a_malformed_list_of_deviations_is_one_line(
    run: Any, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deviations, "deviations_of", lambda *_: read_deviations("[[deviation]]\n", "its file"))
    result = run("gasp_conformance", "--gasp-engine=right")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: its file: deviation 1: check must be a text*"])


def test_a_report_needs_an_engine_and_a_place(suite: Any) -> None:
    result = suite("--gasp-report=report.json")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --gasp-report needs --gasp-engine=NAME"])
    result = suite("--gasp-engine=right", "--gasp-report=nowhere/report.json")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: *report.json: cannot be written*"])


def test_before_every_check_the_report_says_where_the_process_is(examine: Any) -> None:
    # Whatever the check does to the process, this is what it leaves.
    physics = """
    from pathlib import Path
    from gasp_conformance.report import read_report

    @check("V95", Level.VERIFICATION)
    def test_v95(subject, pytestconfig):
        report = read_report(pytestconfig.getoption("--gasp-report"))
        assert report.running == "V95" and not report.finished
        assert report.verdict.reasons == ("the process ended in check V95",)
        assert report.checks
    """
    _, report = examine(physics=physics)
    assert outcomes(report)["V95"] is Outcome.PASSED


def test_it_runs_in_one_process(suite: Any) -> None:
    pytest.importorskip("xdist")
    result = suite("--gasp-engine=right", "-n", "2")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: the suite runs its checks in one process*"])
