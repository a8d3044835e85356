"""From which side things are seen where nobody has said."""

from __future__ import annotations

import dataclasses
import logging

import flying_points
import numpy as np
import pytest

import gasp_core as gasp
from gasp_core import BoxShape, CameraChoice, Collider, HalfSpace, SteadyMotion, simulate
from gasp_core.contract import Side
from gasp_core.rendering.framing import Motion, frame_motion
from gasp_core.rendering.live import LiveFilm
from gasp_core.rendering.player import camera_of
from gasp_core.rendering.sides import LEFT, RIGHT, hidden_share, with_side

SIZE = {"width": 96, "height": 64}


def wall(across, **more):
    """A wall that stands across x at a place, larger than what comes to it."""
    return Collider(shape=BoxShape(center=(across, 0, 0.5), half_extents=(0.05, 2.0, 1.0)), **more)


def flight(toward=1.0, frames=9):
    """A cloud of half a metre that flies a metre along x, to a wall at 0.8 m."""
    cloud = np.random.default_rng(3).uniform(-0.25, 0.25, size=(200, 3)) + [-toward * 0.5, 0, 0.5]
    clouds = [cloud + [toward * way, 0, 0] for way in np.linspace(0, 1, frames)]
    return Motion(points=np.concatenate(clouds), frames=np.repeat(np.arange(frames), len(cloud)))


def view(motion, *colliders, choice=None, **more):
    return with_side(choice or CameraChoice(), motion, colliders, **SIZE, **more).view


def test_what_strikes_a_wall_is_seen_from_the_side_it_comes_from():
    assert view(flight(), wall(0.8)) == LEFT
    assert view(flight(toward=-1.0), wall(-0.8)) == RIGHT


def test_the_usual_side_is_taken_where_nothing_stands_in_the_way():
    floor = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    behind = Collider(shape=BoxShape(center=(0, 3, 0.5), half_extents=(2, 0.1, 1)))
    room = Collider(shape=BoxShape(center=(0, 0, 0.5), half_extents=(2, 2, 1)), side=Side.INSIDE)
    assert view(flight()) == view(flight(), floor, behind, room) == RIGHT
    # And as little from the other one.
    assert view(flight(), wall(-0.9), wall(0.9)) == RIGHT


def test_what_moves_hides_nothing_for_good():
    assert view(flight(), wall(0.8, motion=SteadyMotion(velocity=(5.0, 0, 0)))) == RIGHT


def test_a_film_stays_on_its_side_where_both_are_as_good():
    assert view(flight(), usual=LEFT) == view(flight(), wall(3.0), usual=LEFT) == LEFT
    assert view(flight(toward=-1.0), wall(-0.8), usual=LEFT) == RIGHT


@pytest.mark.parametrize(
    "choice",
    [
        CameraChoice(view="three-quarter"),
        CameraChoice(view=0),
        CameraChoice(view="front"),
        CameraChoice(position=(0, -1, 0), target=(0, 0, 0)),
        CameraChoice(file="cameras.json"),
        # It sees every side.
        CameraChoice(turns=1.0),
    ],
    ids=lambda choice: str(choice.view),
)
def test_a_camera_that_is_said_stays(choice):
    assert with_side(choice, flight(), [wall(0.8)], **SIZE) is choice


def test_as_many_points_are_hidden_as_a_ray_to_each_says():
    """Against the closed form: a ray meets a plate where it crosses its plane within it."""
    motion, choice = flight(), CameraChoice(view=RIGHT, follow=False)
    around, above = choice.direction
    eye = frame_motion(motion, **SIZE, around=around, above=above).position
    points = motion.points
    box = BoxShape(center=(0.8, -0.6, 0.5), half_extents=(1e-6, 0.3, 0.3))
    crossed = (0.8 - eye[0]) / (points[:, 0] - eye[0])
    met = eye + crossed[:, None] * (points - eye)
    expected = (np.abs(met[:, 1] + 0.6) < 0.3) & (np.abs(met[:, 2] - 0.5) < 0.3) & (points[:, 0] < 0.8)
    found = hidden_share(choice, motion, [Collider(shape=box)], **SIZE)
    assert 0.05 < expected.mean() < 0.95
    # All points of all frames are looked at; one of them may be at the edge of the plate, which is 2 um thick.
    assert found == pytest.approx(expected.mean(), abs=1.5 / len(points))


@pytest.fixture
def run_of(tmp_path):
    """Runs a scene with an engine that lets all fly through walls: it matters nothing to where they are seen from."""

    def go(scene, **options):
        engine = flying_points.descriptor()
        able = dataclasses.replace(engine.capabilities, collider_shapes=frozenset({BoxShape}))
        engine = dataclasses.replace(engine, capabilities=able)
        out = tmp_path / "run.gasp"
        return simulate(scene, engine=(engine, flying_points.Ballistic()), out=out, progress=False, **options)

    return go


@pytest.fixture
def struck(falling_scene):
    """A blob that flies to a wall on its right."""
    (item,) = falling_scene.objects
    thrown = dataclasses.replace(item, velocity=(5.0, 0, 0))
    box = BoxShape(center=(1.65, 0, 0), half_extents=(0.05, 4, 3))
    return dataclasses.replace(falling_scene, objects=(thrown,), colliders=(Collider(shape=box),))


def from_left(camera):
    """Whether a camera looks from the left to the right."""
    return camera.rotation[2][0] > 0


def test_a_film_of_it_is_seen_from_there_and_the_log_says_so(run_of, struck, dots, tmp_path, caplog):
    run = run_of(struck)
    with caplog.at_level(logging.WARNING):
        gasp.render(run, tmp_path / "frames", size=(96, 64))
    seen = [camera for camera in dots.cameras if camera.width == 96]
    assert all(from_left(camera) for camera in seen[-7:])
    assert f'seen from the left (view "{LEFT}")' in caplog.text
    caplog.clear()
    for more in ({"camera": "three-quarter"}, {"colliders": False}):
        gasp.render(run, tmp_path / f"other {next(iter(more))}", size=(96, 64), **more)
        assert not from_left(dots.cameras[-1]) and not caplog.text


def test_a_film_of_a_run_that_goes_on_is_seen_from_one_side_all_along(run_of, struck, dots, tmp_path):
    film = LiveFilm(tmp_path / "run.gasp", struck, [tmp_path / "frames"], width=96, height=64)
    with film:
        run_of(struck, recorded=film.recorded)
    assert film.problem == "" and len(film.cameras) == 7 and all(map(from_left, film.cameras))
    assert film.side.startswith("seen from the left")


def test_a_film_that_was_seen_from_the_wrong_side_is_made_anew(run_of, struck, dots, tmp_path):
    """A wind, that nobody knew of when the film was begun, blows it to a wall on its left."""
    (item,), (wall,) = struck.objects, struck.colliders
    left = dataclasses.replace(wall, shape=dataclasses.replace(wall.shape, center=(-1.65, 0, 0)))
    expected = dataclasses.replace(struck, colliders=(wall, left))
    resting = dataclasses.replace(item, velocity=(-5.0, 0, 0))
    film = LiveFilm(tmp_path / "run.gasp", expected, [tmp_path / "frames"], width=96, height=64)
    with film:
        run_of(dataclasses.replace(expected, objects=(resting,)), recorded=film.recorded)
    assert film.problem == "" and film.anew and not film.side
    assert not any(map(from_left, film.cameras))


def test_a_page_begins_there(run_of, struck, monkeypatch, dots_of):
    monkeypatch.setattr("gasp_core.rendering.player.open_renderer", lambda name=None: dots_of())
    begun = camera_of(run_of(struck))
    assert begun["position"][0] < begun["target"][0]
