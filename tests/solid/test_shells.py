"""The solid behind splats whose body is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from splat_shells import SHAPES, discs, shell

from gasp_core.gaussians import Gaussians
from gasp_core.solid import Sheets, SolidOptions, solid_of

CELLS = 64
"""Along the longest side; bounds are in these."""
VOLUME = {"torus": 0.02, "open dome": 0.02}
"""Allowed of the volume; .01 for the others."""


def some_of(*others):
    """All shapes, for a parameter; those of `others` where it is to be thorough."""
    return [pytest.param(name, marks=pytest.mark.thorough if name in others else ()) for name in SHAPES]


def body(solid):
    """The solid without its sheets, whose mass is that of a thickness and no closed form."""
    return dataclasses.replace(solid, sheets=Sheets.none())


def distances(solid, shape):
    """Errors [cells] of the distance at the nodes within two cells of the true surface."""
    nodes = solid.grid.origin + solid.grid.spacing * np.indices(solid.grid.shape).reshape(3, -1).T
    true, found = shape.distance(nodes), solid.distance.reshape(-1)
    near = np.abs(true) < 2 * solid.grid.spacing
    return (found - true)[near] / solid.grid.spacing


@pytest.mark.parametrize("name", some_of("sphere", "thin box"))
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_noisy_shell_with_holes_has_the_mass_of_its_body(name, seed):
    shape = SHAPES[name]
    splat = shell(shape, holes=0.05, noise=0.5 * shape.size / CELLS, seed=seed)
    solid = solid_of(splat, SolidOptions(cells=CELLS))

    found = body(solid).mass_properties()
    error = distances(solid, shape)
    assert found.volume == pytest.approx(shape.volume, rel=VOLUME.get(name, 0.01))
    assert found.volume == pytest.approx(solid.volume, rel=1e-12)
    assert np.abs(found.centre - shape.centre).max() < 0.003 * shape.size
    assert np.diag(found.inertia) == pytest.approx(shape.volume * np.array(shape.inertia), rel=0.02)
    assert np.abs(found.inertia - np.diag(np.diag(found.inertia))).max() < 0.01 * np.diag(found.inertia).max()
    assert np.sqrt(np.mean(error**2)) < 0.2
    assert np.abs(error).max() < 3.0
    assert solid.doubts.undecided < 0.02
    assert solid.doubts.underside_closed == (name == "open dome")
    # What is said of the error covers it, within what a tenth of the volume is off by.
    assert abs(found.volume - shape.volume) < solid.doubts.volume_uncertainty + 0.01 * shape.volume


@pytest.mark.parametrize("name", some_of("cube", "torus"))
def test_distances_to_a_clean_shell_are_right_to_a_small_part_of_a_cell(name):
    solid = solid_of(shell(SHAPES[name]), SolidOptions(cells=CELLS))
    # No surfels tell of the floor that the dome stands on: its rim is as high as the lowest of them are thought to be.
    bound = 0.06 if name == "open dome" else 0.05
    assert np.sqrt(np.mean(distances(solid, SHAPES[name]) ** 2)) < bound


def test_distance_is_trilinear_within_the_grid_and_goes_on_beyond():
    solid = solid_of(shell(SHAPES["sphere"]))
    far = np.array([[0.0, 0.0, 30.0], [0.0, 40.0, 0.5], [0.1, 0.2, 0.4]])
    assert solid.distance_at(far) == pytest.approx(SHAPES["sphere"].distance(far), abs=0.05)


@pytest.mark.parametrize("factor", [1e-3, pytest.param(1e4, marks=pytest.mark.thorough)])
def test_units_do_not_matter(factor):
    splat = shell(SHAPES["torus"], count=5_000, holes=0.05)
    first = solid_of(splat)
    second = solid_of(splat.with_(means=splat.means * factor, scales=splat.scales * factor))
    assert second.volume == pytest.approx(first.volume * factor**3, rel=1e-5)
    assert second.distance == pytest.approx(first.distance * factor, rel=1e-3, abs=1e-3 * factor * first.detail)


def test_a_far_floater_and_haze_change_nothing():
    splat = shell(SHAPES["sphere"], count=5_000)
    more = [[1e6, 0, 0], [0.4, 0.4, 0.4]]
    haze = Gaussians(
        means=np.concatenate([splat.means, more]),
        quaternions=np.concatenate([splat.quaternions, [[1, 0, 0, 0]] * 2]),
        scales=np.concatenate([splat.scales, [[0.01] * 3, [0.5] * 3]]),
        opacities=np.append(splat.opacities, [1.0, 1.0]),
        harmonics=np.zeros((len(splat) + 2, 1, 3)),
    )
    solid, plain = solid_of(haze), solid_of(splat)
    assert (solid.doubts.far, solid.doubts.hazy) == (1, 1)
    assert solid.volume == pytest.approx(plain.volume, rel=1e-3)


def test_a_shell_within_a_shell_is_filled_by_the_outer_one():
    outer = shell(SHAPES["sphere"])
    inner = outer.with_(means=0.5 * outer.means + [0, 0, 0.25], scales=outer.scales)
    both = Gaussians(
        **{
            field.name: np.concatenate([getattr(outer, field.name), getattr(inner, field.name)])
            for field in dataclasses.fields(Gaussians)
        }
    )
    assert solid_of(both).volume == pytest.approx(SHAPES["sphere"].volume, rel=0.01)


def test_which_way_gaussians_face_does_not_matter():
    # Turned by half a turn about an axis in its plane, a disc is the same disc: only light says what is outside.
    splat = shell(SHAPES["cube"], count=5_000)
    w, x, y, z = splat.quaternions.T
    flipped = splat.with_(quaternions=np.stack([-y, -z, w, x], axis=1))
    assert flipped.covariances() == pytest.approx(splat.covariances(), abs=1e-12)
    assert solid_of(flipped).volume == pytest.approx(solid_of(splat).volume, rel=1e-9)


def test_the_underside_is_closed_or_open_as_asked():
    splat = shell(SHAPES["open dome"])
    closed, open_ = (solid_of(splat, SolidOptions(underside=word)) for word in ("closed", "open"))
    assert closed.doubts.underside_closed and not open_.doubts.underside_closed
    assert closed.volume == pytest.approx(SHAPES["open dome"].volume, rel=0.02)
    # Half of the sky comes in, and the surface around has the say: it bulges inwards.
    assert open_.volume < 0.9 * closed.volume


def cup(rng, count=20_000):
    """A tube, half as wide as high, with a bottom and an open top; walls of one surface."""
    sides = int(count * 0.8)
    angle, height = rng.uniform(0, 2 * np.pi, sides), rng.uniform(0, 1, sides)
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    radius, turn = 0.25 * np.sqrt(rng.uniform(0, 1, count - sides)), rng.uniform(0, 2 * np.pi, count - sides)
    bottom = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(count - sides)], axis=1)
    points = np.concatenate([0.25 * around + height[:, None] * [0, 0, 1], bottom])
    normals = np.concatenate([around, np.tile([0.0, 0, -1], (count - sides, 1))])
    return discs(points, normals, np.full((count, 2), 0.01), np.full(count, 0.9), rng)


def test_a_cup_is_filled_to_the_brim_where_that_is_asked():
    splat = cup(np.random.default_rng(0))
    filled = solid_of(splat, SolidOptions(interior="filled"))
    assert filled.volume == pytest.approx(np.pi * 0.25**2, rel=0.05)


def leaves(gap, rng, count=4_000):
    """Two square leaves of side one, one above the other, each a single layer of Gaussians."""
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[:, 2] = np.where(np.arange(count) % 2, gap, 0.0)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1))
    return discs(points, normals, np.full((count, 2), 0.02), np.full(count, 0.9), rng)


@pytest.mark.parametrize("gap", [0.1, 0.2, 0.4])
def test_between_two_leaves_there_is_no_web(gap):
    solid = solid_of(leaves(gap, np.random.default_rng(0)))
    between = np.random.default_rng(1).uniform([-0.4, -0.4, 0.3 * gap], [0.4, 0.4, 0.7 * gap], (500, 3))
    assert (solid.distance_at(between) > 0).all()
    assert solid.volume < 0.05 * gap
    # They are sheets, one piece of matter each, and nothing of them is off them.
    nearest = np.minimum(np.abs(solid.sheets.positions[:, 2]), np.abs(solid.sheets.positions[:, 2] - gap))
    assert nearest.max() < 0.1 * solid.detail
    assert solid.sheets.areas.sum() == pytest.approx(2.0, rel=0.1)
    assert solid.sheets.thickness == solid.detail


@pytest.mark.parametrize("opacity", [0.0, 0.01])
def test_what_is_transparent_is_nothing(opacity):
    splat = shell(SHAPES["sphere"], count=500)
    solid = solid_of(splat.with_(opacities=np.full(len(splat), opacity)))
    assert solid.is_empty and solid.volume == 0.0 and solid.mass_properties().volume == 0.0
    assert solid.doubts.faint == len(splat)
    assert solid.distance_at(np.zeros((3, 3))).min() > 0


def test_one_gaussian_encloses_nothing():
    rng = np.random.default_rng(0)
    solid = solid_of(discs(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.full((1, 2), 0.3), np.array([0.9]), rng))
    assert solid.volume < 0.3**3


def test_a_body_of_two_parts_has_two():
    splat = shell(SHAPES["sphere"], count=8_000)
    rows = np.arange(len(splat)) % 2 == 0
    moved = splat.with_(means=splat.means + rows[:, None] * [3.0, 0, 0])
    labels, count = solid_of(moved).parts()
    sizes = np.bincount(labels.reshape(-1))[1:]
    assert count == 2 and sizes[0] >= sizes[1] > 0.95 * sizes[0]


@pytest.mark.parametrize("details", [6, 3, 1, 0.3, 0.01])
def test_a_hollowed_body_is_its_wall_however_thin(details):
    solid = solid_of(shell(SHAPES["sphere"]))
    hollow = solid.hollowed(details * solid.detail)
    radius, inner = 0.5, 0.5 - hollow.wall
    # Between nodes the slope of the distance is off by half a spacing times the curvature; and the surface, on both
    # sides, by a twentieth of a spacing.
    bound = 0.6 * solid.grid.spacing / radius
    found = hollow.mass_properties()
    assert found.volume == pytest.approx(4 / 3 * np.pi * (radius**3 - inner**3), rel=bound)
    assert hollow.volume + hollow.sheets.volumes.sum() == pytest.approx(found.volume, rel=1e-12)
    inertia = 8 / 15 * np.pi * (radius**5 - inner**5)
    assert np.diag(found.inertia) == pytest.approx([inertia] * 3, rel=bound)
    # Half way through it one is half of it deep.
    across = np.random.default_rng(0).normal(size=(1000, 3))
    across *= (radius - hollow.wall / 2) / np.linalg.norm(across, axis=1, keepdims=True)
    depths = -hollow.distance_at(across + [0, 0, radius])
    assert depths.max() <= hollow.wall / 2 * (1 + 1e-6)
    assert np.sqrt(np.mean((depths - hollow.wall / 2) ** 2)) < 0.05 * solid.grid.spacing


def test_the_same_gaussians_give_the_same_solid():
    splat = shell(SHAPES["torus"], count=3_000, holes=0.05)
    first, second = solid_of(splat), solid_of(splat)
    assert np.array_equal(first.distance, second.distance)
    assert np.array_equal(first.sheets.positions, second.sheets.positions)
