from __future__ import annotations

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import Elastic, Gaussians, SplatObject
from gasp_core.cli import up_axes
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis
from gasp_core.scene.objects import UP_AXES
from gasp_core.scene.placement import place, placement_of, robust_box, upright, with_up
from gasp_core.scene.selection import place_object

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


def thing(splat, **options):
    return SplatObject(name="thing", splat=splat, material=JELLY, **options)


def test_options_offer_the_axes_there_are():
    assert up_axes.UP_AXES == UP_AXES


@pytest.mark.parametrize("up", UP_AXES)
def test_the_up_axis_becomes_plus_z_and_nothing_is_mirrored(up):
    rotation = upright(up)
    axis = np.zeros(3)
    axis["xyz".index(up[1])] = 1.0 if up[0] == "+" else -1.0
    assert np.array_equal(rotation @ axis, [0, 0, 1])
    assert np.array_equal(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == 1.0


@pytest.mark.parametrize("up", UP_AXES)
def test_what_was_turned_stands_again_where_a_scene_says_how_it_lies(cloud, up):
    splat = cloud(20, degree=2)
    lying = with_up(splat, up)
    again = place(lying, placement_of(thing(lying, up=up), lying))
    assert np.array_equal(again.means, splat.means)
    # Quaternions are kept in the precision of the file, harmonics are turned there and back in it.
    expected = splat.covariances()
    np.testing.assert_allclose(again.covariances(), expected, rtol=0, atol=1e-6 * expected.max())
    np.testing.assert_allclose(again.harmonics, splat.harmonics, atol=1e-5)
    assert np.array_equal(upright(up) @ lying.means.T, splat.means.T)


def test_files_are_minus_y_up_and_arrays_plus_z(cloud, tmp_path):
    splat = cloud()
    assert np.array_equal(placement_of(thing(splat), splat).rotation, np.eye(3))
    assert np.array_equal(placement_of(thing(tmp_path / "a.ply"), splat).rotation, upright("-y"))


@pytest.mark.parametrize("far", [(2.0**19, 2.0**22, 128.0), (0.0, -3.0 * 2.0**20, 0.0)])
def test_a_splat_in_map_coordinates_has_the_body_that_it_has_at_the_origin(far):
    splat = shell(SHAPES["thin box"], count=5_000)
    # In steps that double precision has out there too: both are the same splat to the last bit.
    splat = splat.with_(means=np.rint(splat.means * 2.0**20) / 2.0**20)
    near, away = (
        place_object(thing(each, position=(1.0, 2.0, 3.0)), each)
        for each in (splat, splat.with_(means=splat.means + np.array(far)))
    )
    # Sums over points of the size of the box, in another order of magnitude: some thousand roundings of 1e-16.
    assert away.solid().volume == pytest.approx(near.solid().volume, rel=1e-9)
    places = np.random.default_rng(0).uniform(-1, 1, (500, 3)) + [1.0, 2.0, 3.5]
    # Where it stands is a difference of numbers of 4e6, whose roundings are 5e-10; distances are single precision.
    assert away.solid().distance_at(places) == pytest.approx(near.solid().distance_at(places), abs=1e-6)


def test_a_splat_near_its_origin_is_taken_as_its_file_has_it():
    splat = shell(SHAPES["thin box"], count=3_000)
    away = splat.with_(means=(splat.means + [500.0, 0.0, -900.0]).astype(np.float32))
    placed = place_object(thing(away, position=(1.0, 2.0, 3.0)), away)
    assert np.array_equal(placed.solid().translation, placed.placement.translation)


def test_without_any_wish_all_stays_bit_for_bit(cloud):
    splat = cloud(degree=2)
    placed = place(splat, placement_of(thing(splat), splat))
    for name in ("means", "quaternions", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(placed, name), getattr(splat, name))


@pytest.mark.parametrize("rotation", [None, (90.0, 0.0, 0.0), (10.0, -20.0, 130.0), (0.5, 0.5, -0.5, 0.5)])
def test_height_and_foot(cloud, rotation):
    splat = cloud(60)
    item = thing(splat, up="-y", height=0.4, position=(3.0, -2.0, 0.5), rotation=rotation)
    placed = place(splat, placement_of(item, splat))
    lower, upper = placed.means.min(axis=0), placed.means.max(axis=0)
    # A few operations on numbers of order 3 in double precision.
    foot = [(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, lower[2]]
    np.testing.assert_allclose(foot, (3.0, -2.0, 0.5), atol=1e-14)
    if rotation is None:
        np.testing.assert_allclose(upper[2] - lower[2], 0.4, atol=1e-14)
        assert np.argmax(placed.means[:, 2]) == np.argmin(splat.means[:, 1])


def test_a_level_rotation_stays_level():
    """90 degrees about x takes y to z exactly, not to within the cosine of a rounded pi/2."""
    splat = Gaussians(
        means=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]),
        quaternions=np.array([[1.0, 0, 0, 0]] * 2),
        scales=np.ones((2, 3)),
        opacities=np.ones(2),
        harmonics=np.zeros((2, 1, 3)),
    )
    placed = place(splat, placement_of(thing(splat, rotation=(90.0, 0.0, 0.0)), splat))
    assert np.array_equal(placed.means[0], [0, 0, 1])


@pytest.mark.parametrize("up", UP_AXES)
def test_covariance_and_colour_turn_with_the_whole(cloud, up):
    splat = cloud(20, degree=3)
    placement = placement_of(thing(splat, up=up, metres_per_unit=0.25, rotation=(10.0, 20.0, 30.0)), splat)
    placed = place(splat, placement)
    expected = placement.rotation @ splat.covariances() @ placement.rotation.T * 0.25**2
    # Quaternion to matrix and back costs a few ulps of entries of order 1.
    np.testing.assert_allclose(placed.covariances(), expected, rtol=0, atol=1e-14 * np.abs(expected).max() * 100)
    directions = np.random.default_rng(1).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = np.einsum("nk,nkc->nc", basis(directions @ placement.rotation, 3), splat.harmonics)
    after = np.einsum("nk,nkc->nc", basis(directions, 3), placed.harmonics)
    # Coefficients are float32 (6e-8), sixteen of them, of order 1.
    np.testing.assert_allclose(after, before, atol=16 * 6e-8 * 10)


def test_the_robust_box_leaves_out_a_thousandth_of_many_and_none_of_few():
    rng = np.random.default_rng(0)
    many = rng.uniform(size=(5000, 3))
    many[:3] = 1e6
    lower, upper = robust_box(many)
    assert (upper <= 1).all() and (lower >= 0).all()
    few = rng.uniform(size=(7, 3))
    lower, upper = robust_box(few)
    assert np.array_equal(lower, few.min(axis=0)) and np.array_equal(upper, few.max(axis=0))


def test_a_flat_thing_has_no_height(cloud):
    splat = cloud()
    flat = splat.with_(means=splat.means * [1, 1, 0])
    with pytest.raises(SceneError, match="no extent along its up axis"):
        placement_of(thing(flat, height=1.0), flat)


def test_quaternions_of_any_length_turn(cloud):
    splat = cloud()
    scaled = splat.with_(quaternions=splat.quaternions * 7)
    item = thing(splat, up="-y")
    np.testing.assert_allclose(
        rotation_matrices(place(scaled, placement_of(item, scaled)).quaternions),
        rotation_matrices(place(splat, placement_of(item, splat)).quaternions),
        atol=1e-14,
    )
