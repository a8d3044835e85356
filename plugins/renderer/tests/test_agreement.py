"""The rasteriser against the reference, and both against the image model where it can be written in a line."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.harmonics import basis, material_directions
from gasp_core.rendering.contract import ALPHA_FLOOR, ALPHA_LIMIT, LOW_PASS


@pytest.mark.parametrize(
    "name",
    [
        "playbot/3_0",
        *(pytest.param(name, marks=pytest.mark.thorough) for name in ("plant.splat", "skull.sog")),
        pytest.param("guitar.compressed.ply", marks=pytest.mark.slow),
    ],
)
def test_the_rasteriser_agrees_with_the_reference_on_real_splats(name, real, three_views, fast, oracle, psnr):
    splats = real(name)
    for view, camera in enumerate(three_views(splats)):
        found, wanted = fast.render(splats, camera), oracle.render(splats, camera)
        assert wanted.alpha.mean() > 0.05, "the view shows too little to be a test"
        for ground in ("black", "white"):
            background = np.full(3, float(ground == "white"))
            ratio, worst = psnr(found.over(background), wanted.over(background))
            print(f"{name} view {view} over {ground}: {ratio:.1f} dB, worst pixel {worst:.5f}")
            # The eye, and an 8-bit file, see nothing below half of 1/255 (54 dB); a pixel may be off by what a dozen
            # Gaussians exactly at the alpha floor of 1/255 add or not.
            assert ratio >= 60
            assert worst <= 0.05


@pytest.mark.thorough
def test_covariances_draw_what_quaternions_and_scales_do(real, three_views, fast, oracle, psnr):
    by_axes = real("skull.sog")
    full = Gaussians(
        means=by_axes.means,
        quaternions=by_axes.quaternions,
        scales=by_axes.scales,
        opacities=by_axes.opacities,
        harmonics=by_axes.harmonics,
    ).covariances()
    rows, columns = np.triu_indices(3)
    splats = replace(by_axes, quaternions=None, scales=None, covariances=full[:, rows, columns])
    camera = three_views(by_axes, 128)[0]
    for renderer in (fast, oracle):
        ratio, worst = psnr(renderer.render(splats, camera).colour, renderer.render(by_axes, camera).colour)
        print(f"{type(renderer).__name__}: {ratio:.1f} dB, worst pixel {worst:.6f}")
        # The same numbers but for the rounding of float32 quaternions' products: 60 dB is a thousandth.
        assert ratio >= 60


def test_matter_turned_with_the_camera_looks_as_before(real, three_views, fast, psnr):
    splats = real("skull.sog")
    camera = three_views(splats)[0]
    turn = rotation_matrices(np.array([[0.3, -0.5, 0.7, 0.4]]))[0]
    turned = replace(
        splats,
        means=splats.means @ turn.T,
        quaternions=rotation_quaternions(turn @ rotation_matrices(splats.quaternions)),
        turns=np.broadcast_to(turn, (len(splats), 3, 3)),
    )
    along = replace(camera, rotation=camera.rotation @ turn.T)
    before = fast.render(splats, camera).colour
    right, _ = psnr(fast.render(turned, along).colour, before)
    wrong, _ = psnr(fast.render(replace(turned, turns=None), along).colour, before)
    print(f"with turns {right:.1f} dB, without {wrong:.1f} dB")
    # Float32 quaternions and turns: 1e-7 of the picture's 256 pixels moves nothing by a visible amount.
    assert right >= 50
    # 8 of 255 on average: the colours of a material that no longer knows where the light was.
    assert wrong < 30


@pytest.mark.parametrize("degree", range(5))
def test_colours_are_those_of_the_harmonics(degree, cloud, front, renderer):
    one = cloud(1, seed=degree, degree=degree)
    turn = rotation_matrices(np.array([[0.2, 0.9, -0.4, 0.1]]))
    splats = replace(one, means=[[0.2, 0, 0.1]], opacities=[0.9], scales=[[0.5, 0.4, 0.3]], turns=turn)
    camera = front()
    picture = renderer.render(splats, camera)
    direction = splats.means - camera.position
    seen = basis(material_directions(direction / np.linalg.norm(direction), turn), degree) @ splats.harmonics[0]
    row, column = np.unravel_index(picture.alpha.argmax(), picture.alpha.shape)
    colour = picture.colour[row, column] / picture.alpha[row, column]
    # 25 float32 products of numbers of order one, rounded to 6e-8 each, and alpha's own rounding.
    np.testing.assert_allclose(colour, np.maximum(0, 0.5 + seen[0]), atol=25 * 4 * 6e-8)


def test_a_sheet_that_faces_the_camera_is_drawn_in_the_reference_s_order(cloud, front, fast, oracle, rounding):
    # Depths equal but for the last bits that their own computation leaves.
    camera, rng = front(), np.random.default_rng(4)
    places = np.column_stack([rng.uniform(-1, 1, (150, 2)), np.full(150, 5.0)])
    sheet = replace(cloud(150, seed=4), means=camera.position + places @ camera.rotation, scales=np.full((150, 3), 0.3))
    assert 1 < len(set(camera.project(sheet.means)[1])) < 150
    found, wanted = fast.render(sheet, camera), oracle.render(sheet, camera)
    assert (np.abs(found.colour - wanted.colour).max(axis=2) <= rounding(sheet, camera)[1]).all()


def _ellipse(camera, mean, covariance):
    """Alpha of a Gaussian of opacity 1 at every pixel, its Jacobian by differences of the camera's own projection."""
    step = 1e-6
    places, _ = camera.project(np.vstack([mean, mean + step * np.eye(3), mean - step * np.eye(3)]))
    jacobian = ((places[1:4] - places[4:]) / (2 * step)).T
    flat = jacobian @ covariance @ jacobian.T + LOW_PASS * np.eye(2)
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    offset = np.stack([x, y], axis=2) - places[0]
    return np.exp(-0.5 * np.einsum("hwi,ij,hwj->hw", offset, np.linalg.inv(flat), offset))


@pytest.mark.parametrize("opacity", [1.0, 0.6, 0.01])
def test_one_gaussian_has_the_alpha_of_the_image_model(opacity, front, cloud, renderer):
    camera = replace(front(50, 40), center_x=21.3, center_y=24.1)
    one = cloud(1)
    mean, covariance = np.array([0.4, 0.2, -0.3]), np.diag([0.2, 0.05, 0.3]) ** 2 + 0.01
    splats = replace(
        one,
        means=mean[None],
        opacities=[opacity],
        quaternions=None,
        scales=None,
        covariances=covariance[np.triu_indices(3)][None],
    )
    picture = renderer.render(splats, camera)
    alpha = np.minimum(ALPHA_LIMIT, opacity * _ellipse(camera, mean, covariance))
    # Rounding moves alpha by 1e-4 of itself at most (see the fixture `rounding`); at the floor it is then there or not.
    clear = np.abs(alpha / ALPHA_FLOOR - 1) > 1e-4
    alpha[alpha < ALPHA_FLOOR] = 0
    np.testing.assert_allclose(picture.alpha[clear], alpha[clear], rtol=1e-4, atol=1e-6)
    depth = camera.project(mean[None])[1][0]
    inside = picture.alpha > 0
    assert 0 < inside.sum() < inside.size
    # Alpha as one minus the light left has the absolute rounding of one; divided by an alpha down to 1/255.
    np.testing.assert_allclose(picture.depth[inside], depth, rtol=255 * 2**-23)
    assert np.isinf(picture.depth[~inside]).all()


def test_the_jacobian_is_not_followed_far_outside_the_picture(front, cloud, renderer):
    camera = front(40, 40, field_of_view=90.0)
    # Far to the right and huge: its slope x/z of 5 counts as the 1.3 at which the picture, widened, ends.
    mean = np.array([5.0, 0.0, 1.0]) @ camera.rotation + camera.position
    splats = replace(
        cloud(1),
        means=mean[None],
        opacities=[1.0],
        quaternions=None,
        scales=None,
        covariances=[[9.0, 0, 0, 9.0, 0, 9.0]],
    )
    jacobian = camera.focal_x * np.array([[1, 0, -1.3], [0, 1, 0]])
    flat = 9.0 * jacobian @ jacobian.T + LOW_PASS * np.eye(2)
    x, y = np.meshgrid(np.arange(40) + 0.5, np.arange(40) + 0.5)
    offset = np.stack([x, y], axis=2) - camera.project(mean[None])[0][0]
    alpha = np.exp(-0.5 * np.einsum("hwi,ij,hwj->hw", offset, np.linalg.inv(flat), offset))
    assert alpha[20, -1] > 0.01
    seen = alpha > ALPHA_FLOOR * (1 + 1e-4)
    np.testing.assert_allclose(renderer.render(splats, camera).alpha[seen], alpha[seen], rtol=1e-4)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 24),
    sizes=st.tuples(st.floats(-8, 4), st.floats(-8, 4)).map(sorted),
    opacities=st.sampled_from([(0.0, 1.0), (0.95, 1.0), (0.0, 0.02), (1.0, 50.0)]),
    spread=st.sampled_from([0.1, 1.0, 3.0]),
    degree=st.integers(0, 4),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
)
def test_random_clouds_agree_with_the_reference(
    fast, oracle, cloud, front, rounding, seed, count, sizes, opacities, spread, degree, shape
):
    rng = np.random.default_rng(seed)
    splats = cloud(count, seed, degree=degree, size=sizes)
    splats = replace(
        splats,
        means=splats.means * np.float32(spread),
        opacities=rng.uniform(*opacities, size=count).astype(np.float32),
    )
    camera = front(*shape)
    found, wanted = fast.render(splats, camera), oracle.render(splats, camera)
    alpha_error, colour_error = rounding(splats, camera)
    assert (np.abs(found.alpha - wanted.alpha) <= alpha_error).all()
    assert (np.abs(found.colour - wanted.colour).max(axis=2) <= colour_error).all()
