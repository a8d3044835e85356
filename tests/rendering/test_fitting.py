"""Cameras by what is seen: nothing of a subject outside of the picture, and the picture filled by it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gasp_core as gasp
from gasp_core.errors import SceneError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.fitting import fitted, well_framed
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import Motion, frame_motion, motion_of
from gasp_core.rendering.silhouettes import SAFE, extent_of, seen_from
from gasp_core.scene.settings import VIEWS

SIZE = (96, 64)


class Clouds:
    """Points (N, 3) frame by frame, as small Gaussians."""

    path, frame_rate, colliders, camera = "clouds", 25.0, (), None

    def __init__(self, *frames, scale=1e-3):
        self.frames, self.scale = frames, scale
        self.frame_count = len(frames)

    def positions(self, frame):
        return self.frames[frame]

    def subject(self, frame):
        means = self.frames[frame]
        return RenderInput(
            means=means,
            opacities=np.ones(len(means)),
            harmonics=np.zeros((len(means), 1, 3)),
            quaternions=np.tile([1.0, 0, 0, 0], (len(means), 1)),
            scales=np.full((len(means), 3), self.scale),
        )


def cloud(seed=0, count=40, at=(0, 0, 0), stretch=(1, 1, 1)):
    return np.random.default_rng(seed).uniform(-0.5, 0.5, size=(count, 3)) * stretch + at


def reach(footage, cameras):
    """Farthest from the middle of its picture that anything comes in any frame, in half pictures."""
    farthest = 0.0
    for frame, camera in enumerate(cameras):
        places, depths = camera.project(footage.positions(frame))
        assert (depths > camera.near).all()
        farthest = max(farthest, float(np.abs(2 * places / [camera.width, camera.height] - 1).max()))
    return farthest


def test_the_extent_of_a_picture():
    alpha = np.zeros((40, 100))
    alpha[10:20, 50:75] = 1.0
    extent = extent_of(alpha)
    assert (extent.left, extent.right, extent.upper, extent.lower) == pytest.approx((0.0, 0.5, -0.5, 0.0))
    assert extent.filled == pytest.approx(0.25) and extent.reach == pytest.approx(0.5) and not extent.well
    wide = extent_of(alpha, 2.0)
    assert (wide.left, wide.right, wide.upper, wide.lower) == pytest.approx((0.0, 1.0, -1.0, 0.0))
    assert extent_of(np.zeros((4, 4))) is None
    # A hundredth of a pixel, of 250 that are full, is left out.
    alpha[0, 0] = 0.01
    assert extent_of(alpha) == extent


@given(
    st.integers(0, 10),
    st.tuples(*[st.floats(1e-2, 1e2)] * 3),
    st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    st.sampled_from(sorted(VIEWS)),
    st.sampled_from([(640, 360), (300, 400), (64, 64)]),
)
@settings(max_examples=25, deadline=None)
def test_a_fitted_camera_has_all_of_it_in_the_picture_and_the_picture_filled(dots_of, seed, stretch, at, view, size):
    start = cloud(seed, at=at, stretch=stretch)
    footage = Clouds(start, start + 0.5 * np.array(stretch))
    motion = motion_of(footage)
    around, above = VIEWS[view]
    camera = frame_motion(motion, width=size[0], height=size[1], around=around, above=above)
    found = fitted(camera, motion, footage.subject, dots_of())
    assert camera.rotation == pytest.approx(found.rotation, abs=1e-9)
    # A pixel of the silhouettes, of which the longer side of the picture has 160, is a dot either way.
    assert reach(footage, [found] * 2) < SAFE + 2 / 160 * max(size) / min(size)
    assert well_framed([found] * 2, motion, footage.subject, dots_of())


def test_what_is_large_is_in_the_picture_with_all_of_its_size():
    renderer = pytest.importorskip("gasp_renderer.rasteriser").NumbaRenderer()
    footage = Clouds(cloud(count=3, stretch=(0.2, 0.2, 0.2)), scale=0.3)
    motion = motion_of(footage)
    camera = frame_motion(motion, width=320, height=180, around=35, above=18)
    assert seen_from(camera, footage.subject(0), renderer).extent.reach > 1
    found = fitted(camera, motion, footage.subject, renderer)
    assert seen_from(found, footage.subject(0), renderer).extent.well
    assert well_framed([found], motion, footage.subject, renderer)
    assert not well_framed([camera], motion, footage.subject, renderer)


def test_a_turn_has_all_of_it_in_every_picture(cameras_of):
    footage = Clouds(*[cloud(stretch=(2, 0.3, 0.7), at=(3, 3, 3))] * 24)
    cameras = cameras_of(footage, gasp.CameraChoice(view="front", turns=1))
    middles = [camera.rotation[2] for camera in cameras]
    assert middles[0] == pytest.approx(-middles[12] * [1, 1, -1])
    # Going to the right of what one looks at: after a quarter it is seen from its right.
    assert cameras[6].position[0] > 4
    assert 0.8 < reach(footage, cameras) < SAFE + 0.02


def flying(count=25, speed=1.0):
    return Clouds(*[cloud(at=(speed * k, 0, 0)) for k in range(count)])


def test_a_camera_that_follows_keeps_what_flies_large(cameras_of):
    footage = flying()
    choice = gasp.CameraChoice(view="front", follow=True)
    cameras = cameras_of(footage, choice)
    assert reach(footage, cameras) < SAFE + 0.02
    heights = [np.ptp(camera.project(footage.positions(k))[0][:, 1]) / SIZE[1] for k, camera in enumerate(cameras)]
    assert min(heights) > 0.5
    standing = cameras_of(footage, gasp.CameraChoice(view="front", follow=False))
    assert standing[0] is standing[-1]
    assert np.ptp(standing[0].project(footage.positions(12))[0][:, 1]) / SIZE[1] < 0.1


def test_a_camera_that_follows_does_not_jump_with_what_it_films(cameras_of):
    shaken = Clouds(*[cloud(at=(0, 0, 0.2 * (-1) ** k)) for k in range(25)])
    cameras = cameras_of(shaken, gasp.CameraChoice(follow=True))
    steps = np.linalg.norm(np.diff([camera.position for camera in cameras], axis=0), axis=1)
    # An eighth of what it is shaken by.
    assert steps.max() < 0.05


def test_what_goes_far_is_followed_and_what_does_not_is_not(cameras_of):
    near, far = cameras_of(flying(speed=0.1)), cameras_of(flying(speed=1.0))
    assert near[0] is near[-1]
    assert far[-1].position[0] - far[0].position[0] > 20
    assert cameras_of(flying(speed=1.0), gasp.CameraChoice(follow=False))[0].position == pytest.approx(
        cameras_of(flying(speed=1.0), gasp.CameraChoice(follow=False))[-1].position
    )


def test_a_path_goes_through_its_viewpoints_without_going_beyond_them(cameras_of):
    footage = Clouds(*[cloud()] * 51)
    path = (
        gasp.Viewpoint(time=0.4, position=(0, -2, 1), target=(0, 0, 0)),
        gasp.Viewpoint(time=0.8, position=(2, -2, 1), target=(0, 0, 0.5)),
        gasp.Viewpoint(time=1.6, position=(2, 0, 1), target=(0.1, 0, 0)),
    )
    cameras = cameras_of(footage, gasp.CameraChoice(path=path, field_of_view=50))
    eyes = np.array([camera.position for camera in cameras])
    assert eyes[:11] == pytest.approx(np.tile(path[0].position, (11, 1)))
    assert eyes[20] == pytest.approx(path[1].position) and eyes[40:] == pytest.approx(
        np.tile(path[2].position, (11, 1))
    )
    assert (eyes <= np.array([2, 0, 1]) + 1e-9).all() and (eyes >= np.array([0, -2, 1]) - 1e-9).all()
    assert (np.diff(eyes, axis=0)[:, :2] >= -1e-9).all()
    aim = cameras[20].project(np.array([path[1].target]))[0]
    assert aim == pytest.approx(np.array([[48, 32]])) and cameras[3].field_of_view == pytest.approx(50)
    (alone,) = cameras_of(footage, gasp.CameraChoice(path=path[:1]), numbers=[7])
    assert alone.position == pytest.approx(path[0].position)


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ({"view": "sideways"}, "view must be one of three-quarter, front"),
        ({"view": "bakc"}, r'found .bakc., did you mean "back"\?'),
        ({"view": 3}, "view must be one of three-quarter, front"),
        ({"position": (0, 0, 0)}, "target belongs to position"),
        ({"position": (0, 0, 0), "target": (1, 0, 0), "file": "cameras.json"}, "file contradicts position"),
        ({"position": (0, 0, 0), "target": (1, 0, 0), "follow": True}, "follow has no meaning with position"),
        ({"file": "cameras.json", "turns": 1.0}, "turns has no meaning with file"),
        (
            {"path": [gasp.Viewpoint(time=t, position=(0, 0, 0), target=(1, 0, 0)) for t in (1.0, 1.0)]},
            "path must have rising times, found 1.0 after 1.0",
        ),
        ({"turns": float("inf")}, "turns"),
    ],
)
def test_cameras_that_cannot_be(choice, says):
    with pytest.raises(SceneError, match=says):
        gasp.CameraChoice(**choice)


def test_a_backdrop_is_not_what_is_filmed_and_a_table_is(run_of, falling_scene):
    (item,) = falling_scene.objects
    splat = item.splat

    def beside(scale):
        still = splat.with_(means=splat.means * scale, scales=splat.scales * scale)
        return gasp.SplatObject(name="still", splat=still, static=True, position=(0, 0, -0.5))

    for scale, seen in ((1.5, 120), (20.0, 60)):
        scene = dataclasses.replace(falling_scene, objects=(item, beside(scale)))
        footage = RecordedFootage(run_of(scene, name=f"{scale}.gasp"))
        assert len(footage.subject(3)) == seen and len(footage.splats(3)) == 120
        assert np.sort(footage.positions(3), axis=0) == pytest.approx(
            np.sort(footage.subject(3).means, axis=0), abs=1e-6
        )


def test_several_motions_are_one():
    first, second = motion_of(Clouds(cloud(), cloud(1))), motion_of(Clouds(cloud(2, at=(9, 0, 0))))
    both = Motion.joined([first, second.later(2)])
    assert sorted(set(both.frames.tolist())) == [0, 1, 2]
    assert both.reach > 9 > first.reach and both.size == pytest.approx(max(first.size, second.size))


CAMERAS = {
    'view = "front"\nfollow = true\nturns = -0.5': gasp.CameraChoice(view="front", follow=True, turns=-0.5),
    "path = [{ time = 0, position = [0, 0, 1], target = [1, 0, 0] }]\nfield_of_view = 30": gasp.CameraChoice(
        path=(gasp.Viewpoint(time=0, position=(0, 0, 1), target=(1, 0, 0)),), field_of_view=30
    ),
    "position = [0, 0, 1]\ntarget = [1, 0, 0]": gasp.CameraChoice(position=(0, 0, 1), target=(1, 0, 0)),
}


SCENE = """
[scene]
duration = 1.0
frame_rate = 25
[[object]]
name = "blob"
splat = "blob.ply"
material = "rubber"
[camera]
"""


def read(folder, text, name="scene.toml"):
    (folder / "blob.ply").touch()
    (folder / name).write_text(text)
    return gasp.load_scene(folder / name)


@pytest.mark.parametrize("text", CAMERAS)
def test_a_camera_is_read_from_a_scene_and_written_into_one(text, tmp_path):
    scene = read(tmp_path, SCENE + text)
    assert scene.camera == CAMERAS[text]
    assert read(tmp_path, gasp.scene_to_toml(scene), "again.toml").camera == scene.camera


def test_what_is_wrong_with_a_viewpoint_is_told_by_its_place(tmp_path):
    with pytest.raises(SceneError, match=r"camera\.path\[0\]\.target.*must not be the position"):
        read(tmp_path, SCENE + "path = [{ time = 0, position = [0, 0, 1], target = [0, 0, 1] }]")


@pytest.mark.parametrize(
    ("seed", "stretch", "view"), [(0, (0.25, 0.125, 34.0), "top"), (0, (0.125, 20.0, 0.125), "back")]
)
def test_a_needle_that_points_at_the_camera_is_as_large_as_it_may_be(dots_of, seed, stretch, view):
    """Its nearest end is at the eye, and the rest of it small: no camera that looks that way fills its picture more."""
    start = cloud(seed, stretch=stretch)
    footage = Clouds(start, start + 0.5 * np.array(stretch))
    motion = motion_of(footage)
    around, above = VIEWS[view]
    camera = frame_motion(motion, width=640, height=360, around=around, above=above)
    found = fitted(camera, motion, footage.subject, dots_of())
    assert not seen_from(found, footage.subject(0), dots_of()).extent.well
    assert well_framed([found] * 2, motion, footage.subject, dots_of())
    assert not well_framed(
        [dataclasses.replace(found, translation=found.translation + [0, 0, 1.0])] * 2,
        motion,
        footage.subject,
        dots_of(),
    )
