"""Where pages that play a run begin."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import gasp_core as gasp
from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.player import camera_of

EYE, AIM = (0.5, -3.0, 0.8), (0.0, 0.0, 0.2)


@pytest.fixture(params=["with a renderer", "without one"], autouse=True)
def renderer(request, monkeypatch, dots_of):
    def opened(name=None):
        if request.param == "without one":
            raise RenderingError("no renderer is installed")
        return dots_of()

    monkeypatch.setattr("gasp_core.rendering.player.open_renderer", opened)


@pytest.fixture
def begins(run_of, falling_scene):
    """The camera of a page, of a scene with this one."""

    def of(choice):
        return camera_of(run_of(dataclasses.replace(falling_scene, camera=choice), overwrite=True))

    return of


def ways(camera):
    """From what is looked at to the eye, of length one."""
    way = np.array(camera["position"]) - camera["target"]
    return way / np.linalg.norm(way)


@pytest.mark.parametrize("kind", ["place", "path", "file"])
def test_it_begins_where_the_camera_of_the_scene_stands_in_the_first_frame(begins, tmp_path, kind):
    camera = look_at(EYE, AIM, width=120, height=80, field_of_view=40)
    entry = {"position": camera.position.tolist(), "rotation": camera.rotation.T.tolist(), "fx": camera.focal_x}
    size = {"width": 120, "height": 80, "fy": camera.focal_y, "img_name": "a"}
    (tmp_path / "cameras.json").write_text(json.dumps([entry | size]))
    later = gasp.Viewpoint(time=0.2, position=(5, 5, 5), target=AIM)
    choices = {
        "place": gasp.CameraChoice(position=EYE, target=AIM),
        "path": gasp.CameraChoice(path=(gasp.Viewpoint(time=0, position=EYE, target=AIM), later)),
        "file": gasp.CameraChoice(file=tmp_path / "cameras.json"),
    }
    found = begins(choices[kind])
    # cameras.json keeps sixteen digits.
    assert found["position"] == pytest.approx(EYE, abs=1e-9)
    assert ways(found) == pytest.approx(np.subtract(EYE, AIM) / np.linalg.norm(np.subtract(EYE, AIM)), abs=1e-9)
    assert found["vertical_angle"] == pytest.approx(40)


@pytest.mark.parametrize("others", [{}, {"turns": 1.0}, {"follow": True}], ids=str)
def test_it_begins_on_the_side_that_a_view_names_with_all_that_moves_before_it(begins, others):
    default, left = begins(None), begins(gasp.CameraChoice(view="left", **others))
    rise = np.radians(8)
    assert ways(left) == pytest.approx([-np.cos(rise), 0, np.sin(rise)], abs=1e-9)
    # No page's camera goes with what moves: both see all of it, from about as far.
    aways = [np.linalg.norm(np.subtract(each["position"], each["target"])) for each in (default, left)]
    assert 0.8 < aways[1] / aways[0] < 1.25


def test_a_camera_file_that_is_gone_is_told_and_the_view_is_that_of_no_camera(begins, tmp_path, caplog):
    assert begins(gasp.CameraChoice(file=tmp_path / "gone.json", view="a")) == begins(None)
    assert "gone.json" in caplog.text and "not with the scene's camera" in caplog.text
