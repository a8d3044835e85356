from dataclasses import fields, replace

import numpy as np
import pytest
from gasp_renderer import memory

from gasp_core.errors import RenderingError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.contract import ALPHA_LIMIT


def finite(picture):
    return np.isfinite(picture.colour).all() and np.isfinite(picture.alpha).all() and not np.isnan(picture.depth).any()


def empty(picture):
    return picture.alpha.max() == 0 and picture.colour.max() == 0 and np.isinf(picture.depth).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 37), (37, 1), (15, 17), (16, 16), (33, 48)])
def test_pictures_of_any_size_have_it(shape, cloud, front, fast, oracle, rounding):
    splats, camera = cloud(60, seed=3), front(*shape)
    found, wanted = fast.render(splats, camera), oracle.render(splats, camera)
    assert found.colour.shape == (shape[1], shape[0], 3)
    assert found.alpha.shape == found.depth.shape == (shape[1], shape[0])
    assert found.colour.dtype == found.alpha.dtype == found.depth.dtype == np.float32
    assert (np.abs(found.colour - wanted.colour).max(axis=2) <= rounding(splats, camera)[1]).all()
    assert wanted.alpha.max() > 0.1


def test_an_8k_picture_has_its_gaussians_where_they_belong(front, cloud, fast):
    camera = front(7680, 4320)
    pixels = np.array([[0, 0], [7679, 4319], [3840, 2160], [7679, 0], [1234, 4000]])
    depth = 5.0
    rays = np.column_stack(
        [
            (pixels[:, 0] + 0.5 - camera.center_x) / camera.focal_x,
            (pixels[:, 1] + 0.5 - camera.center_y) / camera.focal_y,
            np.ones(len(pixels)),
        ]
    )
    splats = replace(
        cloud(len(pixels)),
        means=camera.position + depth * rays @ camera.rotation,
        scales=np.full((5, 3), 3 * depth / camera.focal_x),
        opacities=np.full(5, 0.8),
    )
    picture = fast.render(splats, camera)
    columns, rows = pixels.T
    # Offsets of 8000 px times 1.55 whitened units a pixel are rounded to 2^-24 of themselves; squared near the center
    # they vanish against that of alpha itself.
    np.testing.assert_allclose(picture.alpha[rows, columns], 0.8, rtol=1e-5)
    np.testing.assert_allclose(picture.depth[rows, columns], depth, rtol=1e-5)
    # Nothing beyond the reach of 3 px * sqrt(1 + .3 / 9 + tilt) * sqrt(2 ln(.8 * 255)) < 12 px of five places.
    assert 0 < np.count_nonzero(picture.alpha) <= 5 * 24**2


def test_no_gaussians_are_an_empty_picture(cloud, front, renderer):
    none = RenderInput(
        **{f.name: getattr(cloud(3), f.name)[:0] for f in fields(RenderInput) if getattr(cloud(3), f.name) is not None}
    )
    assert empty(renderer.render(none, front()))
    assert empty(renderer.render(none, front(), occluders=np.ones((40, 48))))


def test_what_is_behind_the_camera_or_nearer_than_near_is_not_drawn(cloud, front, renderer):
    camera = front()
    assert empty(renderer.render(replace(cloud(), means=cloud().means - [0, 12, 0]), camera))
    on_axis = replace(cloud(1), means=camera.position[None] + 0.02 * camera.rotation[2], scales=[[0.01] * 3])
    assert empty(renderer.render(on_axis, replace(camera, near=0.03)))
    assert not empty(renderer.render(on_axis, replace(camera, near=0.01)))
    # In the eye itself, and in its plane.
    flat = replace(cloud(2), means=camera.position + np.stack([np.zeros(3), camera.rotation[0]]))
    assert empty(renderer.render(flat, camera))


def test_a_gaussian_that_covers_everything_does(cloud, front, renderer):
    huge = replace(cloud(1), means=[[0.0, 0, 0]], scales=[[1e6] * 3], opacities=[1.0])
    picture = renderer.render(huge, front())
    np.testing.assert_allclose(picture.alpha, ALPHA_LIMIT, rtol=1e-5)


@pytest.mark.parametrize("exponent", [-30, -18, 6, 12, 18, 37])
def test_scales_and_places_of_any_magnitude_draw_the_right_picture(exponent, cloud, front, fast, oracle, rounding):
    rng = np.random.default_rng(1)
    size = 10.0**exponent
    splats = cloud(30, seed=2)
    needles = replace(splats, scales=splats.scales * np.where(rng.random((30, 3)) < 0.5, size, 1))
    scattered = replace(splats, means=splats.means * np.where(rng.random((30, 1)) < 0.5, size, 1))
    for strange in (needles, scattered):
        found, wanted = fast.render(strange, front()), oracle.render(strange, front())
        assert finite(found) and finite(wanted)
        assert (np.abs(found.colour - wanted.colour).max(axis=2) <= rounding(strange, front())[1]).all()


def test_flat_pointlike_and_rounded_covariances_are_drawn(cloud, front, fast, oracle, rounding):
    splats = cloud(30, seed=5)
    point = replace(splats, scales=np.zeros((30, 3)))
    axes = np.random.default_rng(0).normal(size=(30, 3))
    # Rank one, then no covariance at all: an eigenvalue of -1e-9 from rounding.
    needle = np.einsum("ni,nj->nij", axes, axes)
    rows, columns = np.triu_indices(3)
    flat = replace(splats, quaternions=None, scales=None, covariances=needle[:, rows, columns])
    broken = replace(flat, covariances=(needle - 1e-9 * np.eye(3))[:, rows, columns])
    for strange in (point, flat, broken):
        found, wanted = fast.render(strange, front()), oracle.render(strange, front())
        assert finite(found)
        assert found.alpha.max() > 0.1
        assert (np.abs(found.colour - wanted.colour).max(axis=2) <= rounding(strange, front())[1]).all()


def test_quaternions_of_any_length_turn_alike(cloud, front, renderer, rounding):
    unit = cloud(20, seed=6, dtype=np.float64)
    unit = replace(unit, quaternions=unit.quaternions / np.linalg.norm(unit.quaternions, axis=1, keepdims=True))
    wanted, (_, error) = renderer.render(unit, front()), rounding(unit, front())
    for length in (1e-200, 1e-6, 3.0, 1e200):
        found = renderer.render(replace(unit, quaternions=length * unit.quaternions), front())
        # Both are rounded, and a turn by the 2^-22 of a float32 quaternion moves the end of an ellipse by less.
        assert (np.abs(found.colour - wanted.colour).max(axis=2) <= 2 * error).all()
    untold = renderer.render(replace(unit, quaternions=np.zeros((20, 4))), front())
    unturned = renderer.render(replace(unit, quaternions=np.tile([1.0, 0, 0, 0], (20, 1))), front())
    np.testing.assert_array_equal(untold.colour, unturned.colour)


ARRAYS = ("means", "quaternions", "scales", "covariances", "opacities", "harmonics", "turns")
# A quaternion may have any length.
BAD = [(n, bad) for n in ARRAYS for bad in (np.nan, np.inf, -np.inf, 1e300) if (n, bad) != ("quaternions", 1e300)]


@pytest.mark.parametrize(("name", "bad"), BAD)
def test_numbers_that_are_none_are_refused_by_row_and_array(name, bad, cloud, front, renderer):
    splats = replace(cloud(9, degree=1, dtype=np.float64), turns=np.tile(np.eye(3), (9, 1, 1)))
    if name == "covariances":
        splats = replace(splats, quaternions=None, scales=None, covariances=np.ones((9, 6)))
    values = getattr(splats, name).copy()
    values[7].flat[-1] = values[4].flat[0] = bad
    if values.ndim == 1:
        values[[4, 7]] = bad
    with pytest.raises(RenderingError, match=rf"RenderInput\.{name} is not finite.* row 4 .*one of 2"):
        renderer.render(replace(splats, **{name: values}), front())


def test_arrays_that_hold_no_numbers_are_refused(cloud, front, renderer):
    with pytest.raises(RenderingError, match=r"RenderInput\.scales holds object"):
        renderer.render(replace(cloud(2), scales=np.full((2, 3), "0.1", dtype=object)), front())


def test_colours_and_opacities_beyond_reason_stay_finite(cloud, front, fast):
    splats = cloud(30, degree=2)
    mad = replace(splats, harmonics=splats.harmonics * np.float32(3e37), opacities=splats.opacities * np.float32(1e38))
    assert finite(fast.render(mad, front()))
    dark = replace(splats, harmonics=splats.harmonics - np.float32(1e3), opacities=-splats.opacities)
    assert empty(fast.render(dark, front()))


def test_a_scene_far_from_the_origin_looks_as_it_does_there(real, three_views, fast, oracle, psnr):
    splats = real("plant.splat")
    camera = three_views(splats)[0]
    offset = np.array([1e4, -1e4, 2e4])
    moved = replace(splats, means=splats.means.astype(np.float64) + offset)
    along = replace(camera, translation=camera.translation - camera.rotation @ offset)
    ratio, worst = psnr(fast.render(moved, along).colour, fast.render(splats, camera).colour)
    print(f"{ratio:.1f} dB, worst pixel {worst:.6f}")
    # 1e4 m in float64 is known to 2e-12 m, a billionth of a pixel here: only a Gaussian at the floor may tell.
    assert ratio >= 55


def test_an_off_centre_picture_is_cut_from_the_larger_one(cloud, renderer, rounding):
    splats = cloud(200, seed=8, size=(-2, -1))
    whole = look_at((0, -6, 0), (0, 0, 0), width=64, height=64, field_of_view=30)
    part = replace(whole, width=30, height=20, center_x=32 - 11.0, center_y=32 - 37.0)
    wanted, error = renderer.render(splats, whole), rounding(splats, whole)[1]
    # Where the Jacobian is followed depends on the picture's edges; ellipses from beyond them end before the middle.
    found = renderer.render(splats, part).colour[4:-4, 4:-4]
    difference = np.abs(found - wanted.colour[41:53, 15:37]).max(axis=2)
    assert wanted.alpha[41:53, 15:37].max() > 0.9
    assert (difference <= 2 * error[41:53, 15:37]).all()


def test_what_does_not_fit_in_memory_is_refused_before_it_is_asked_for(cloud, front, fast, monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 1 << 30)
    with pytest.raises(
        RenderingError, match=r"16384 x 16384 pixels and 40 Gaussians need 6\.0 GiB.*1\.0 GiB are avail"
    ):
        fast.render(cloud(), front(16384, 16384))
    huge = replace(cloud(200_000, size=(3, 4)), means=np.zeros((200_000, 3)), opacities=np.ones(200_000))
    with pytest.raises(
        RenderingError, match=r"200,000 Gaussians that touch 819,200,000 tiles .* leave out the largest"
    ):
        fast.render(huge, front(1024, 1024))


def test_the_memory_there_is_is_known():
    # Fewer than a megabyte or more than a petabyte is a misread file.
    assert 2**20 < memory.available_bytes() < 2**50
