"""The reduction `volume`: points that fill the solid, and what they move."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from splat_shells import SHAPES, discs, shell

from gasp_core import Elastic, EngineAccuracy, Gaussians, Reduction, Scene, SplatObject
from gasp_core.contract import BoxShape, HalfSpace
from gasp_core.errors import SceneError
from gasp_core.reduction import lattice, volume
from gasp_core.reduction.assembly import assemble
from gasp_core.reduction.bodies import moved_simplices
from gasp_core.reduction.choosing import chosen_mode
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.reduction.volume import fill
from gasp_core.scene.selection import place_object
from gasp_core.solid import Sheets, SolidOptions

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
VOLUME = Reduction(mode="volume")


def item(splat, **options):
    return SplatObject(**{"name": "thing", "splat": splat, "material": JELLY, "reduction": VOLUME, **options})


def assembled(splat, resolution=24, **options):
    thing = item(splat, **options)
    scene = Scene(duration=1, frame_rate=1, objects=(thing,), accuracy=EngineAccuracy(resolution=resolution))
    return assemble(scene, [place_object(thing, splat)])


@cache
def body_of(name):
    """A body of `SHAPES` that tests look at and leave as it is."""
    return assembled(shell(SHAPES[name], count=3_000)).bodies[0]


def leaf(rng, count=3_000):
    points = rng.uniform(-0.5, 0.5, (count, 3)) * [1, 1, 0]
    return discs(points, np.tile([0.0, 0, 1], (count, 1)), np.full((count, 2), 0.02), np.full(count, 0.9), rng)


def joined(*splats):
    names = [field.name for field in dataclasses.fields(Gaussians)]
    return Gaussians(**{name: np.concatenate([getattr(splat, name) for splat in splats]) for name in names})


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(
    ("resolutions", "jittered"),
    [
        ((24, 48), False),
        pytest.param((32, 64), False, marks=pytest.mark.thorough),
        pytest.param((24, 32, 48, 64), True, marks=pytest.mark.thorough),
    ],
)
def test_the_points_have_the_volume_of_the_solid_on_every_grid(name, resolutions, jittered):
    splat = shell(SHAPES[name], count=5_000)
    solid = place_object(item(splat), splat).solid()
    expected = solid.mass_properties()
    for resolution in resolutions:
        found = fill(solid, SHAPES[name].size / resolution, jittered=jittered)
        assert found.volumes.sum() == pytest.approx(expected.volume, rel=0.005)
        centre = found.volumes @ found.positions / found.volumes.sum()
        assert np.abs(centre - expected.centre).max() < 0.002 * SHAPES[name].size


def test_more_points_than_memory_holds_are_refused_before_one_is_made(monkeypatch):
    splat = shell(SHAPES["cube"])
    size = SHAPES["cube"].size
    made = []
    monkeypatch.setattr(volume, "fill", lambda *args, **options: made.append(args))
    with pytest.raises(SceneError, match=r'^object "thing": at a grid spacing of .* points fill its .*: lower '):
        assembled(splat, resolution=4096)
    assert not made
    # Eight points a cell: (2 * 24)^3 of them are 111 kB at a byte each, and 111 MB at a thousand.
    monkeypatch.setattr(lattice, "available_memory", lambda: 100 * 1000 * 1000)
    with pytest.raises(SceneError, match=rf"some 1[01]\d,\d{{3}} points fill its {size**3:.0f}.* 100 MB free"):
        assembled(splat)
    assert not made


def test_there_are_eight_points_a_cell_and_they_are_inside():
    splat = shell(SHAPES["cube"])
    solid = place_object(item(splat), splat).solid()
    spacing = 1 / 20
    found = fill(solid, spacing)
    # Discs may stand out over the edges, and are sheets there.
    assert found.sheet < 0.05 * len(found.positions)
    assert solid.distance_at(found.positions[: len(found.positions) - found.sheet]).max() < spacing / 4
    whole = np.isclose(found.volumes, (spacing / 2) ** 3)
    # Of 40 points along each side the surface may cut the outermost two.
    assert 38**3 <= whole.sum() <= 40**3
    shifted = fill(solid, spacing, jittered=True)
    moved = np.abs(shifted.positions - found.positions)
    assert moved[whole].max() <= spacing / 8 and moved[whole].max() > 0.9 * spacing / 8
    assert not moved[~whole].any()


def test_without_displacement_simplices_are_those_at_rest_to_the_last_bit():
    body = body_of("torus")
    assert isinstance(body.carrier, PointFrames)
    points = body.points.stop - body.points.start
    assert np.array_equal(moved_simplices(body, np.zeros((points, 3))), body.block.rest)


@pytest.mark.parametrize("splat", [pytest.param("torus", marks=pytest.mark.thorough), "thin box", "leaf"])
def test_what_moves_affinely_is_moved_affinely(splat):
    rng = np.random.default_rng(0)
    gaussians = leaf(rng) if splat == "leaf" else shell(SHAPES[splat], count=3_000, noise=0.01)
    body = assembled(gaussians).bodies[0]
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    for gradient in (turn, turn @ np.diag([1.3, 0.8, 1.1])):
        shift = rng.normal(size=3)
        points = body.carrier.points
        moved = moved_simplices(body, points @ gradient.T + shift - points)
        # Second moments of a neighbourhood are inverted, of condition 1e4 at most, in double precision.
        assert moved == pytest.approx(body.block.rest @ gradient.T + shift, abs=1e-9)


def test_float32_displacements_keep_shapes():
    body = body_of("sphere")
    points = body.carrier.points
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    displacements = (points @ turn.T - points).astype(np.float32)
    edges = np.diff(moved_simplices(body, displacements), axis=1)
    # An error of 2^-25 of the size over neighbours half a cell, a fiftieth of the size, apart; some ten times that
    # where they lie to one side.
    assert edges == pytest.approx(np.diff(body.block.rest, axis=1) @ turn.T, abs=5e-5 * np.abs(edges).max())


def test_pieces_that_part_take_their_own_along_and_nothing_is_smeared():
    body = body_of("cube")
    points = body.carrier.points
    above = points[:, 2] > 0.013
    shifts = np.where(above[:, None], [0.0, 0.3, 0.8], 0.0)
    moved = moved_simplices(body, shifts) - body.block.rest
    up = np.abs(moved - [0, 0.3, 0.8]).max(axis=(1, 2)) < 1e-9
    still = np.abs(moved).max(axis=(1, 2)) < 1e-9
    assert (up | still).all() and up.any() and still.any()


@pytest.mark.parametrize(
    "stretches", [(2.5, 1, 1), (4, 0.5, 0.5), (3, 3, 1 / 9), (3, 3, 3)], ids=["bar", "rubber", "sheet", "all round"]
)
def test_what_is_stretched_as_a_whole_is_drawn_so_however_far(stretches):
    body = body_of("cube")
    points = body.carrier.points
    # Farther at one end than at the other, by a tenth.
    ends = points * (1 + 0.05 * points[:, :1] / np.abs(points[:, 0]).max()) @ np.diag(stretches)
    moved, rest = (np.diff(each, axis=1) for each in (moved_simplices(body, ends - points), body.block.rest))
    lengths, before = np.linalg.norm(moved, axis=2), np.linalg.norm(rest @ np.diag(stretches), axis=2)
    assert lengths == pytest.approx(before, rel=0.25)
    assert np.median(lengths / before) == pytest.approx(1.0, abs=0.05)


def test_what_flows_apart_keeps_gaussians_whole():
    body = body_of("sphere")
    rng = np.random.default_rng(0)
    # Every point goes its own way, farther than the body is wide.
    displacements = rng.normal(size=(len(body.carrier.points), 3)) * 3
    moved = moved_simplices(body, displacements)
    lengths = np.linalg.norm(np.diff(moved, axis=1), axis=2) / np.linalg.norm(np.diff(body.block.rest, axis=1), axis=2)
    assert np.isfinite(moved).all()
    assert np.median(lengths) == pytest.approx(1.0, abs=1e-6) and (lengths < 2).mean() > 0.99


@pytest.mark.parametrize("scatter", [0.3, 1.0, 3.0])
def test_what_is_stirred_stretches_no_gaussian_beyond_what_tears(scatter):
    body = body_of("cube")
    points = body.points.stop - body.points.start
    assert isinstance(body.carrier, PointFrames)
    stirred = np.random.default_rng(0).normal(0, scatter * body.carrier.spacing, (points, 3))
    moved, rest = moved_simplices(body, stirred), body.block.rest
    edges, before = (np.linalg.norm(np.diff(each, axis=1), axis=2) for each in (moved, rest))
    # The size of a matrix of three stretches of at most 2, and rounding of short edges far from the origin.
    assert (edges <= np.sqrt(3) * 2.0 * before + 1e-12).all()


def test_neighbours_are_never_across_a_gap():
    box = SHAPES["thin box"]
    lower = shell(box)
    # A tenth of the size apart; a cell is a tenth of it too.
    gap = 0.1
    upper = lower.with_(means=lower.means + [0, 0, 0.12 + gap])
    body = assembled(joined(lower, upper), resolution=10).bodies[0]
    points, neighbours = body.carrier.points, body.carrier.neighbours
    middle = points[:, 2].mean()
    assert ((points[neighbours][..., 2] > middle) == (points[:, 2] > middle)[:, None]).all()
    shift = np.where(points[:, 2:] > middle, [0.0, 0.0, 0.05], 0.0)
    moved = moved_simplices(body, shift) - body.block.rest
    high = body.block.rest[:, :1, 2:] > middle
    assert moved == pytest.approx(np.broadcast_to(np.where(high, [0.0, 0.0, 0.05], 0.0), moved.shape), abs=1e-9)


def test_a_leaf_gets_points_of_its_own_with_the_mass_of_its_sheet():
    splat = leaf(np.random.default_rng(0))
    solid = place_object(item(splat), splat).solid()
    filling = fill(solid, 1 / 24)
    assert filling.sheet == len(filling.positions)
    # All of it but for shreds of its rim.
    assert filling.volumes.sum() == pytest.approx(solid.mass_properties().volume, rel=1e-3)
    # About the leaf, a thickness to either side at most.
    assert np.abs(filling.positions[:, 2]).max() <= solid.detail


def test_only_the_region_is_filled():
    splat = shell(SHAPES["cube"], count=5_000)
    region = BoxShape(center=(0, 0, 0.75), half_extents=(1, 1, 0.25))
    problem = assembled(splat, region=region).problem
    assert problem.points.reference_positions[:, 2].min() >= 0.5
    assert problem.points.reference_volumes.sum() == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize("resolution", [24, pytest.param(48, marks=pytest.mark.thorough)])
def test_a_hollow_body_has_the_mass_of_its_wall(resolution):
    splat = shell(SHAPES["sphere"])
    hollow = SolidOptions(interior="hollow", wall=0.2)
    points = assembled(splat, resolution, height=2.0, solid=hollow).problem.points
    # The wall is six details thick; each of its two sides is known to some hundredths of one.
    assert points.reference_volumes.sum() == pytest.approx(4 / 3 * np.pi * (1 - 0.8**3), rel=0.03)
    middle = points.reference_positions.mean(axis=0)
    depths = 1 - np.linalg.norm(points.reference_positions - middle, axis=1)
    assert depths.min() > -0.05 and depths.max() < 0.25


@pytest.mark.parametrize("wall", [0.02, 0.005, 0.0005])
@pytest.mark.parametrize("resolution", [12, pytest.param(24, marks=pytest.mark.thorough)])
def test_a_wall_thinner_than_any_grid_has_its_mass_and_turns_with_it(wall, resolution):
    splat = shell(SHAPES["sphere"], count=5_000)
    thing = item(splat, solid=SolidOptions(interior="hollow", wall=wall), reduction=Reduction())
    solid = place_object(thing, splat).solid()
    assert chosen_mode(place_object(thing, splat), None).mode == "volume"
    assembly = assembled(splat, resolution, solid=thing.solid)
    # The slope of distances between nodes is off by half a spacing times the curvature, the surface by a twentieth.
    exact = 4 / 3 * np.pi * (0.5**3 - (0.5 - wall) ** 3)
    assert assembly.problem.points.reference_volumes.sum() == pytest.approx(exact, rel=0.6 * solid.spacing / 0.5)
    body = assembly.bodies[0]
    points = body.carrier.points
    turn = np.array([[0.0, -1, 0], [0.6, 0, 0.8], [-0.8, 0, 0.6]])
    moved = moved_simplices(body, points @ turn.T - points)
    # As in any body: second moments are inverted in double precision. Where points are in a plane there is no inverse.
    assert moved == pytest.approx(body.block.rest @ turn.T, abs=1e-9)


def test_the_surface_of_a_hollow_body_has_two_sides():
    splat = shell(SHAPES["sphere"], count=5_000)
    wall = 0.005
    solid = place_object(item(splat, solid=SolidOptions(interior="hollow", wall=wall)), splat).solid()
    depths = -solid.filled.distance_at(solid.surface_positions())
    inner = depths > wall / 2
    assert 0.7 < inner.mean() / (1 - inner.mean()) < 1.1
    # Where a node is and how far it is from there are each known to a twentieth of a spacing.
    assert np.sqrt(np.mean((depths - wall * inner) ** 2)) < 0.1 * solid.spacing


@pytest.mark.parametrize("options", [{"interior": "hollow"}, {"wall": 0.1}, {"interior": "filled", "wall": 0.1}])
def test_a_wall_and_a_hollow_belong_together(options):
    with pytest.raises(SceneError, match='wall belongs to interior = "hollow"'):
        SolidOptions(**options)


def test_what_encloses_nothing_is_refused_by_name():
    faint = shell(SHAPES["sphere"], count=3_000)
    with pytest.raises(SceneError, match='object "thing": there is nothing to fill'):
        assembled(faint.with_(opacities=np.full(len(faint), 0.01)))
    with pytest.raises(SceneError, match="nothing to fill in its region"):
        splat = leaf(np.random.default_rng(0))
        assembled(splat, region=BoxShape(center=tuple(splat.means[0]), half_extents=(1e-4, 1e-4, 1e-4)))


def test_a_point_stands_for_a_gaussian_of_its_own_piece():
    # The way between two balls a tenth apart is shorter than that to the far side of either.
    ball = shell(SHAPES["sphere"], count=2_500)
    splat = joined(ball, ball.with_(means=ball.means + [0, 0, 1.1]))
    carrier = assembled(splat, resolution=24).bodies[0].carrier
    middle = carrier.points[:, 2].mean()
    stands_for = np.arange(len(splat))[carrier.standing_for] >= 2_500
    assert np.array_equal(stands_for, carrier.points[:, 2] > middle)
    # What is in the middle of a ball of one is half a one from its surface.
    means = splat.means - splat.means.mean(axis=0)
    ways = np.linalg.norm(means[carrier.standing_for] - (carrier.points - carrier.points.mean(axis=0)), axis=1)
    assert ways.max() < 0.5 + carrier.spacing


def test_velocities_of_a_rigid_motion_go_on_into_the_body():
    body = body_of("sphere")
    spin = np.array([0.3, -1.0, 2.0])
    velocities = np.cross(spin, body.block.rest) + [1.0, 0, 0]
    found = body.carrier.gather(body.block.rest, velocities)
    expected = np.cross(spin, body.carrier.points) + [1.0, 0, 0]
    # A fit to thousands of vertices in double precision.
    assert found == pytest.approx(expected, abs=1e-9)
    # What is no affine field: each point at the surface has the mean of the Gaussians that follow it, which lie half a
    # cell off it on average.
    twist = body.block.rest[..., 2:] * np.cross([0.0, 0.0, 1.0], body.block.rest)
    found = body.carrier.gather(body.block.rest, twist)
    expected = body.carrier.points[:, 2:] * np.cross([0.0, 0.0, 1.0], body.carrier.points)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.03 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"mode": "volume", "count": 3}, 'count has no meaning with mode = "volume"'),
        ({"mode": "volume", "points": "random"}, '"regular" or "jittered"'),
        ({"mode": "all", "points": "regular"}, 'points has no meaning with mode = "all"'),
        ({"mode": "solid"}, '"all", "centres", "cores", "mesh" or "volume"'),
    ],
)
def test_what_has_no_meaning_is_refused(options, says):
    with pytest.raises(SceneError, match=says):
        Reduction(**options)


def test_a_run_starts_with_the_splat_and_falls_as_one(tmp_path, scene_of, run):
    splat = shell(SHAPES["sphere"], count=3_000)
    scene = scene_of(splat, duration=0.2, reduction=VOLUME, position=(0.0, 0.0, 1.0))
    recording = run(scene, tmp_path / "run.gasp")
    first, last = recording.gaussians(0), recording.gaussians(5)
    assert first.covariances() == pytest.approx(splat.covariances(), rel=1e-6, abs=1e-12)
    fallen = last.means - first.means
    # Displacements are float32; the engine of the tests falls in whole steps, a two-hundredth too far.
    assert np.ptp(fallen, axis=0).max() < 1e-6
    assert fallen.mean(axis=0) == pytest.approx([0, 0, -0.5 * 9.81 * 0.2**2], abs=2e-3)
    assert recording.bodies[0].carrier.kind == "volume"
    (note,) = [note for note in recording.notes if "points fill" in note]
    assert "carry 3,000 Gaussians" in note


def test_a_run_that_was_stopped_ends_as_if_it_had_not_been(tmp_path, scene_of, run):
    splat = shell(SHAPES["torus"], count=3_000)
    scene = scene_of(splat, duration=0.2, reduction=VOLUME, angular_velocity=(0.0, 1.0, 2.0))
    whole = run(scene, tmp_path / "whole.gasp")
    run(scene, tmp_path / "cut.gasp", frames=3)
    again = run(scene, tmp_path / "cut.gasp", resume=True)
    for frame in range(whole.frame_count):
        assert np.array_equal(whole.gaussians(frame).means, again.gaussians(frame).means)


def test_points_that_are_known_are_taken_again_where_they_are_these_but_for_roundings():
    splat = shell(SHAPES["torus"], count=3_000)
    thing = item(splat)
    scene = Scene(duration=1, frame_rate=1, objects=(thing,), accuracy=EngineAccuracy(resolution=16))
    placed = [place_object(thing, splat)]
    carrier = assemble(scene, placed).bodies[0].carrier
    rng = np.random.default_rng(0)
    for off, taken in ((1e-9, True), (1e-2, False)):
        other = dataclasses.replace(carrier, points=carrier.points + off * rng.uniform(-1, 1, carrier.points.shape))
        found = assemble(scene, placed, None, {"thing": other}).bodies[0].carrier
        assert np.array_equal(found.points, other.points) == taken


def test_an_object_stands_on_its_solid_and_not_on_its_outermost_gaussian():
    splat = shell(SHAPES["sphere"], count=4_000)
    # A beard of faint Gaussians below, that the box of centres would stand on.
    beard = leaf(np.random.default_rng(0), count=60)
    beard = beard.with_(means=0.1 * beard.means - [0, 0, 0.1], opacities=np.full(60, 0.015), scales=0.1 * beard.scales)
    placed = place_object(item(joined(splat, beard), position=(1.0, 2.0, 3.0)), joined(splat, beard))
    assert placed.solid().lowest() == pytest.approx(3.0, abs=1e-6)
    sphere = placed.gaussians.means[:4_000]
    assert sphere[:, 2].min() == pytest.approx(3.0, abs=0.01)
    floor = HalfSpace(point=(0, 0, 3.0), normal=(0, 0, 1))
    assert floor.signed_distance(sphere).min() > -0.01


def test_haze_beside_a_body_has_no_points_of_its_own():
    """Crumbs of a hundredth of a cell's side, squared, along a cube, and the like of them where nothing else is."""
    splat = shell(SHAPES["cube"], count=8_000)
    placed = place_object(item(splat), splat).solid()
    spacing, thickness = 1 / 20, 0.01
    beside = np.random.default_rng(3).uniform(-0.4, 0.4, (30, 3)) * [1, 1, 0] + [0, 0, 1 + 1.5 * spacing]
    specks = np.concatenate([beside, beside + [0, 0, 2]])
    areas = np.full(len(specks), 1e-4 * spacing**2)
    sheets = Sheets(
        positions=(specks - placed.translation) / placed.scale @ placed.rotation, areas=areas, thickness=thickness
    )
    found = fill(dataclasses.replace(placed, solid=dataclasses.replace(placed.solid, sheets=sheets)), spacing)
    assert found.positions[: len(found.positions) - found.sheet, 2].max() < 1 + spacing
    assert found.sheet > 0
    assert found.positions[-found.sheet :, 2].min() > 2


def test_what_is_far_off_the_matter_is_not_swung_about_by_its_turns():
    """A piece too small to have a body: 1 % of the Gaussians, ten cells away."""
    ball = shell(SHAPES["sphere"], count=5_000)
    piece = shell(SHAPES["sphere"], count=50)
    piece = piece.with_(means=0.1 * piece.means + [1.2, 0, 0], scales=0.1 * piece.scales)
    body = assembled(joined(ball, piece)).bodies[0]
    points = body.carrier.points
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = moved_simplices(body, points @ quarter.T - points)
    way = np.linalg.norm(moved[-50:, 0] - body.block.rest[-50:, 0], axis=1)
    # As far as the nearest matter goes, at the surface of the ball; what is thrice as far out would go farther.
    assert (way < 1.1 * np.sqrt(2) * np.linalg.norm(points, axis=1).max()).all()
    assert any("50 Gaussians far off its matter" in note for note in body.notes)


def test_shreds_that_hang_about_a_body_have_no_points_of_their_own_and_leaves_beside_it_do():
    """Crumbs of a sixtieth of a cell, of which the farthest stretched set the step of all; a leaf so thin is a leaf."""
    splat = shell(SHAPES["cube"], count=8_000)
    placed = place_object(item(splat), splat).solid()
    spacing, thickness = 1 / 20, 0.01
    places = np.stack(np.meshgrid(*2 * [np.arange(-0.4, 0.45, 0.1)], [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    above = [places + [0, 0, 1 + cells * spacing] for cells in (1.5, 2.5, 6.0)]
    none = fill(dataclasses.replace(placed, solid=dataclasses.replace(placed.solid, sheets=Sheets.none())), spacing)

    def filled(positions, area, thick):
        sheets = Sheets(
            positions=(positions - placed.translation) / placed.scale @ placed.rotation,
            areas=np.full(len(positions), area),
            thickness=thick,
        )
        found = fill(dataclasses.replace(placed, solid=dataclasses.replace(placed.solid, sheets=sheets)), spacing)
        assert np.array_equal(found.positions[: len(none.positions)], none.positions)
        return found

    shreds = filled(np.concatenate(above), spacing**3 / 60 / thickness, thickness)
    heights = shreds.positions[-shreds.sheet :, 2] - 1
    # Four points each, and those about the others: a thickness off the middle at most.
    assert shreds.sheet == 4 * len(places) and heights.min() > 6 * spacing - thickness
    fine = np.stack(np.meshgrid(*2 * [np.arange(-0.4, 0.4, 0.01)], [1 + 2.5 * spacing], indexing="ij"), axis=-1)
    leaf_beside = filled(fine.reshape(-1, 3), 0.01**2, thickness / 5)
    # A whole piece of it has less than a crumb that counts for nothing. Its rim may be lost, of crumbs in truth.
    assert (0.75 * spacing) ** 2 * thickness / 5 < spacing**3 / 32
    assert leaf_beside.volumes[-leaf_beside.sheet :].sum() == pytest.approx(0.8**2 * thickness / 5, rel=0.05)
