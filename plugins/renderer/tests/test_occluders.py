from dataclasses import replace

import numpy as np
import pytest

from gasp_core.errors import RenderingError


@pytest.fixture
def wall(front):
    """A wall at depth 6 that covers the right half of the picture, and its camera."""
    camera = front(40, 40)
    occluders = np.full((40, 40), np.inf)
    occluders[:, 20:] = 6.0
    return camera, occluders


def at_depth(cloud, camera, depths):
    """Equal round splats on the axis of view."""
    rows = np.asarray(depths, dtype=float)[:, None]
    return replace(
        cloud(len(rows), degree=0),
        means=camera.position + rows * camera.rotation[2],
        scales=np.full((len(rows), 3), 0.8),
        opacities=np.full(len(rows), 0.7),
    )


def test_what_is_behind_a_wall_is_not_drawn_there(wall, cloud, renderer):
    camera, occluders = wall
    splats = at_depth(cloud, camera, [7.0])
    free, hidden = renderer.render(splats, camera), renderer.render(splats, camera, occluders=occluders)
    np.testing.assert_array_equal(hidden.colour[:, :20], free.colour[:, :20])
    assert free.alpha[:, 20:].max() > 0.5
    assert hidden.alpha[:, 20:].max() == 0 and hidden.colour[:, 20:].max() == 0
    assert np.isinf(hidden.depth[:, 20:]).all()


def test_what_is_before_a_wall_is_drawn_as_if_there_were_none(wall, cloud, renderer):
    camera, occluders = wall
    splats = at_depth(cloud, camera, [4.0, 5.0])
    free, before = renderer.render(splats, camera), renderer.render(splats, camera, occluders=occluders)
    for name in ("colour", "alpha", "depth"):
        np.testing.assert_array_equal(getattr(before, name), getattr(free, name))


def test_a_wall_between_two_gaussians_shows_the_first_alone(wall, cloud, renderer):
    camera, occluders = wall
    both, first = at_depth(cloud, camera, [7.0, 5.0]), at_depth(cloud, camera, [5.0])
    first = replace(first, harmonics=both.harmonics[1:], quaternions=both.quaternions[1:])
    found, alone = renderer.render(both, camera, occluders=occluders), renderer.render(first, camera)
    together = renderer.render(both, camera)
    for name in ("colour", "alpha", "depth"):
        np.testing.assert_array_equal(getattr(found, name)[:, 20:], getattr(alone, name)[:, 20:])
        np.testing.assert_array_equal(getattr(found, name)[:, :20], getattr(together, name)[:, :20])


def test_occluders_that_differ_from_pixel_to_pixel_agree_with_the_reference(real, three_views, fast, oracle, psnr):
    splats = real("skull.sog")
    camera = three_views(splats, 128)[0]
    depth = np.linalg.norm(np.median(splats.means, axis=0) - camera.position)
    # A slope through the object, rough enough that every pixel ends elsewhere, and free in places.
    occluders = depth * (0.8 + 0.4 * np.random.default_rng(0).random((128, 128))).astype(np.float32)
    occluders[::7] = np.inf
    found, wanted = fast.render(splats, camera, occluders=occluders), oracle.render(splats, camera, occluders=occluders)
    ratio, worst = psnr(found.colour, wanted.colour)
    print(f"{ratio:.1f} dB, worst pixel {worst:.5f}")
    assert psnr(found.colour, fast.render(splats, camera).colour)[0] < 30, "the occluders hide next to nothing"
    # The bar of the pictures without occluders: depths beside a wall differ by 6e-8 of themselves, for a few Gaussians.
    assert ratio >= 60
    assert worst <= 0.05


def test_occluders_of_the_wrong_size_or_not_a_number_are_refused(wall, cloud, renderer):
    camera, occluders = wall
    splats = at_depth(cloud, camera, [5.0])
    with pytest.raises(RenderingError, match=r"shape \(40, 39\), expected the picture's \(40, 40\)"):
        renderer.render(splats, camera, occluders=occluders[:, 1:])
    occluders[3, 5] = np.nan
    with pytest.raises(RenderingError, match="NaN at row 3, column 5"):
        renderer.render(splats, camera, occluders=occluders)
