"""``gasp engines new``: what it writes is an engine, and what it will not write."""

import json
import re

import pytest

from gasp_core.cli.main import main
from gasp_core.contract import CONTRACT_VERSION

LIST = ["-m", "gasp_core.cli.main", "engines", "--json"]


@pytest.mark.thorough
def test_a_new_engine_passes_the_suite_for_what_it_declares(new_engine, in_process_of_its_own):
    folder = new_engine("bounce-2")
    done = in_process_of_its_own(["-m", "gasp_conformance", "bounce-2", "--quick"], folder)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "bounce-2 (float64, cpu, quick): passes" in done.stdout


def test_a_new_engine_is_ready_and_its_own_test_passes(new_engine, in_process_of_its_own):
    folder = new_engine("bounce")
    rows = json.loads(in_process_of_its_own(LIST, folder).stdout)["engines"]
    (row,) = [row for row in rows if row["name"] == "bounce"]
    assert (row["status"], row["distribution"], row["error"]) == ("ready", "bounce", None)
    # Nothing newer than what is installed, and nothing older that would have to be brought up to date first.
    assert row["contract_version"] == list(CONTRACT_VERSION)
    done = in_process_of_its_own(["-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)], folder)
    assert done.returncode == 0, done.stdout


def test_nothing_is_left_of_the_name_of_the_template(new_engine):
    folder = new_engine("soft-body")
    written = [path for path in folder.rglob("*") if path.is_file() and ".dist-info" not in str(path)]
    assert sorted(str(path.relative_to(folder)) for path in written) == [
        "README.md",
        "pyproject.toml",
        "soft_body/__init__.py",
        "soft_body/engine.py",
        "soft_body/motion.py",
        "soft_body/plugin.py",
        "tests/test_soft_body.py",
    ]
    for path in written:
        assert not re.search("my.?engine", path.read_text(encoding="utf-8"), re.IGNORECASE), path


def test_the_next_steps_are_told(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main(["engines", "new", "bounce"]) == 0
    told = capfd.readouterr().out
    for command in ("cd bounce", "pip install -e .", "gasp engines check bounce", "gasp-conformance bounce --quick"):
        assert f"  {command}\n" in told


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("My Engine", "small letters and digits"),
        ("my_engine", "small letters and digits"),
        ("2d", "small letters and digits"),
        ("../elsewhere", "small letters and digits"),
        ("bounce-", "small letters and digits"),
        ("", "small letters and digits"),
        ("class", "a word of Python"),
        ("random", "package random, and there is one already"),
        ("gasp-core", "package gasp_core, and there is one already"),
        ("ballistic", "installed already, by gasp-fake-ballistic"),
    ],
)
def test_a_name_that_will_not_do_is_refused_in_one_line(tmp_path, monkeypatch, capfd, installed, name, reason):
    installed("ballistic")
    monkeypatch.chdir(tmp_path)
    assert main(["engines", "new", name]) == 2
    told = capfd.readouterr().err
    assert told.startswith("gasp: ") and told.count("\n") == 1 and reason in told
    assert not list(tmp_path.iterdir())


def test_what_is_there_is_not_overwritten(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bounce").mkdir()
    (tmp_path / "taken").write_text("mine")
    for name in ("bounce", "taken"):
        assert main(["engines", "new", name]) == 2
        told = capfd.readouterr().err
        assert told.count("\n") == 1 and f"{name} is there already" in told
    assert not list((tmp_path / "bounce").iterdir())
    assert (tmp_path / "taken").read_text() == "mine"


def test_every_file_of_the_template_is_in_the_wheel(request):
    from hatchling.builders.wheel import WheelBuilder

    root = request.config.rootpath
    template = root / "gasp_core" / "cli" / "engine_template"
    packed = {file.distribution_path for file in WheelBuilder(str(root)).recurse_included_files()}
    for path in template.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            assert path.relative_to(root).as_posix() in packed
