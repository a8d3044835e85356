"""``gasp engines`` in a process of its own, with distributions on the path as if installed."""

import json
import re
import sys

import pytest

SLOW = ["taichi", "numba", "scipy", "zarr", "rich", "gsply", "PIL", "sklearn", "llvmlite"]
ENGINES = ["-m", "gasp_core.cli.main", "engines"]

# Runs a command and prints, as its last line, what has been imported by then.
PROBE = """
import json, sys
from gasp_core.cli.main import main
status = main(sys.argv[1:])
print()
print(json.dumps([status, sorted(name for name in sys.modules if "." not in name)]))
"""


def test_every_kind_of_trouble_is_a_row(listed):
    rows = listed(
        "ballistic",
        "unimportable",
        "exits",
        "misspelt",
        "twin_one",
        "twin_two",
        "other_major",
        "no_factory",
        "no_backend",
    )
    status = {key: row["status"] for key, row in rows.items() if key[1].startswith("gasp-fake-")}
    assert status == {
        ("ballistic", "gasp-fake-ballistic"): "ready",
        ("unimportable", "gasp-fake-unimportable"): "failed",
        ("exits", "gasp-fake-exits"): "failed",
        ("misspelt", "gasp-fake-misspelt"): "failed",
        ("twin", "gasp-fake-twin-one"): "duplicate",
        ("twin", "gasp-fake-twin-two"): "duplicate",
        ("other-major", "gasp-fake-other-major"): "failed",
        ("no-factory", "gasp-fake-no-factory"): "failed",
        ("no-backend", "gasp-fake-no-backend"): "missing backend",
    }
    for key, row in rows.items():
        assert (row["error"] is None) == (row["status"] == "ready"), key
    # A requirement for another platform is nothing that is missing here.
    assert "fake-windows" not in rows["no-backend", "gasp-fake-no-backend"]["error"]


def test_a_ready_engine_tells_its_capabilities(listed):
    row = listed("ballistic")["ballistic", "gasp-fake-ballistic"]
    assert row["error"] is None
    assert row["materials"] == ["elastic"]
    assert row["devices"] == ["cpu"]
    assert row["precisions"] == ["float64"]
    assert row["options"] == ["time_scale"]
    assert row["checkpoints"] is True
    assert row["contract_version"] == [1, 7]


def test_for_people_each_failure_is_told_in_one_line(in_process_of_its_own):
    done = in_process_of_its_own(ENGINES, "ballistic", "unimportable", "twin_one", "twin_two")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert [line.split()[1] for line in lines if line.startswith("ballistic ")] == ["ready"]
    (told,) = [line for line in lines if line.startswith("unimportable (of ")]
    assert "flux capacitor is missing" in told
    assert any("gasp-fake-twin-one and gasp-fake-twin-two" in line for line in lines)


def imported(in_process_of_its_own, *arguments, fakes=()):
    done = in_process_of_its_own(["-c", PROBE, *arguments], *fakes)
    status, modules = json.loads(done.stdout.splitlines()[-1])
    assert status == 0
    return set(modules)


@pytest.mark.parametrize(
    "arguments", [["--help"], ["engines"], ["engines", "--json"], ["run", "--help"], ["demo", "--help"], ["--version"]]
)
def test_nothing_slow_is_imported(in_process_of_its_own, arguments):
    modules = imported(in_process_of_its_own, *arguments)
    assert "click" in modules
    assert modules.isdisjoint(SLOW)


def test_installed_plugins_import_no_backend(in_process_of_its_own):
    """`plugin.py` of every engine in this environment is imported by ``gasp engines``; none may pull its backend in."""
    modules = imported(in_process_of_its_own, "engines")
    third_party = modules - set(sys.stdlib_module_names)
    plugins = {name for name in third_party if name.startswith("gasp_")} - {"gasp_core"}
    assert plugins, "no engine is installed in this environment, so nothing was checked"
    assert not {"taichi", "warp", "mujoco", "genesis", "bpy", "torch", "jax"} & third_party


def test_version_and_command_help_do_not_even_import_numpy(in_process_of_its_own):
    for arguments in (["--version"], ["run", "--help"]):
        assert "numpy" not in imported(in_process_of_its_own, *arguments)


def test_command_of_a_plugin_is_listed_without_importing_it_and_runs(in_process_of_its_own):
    done = in_process_of_its_own(["-c", PROBE, "--help"], "ballistic")
    assert re.search(r"greet +Say hello\.", done.stdout)
    assert "fake_ballistic_command" not in json.loads(done.stdout.splitlines()[-1])[1]
    done = in_process_of_its_own(["-m", "gasp_core.cli.main", "greet", "--name", "bear"], "ballistic")
    assert (done.returncode, done.stdout) == (0, "hello bear\n")
