"""What the points of a body with parts are made of, in every reduction, and where they are held."""

from __future__ import annotations

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import (
    BoxShape,
    Elastic,
    EngineAccuracy,
    HalfSpace,
    Part,
    Pinned,
    Reduction,
    Rigid,
    Scene,
    SphereShape,
    SplatObject,
    VaryingMaterial,
)
from gasp_core.contract import PointProblem, SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.reduction.assembly import assemble
from gasp_core.reduction.clusters import cluster_apart
from gasp_core.reduction.held_region import held_region
from gasp_core.reduction.rounded_fields import rounded_rows
from gasp_core.scene.selection import place_object

SOFT = Elastic(density=300, youngs_modulus=1e5, poissons_ratio=0.3)
STIFF = Elastic(density=900, youngs_modulus=1e7, poissons_ratio=0.2)
MODES = {
    "all": Reduction(mode="all"),
    "cores": Reduction(mode="cores", fraction=0.1, levels=2),
    "volume": Reduction(mode="volume"),
}
LEFT = BoxShape(center=(-0.5, 0, 0.5), half_extents=(0.5, 1, 1))


@pytest.fixture(scope="module")
def cube():
    """Standing on z = 0, from -0.5 to 0.5 in x and y."""
    return shell(SHAPES["cube"], count=4_000)


def assembled(splat, *parts, reduction=MODES["volume"], material=SOFT, resolution=12):
    item = SplatObject(name="thing", splat=splat, material=material, parts=parts, reduction=reduction)
    scene = Scene(duration=1, frame_rate=1, objects=(item,), accuracy=EngineAccuracy(resolution=resolution))
    return assemble(scene, [place_object(item, splat)])


def told(assembly):
    return [note for note in assembly.bodies[0].notes if "part" in note]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("by", ["region", "labels"])
def test_matter_is_of_its_part_in_every_reduction(cube, mode, by):
    left = cube.means[:, 0] <= 0
    which = {"region": LEFT} if by == "region" else {"labels": left.astype(int), "label": 1}
    assembly = assembled(cube, Part(name="left", material=STIFF, **which), reduction=MODES[mode])
    problem = assembly.problem
    assert problem.materials == (SOFT, STIFF)
    # One body, one grid: nothing tears where they meet.
    assert set(problem.points.body_ids) == {0}
    x = problem.points.reference_positions[:, 0]
    stiff = problem.points.material_ids == 1
    # Points of the left's Gaussians or clusters lie to its right by no more than those are wide; in a filled body the
    # region itself says, and else the Gaussians nearest by way of matter, two distances of points away at most.
    wide = {"all": 0.15, "cores": 0.35, "volume": 0.0 if by == "region" else 2 / 12}[mode]
    assert x[stiff].max() <= wide + 1e-9
    assert x[~stiff].min() >= -wide - 1e-9
    volumes = problem.points.reference_volumes
    # Both halves are alike; where it is cut, a layer of points may go to either side.
    assert volumes[stiff].sum() == pytest.approx(volumes.sum() / 2, rel=0.15)
    assert problem.masses.sum() == pytest.approx(900 * volumes[stiff].sum() + 300 * volumes[~stiff].sum())
    (note,) = told(assembly)
    assert note.startswith(f'part "left", elastic: {int(left.sum()):,} Gaussians, {int(stiff.sum()):,} points, ')
    assert note.endswith(f"{900 * volumes[stiff].sum():.3g} kg")


def test_a_core_is_of_one_part(cube):
    labels = np.random.default_rng(0).integers(0, 3, len(cube))
    assembly = assembled(
        cube,
        Part(labels=labels, label=1, material=STIFF),
        Part(labels=labels, label=2, material=Elastic(density=1, youngs_modulus=1, poissons_ratio=0)),
        reduction=MODES["cores"],
    )
    body, problem = assembly.bodies[0], assembly.problem
    of_gaussians = problem.points.material_ids[body.carrier.leaders]
    # Materials stand in the order of parts.
    assert of_gaussians.tolist() == labels.tolist()
    assert len(problem.points) <= 4 * 400
    # Four corners of a core are of one material.
    assert (np.ptp(problem.points.material_ids.reshape(-1, 4), axis=1) == 0).all()


def test_clusters_apart_are_as_many_as_asked_and_none_of_two_kinds():
    places = np.random.default_rng(0).normal(size=(1000, 3))
    kinds = np.repeat([5, -1, 9], [700, 297, 3])
    labels = cluster_apart(places, kinds, 100)
    assert sorted(set(labels)) == list(range(100))
    assert [len(set(kinds[labels == label])) for label in range(100)] == [1] * 100
    assert len(set(cluster_apart(places, kinds, 1))) == 3


def test_a_speck_of_wrong_labels_on_the_surface_is_outvoted(cube):
    labels = np.ones(len(cube), dtype=int)
    # One in twenty, which is what they had without a vote; a point of this grid leads some ten Gaussians.
    labels[np.random.default_rng(0).permutation(len(cube))[: len(cube) // 20]] = 2
    assembly = assembled(cube, Part(labels=labels, label=2, material=STIFF), resolution=4)
    shares = assembly.problem.points.reference_volumes / assembly.problem.points.reference_volumes.sum()
    assert shares[assembly.problem.points.material_ids == 1].sum() < 0.01


def test_regions_of_a_filled_body_must_not_overlap_within_it_either(cube):
    ball = SphereShape(center=(0.2, 0, 0.5), radius=0.28)
    # Its middle has no Gaussians, so that these share none.
    box = BoxShape(center=(-0.5, 0, 0.5), half_extents=(0.5, 1, 1))
    face = Part(name="face", region=BoxShape(center=(0.5, 0, 0.5), half_extents=(0.4, 1, 1)), material=STIFF)
    with pytest.raises(SceneError, match="no Gaussian is inside its region"):
        assembled(cube, Part(region=ball, material=STIFF), Part(region=box, material=STIFF))
    tall = Part(region=BoxShape(center=(0, 0, 0.9), half_extents=(0.11, 0.11, 0.9)), material=STIFF)
    with pytest.raises(SceneError, match=r'part "face" and part 2 share \d+ (points|Gaussians)'):
        assembled(cube, face, tall)


def test_a_part_too_small_for_the_grid_says_that_it_moves_with_the_rest(cube):
    # Between the points of this grid: nothing of the body is of it, though a Gaussian is.
    corner = Part(region=SphereShape(center=tuple(map(float, cube.means[0])), radius=1e-4), material=STIFF)
    (note,) = told(assembled(cube, corner))
    assert "1 Gaussians, 0 points, 0 kg: it is finer than what is simulated" in note


def test_an_object_of_two_densities_that_is_rigid_all_over_is_one_body(cube):
    assembly = assembled(cube, Part(region=LEFT, material=Rigid(density=9)), material=Rigid(density=1))
    assert [material.density for material in assembly.problem.materials] == [1, 9]
    assert assembly.problem.rigid_parts == {}
    assert set(assembly.problem.points.body_ids) == {0}


def test_a_pinned_part_is_held_by_its_region(cube):
    assembly = assembled(cube, Part(name="pot", region=LEFT, pinned=True))
    assert assembly.problem.drives == (Pinned(region=LEFT),)
    assert assembly.drive_names == ['object "thing", part "pot"']
    assert assembly.problem.materials == (SOFT,)
    assert "elastic, pinned" in told(assembly)[0]


@pytest.mark.parametrize("mode", MODES)
def test_a_pinned_part_without_a_region_is_held_where_its_points_are_and_others_are_not(cube, mode):
    labels = (cube.means[:, 0] <= 0).astype(int)
    assembly = assembled(cube, Part(labels=labels, label=1, pinned=True, material=STIFF), reduction=MODES[mode])
    (drive,) = assembly.problem.drives
    assert isinstance(drive.region, SignedDistanceField)
    points = assembly.problem.points
    held = drive.region.signed_distance(points.reference_positions) <= 0
    stiff = points.material_ids == 1
    # Half way between a point of either side, on a field of half a cell: points that touch may go either way.
    assert (held == stiff).mean() > 0.97


def test_the_held_region_ends_half_way_to_other_matter_and_a_cell_and_a_half_outside():
    spacing = 0.1
    own = np.argwhere(np.ones((6, 6, 6))) * spacing / 2
    others = own + [0, 0, 0.3]
    field = held_region(own, others, spacing)
    middle = np.array([0.125, 0.125, 0.0])
    heights = np.linspace(-0.3, 0.6, 901)
    inside = heights[field.signed_distance(middle + np.outer(heights, [0, 0, 1])) <= 0]
    # Trilinear between nodes half a cell apart: distances to a lattice bend by a quarter of that.
    assert inside.min() == pytest.approx(-0.15, abs=spacing / 8)
    assert inside.max() == pytest.approx(0.275, abs=spacing / 8)
    with pytest.raises(SceneError, match="too scattered"):
        held_region(own[:1] + 1e-9, own, spacing)


def test_a_field_of_few_values_is_exact(cube):
    stiffnesses = np.where(cube.means[:, 0] <= 0, 1e4, 1e6)
    material = VaryingMaterial(base=SOFT, columns={"youngs_modulus": stiffnesses})
    for mode in ("all", "volume"):
        assembly = assembled(cube, reduction=MODES[mode], material=material)
        found = assembly.problem.material_values("youngs_modulus")
        x = assembly.problem.points.reference_positions[:, 0]
        assert (found[x < -0.25] == 1e4).all()
        assert (found[x > 0.25] == 1e6).all()
        assert any("exactly" in note and "1e+04 to 1e+06" in note for note in assembly.bodies[0].notes)


def test_a_field_of_many_values_is_rounded_by_less_than_a_per_cent(cube):
    rng = np.random.default_rng(0)
    columns = {
        "youngs_modulus": np.exp(rng.uniform(np.log(1e4), np.log(1e6), len(cube))),
        "density": rng.uniform(100, 110, len(cube)),
    }
    material = VaryingMaterial(base=SOFT, columns=columns)
    assembly = assembled(cube, reduction=MODES["all"], material=material)
    problem = assembly.problem
    followers = assembly.bodies[0].carrier.followers
    for name, column in columns.items():
        off = problem.material_values(name) / column[followers] - 1
        # Half a step of 1 %; all the Gaussians are 4,000, fewer than the rows that stay exact, but their pairs are not.
        assert np.abs(off).max() <= np.sqrt(1.01) - 1 + 1e-12
    assert len(problem.materials) <= 4096


def test_a_field_at_a_core_is_the_mean_of_its_cluster(cube):
    densities = np.random.default_rng(0).uniform(100, 200, len(cube))
    material = VaryingMaterial(base=SOFT, columns={"density": densities})
    assembly = assembled(cube, reduction=Reduction(mode="cores", count=50), material=material)
    cores = assembly.bodies[0].carrier.labels
    expected = np.bincount(cores, densities) / np.bincount(cores)
    np.testing.assert_allclose(assembly.problem.material_values("density")[::4], expected, rtol=1e-12)


def test_points_that_a_region_cuts_off_from_their_gaussians_have_the_value_of_the_nearest_of_the_part(cube):
    stiffnesses = 1e5 + np.arange(len(cube))
    part = Part(region=LEFT, material=VaryingMaterial(base=STIFF, columns={"youngs_modulus": stiffnesses}))
    problem = assembled(cube, part).problem
    own = problem.material_values("youngs_modulus")[problem.points.reference_positions[:, 0] <= 0]
    assert own.min() >= 1e5
    assert own.max() <= 1e5 + len(cube)


def test_matter_that_regions_of_all_gaussians_leave_is_as_the_gaussians_around_it(cube):
    """Two regions hold them all, and not a slab between the two: none is the object's own."""
    splat = cube.select(np.abs(cube.means[:, 2] - 0.5) > 0.06)
    left = splat.means[:, 0] <= 0
    halves = [BoxShape(center=(0, 0, z), half_extents=(1, 1, 0.44)) for z in (0.0, 1.0)]
    parts = [Part(region=half, material=STIFF) for half in halves]
    material = VaryingMaterial(base=SOFT, columns={"youngs_modulus": np.where(left, 1e4, 1e6)})
    problem = assembled(splat, *parts, material=material).problem
    places = problem.points.reference_positions
    between = np.all([half.signed_distance(places) > 0 for half in halves], axis=0)
    found, x = problem.material_values("youngs_modulus")[between], places[between, 0]
    assert (found[x < -0.25] == 1e4).all() and (found[x > 0.25] == 1e6).all()
    assert (x < -0.25).any() and (x > 0.25).any()


def test_what_no_gaussian_is_made_of_is_looked_at_where_matter_is(cube):
    nothing = VaryingMaterial(base=SOFT, columns={"youngs_modulus": np.full(len(cube), np.nan)})
    everywhere = BoxShape(center=(0, 0, 0.5), half_extents=(1, 1, 1))
    with pytest.raises(SceneError, match='object "thing": youngs_modulus must be > 0, is nan of Gaussian 0'):
        assembled(cube, Part(region=everywhere, material=STIFF), material=nothing)
    ones = np.ones(len(cube), dtype=int)
    assert assembled(cube, Part(labels=ones, label=1, material=STIFF), material=nothing).problem.materials == (STIFF,)


def rows_of(**values):
    table, rows, off = rounded_rows({name: np.asarray(column, dtype=float) for name, column in values.items()}, 50)
    return {name: table[rows, at] for at, name in enumerate(values)}, len(table), off


def test_rows_are_exact_where_they_are_few_and_else_off_by_what_is_said():
    rng = np.random.default_rng(0)
    few = rng.choice([1e5, 3.3e5, 7.1e6], 1000)
    found, count, off = rows_of(youngs_modulus=few, density=few / 1e3)
    assert (found["youngs_modulus"] == few).all()
    assert (count, off) == (3, 0.0)
    stiffness, ratios = rng.uniform(1e5, 1.2e5, 1000), rng.uniform(-0.9, 0.499, 1000)
    found, count, off = rows_of(youngs_modulus=stiffness)
    assert count <= 50
    assert np.abs(found["youngs_modulus"] / stiffness - 1).max() <= off <= np.sqrt(1.01) - 1 + 1e-12
    found, count, off = rows_of(poissons_ratio=ratios)
    assert count <= 50
    assert np.abs((1 - 2 * found["poissons_ratio"]) / (1 - 2 * ratios) - 1).max() <= off
    assert (found["poissons_ratio"] < 0.5).all()


def test_a_step_is_doubled_until_the_rows_are_few_enough():
    stiffness = np.exp(np.random.default_rng(0).uniform(0, 10, 10_000))
    found, count, off = rows_of(youngs_modulus=stiffness)
    # 10 / ln 1.01 = 1,005 steps; halved five times 32.
    assert 25 <= count <= 50
    assert off == pytest.approx(1.01**16 - 1, rel=0.01)
    assert np.abs(found["youngs_modulus"] / stiffness - 1).max() <= off * (1 + 1e-9)


def test_engines_take_thousands_of_materials(cube):
    """Units, tables and messages of all that is shared, of as many rows as there can be."""
    from gasp_mpm_host.scaling import Units, material_table

    from gasp_core.contract.capabilities import needs

    stiffnesses = np.exp(np.random.default_rng(0).uniform(0, 12, len(cube)))
    material = VaryingMaterial(base=SOFT, columns={"youngs_modulus": stiffnesses})
    problem: PointProblem = assembled(cube, reduction=MODES["all"], material=material).problem
    assert len(problem.materials) > 1000
    assert np.isfinite(material_table(problem, Units.of(problem, 0.1))).all()
    refusals = {need.refusal for need in needs(problem, body_names=["thing"])}
    assert len(refusals) == 1


def test_a_half_space_may_be_a_part(cube):
    assembly = assembled(cube, Part(region=HalfSpace(point=(0, 0, 0.5), normal=(0, 0, 1)), material=STIFF))
    z = assembly.problem.points.reference_positions[:, 2]
    assert ((z <= 0.5) == (assembly.problem.points.material_ids == 1)).all()
