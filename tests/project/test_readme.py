"""What the README shows works as it stands, with a toy in the plant's place and a shorter film."""

import re
from pathlib import Path

import pytest

import gasp_core as gasp
from gasp_core.toy import make_toy

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def block(language, start):
    (found,) = [code for code in re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL) if code.startswith(start)]
    return found


@pytest.fixture
def folder(tmp_path, monkeypatch):
    gasp.write_splat(tmp_path / "plant.splat", make_toy(200))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_first_scene(folder):
    (folder / "scene.toml").write_text(block("toml", "collider"), encoding="utf-8")
    scene = gasp.load_scene(folder / "scene.toml")
    assert scene.frame_count == 51
    assert gasp.simulate(scene, frames=2).frame_count == 2


def test_the_same_in_python(folder):
    code = block("python", "import gasp_core")
    assert "duration=2" in code
    exec(code.replace("duration=2", "duration=0.04"), {})
    assert len(gasp.read_splat(folder / "last.ply")) == 200
    assert gasp.Recording.open(folder / "plant.gasp").status == "complete"
