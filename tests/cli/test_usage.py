"""What is wrong with the command itself, and what is wrong with the world around it."""

import json
import os
import resource
import signal

import pytest

from gasp_core.cli.command_group import BUILT_IN, gasp
from gasp_core.cli.main import FAILED, INTERRUPTED, main


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["rnu", "scene.toml"], ['no command "rnu"', 'did you mean "run"?', 'see "gasp --help"']),
        (["xyz"], ['no command "xyz"', "the commands are new, run, demo"]),
        (["run"], ["SCENE", 'see "gasp run --help"']),
        (["run", "scene.toml", "--frames", "0"], ["--frames", "0"]),
        (["run", "scene.toml", "--frames", "many"], ["--frames", "many"]),
        (["run", "scene.toml", "--engin", "x"], ["--engin", "--engine"]),
        (["run", "scene.toml", "--resume", "--overwrite"], ["--resume", "--overwrite"]),
        (["run", "scene.toml", "other.toml"], ["other.toml"]),
        (["inspect"], ["FILE"]),
        (["convert", "toy.ply"], ["OUT"]),
        (["export", "scene.gasp"], ["--frame K, --all and --motion"]),
        (["export", "scene.gasp", "--all", "--frame", "1"], ["--frame K, --all and --motion"]),
        (["export", "scene.gasp", "--all", "--format", "obj"], ["--format", "obj", "ply"]),
        (["export", "scene.gasp", "--all"], ["scene.gasp"]),
        (["export", "toy.ply", "--all"], ["toy.ply"]),
        (["--verbose"], ["--verbose"]),
        (["demo", "--engine", "nothing"], ["nothing", "is installed"]),
        (["demo", "--out", "toy.ply"], ["toy.ply", "choose another --out"]),
        (["demo", "--out", "."], ["not empty", "choose another --out"]),
    ],
)
def test_command_that_makes_no_sense(refused, arguments, says):
    refused(*arguments, says=says)


def test_without_arguments_it_says_what_it_can_do(gasp):
    outcome = gasp()
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out == gasp("--help").out
    for name, (_, summary) in BUILT_IN.items():
        assert f"{name} " in outcome.out
        assert summary in outcome.out


@pytest.mark.parametrize("name", BUILT_IN)
def test_help_of_every_command_teaches_by_example(gasp, name):
    outcome = gasp(name, "--help")
    assert (outcome.status, outcome.err) == (0, "")
    assert f"  gasp {name}" in outcome.out.partition("Examples:")[2]


@pytest.mark.parametrize("name", BUILT_IN)
def test_the_line_in_the_list_is_the_first_of_the_help(name):
    """The list is made without importing the command, so the line is written twice."""
    command = gasp_command(name)
    assert command.name == name
    assert command.help.startswith(BUILT_IN[name][1].rstrip("."))


def gasp_command(name):
    import click

    return gasp.get_command(click.Context(gasp), name)


def test_version(gasp):
    outcome = gasp("--version")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.split()[0] == "gasp"


def test_inspect_json_has_what_others_rely_on(gasp, toy):
    summary = json.loads(gasp("inspect", "toy.ply", "--json").out)
    assert summary["count"] == len(toy)
    assert summary["sh_degree"] == 1
    assert "64" in gasp("inspect", "toy.ply").out


def test_fault_of_our_own_is_one_line_that_asks_for_a_report(capsys, monkeypatch):
    monkeypatch.setattr("gasp_core.discovery.registry.discover", lambda: 1 / 0)
    monkeypatch.delenv("GASP_TRACEBACK", raising=False)
    assert main(["engines"]) == FAILED
    err = capsys.readouterr().err
    assert err.startswith("gasp: internal error: ZeroDivisionError")
    assert (err.count("\n"), "GASP_TRACEBACK=1" in err) == (1, True)
    monkeypatch.setenv("GASP_TRACEBACK", "1")
    assert main(["engines"]) == FAILED
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("gasp: internal error")


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (MemoryError(), "out of memory"),
        (PermissionError(13, "Permission denied", "/somewhere"), "/somewhere: Permission denied"),
        (OSError(28, "No space left on device"), "No space left on device: check that"),
    ],
)
def test_trouble_of_the_machine(capsys, monkeypatch, error, says):
    def fail():
        raise error

    monkeypatch.setattr("gasp_core.discovery.registry.discover", fail)
    assert main(["engines"]) == FAILED
    assert capsys.readouterr().err.startswith(f"gasp: {says}")


def test_ctrl_c_anywhere(capsys, monkeypatch):
    def fail():
        raise KeyboardInterrupt

    monkeypatch.setattr("gasp_core.discovery.registry.discover", fail)
    assert main(["engines"]) == INTERRUPTED
    assert capsys.readouterr().err == "gasp: interrupted\n"


def test_control_characters_do_not_reach_the_terminal(refused):
    assert "\x1b" not in refused("inspect", "\x1b[31mred.ply", says=["red.ply"])


def test_nobody_reads_the_output(gasp_process):
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = gasp_process("engines", stdout=writing)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full to stand for a full disk")  # noqa: PTH110
def test_stdout_on_a_full_disk(gasp_process):
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = gasp_process("engines", stdout=full)
    assert done.returncode == 2
    assert done.stderr.startswith("gasp: No space left on device")
    assert done.stderr.count("\n") == 1


def no_room(limit):
    """A limit on the size of files stands for a full disk: writing fails in the middle, with an OSError."""

    def set_limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return set_limit


@pytest.mark.parametrize("target", ["out.ply", "out.splat", "out.spz", "out.sog"])
def test_full_disk_leaves_no_half_file(gasp_process, workplace, target):
    before = sorted(path.name for path in workplace.iterdir())
    done = gasp_process("convert", "toy.ply", target, preexec_fn=no_room(256))
    assert done.returncode == 2
    assert done.stderr.startswith(f"gasp: {target}: ")
    assert "room" in done.stderr
    assert done.stderr.count("\n") == 1
    assert sorted(path.name for path in workplace.iterdir()) == before


def test_full_disk_at_the_start_of_a_run(gasp_process, workplace):
    before = sorted(path.name for path in workplace.iterdir())
    done = gasp_process("run", "scene.toml", preexec_fn=no_room(512))
    assert done.returncode == 2
    assert done.stderr.startswith("gasp: scene.gasp")
    assert done.stderr.count("\n") == 1
    assert "internal error" not in done.stderr
    assert sorted(path.name for path in workplace.iterdir()) == before
