from dataclasses import replace

import numpy as np
import pytest

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import look_at


@pytest.fixture
def wall(front):
    """A wall at depth 6 that covers the right half of the picture, and its camera."""
    camera = front(40, 40)
    occluders = np.full((40, 40), np.inf)
    occluders[:, 20:] = 6.0
    return camera, occluders


def at_depth(cloud, camera, depths, thickness=0.1):
    """Equal discs on the axis of view, upright to it, or balls where they are as thick as wide (0.8)."""
    rows = np.asarray(depths, dtype=float)[:, None]
    covariance = camera.rotation.T @ np.diag([0.64, 0.64, thickness**2]) @ camera.rotation
    return replace(
        cloud(len(rows), degree=0),
        means=camera.position + rows * camera.rotation[2],
        quaternions=None,
        scales=None,
        covariances=np.tile(covariance[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]], (len(rows), 1)),
        opacities=np.full(len(rows), 0.7),
    )


def integrated(splats, camera, walls, alpha, *, steps=800):
    """Alpha (H, W) of one Gaussian before a wall: its density, added up along every ray; `alpha` has no wall.

    Nothing here is projected: a ray is cut into pieces, and the Gaussian's own three-dimensional density is read there.
    """
    covariance = splats.covariances[0][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    inverse = np.linalg.inv(covariance)
    depth = float((splats.means[0] - camera.position) @ camera.rotation[2])
    reach = 6 * float(np.sqrt(camera.rotation[2] @ covariance @ camera.rotation[2]))
    depths = np.linspace(max(depth - reach, camera.near), depth + reach, steps)
    share = np.empty(alpha.shape)
    for row, rays in enumerate(camera.rays()):
        offsets = camera.position + depths[None, :, None] * rays[:, None, :] - splats.means[0]
        density = np.exp(-0.5 * np.einsum("wki,ij,wkj->wk", offsets, inverse, offsets))
        nearer = depths[None, :] < walls[row][:, None]
        share[row] = (density * nearer).sum(axis=1) / density.sum(axis=1)
    return 1 - (1 - alpha) ** share


def test_what_is_behind_a_wall_is_not_drawn_there(wall, cloud, renderer):
    camera, occluders = wall
    splats = at_depth(cloud, camera, [7.0])
    free, hidden = renderer.render(splats, camera), renderer.render(splats, camera, occluders=occluders)
    # Where a wall is near, what is free of it is drawn to the 1e-5 of the functions there.
    np.testing.assert_allclose(hidden.colour[:, :20], free.colour[:, :20], atol=1e-5)
    assert free.alpha[:, 20:].max() > 0.5
    # Ten deviations of its depth behind.
    assert hidden.alpha[:, 20:].max() < 1e-5 and hidden.colour[:, 20:].max() < 1e-5


def test_what_is_before_a_wall_is_drawn_as_if_there_were_none(wall, cloud, renderer):
    camera, occluders = wall
    splats = at_depth(cloud, camera, [4.0, 5.0])
    free, before = renderer.render(splats, camera), renderer.render(splats, camera, occluders=occluders)
    for name in ("colour", "alpha", "depth"):
        np.testing.assert_array_equal(getattr(before, name), getattr(free, name))


def test_a_wall_between_two_gaussians_shows_the_first_alone(wall, cloud, renderer):
    camera, occluders = wall
    both, first = at_depth(cloud, camera, [7.0, 5.0]), at_depth(cloud, camera, [5.0])
    first = replace(first, harmonics=both.harmonics[1:])
    found, alone = renderer.render(both, camera, occluders=occluders), renderer.render(first, camera)
    together = renderer.render(both, camera)
    for name in ("colour", "alpha", "depth"):
        # Phi and the logarithm are approximated to some 1e-5 where a wall is near.
        np.testing.assert_allclose(getattr(found, name)[:, 20:], getattr(alone, name)[:, 20:], rtol=1e-4)
        np.testing.assert_allclose(getattr(found, name)[:, :20], getattr(together, name)[:, :20], rtol=1e-4)


@pytest.mark.parametrize("tilt", [0.0, 20.0, 60.0])
@pytest.mark.parametrize("height", [-0.15, 0.0, 0.05])
def test_a_gaussian_across_a_floor_is_what_its_density_before_it_adds_up_to(cloud, renderer, psnr, tilt, height):
    """A Gaussian of 0.2 m across a plane, from 1.2 m away: no line where its mean is as deep as the floor."""
    camera = look_at((0, -1.2, 0.5), (0, 0, 0), width=96, height=72, field_of_view=60)
    turn, (wide, long, thin) = np.radians(tilt), (0.2, 0.14, 0.08)
    axes = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    covariance = axes @ np.diag(np.square([wide, long, thin])) @ axes.T
    splats = replace(
        cloud(1, degree=0),
        means=np.array([[0.0, 0.0, height]]),
        quaternions=None,
        scales=None,
        covariances=covariance[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]][None],
        opacities=np.array([0.95]),
    )
    rays = camera.rays()
    walls = np.where(rays[..., 2] < 0, camera.position[2] / np.maximum(-rays[..., 2], 1e-9), np.inf)
    free = renderer.render(splats, camera).alpha
    found = renderer.render(splats, camera, occluders=walls).alpha
    wanted = integrated(splats, camera, walls, free.astype(float))
    assert np.abs(free - wanted).max() > 0.2, "the floor hides next to nothing"
    ratio, _ = psnr(found, wanted)
    print(f"{ratio:.1f} dB")
    assert ratio >= 35
    # What changes from pixel to pixel is what changes in what was added up, and half as much again at the most.
    for axis in (0, 1):
        assert np.abs(np.diff(found, axis=axis)).max() < 1.5 * np.abs(np.diff(wanted, axis=axis)).max()


def test_a_disc_that_lies_on_a_floor_is_nowhere_cut(cloud, renderer, psnr):
    """As deep as the floor in every pixel: about half of it is before it wherever it is seen."""
    camera = look_at((0, -1.2, 0.5), (0, 0, 0), width=120, height=90, field_of_view=24)
    splats = replace(
        cloud(1, degree=0),
        means=np.zeros((1, 3)),
        quaternions=None,
        scales=None,
        covariances=np.array([[0.01, 0, 0, 0.01, 0, 0.0004]]),
        opacities=np.array([0.9]),
    )
    rays = camera.rays()
    walls = camera.position[2] / np.maximum(-rays[..., 2], 1e-9)
    free, found = renderer.render(splats, camera).alpha, renderer.render(splats, camera, occluders=walls).alpha
    ratio, _ = psnr(found, integrated(splats, camera, walls, free.astype(float)))
    print(f"{ratio:.1f} dB")
    assert ratio >= 35
    core = free > 0.3
    # As thick as a fifth of its width: more of a ray's way through it is before its middle on this side of it.
    assert (found[core] > 0.5 * (1 - (1 - free[core]) ** 0.5)).all()


def test_occluders_that_differ_from_pixel_to_pixel_agree_with_the_reference(real, three_views, fast, oracle, psnr):
    splats = real("skull.sog")
    camera = three_views(splats, 96)[0]
    depth = np.linalg.norm(np.median(splats.means, axis=0) - camera.position)
    # A slope through the object, rough enough that every pixel ends elsewhere, and free in places.
    occluders = depth * (0.8 + 0.4 * np.random.default_rng(0).random((96, 96))).astype(np.float32)
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
