"""Code that comes with a scene: it is not imported until somebody has agreed to it, and all else is in order."""

import os
import pty
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import gasp_core
from gasp_core import PythonMotion, Recording, load_scene, simulate
from gasp_core.errors import SceneError
from gasp_core.scene.named_code import NamedCode, code_of
from gasp_core.studies.runs import Run, RunStatus, carry_out

FAKES = Path(__file__).parents[1] / "fake_plugins"
MARK = "imported"
CODE = f"""\
import pathlib
with pathlib.Path(__file__).with_name("{MARK}").open("a") as mark:
    mark.write("x")

def sway(simplices, s):
    return simplices
"""
MOTION = '[object.motion]\nkind = "python"\nfunction = "sway:sway"\n\n[engine]'


@pytest.fixture
def scene(workplace):
    """A scene file with code beside it, which leaves a mark where it is imported."""
    (workplace / "sway.py").write_text(CODE)
    path = workplace / "moving.toml"
    path.write_text((workplace / "scene.toml").read_text().replace("[engine]", MOTION))
    return path


@pytest.mark.parametrize(
    "command", [["run"], ["compare", "--engines", "ballistic"], ["tradeoff", "--resolutions", "8"]], ids=lambda c: c[0]
)
def test_without_a_terminal_it_is_refused_unread_and_the_line_names_file_and_flag(refused, workplace, scene, command):
    refused(command[0], scene, *command[1:], says=[f"{workplace / 'sway.py'}", "--trust-code", 'object "toy"'])


def test_with_the_flag_it_runs(gasp, workplace, scene):
    assert gasp("run", scene, "--trust-code").status == 0
    assert (workplace / MARK).exists()


def test_a_recording_of_it_is_looked_at_without_asking_and_without_importing(gasp, workplace, scene):
    assert gasp("run", scene, "--trust-code").status == 0
    (workplace / MARK).unlink()
    assert gasp("export", "moving.gasp", "--all", "--out", "frames").status == 0
    recording = Recording.open(workplace / "moving.gasp")
    assert code_of(recording.scene)
    recording.simplices(1)
    assert not (workplace / MARK).exists()
    with pytest.raises(SceneError, match="trust_code=True"):
        simulate(recording.scene, out=workplace / "again.gasp", progress=False)


def test_going_on_asks_again(gasp, refused, scene):
    assert gasp("run", scene, "--trust-code", "--frames", "1").status == 0
    refused("run", scene, "--resume", says=["--trust-code"])
    assert gasp("run", scene, "--resume", "--trust-code").status == 0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('splat = "toy.ply"', 'splat = "broken.ply"', "broken.ply"),
        ('name = "ballistic"', 'name = "ballistic"\noptions = { no_such = 1 }', "no_such"),
        ('model = "elastic"', 'model = "sand", friction_angle = 30', "sand"),
    ],
)
def test_what_is_agreed_to_is_not_imported_for_a_scene_that_is_refused(refused, workplace, scene, old, new, said):
    (workplace / "broken.ply").write_bytes(b"ply\nnonsense")
    text = scene.read_text().replace(old, new)
    assert text != scene.read_text()
    scene.write_text(text)
    refused("run", scene, "--trust-code", says=[said])
    assert not (workplace / MARK).exists()


def test_nor_where_a_later_object_cannot_be_read_or_the_place_is_taken(refused, workplace, scene):
    (workplace / "broken.ply").write_bytes(b"ply\nnonsense")
    first, engine = scene.read_text().split("[engine]")
    later = '[[object]]\nname = "later"\nsplat = "broken.ply"\nstatic = true\n\n[engine]'
    (workplace / "two.toml").write_text(first + later + engine)
    refused("run", workplace / "two.toml", "--trust-code", says=["broken.ply"])
    (workplace / "moving.gasp").mkdir()
    (workplace / "moving.gasp" / "mine.txt").write_text("mine")
    refused("run", scene, "--trust-code", says=["is no recording"])
    (workplace / "out").mkdir()
    (workplace / "out" / "ballistic.mp4").mkdir()
    refused("compare", scene, "--trust-code", "--out", "out", says=["ballistic.mp4"])
    assert not (workplace / MARK).exists()


def test_in_python_it_is_refused_unless_trusted_and_an_own_function_asks_nothing(workplace, scene, installed):
    loaded = load_scene(scene)
    with pytest.raises(SceneError, match="trust_code=True"):
        simulate(loaded, out=workplace / "a.gasp", progress=False)
    with pytest.raises(SceneError, match="trust_code=True"):
        gasp_core.compare(loaded, ["ballistic"], workplace / "c", progress=False)
    assert not (workplace / MARK).exists()
    assert simulate(loaded, out=workplace / "a.gasp", trust_code=True, progress=False).status == "complete"
    own = PythonMotion(function=lambda simplices, s: simplices)
    with_own = gasp_core.Scene(
        objects=(gasp_core.SplatObject(**{**_fields(loaded.objects[0]), "motion": own}),),
        duration=loaded.duration,
        frame_rate=loaded.frame_rate,
        engine=loaded.engine,
    )
    assert simulate(with_own, out=workplace / "b.gasp", progress=False).status == "complete"


def _fields(item):
    return {name: getattr(item, name) for name in type(item).__dataclass_fields__}


def test_a_module_is_named_by_where_it_is_and_is_not_imported_to_find_that():
    motion = PythonMotion(function="no_such_package_at_all.deep:f")
    named = NamedCode(owner="a", function=motion.function)
    assert "nowhere that Python looks" in named.where()
    sys.modules.pop("this", None)
    assert NamedCode(owner="a", function="this:c").where().endswith("this.py")
    assert "this" not in sys.modules


@pytest.mark.thorough
def test_the_decision_reaches_a_process_of_its_own(workplace, scene, installed):
    loaded = load_scene(scene)
    runs = [
        Run(key=str(trusted), scene=loaded, out=workplace / f"{trusted}.gasp", trust_code=trusted)
        for trusted in (False, True)
    ]
    refused, trusted = carry_out(runs)
    assert (refused.ending, trusted.ending) == (RunStatus.FAILED, RunStatus.COMPLETE)
    assert "--trust-code" in refused.reason


@pytest.mark.parametrize(("answer", "status"), [("y", 0), ("n", 2)])
def test_on_a_terminal_it_asks(workplace, scene, answer, status):
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "gasp_core.cli.main", "run", str(scene), "--json"],
        cwd=workplace,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(FAKES / "ballistic"), os.environ.get("PYTHONPATH", "")])},
        stdin=theirs,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
    )
    os.close(theirs)
    said = bytearray()

    def listen():
        try:
            while part := os.read(ours, 4096):
                said.extend(part)
                if said.endswith(b"]: "):
                    assert not (workplace / MARK).exists()
                    os.write(ours, answer.encode() + b"\n")
        except OSError:  # the terminal is gone with the process
            pass

    listener = threading.Thread(target=listen)
    listener.start()
    assert process.wait(60) == status, said.decode()
    listener.join()
    os.close(ours)
    assert str(workplace / "sway.py") in said.decode()
    assert (workplace / MARK).exists() is (answer == "y")
