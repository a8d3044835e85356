import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at

coordinates = st.floats(-100, 100)
vectors = st.tuples(coordinates, coordinates, coordinates)

# Products of three rotations and a shift, coordinates to 100: a few hundred units in the last place.
ROUNDING = 1e-10


def a_camera(**values):
    given = {
        "width": 64,
        "height": 48,
        "focal_x": 50.0,
        "focal_y": 50.0,
        "center_x": 32.0,
        "center_y": 24.0,
        "rotation": np.eye(3),
        "translation": np.zeros(3),
    }
    return Camera(**(given | values))


@given(eye=vectors, target=vectors, fov=st.floats(5, 120))
def test_what_it_looks_at_is_in_the_middle_and_up_is_up(eye, target, fov):
    distance = math.dist(eye, target)
    if distance < 1e-3:
        return
    camera = look_at(eye, target, width=200, height=100, field_of_view=fov)
    (place,), (depth,) = camera.project(np.array([target]))
    # Looking from 1e-3 away at coordinates of 100 leaves ten digits of the direction.
    assert place == pytest.approx([100, 50], abs=1e-6 * camera.focal_y / min(distance, 1))
    assert depth == pytest.approx(distance, rel=1e-9, abs=1e-9)
    assert np.abs(camera.rotation @ camera.rotation.T - np.eye(3)).max() < ROUNDING
    assert np.linalg.det(camera.rotation) == pytest.approx(1)
    assert np.abs(camera.position - eye).max() < 1e-9
    assert camera.rotation[1, 2] <= 1e-6  # the picture's down is not the world's up
    assert camera.field_of_view == pytest.approx(fov)


def test_a_point_right_of_the_target_is_right_of_the_middle_and_one_above_is_above():
    camera = look_at((0, -2, 0), (0, 0, 0), width=100, height=100)
    (right, above), _ = camera.project(np.array([[0.1, 0, 0], [0, 0, 0.1]]))
    assert right[0] > 50 and right[1] == pytest.approx(50)
    assert above[1] < 50 and above[0] == pytest.approx(50)


def test_straight_down_there_is_a_camera_too():
    camera = look_at((0, 0, 5), (0, 0, 0), width=10, height=10)
    assert camera.project(np.zeros((1, 3)))[1] == pytest.approx([5])


def test_rays_go_where_points_are_seen():
    camera = look_at((1, -2, 0.7), (0.2, 0, 0.1), width=7, height=5, field_of_view=60)
    points = camera.position + 3.0 * camera.rays().reshape(-1, 3)
    places, depths = camera.project(points)
    rows, columns = np.divmod(np.arange(35), 7)
    assert np.abs(places - np.stack([columns + 0.5, rows + 0.5], axis=1)).max() < ROUNDING
    assert depths == pytest.approx(np.full(35, 3.0))


def test_resized_it_sees_the_same_height_about_the_same_middle():
    camera = a_camera(center_x=30.0, center_y=20.0).resized(256, 96)
    assert (camera.width, camera.height) == (256, 96)
    assert camera.field_of_view == pytest.approx(a_camera().field_of_view)
    assert (camera.focal_x, camera.focal_y) == (100, 100)
    assert (camera.center_x, camera.center_y) == (128 - 4, 40)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"width": 0}, "width"),
        ({"height": 10**6}, "height"),
        ({"width": 3.5}, "width"),
        ({"focal_x": math.nan}, "focal_x"),
        ({"focal_y": -1.0}, "focal_y"),
        ({"near": 0.0}, "near"),
        ({"center_x": math.inf}, "center_x"),
        ({"translation": [0, math.nan, 0]}, "not finite"),
        ({"rotation": np.full((3, 3), math.nan)}, "not finite"),
        ({"rotation": 2 * np.eye(3)}, "rotation is none"),
        ({"rotation": np.diag([1, 1, -1])}, "determinant"),
        ({"rotation": np.eye(4)}, "shapes"),
    ],
)
def test_an_impossible_camera_is_refused(values, says):
    with pytest.raises(RenderingError, match=says):
        a_camera(**values)


@pytest.mark.parametrize(
    ("eye", "target", "fov", "says"),
    [
        ((0, 0, 0), (0, 0, 0), 40, "stands where it looks at"),
        ((math.nan, 0, 0), (0, 0, 0), 40, "not finite"),
        ((1, 0, 0), (0, 0, math.inf), 40, "not finite"),
        ((1, 0, 0), (0, 0, 0), 180, "field of view"),
        ((1, 0, 0), (0, 0, 0), math.nan, "field of view"),
    ],
)
def test_nowhere_to_look(eye, target, fov, says):
    with pytest.raises(RenderingError, match=says):
        look_at(eye, target, width=10, height=10, field_of_view=fov)
