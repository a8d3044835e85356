"""The command: a process of its own, what reaches it, and what is said when it dies."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from click.testing import CliRunner, Result
from gasp_conformance import process
from gasp_conformance.command import conformance
from gasp_conformance.report import (
    EngineIdentity,
    Extent,
    Machine,
    Outcome,
    Report,
    Verdict,
    VerdictOutcome,
    read_report,
    write_report,
)

PLUGIN = """
from gasp_core.contract import Determinism, EngineCapabilities, EngineDescriptor, Field, Precision
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.contract import Elastic


@hookimpl
def gasp_point_engines():
    capabilities = EngineCapabilities(
        materials=frozenset({Elastic}),
        collider_shapes=frozenset(),
        contact_conditions=frozenset(),
        drives=frozenset(),
        force_fields=frozenset(),
        output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
        conserved=frozenset(),
        devices=("cpu",),
        precisions=(Precision.FLOAT64,),
        determinism=Determinism.BITWISE,
    )
    return [
        EngineDescriptor(name=name, summary="flies", contract_version=(1, 0), capabilities=capabilities,
                         factory=f"little_engines.engines:{name}")
        for name in ("flyer", "crasher", "sleeper", "tired", "stillborn")
    ]
"""
ENGINES = """
import os
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from gasp_core.contract import PointState, Status, StepReport

STEP = 1e-3


class Flyer:
    def open(self, problem, **_):
        print("noise of an engine")
        return Session(problem)


class Session:
    def __init__(self, problem):
        self.problem, self.time = problem, 0.0

    def advance_to(self, time):
        count, self.time = round((time - self.time) / STEP), time
        return StepReport(status=Status.OK, substep_count=count, smallest_substep=STEP, largest_substep=STEP)

    def read(self, fields):
        points, time, gravity = self.problem.points, self.time, np.array(self.problem.gravity)
        return PointState(
            time=time,
            positions=points.reference_positions + time * (points.initial_velocities + gravity * (time + STEP) / 2),
            velocities=points.initial_velocities + gravity * time,
        )

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


class Crasher(Flyer):
    def open(self, problem, **_):
        os.kill(os.getpid(), signal.SIGSEGV)


class Sleeper(Flyer):
    def open(self, problem, **_):
        helper = subprocess.Popen(["sleep", "60"])
        Path(os.environ["SLEEPER_IS_UP"]).write_text(f"{os.getpid()} {helper.pid} .")
        time.sleep(60)


class Tired(Sleeper):
    # Shows matter a metre off, and later falls asleep.

    def open(self, problem, **others):
        up = Path(os.environ["SLEEPER_IS_UP"])
        if not up.exists():
            up.touch()
            return Astray(problem)
        return super().open(problem, **others)


class Astray(Session):
    def read(self, fields):
        state = super().read(fields)
        return replace(state, positions=state.positions + 1.0)


def stillborn():
    os._exit(7)


flyer, crasher, sleeper, tired = Flyer, Crasher, Sleeper, Tired
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of installed packages with some engines."""
    folder = tmp_path_factory.mktemp("site")
    package, metadata = folder / "little_engines", folder / "little_engines-1.0.dist-info"
    for one in (package, metadata):
        one.mkdir()
    (package / "__init__.py").touch()
    (package / "plugin.py").write_text(PLUGIN)
    (package / "engines.py").write_text(ENGINES)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: little-engines\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[gasp]\nlittle = little_engines.plugin\n")
    return folder


def environment(site: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])}


def command(site: Path, folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gasp_conformance", *arguments],
        cwd=folder,
        env=environment(site) | variables,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.thorough
def test_nothing_of_the_folder_it_is_called_from_reaches_the_run(site: Path, tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --no-such-option\n")
    (tmp_path / "conftest.py").write_text("raise RuntimeError('not to be imported')\n")
    (tmp_path / "gasp_conformance.py").write_text("raise RuntimeError('not to be imported')\n")
    (tmp_path / "test_mine.py").write_text("def test_mine():\n    assert False\n")
    before = sorted(path.name for path in tmp_path.rglob("*"))
    # As a console script would: the folder is not on the import path.
    ran = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; sys.path.remove(''); from gasp_conformance.__main__ import main; sys.exit(main())",
            "flyer",
            "-k",
            "V2",
            "--json",
            "flyer.json",
        ],
        cwd=tmp_path,
        # A relative place is meant from where the command is called.
        env=environment(Path(os.path.relpath(site, tmp_path)))
        | {"PYTEST_ADDOPTS": "--no-such-option", "PYTEST_PLUGINS": "no_such_plugin"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 3, ran.stdout + ran.stderr
    assert "flyer (float64, cpu, full): partial, no verdict (1 passed)" in ran.stdout
    assert "noise of an engine" not in ran.stdout and "\x1b" not in ran.stdout
    assert sorted(path.name for path in tmp_path.rglob("*")) == sorted([*before, "flyer.json"])
    report = read_report(tmp_path / "flyer.json")
    assert [check.name for check in report.checks] == ["V2"]
    assert (report.engine.distribution, report.engine.version) == ("little-engines", "1.0")


@pytest.mark.thorough
def test_a_process_that_dies_fails_in_the_check_it_died_in(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "crasher", "-k", "V2", "--json", "report.json")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    said = "the process was killed by SIGSEGV in check V2"
    assert f"- {said}" in ran.stdout
    assert json.loads((tmp_path / "report.json").read_text())["verdict"] == {"outcome": "fails", "reasons": [said]}


def test_an_engine_that_ends_the_process_when_it_is_loaded_fails(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "stillborn")
    assert ran.returncode == 1
    assert ran.stdout == "fails: the process ended by itself with status 7 before any check\n"


@pytest.mark.parametrize(
    ("number", "status"),
    [
        (signal.SIGINT, 130),
        pytest.param(signal.SIGTERM, 143, marks=pytest.mark.thorough),
        pytest.param(signal.SIGKILL, -signal.SIGKILL, marks=pytest.mark.thorough),
    ],
)
def test_whatever_ends_the_command_ends_the_suite_and_all_it_started(
    site: Path, tmp_path: Path, number: signal.Signals, status: int
) -> None:
    is_up = tmp_path / "up"
    is_up.touch()
    with subprocess.Popen(
        [sys.executable, "-m", "gasp_conformance", "sleeper", "-k", "V2"],
        cwd=tmp_path,
        env=environment(site) | {"SLEEPER_IS_UP": str(is_up)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as running:
        deadline = time.monotonic() + 60
        while not (told := is_up.read_text()).endswith(".") and time.monotonic() < deadline and running.poll() is None:
            time.sleep(0.05)
        suite, helper = (int(pid) for pid in told.split()[:2])
        assert is_alive(suite) and is_alive(helper)
        running.send_signal(number)
        # Which waits until none of them holds the output open.
        running.communicate(timeout=60)
        assert running.returncode == status
    deadline = time.monotonic() + 10  # a limit of hanging
    while (is_alive(suite) or is_alive(helper)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_alive(suite) and not is_alive(helper)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_what_was_found_before_the_end_from_outside_is_printed_and_written(
    site: Path, tmp_path: Path, number: signal.Signals, status: int
) -> None:
    is_up, printed = tmp_path / "up", tmp_path / "printed"
    failure = "free-fall failed: free-fall: "
    with printed.open("w") as output:
        running = subprocess.Popen(
            [sys.executable, "-m", "gasp_conformance", "tired", "-k", "free-fall or V2", "--json", "report.json"],
            cwd=tmp_path,
            env=environment(site) | {"SLEEPER_IS_UP": str(is_up)},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            deadline = time.monotonic() + 60  # a limit of hanging
            while not (is_up.exists() and is_up.read_text().endswith(".")) and time.monotonic() < deadline:
                time.sleep(0.05)
            # Said while the run goes on.
            assert failure in printed.read_text()
            running.send_signal(number)
            assert running.wait(60) == status
        finally:
            running.kill()
    said = printed.read_text()
    table = said[said.index("LEVEL") :]
    assert failure in table and "tired (float64, cpu, full): fails (1 failed)" in table
    report = read_report(tmp_path / "report.json")
    assert [(one.name, one.outcome) for one in report.checks] == [("free-fall", Outcome.FAILED)]
    assert "checks did not run, the first is V2" in report.verdict.reasons[-1]


def is_alive(pid: int) -> bool:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    return False


def test_an_engine_that_is_not_there_is_a_matter_of_usage(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "flier")
    assert ran.returncode == 2
    assert 'ERROR: no engine named "flier"' in ran.stderr and 'did you mean "flyer"?' in ran.stderr


def test_a_device_that_the_engine_does_not_declare_is_a_matter_of_usage(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "flyer", "--device", "cuda")
    assert ran.returncode == 2
    assert ran.stderr.strip() == 'ERROR: flyer does not run on device "cuda"; it runs on cpu'


def test_the_list_names_checks_levels_and_what_they_are(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "--list")
    assert ran.returncode == 0, ran.stderr
    rows = [line.split(maxsplit=3) for line in ran.stdout.splitlines() if line.strip()]
    assert all(len(row) == 4 for row in rows), ran.stdout
    assert [row[0] for row in rows if row[1] == "V2"] == ["verification"]
    assert not list(tmp_path.iterdir())


def test_the_list_has_what_a_selection_would_run(site: Path, tmp_path: Path) -> None:
    ran = command(site, tmp_path, "--list", "-k", "collider:plane")
    assert ran.returncode == 0, ran.stderr
    names = [line.split()[1] for line in ran.stdout.splitlines() if line.strip()]
    assert names == ["collider:plane[outside]", "collider:plane[inside]"]


def test_registering_the_command_imports_neither_pytest_nor_the_suite() -> None:
    code = """
    import sys
    import gasp_conformance.plugin
    loaded = [name for name in sys.modules if name.startswith(("gasp_conformance", "pytest", "_pytest", "scipy"))]
    assert sorted(loaded) == ["gasp_conformance", "gasp_conformance.plugin"], loaded
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True, timeout=60)


REPORT = Report(
    suite_version="0.1",
    engine=EngineIdentity(
        name="flyer", distribution="d", version="1", contract_version=(1, 0), device="cpu", precision="float64"
    ),
    machine=Machine(python="3.11", numpy="2.0", platform="here", processors=2),
    extent=Extent.FULL,
    verdict=Verdict(outcome=VerdictOutcome.PASSES),
    running="",
    finished=True,
)


def invoke(
    monkeypatch: pytest.MonkeyPatch, left: Report | None, ended: int, *arguments: str
) -> tuple[Result, list[str]]:
    """The command with a process that leaves this report and ends with this status; and what it was asked."""
    asked: list[str] = []

    def run_suite(options: Sequence[str], folder: Path) -> int:
        asked.extend(options)
        if left is not None:
            write_report(left, folder / "report.json")
        return ended

    monkeypatch.setattr(process, "run_suite", run_suite)
    return CliRunner().invoke(conformance, ["flyer", *arguments]), asked


@pytest.mark.parametrize(
    ("outcome", "ended", "status"),
    [
        (VerdictOutcome.PASSES, 0, 0),
        (VerdictOutcome.FAILS, 1, 1),
        (VerdictOutcome.PARTIAL, 0, 3),
        # Whatever the checks said: a process that dies while it ends is no engine to rely on.
        (VerdictOutcome.PASSES, -int(signal.SIGABRT), 1),
        (VerdictOutcome.PASSES, int(pytest.ExitCode.INTERNAL_ERROR), 1),
    ],
)
def test_the_exit_status_is_the_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, outcome: VerdictOutcome, ended: int, status: int
) -> None:
    target = tmp_path / "report.json"
    ran, _ = invoke(monkeypatch, replace(REPORT, verdict=Verdict(outcome=outcome)), ended, "--json", str(target))
    assert ran.exit_code == status, ran.output
    report = read_report(target)
    assert (report.verdict.outcome is VerdictOutcome.FAILS) == (status == 1)
    if ended not in (0, 1):
        assert "after the last check" in report.verdict.reasons[-1] and "after the last check" in ran.output


def test_a_process_that_ends_well_in_the_midst_of_a_check_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    ran, _ = invoke(monkeypatch, replace(REPORT, running="V2", finished=False), 0)
    assert ran.exit_code == 1
    assert "- the process ended by itself with status 0 in check V2" in ran.output


def test_a_check_that_does_not_end_when_it_is_interrupted_is_no_lack_of_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_suite(options: Sequence[str], folder: Path) -> int:
        write_report(replace(REPORT, running="V2", finished=False), folder / "report.json")
        raise process.SuiteInterrupted(-signal.SIGKILL)

    monkeypatch.setattr(process, "run_suite", run_suite)
    ran = CliRunner().invoke(conformance, ["flyer", "--json", str(tmp_path / "report.json")])
    assert "- the process was interrupted in check V2" in ran.output and "memory" not in ran.output
    assert read_report(tmp_path / "report.json").verdict.reasons == ("the process was interrupted in check V2",)


def test_what_is_asked_reaches_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = ["--precision", "float64", "--device", "cuda", "--oracle", "other"]
    _, asked = invoke(monkeypatch, REPORT, 0, "--quick", *chosen, "-k", "V2")
    wanted = ["--gasp-engine=flyer", "--gasp-precision=float64", "--gasp-device=cuda", "--gasp-oracle=other"]
    wanted += ["--gasp-quick", "-k", "V2"]
    assert asked[:-1] == wanted and asked[-1].startswith("--gasp-report=")


def test_a_name_that_matches_no_check_is_a_matter_of_usage(monkeypatch: pytest.MonkeyPatch) -> None:
    ran, _ = invoke(monkeypatch, REPORT, int(pytest.ExitCode.NO_TESTS_COLLECTED), "-k", "V999")
    assert ran.exit_code == 2
    assert 'no check matches -k "V999"; --list shows their names' in ran.stderr


@pytest.mark.parametrize(
    "arguments", [[], ["flyer", "--json", "no/such/folder/report.json"], ["flyer", "--precision=x"]]
)
def test_what_cannot_be_asked_is_a_matter_of_usage(arguments: list[str]) -> None:
    ran = CliRunner().invoke(conformance, arguments)
    assert ran.exit_code == 2
    assert "Error: " in ran.stderr


def test_the_statuses_are_pytest_s() -> None:
    assert pytest.ExitCode.USAGE_ERROR == process.USAGE
    assert pytest.ExitCode.NO_TESTS_COLLECTED == process.NOTHING_MATCHED
    orderly = {pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED}
    assert {code for code in pytest.ExitCode if process.is_orderly(code)} == orderly
