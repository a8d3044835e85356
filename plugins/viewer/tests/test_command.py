import shutil
import subprocess
import sys
import webbrowser

import pytest

from gasp_core.cli.main import main
from gasp_core.discovery.registry import discover
from gasp_core.io import write_splat


@pytest.fixture
def gasp(capfd):
    """Runs gasp; returns its status, output and errors."""

    def run(*arguments):
        status = main([str(argument) for argument in arguments])
        return (status, *capfd.readouterr())

    return run


def refused(outcome, *parts):
    status, out, err = outcome
    assert (status, out) == (2, "")
    assert err.startswith("gasp: ") and err.count("\n") == 1
    for part in parts:
        assert part in err


def test_the_plugin_offers_the_command_and_imports_nothing_heavy():
    code = (
        "import sys, gasp_viewer.plugin\n"
        "assert [command.name for command in gasp_viewer.plugin.gasp_commands()] == ['view']\n"
        "heavy = {'viser', 'websockets', 'gasp_viewer.command', 'gasp_viewer.session'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_it_is_registered():
    assert "view" in discover().commands


def test_the_help_teaches_with_examples_and_needs_no_viser():
    code = (
        "import sys\nfrom gasp_core.cli.main import main\n"
        "status = main(['view', '--help'])\nassert 'viser' not in sys.modules\nsys.exit(status)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Examples:" in done.stdout and "gasp view plant.gasp" in done.stdout
    assert "127.0.0.1" in done.stdout


def test_a_path_that_is_missing(gasp, tmp_path):
    refused(gasp("view", tmp_path / "none.gasp"), "none.gasp", "there is no such")


def test_a_file_that_is_no_splat(gasp, tmp_path):
    (tmp_path / "letter.ply").write_text("Dear reader")
    refused(gasp("view", tmp_path / "letter.ply"), "letter.ply")


def test_a_folder_that_is_nothing(gasp, tmp_path):
    refused(gasp("view", tmp_path), str(tmp_path))


def test_a_recording_whose_header_is_damaged(gasp, tmp_path, toy_run):
    shutil.copytree(toy_run, tmp_path / "run.gasp")
    (tmp_path / "run.gasp" / "zarr.json").write_text("{")
    refused(gasp("view", tmp_path / "run.gasp"), "damaged")


def test_a_recording_whose_arrays_are_damaged(gasp, tmp_path, toy_run):
    shutil.copytree(toy_run, tmp_path / "run.gasp")
    shutil.rmtree(tmp_path / "run.gasp" / "reference" / "means")
    refused(gasp("view", tmp_path / "run.gasp"), "reference/means", "damaged")


def test_a_dead_run_without_frames(gasp, tmp_path, toy_run):
    shutil.copytree(toy_run, tmp_path / "run.gasp")
    shutil.rmtree(tmp_path / "run.gasp" / "commits")
    refused(gasp("view", tmp_path / "run.gasp"), "holds no frame", "gasp run --resume")


def test_up_is_for_files(gasp, toy_run):
    refused(gasp("view", toy_run, "--up", "+z"), "--up is for splat files")


def test_a_file_has_no_points_and_no_speed(gasp, tmp_path, toy):
    write_splat(tmp_path / "toy.ply", toy)
    refused(gasp("view", tmp_path / "toy.ply", "--layer", "points"), "no layer points", "gaussians, triangles")
    refused(gasp("view", tmp_path / "toy.ply", "--colour", "speed"), "no colour speed", "trained")


def test_a_host_that_is_not_here(gasp, toy_run):
    refused(gasp("view", toy_run, "--host", "203.0.113.7"), "--host 203.0.113.7", "127.0.0.1")


@pytest.mark.parametrize("port", ["-1", "65536", "http"])
def test_an_impossible_port(gasp, toy_run, port):
    refused(gasp("view", toy_run, "--port", port), "--port")


@pytest.fixture
def ended(monkeypatch):
    """Ctrl-C as soon as the page is there."""
    from gasp_viewer.session import Session

    def run(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(Session, "run", run)


@pytest.fixture
def opened(monkeypatch):
    """The addresses a browser was sent to."""
    found = []
    monkeypatch.setattr(webbrowser, "open", found.append)
    monkeypatch.setattr(webbrowser, "get", lambda: None)
    monkeypatch.setenv("DISPLAY", ":0")
    return found


def test_it_says_where_the_page_is_and_opens_it(gasp, toy_run, ended, opened):
    status, out, err = gasp("view", toy_run, "--port", "0")
    assert (status, err) == (130, "gasp: interrupted\n")
    assert out.startswith(f"{toy_run}: http://127.0.0.1:") and out.count("\n") == 1
    assert opened == [out.split()[1]]


def test_it_opens_no_browser_that_was_not_wanted_or_is_not_there(gasp, toy_run, ended, opened, monkeypatch):
    assert gasp("view", toy_run, "--port", "0", "--no-open")[0] == 130
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert gasp("view", toy_run, "--port", "0")[0] == 130
    assert opened == []


def test_a_page_that_others_can_see_comes_with_a_warning(gasp, toy_run, ended):
    status, out, err = gasp("view", toy_run, "--host", "0.0.0.0", "--port", "0", "--no-open")
    assert status == 130
    assert "http://localhost:" in out
    assert err.startswith("warning: everyone who can reach 0.0.0.0 can see this")
