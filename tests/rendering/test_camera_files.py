import json
import math

import numpy as np
import pytest

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.camera_files import choose, placed, read_cameras
from gasp_core.scene.placement import Placement

POINTS = np.array([[0.1, 0.2, 0.3], [-0.4, 0.1, 0.0], [0.0, 0.0, 0.5]])


@pytest.fixture
def written(tmp_path):
    def write(value, name="cameras.json"):
        path = tmp_path / name
        path.write_text(value if isinstance(value, str) else json.dumps(value))
        return path

    return write


def as_3dgs(camera, name="r_0"):
    """As `camera_to_JSON` of the 3DGS code writes it: the eye, and camera to world by rows."""
    return {
        "id": 0,
        "img_name": name,
        "width": camera.width,
        "height": camera.height,
        "position": camera.position.tolist(),
        "rotation": camera.rotation.T.tolist(),
        "fx": camera.focal_x,
        "fy": camera.focal_y,
    }


def as_nerf(camera, name="images/r_0.png"):
    """Camera to world with OpenGL's axes: y up, z out of the picture."""
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation.T @ np.diag([1, -1, -1])
    pose[:3, 3] = camera.position
    return {"file_path": name, "transform_matrix": pose.tolist()}


A = look_at((1, -2, 0.7), (0.2, 0, 0.1), width=640, height=480, field_of_view=50)
B = look_at((0, 3, 1), (0, 0, 0), width=640, height=480, field_of_view=50)


def same_view(found, expected):
    places, depths = found.project(POINTS)
    wanted, wanted_depths = expected.project(POINTS)
    assert places == pytest.approx(wanted, abs=1e-9)
    assert depths == pytest.approx(wanted_depths)


def test_3dgs(written):
    cameras = read_cameras(written([as_3dgs(A), as_3dgs(B, "r_1")]))
    assert [entry.name for entry in cameras] == ["r_0", "r_1"]
    same_view(cameras[0].camera, A)
    same_view(cameras[1].camera, B)


@pytest.mark.parametrize("where", ["file", "frame"])
def test_nerf_with_focal_lengths(written, where):
    lens = {"w": 640, "h": 480, "fl_x": A.focal_x, "fl_y": A.focal_y, "cx": 320, "cy": 240, "k1": 0.01}
    frames = [as_nerf(A) | (lens if where == "frame" else {}), as_nerf(B, "images/r_1.png") | lens]
    cameras = read_cameras(written({"frames": frames} | (lens if where == "file" else {})))
    same_view(cameras[0].camera, A)
    same_view(choose(cameras, "r_1", "f"), B)
    same_view(choose(cameras, "images/r_1.png", "f"), B)


def test_nerf_with_an_angle_alone(written):
    square = look_at((1, -2, 0.7), (0.2, 0, 0.1), width=800, height=800, field_of_view=50)
    (camera,) = read_cameras(written({"camera_angle_x": math.radians(50), "frames": [as_nerf(square)]}))
    same_view(camera.camera, square)


def test_by_number_and_by_name(written):
    path = written([as_3dgs(A, "7"), as_3dgs(B, "front")])
    cameras = read_cameras(path)
    same_view(choose(cameras, 0, path), A)
    same_view(choose(cameras, "1", path), B)
    same_view(choose(cameras, "7", path), A)
    with pytest.raises(RenderingError, match="has cameras 0 to 1, not 2"):
        choose(cameras, 2, path)
    with pytest.raises(RenderingError, match='no camera "back", its cameras are 7, front'):
        choose(cameras, "back", path)


def test_a_placed_splat_is_seen_as_before():
    turn = look_at((1, 2, 3), (0, 0, 0), width=1, height=1).rotation
    placement = Placement(rotation=turn, scale=0.25, translation=np.array([5.0, -3.0, 0.4]))
    moved = 0.25 * POINTS @ turn.T + placement.translation
    camera = placed(A, placement)
    places, depths = camera.project(moved)
    expected, expected_depths = A.project(POINTS)
    assert places == pytest.approx(expected, abs=1e-9)
    assert depths == pytest.approx(0.25 * expected_depths)
    assert camera.near == pytest.approx(0.25 * A.near)


def broken(**values):
    return [as_3dgs(A) | values]


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("{", "is not valid JSON"),
        ("[" * 100_000, "is not valid JSON"),
        ("3", "is no camera file"),
        ("{}", "is no camera file"),
        ('{"frames": 3}', "is no camera file"),
        ("[]", "holds no camera"),
        ('{"frames": []}', "holds no camera"),
        ("[3]", "camera 0 is no object"),
        (broken(width="wide"), "camera 0: width: must be a number, found wide"),
        (broken(fx=None), "camera 0: fx: must be a number"),
        (broken(fx=True), "camera 0: fx: must be a number"),
        (broken(fx=-3.0), "camera 0: the camera's focal_x must be a number > 0"),
        (broken(position=[0, 0]), "camera 0: position: must be finite numbers of shape (3,)"),
        (broken(rotation="x"), "camera 0: rotation: must be finite numbers of shape (3, 3)"),
        (broken(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, 2]]), "camera 0: the camera's rotation is none"),
        ('[{"rotation": [[NaN, 0, 0], [0, 1, 0], [0, 0, 1]]}]', "camera 0: rotation: must be finite"),
        ({"frames": [{"transform_matrix": np.eye(4).tolist()}]}, "frame 0: camera_angle_x: must be a number"),
        ({"camera_angle_x": 4, "frames": [as_nerf(A)]}, "frame 0: camera_angle_x: must be an angle"),
        ({"camera_angle_x": 1, "frames": [{}]}, "frame 0: transform_matrix: must be finite numbers"),
    ],
)
def test_a_broken_file_is_told_by_camera_and_key(written, value, says):
    path = written(value)
    with pytest.raises(RenderingError) as caught:
        read_cameras(path)
    assert str(path) in str(caught.value)
    assert says in str(caught.value)


def test_no_file_and_no_text(tmp_path):
    with pytest.raises(RenderingError, match="there is no such camera file"):
        read_cameras(tmp_path / "none.json")
    with pytest.raises(RenderingError, match="cannot be read"):
        read_cameras(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RenderingError, match="cannot be read"):
        read_cameras(tmp_path / "binary.json")


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"fx": 10**400}, "camera 0: fx: must be a number, found 1000"),
        ({"width": 10**400}, "camera 0: width: must be a number"),
        ({"position": [10**400, 0, 0]}, "camera 0: position: must be finite numbers"),
        ({"rotation": [[1e200, 0, 0], [0, 1e200, 0], [1e200, -1e200, 0]]}, "camera 0: the camera's rotation is none"),
        ({"rotation": [[1e200, 1e200, 0], [1e200, -1e200, 0], [0, 0, 1]]}, "camera 0: the camera's rotation is none"),
        ({"img_name": ["a"]}, "camera 0: img_name: must be a text"),
        ({"fy": "\x1b[31m"}, r"camera 0: fy: must be a number, found \\x1b\[31m"),
    ],
)
def test_what_no_camera_has_is_refused_in_one_line(written, values, says):
    with pytest.raises(RenderingError, match=says) as error:
        read_cameras(written([as_3dgs(A) | values]))
    assert str(error.value).isprintable()


@pytest.mark.parametrize("number", ["9" * 5000, "1e400", "-Infinity", "NaN"])
def test_numbers_that_are_none_are_refused(written, number):
    text = json.dumps([as_3dgs(A)]).replace('"width": 640', f'"width": {number}')
    with pytest.raises(RenderingError):
        read_cameras(written(text))


def test_an_angle_of_nothing_is_refused(written):
    with pytest.raises(RenderingError, match="must be an angle between 0 and pi"):
        read_cameras(written({"camera_angle_x": 5e-324, "frames": [as_nerf(A)]}))


def test_names_are_fit_to_be_printed(written):
    path = written([as_3dgs(A, "a\x1b[31m"), as_3dgs(B, "b" * 5000)])
    first, second = read_cameras(path)
    assert first.name == r"a\x1b[31m"
    assert len(second.name) == 200
    with pytest.raises(RenderingError) as error:
        choose([first], "c\n", path)
    assert str(error.value).isprintable()


def test_a_file_without_an_end_holds_no_cameras():
    with pytest.raises(RenderingError, match="longer than the 16,777,216 bytes"):
        read_cameras("/dev/zero")
