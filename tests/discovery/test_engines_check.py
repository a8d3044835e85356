"""What is wrong with an engine's own code: what the list sees without importing it, and what ``check`` finds out."""

import json
import sys

import pytest

from gasp_core.discovery.requirements import missing_factory, source_fault

ENGINES = ["-m", "gasp_core.cli.main", "engines"]


@pytest.fixture
def row(in_process_of_its_own):
    """The row of an engine as ``gasp engines --json``, or a command below it, has it."""

    def find(name, folder, *command):
        done = in_process_of_its_own([*ENGINES, *command, "--json"], folder)
        (found,) = [row for row in json.loads(done.stdout)["engines"] if row["name"] == name]
        assert (found["error"] is None) == (found["status"] == "ready")
        assert "\n" not in (found["error"] or "")
        if command:
            assert done.returncode == (found["status"] != "ready")
        return found

    return find


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        ({"plugin": ("my_engine.engine:", "my_engine.engin:")}, "its module my_engine.engin is not there"),
        ({"plugin": ("my_engine.engine:", "mine.engine:")}, "its module mine is not there"),
        ({"plugin": (":Engine", ":Motor")}, "its module my_engine.engine has no Motor"),
        ({"engine": ("class Engine:", "class Engine")}, "is no Python: expected ':', line "),
    ],
    ids=["no such module", "no such package", "no such attribute", "no Python"],
)
def test_the_list_shows_a_factory_that_cannot_be_there(new_engine, row, texts, reason):
    found = row("my-engine", new_engine(**texts))
    assert found["status"] == "failed"
    assert reason in found["error"]


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        ({"engine": ("import numpy as np", "import no_such_backend as np")}, "No module named 'no_such_backend'"),
        ({"engine": ("__all__ =", 'raise RuntimeError("no coil")\n__all__ =')}, "RuntimeError: no coil"),
        ({"engine": ("__all__ =", "raise SystemExit(3)\n__all__ =")}, "SystemExit: 3"),
        ({"engine": ("__all__ =", "import os\nos.abort()\n__all__ =")}, "SIGABRT"),
        ({"engine": ("    def open(", "    def opens(")}, "has no method open"),
        pytest.param(
            {"engine": ("__all__ =", "import time\ntime.sleep(600)\n__all__ =")},
            "was given up after 5 s",
            marks=pytest.mark.thorough,
        ),
    ],
    ids=["no backend", "error", "exit", "abort", "no engine", "hang"],
)
def test_check_shows_an_engine_that_does_not_load_as_failed(new_engine, row, texts, reason, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # logs of workers that died are kept
    folder = new_engine(**texts)
    # Nothing that could be seen without importing it.
    assert row("my-engine", folder)["status"] == "ready"
    limit = "5" if "given up" in reason else "100"
    found = row("my-engine", folder, "check", "my-engine", "--limit", limit)
    assert found["status"] == "failed"
    assert reason in found["error"]


def test_check_of_an_engine_that_loads_says_ready(new_engine, row):
    assert row("my-engine", new_engine(), "check", "my-engine")["status"] == "ready"


def test_check_leaves_what_the_list_knows_to_be_broken(in_process_of_its_own):
    done = in_process_of_its_own([*ENGINES, "check", "no-factory", "no-backend"], "no_factory", "no_backend")
    assert done.returncode == 1
    status = {line.split()[0]: line.split("  ")[1].strip() for line in done.stdout.splitlines() if "  cpu  " in line}
    assert status == {"no-backend": "missing backend", "no-factory": "failed"}
    assert "no-backend (of gasp-fake-no-backend): needs fake-backend>=3, which is not installed" in done.stdout
    assert "no-factory (of gasp-fake-no-factory): its module fake_no_factory_engine is not there" in done.stdout


def test_check_of_a_name_that_nobody_offers_is_refused(in_process_of_its_own):
    done = in_process_of_its_own([*ENGINES, "check", "balistic"], "ballistic")
    assert done.returncode == 2
    assert done.stderr.startswith("gasp: ") and 'did you mean "ballistic"?' in done.stderr


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Write a module that can be found and has not been imported."""

    def write(source):
        (tmp_path / "gasp_test_sketch.py").write_text(source)
        monkeypatch.syspath_prepend(tmp_path)
        return "gasp_test_sketch"

    return write


@pytest.mark.parametrize(
    "source",
    [
        "class Engine: ...",
        "def Engine(): ...",
        "Engine = make()",
        "Engine: type = make()",
        "first, (Engine, *others) = make()",
        "from backend import Engine",
        "from backend import Solver as Engine",
        "import Engine",
        "import Engine.solver",
        "try:\n    from backend import Engine\nexcept ImportError:\n    Engine = None",
        "if True:\n    def Engine(): ...",
        "for Engine in engines: ...",
        "with backend() as Engine: ...",
        "if (Engine := make()): ...",
        "match make():\n    case [Engine]: ...",
        "def setup():\n    global Engine\n    Engine = make()\nsetup()",
        "from backend import *",
        "globals()['Engine'] = make()",
        "exec('class Engine: ...')",
        "import sys\nsetattr(sys.modules[__name__], 'Engine', make())",
        "def __getattr__(name): ...",
    ],
)
def test_a_factory_that_may_be_in_its_module_is_no_fault(module, source):
    assert source_fault(f"{module(source)}:Engine") is None
    assert "gasp_test_sketch" not in sys.modules


@pytest.mark.parametrize(
    "source",
    ["", "engine = 1", "class Other:\n    Engine = 1", "def other():\n    Engine = 1", "Other.Engine = 1", "Engine"],
)
def test_a_factory_that_cannot_be_in_its_module_is_told(module, source):
    assert "has no Engine" in source_fault(f"{module(source)}:Engine.make")
    assert "gasp_test_sketch" not in sys.modules


def test_a_module_that_is_imported_already_is_looked_at_itself():
    assert source_fault("json:loads") is None
    assert "has no Engine" in source_fault("json:Engine")


def test_what_lies_below_a_package_that_is_not_imported_is_not_looked_up(tmp_path, monkeypatch):
    (tmp_path / "gasp_test_package").mkdir()
    (tmp_path / "gasp_test_package" / "__init__.py").write_text("raise RuntimeError('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    # What `__init__` makes of its path, nobody knows who has not run it.
    assert missing_factory("gasp_test_package.engine:Engine") is None
    assert source_fault("gasp_test_package.engine:Engine") is None
    assert missing_factory("gasp_test_packet.engine:Engine") == "gasp_test_packet"
