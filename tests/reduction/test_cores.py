from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gasp_core import Elastic, EngineAccuracy, MapChoice, Reduction, Scene, SplatObject
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.reduction.all_vertices import block_of
from gasp_core.reduction.assembly import assemble
from gasp_core.reduction.bodies import moved_gaussians, moved_simplices
from gasp_core.reduction.clusters import cluster
from gasp_core.reduction.cores import Level, Levels, sample_cores
from gasp_core.reduction.transfer import NEIGHBOURS, Cores, LeastSquares, OneFrame
from gasp_core.scene.selection import place_object

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


def splat_of(means, seed=0, scales=None):
    rng = np.random.default_rng(seed)
    count = len(means)
    return Gaussians(
        means=np.asarray(means, dtype=np.float64),
        quaternions=rng.normal(size=(count, 4)),
        scales=np.exp(rng.uniform(-6, -4, size=(count, 3))) if scales is None else scales,
        opacities=np.full(count, 0.9),
        harmonics=np.zeros((count, 1, 3), dtype=np.float32),
    )


def ball(count=600, seed=0, offset=0.0):
    return splat_of(np.random.default_rng(seed).normal(size=(count, 3)) / 4 + offset, seed)


def assembled(*splats, vertices=None, maps=None, **reduction):
    items = [
        SplatObject(
            name=f"thing {index}",
            splat=splat,
            material=JELLY,
            reduction=Reduction(mode="cores", **reduction),
            vertices=vertices,
        )
        for index, splat in enumerate(splats)
    ]
    accuracy = EngineAccuracy(resolution=64)
    scene = Scene(duration=1, frame_rate=1, objects=items, maps=maps or MapChoice(), accuracy=accuracy)
    return assemble(scene, [place_object(item, item.splat) for item in items])


def every_vertex(item):
    """The same as the engine would have been given it without any cores."""
    item = dataclasses.replace(item, reduction=Reduction(mode="all"))
    scene = Scene(duration=1, frame_rate=1, objects=(item,), accuracy=EngineAccuracy(resolution=64))
    return assemble(scene, [place_object(item, item.splat)])


def turn(angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1.0]]) @ np.array(
        [[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]
    )


def moved_by(body, points, gradient, shift=(0.3, -0.2, 0.5)):
    """Displacements of a body's points under x -> F x + t about its centre as a recording has them, and their mean."""
    own = points[body.points] - body.block.centre
    displacements = own @ (np.asarray(gradient) - np.eye(3)).T + shift
    mean = displacements.mean(axis=0)
    return (displacements - mean).astype(np.float32), mean


AFFINE = np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.1]])
EXACT = [("least-squares", AFFINE), ("least-squares", turn(1.0)), ("frame", turn(1.0))]


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("vertices", [3, 4])
@pytest.mark.parametrize("transfer,gradient", EXACT)
def test_a_motion_of_its_class_is_carried_exactly(transfer, gradient, vertices, levels):
    """float32 knows a displacement of order 1 to 6e-8; a fit over cores a tenth apart spreads that tenfold."""
    assembly = assembled(ball(), vertices=vertices, fraction=0.1, levels=levels, transfer=transfer)
    body = assembly.bodies[0]
    relative, mean = moved_by(body, assembly.problem.points.reference_positions, gradient)
    expected = body.block.rest @ gradient.T + (0.3, -0.2, 0.5)
    assert np.abs(moved_simplices(body, relative) + mean - expected).max() < 1e-5


def test_one_frame_is_not_exact_where_matter_is_strained():
    """That the test above can fail: a rigid frame leaves a stretch of 1.2 behind."""
    assembly = assembled(ball(), fraction=0.1, transfer="frame")
    body = assembly.bodies[0]
    relative, mean = moved_by(body, assembly.problem.points.reference_positions, AFFINE)
    expected = body.block.rest @ AFFINE.T + (0.3, -0.2, 0.5)
    assert np.abs(moved_simplices(body, relative) + mean - expected).max() > 1e-2


@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
@pytest.mark.parametrize("levels", [1, 2])
def test_displacement_zero_is_the_rest_state_to_the_last_bit(transfer, levels):
    assembly = assembled(ball(offset=1e4), fraction=0.05, levels=levels, transfer=transfer)
    body = assembly.bodies[0]
    zeros = np.zeros((len(assembly.problem.points), 3), dtype=np.float32)
    assert np.array_equal(moved_simplices(body, zeros), body.block.rest)


@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
def test_a_smooth_motion_gains_from_more_cores(transfer):
    """Least squares is of second order in the distance of cores, one frame of first: N^(-2/3) and N^(-1/3)."""
    splat = ball(4000)
    errors = []
    for fraction in (0.02, 0.16):
        assembly = assembled(splat, fraction=fraction, transfer=transfer)
        body = assembly.bodies[0]
        field = lambda x: 0.1 * np.sin(2 * x[..., [1, 2, 0]])  # noqa: E731
        points = assembly.problem.points.reference_positions - body.block.centre
        moved = moved_simplices(body, field(points)) - (body.block.rest + field(body.block.rest))
        errors.append(np.sqrt((moved**2).sum(axis=-1).mean()))
    # Eight times the cores: a quarter and a half, in theory; half of that gain has to be there on a random cloud.
    assert errors[1] < errors[0] * (0.25 if transfer == "least-squares" else 0.5) ** 0.5


def test_least_squares_beats_one_frame():
    splat = ball(4000)
    errors = {}
    for transfer in ("least-squares", "frame"):
        assembly = assembled(splat, fraction=0.05, transfer=transfer)
        body = assembly.bodies[0]
        field = lambda x: 0.1 * np.sin(2 * x[..., [1, 2, 0]])  # noqa: E731
        points = assembly.problem.points.reference_positions - body.block.centre
        moved = moved_simplices(body, field(points)) - (body.block.rest + field(body.block.rest))
        errors[transfer] = np.sqrt((moved**2).sum(axis=-1).mean())
    assert errors["least-squares"] < errors["frame"]


@pytest.mark.parametrize("count", [1, 2, 3, 7, 50, 599])
def test_there_are_as_many_cores_as_asked(count):
    assembly = assembled(ball(), count=count)
    assert len(assembly.problem.points) == 4 * count
    assert len(np.unique(assembly.bodies[0].carrier.labels)) == count


@pytest.mark.parametrize("fraction", [0.0001, 0.05, 1.0])
def test_a_fraction_is_of_the_gaussians_that_move(fraction):
    splat = ball()
    item = SplatObject(
        name="a",
        splat=splat.with_(opacities=np.where(np.arange(600) < 100, 0.0, 0.9)),
        material=JELLY,
        min_opacity=0.5,
        reduction=Reduction(mode="cores", fraction=fraction),
    )
    assembly = assemble(Scene(duration=1, frame_rate=1, objects=(item,)), [place_object(item, item.splat)])
    assert len(assembly.problem.points) == 4 * max(1, round(fraction * 500))


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_the_mass_is_that_of_all_points(levels):
    splat = ball()
    item = SplatObject(name="a", splat=splat, material=JELLY)
    whole = every_vertex(item)
    reduced = assembled(splat, count=20, levels=levels)
    # A sum of some thousand doubles.
    np.testing.assert_allclose(reduced.problem.masses.sum(), whole.problem.masses.sum(), rtol=1e-12)
    assert (reduced.problem.masses > 0).all()
    assert reduced.spacing == whole.spacing


def test_a_core_has_the_mass_the_mean_and_the_covariance_of_its_cluster():
    """One core for all has the moments of all vertices, as the engine would have been given them."""
    splat = ball(50)
    item = SplatObject(name="a", splat=splat, material=JELLY, vertices=4)
    whole = every_vertex(item).problem.points
    positions, weights = whole.reference_positions, whole.reference_volumes
    corners = assembled(splat, count=1, vertices=4).problem.points.reference_positions
    mean = np.average(positions, axis=0, weights=weights)
    expected = np.cov(positions.T, aweights=weights, bias=True)
    # Some two hundred operations in double precision on numbers of order one.
    np.testing.assert_allclose(corners.mean(axis=0), mean, atol=1e-13)
    np.testing.assert_allclose(np.cov(corners.T, bias=True), expected, atol=1e-13)


def test_levels_are_cores_of_cores():
    carrier = assembled(ball(), count=10, levels=2).bodies[0].carrier
    first, second = carrier.levels
    assert len(first.cores) == 10 and 10 < len(second.cores) < 600
    assert first.transfer.labels.shape == (len(second.cores),)
    assert np.array_equal(carrier.labels, first.transfer.labels[second.transfer.labels])


def test_leaders_and_followers_are_of_one_cluster():
    carrier = assembled(ball(), count=10).bodies[0].carrier
    assert np.array_equal(carrier.labels[carrier.followers], np.repeat(np.arange(10), 4))
    assert np.array_equal(carrier.leaders // 4, carrier.labels)


def test_two_bodies_do_not_pull_at_each_other():
    """They lie in the same place; one stands still, the other flies."""
    assembly = assembled(ball(seed=1), ball(seed=2), fraction=0.05)
    still, flying = assembly.bodies
    moved = np.zeros((len(assembly.problem.points), 3))
    moved[flying.points] = (1.0, 2.0, 3.0)
    assert np.array_equal(moved_simplices(still, moved[still.points]), still.block.rest)
    carried = moved_simplices(flying, moved[flying.points]) - flying.block.rest
    # Weights in float32 are normalised in float64; the fit's slope is the rounding of sums of order 1 over a spacing.
    np.testing.assert_allclose(carried, np.broadcast_to((1.0, 2.0, 3.0), carried.shape), atol=1e-10)


@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
@pytest.mark.parametrize(
    "means",
    {
        "one": np.zeros((1, 3)),
        "all in one place": np.ones((40, 3)),
        "on a line": np.linspace(0, 1, 200)[:, None] * [1.0, 2.0, 3.0],
        "coplanar": np.random.default_rng(0).uniform(size=(300, 3)) * [1.0, 1.0, 0.0],
        "two places": np.repeat([[0.0, 0, 0], [1, 0, 0]], 30, axis=0),
    }.items(),
    ids=lambda item: item[0],
)
def test_odd_clouds_turn_with_their_cores(means, transfer):
    splat = splat_of(means[1])
    assembly = assembled(splat, count=min(5, len(splat)), transfer=transfer)
    body = assembly.bodies[0]
    places = len(np.unique(splat.means, axis=0))
    assert 1 <= len(assembly.problem.points) // 4 <= min(5, places)
    rotation = turn(0.7)
    relative, mean = moved_by(body, assembly.problem.points.reference_positions, rotation)
    expected = body.block.rest @ rotation.T + (0.3, -0.2, 0.5)
    # As above, in units of the body: its extent, or that of a Gaussian.
    assert np.abs(moved_simplices(body, relative) + mean - expected).max() < 1e-5


def test_flat_neighbourhoods_fall_back_and_are_counted():
    """Without magnified edges the corners of cores of a sheet lie in its plane: no affine map can be fitted."""
    sheet = np.random.default_rng(0).uniform(size=(300, 3)) * [1.0, 1.0, 0.0]
    splat = splat_of(sheet, scales=np.full((300, 3), 1e-9))
    assembly = assembled(splat, fraction=0.1, vertices=4, maps=MapChoice(edge_floor=0.0))
    body = assembly.bodies[0]
    level = body.carrier.levels[0]
    assert isinstance(level.transfer, LeastSquares)
    assert len(level.transfer.fallen) == 300
    assert body.notes[0] == ("30 cores carry 300 Gaussians, 300 neighbourhoods fell back on one core's frame")
    zeros = np.zeros((len(assembly.problem.points), 3), dtype=np.float32)
    moved = moved_gaussians(body, zeros + np.float32(0.5), MapChoice())
    assert np.abs(moved.gaussians.means - body.block.local.means - 0.5).max() < 1e-12


def test_too_few_corners_for_the_grid_are_told():
    item = SplatObject(name="a", splat=ball(), material=JELLY)
    scene = Scene(duration=1, frame_rate=1, objects=(item,), accuracy=EngineAccuracy(resolution=4))
    whole = assemble(scene, [place_object(item, item.splat)])
    cells = round(whole.problem.points.reference_volumes.sum() / whole.spacing**3)
    for count, notes in ((cells - 1, 2), (cells, 1)):
        fewer = dataclasses.replace(item, reduction=Reduction(mode="cores", count=count))
        found = assemble(scene, [place_object(fewer, fewer.splat)]).bodies[0].notes
        assert len(found) == notes
        assert notes == 1 or found[1].endswith(f"ask for some {cells} cores")


def test_more_cores_than_gaussians_is_refused():
    with pytest.raises(SceneError, match=r'object "thing 0": reduction.count 601 is more than the 600 Gaussians'):
        assembled(ball(), count=601)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [1, 2, 10, 100])
def test_clusters_are_many_as_asked_and_compact(seed, count):
    positions = np.random.default_rng(seed).uniform(size=(1000, 3)) * [1.0, 5.0, 0.1]
    labels = cluster(positions, count)
    sizes = np.bincount(labels)
    assert len(sizes) == count and sizes.min() > 0
    within = sum(
        ((positions[labels == own] - positions[labels == own].mean(axis=0)) ** 2).sum() for own in range(count)
    )
    whole = ((positions - positions.mean(axis=0)) ** 2).sum()
    # A plate cut into n squares keeps 1/n of its scatter at the least, cut into strips across its length 1/n^2.
    assert within <= whole * 1.5 / count


@pytest.mark.parametrize("count", [12, 40, 120])
def test_least_squares_errs_less_than_one_frame_also_where_leaves_move_apart(count):
    """Two sheets, a quarter of their size from each other, stretched and bent apart; cores move as their clusters do.

    Less than a quarter: a cluster of size h strays by some 0.2 h^2 from its affine fit, that is curvature, and from its
    rotation by the strain, 0.25 h, as well; h is 0.6 or less.
    """
    rng = np.random.default_rng(4)
    sheets = rng.uniform(-1, 1, size=(2, 600, 3)) * [1.0, 1.0, 0.01] + np.array([[[0, 0, -0.25]], [[0, 0, 0.25]]])
    assembly = assembled(splat_of(sheets.reshape(-1, 3)), count=count)
    body = assembly.bodies[0]
    rest, carrier = body.block.rest, body.carrier
    x, y, z = np.moveaxis(rest, -1, 0)
    upper = z > 0
    moved = rest + np.where(upper, 1, -1)[..., None] * np.stack([0.25 * x, 0.1 * x * y, 0.2 + 0.2 * x * x], axis=-1)
    displacements = carrier.gather(rest, moved - rest)
    (level,) = carrier.levels
    frame = Levels(levels=(Level(cores=level.cores, transfer=OneFrame(labels=level.transfer.labels)),))
    fitted, turned = (
        np.sqrt(((each.carry(rest, displacements) - moved) ** 2).sum(axis=-1).mean()) for each in (carrier, frame)
    )
    assert fitted < 0.25 * turned


def test_a_carrier_comes_back_from_its_arrays():
    for transfer in ("least-squares", "frame"):
        assembly = assembled(ball(), count=20, levels=2, transfer=transfer)
        body = assembly.bodies[0]
        again = Levels.of(dict(body.carrier.arrays()))
        moved = np.random.default_rng(0).normal(size=(80, 3))
        assert np.array_equal(again.carry(body.block.rest, moved), body.carrier.carry(body.block.rest, moved))


def test_eight_neighbours_where_there_are_eight():
    for count, expected in ((3, 3), (8, 8), (50, 8)):
        body = assembled(ball(), count=count).bodies[0]
        (level,) = body.carrier.levels
        weights = level.transfer.weights
        assert weights.shape == level.transfer.neighbours.shape == (600, NEIGHBOURS)
        assert (weights[:, :expected] > 0).all() and not weights[:, expected:].any()
    assert NEIGHBOURS == 8


def test_a_transfer_kept_with_as_many_columns_as_there_were_cores():
    body = assembled(ball(), count=3).bodies[0]
    kept = dict(body.carrier.arrays())
    for name in ("neighbours", "weights"):
        kept[f"levels/0/transfer/{name}"] = kept[f"levels/0/transfer/{name}"][:, :3]
    moved = np.random.default_rng(0).normal(size=(12, 3))
    expected = body.carrier.carry(body.block.rest, moved)
    assert np.array_equal(Levels.of(kept).carry(body.block.rest, moved), expected)


def test_rest_may_lie_in_memory_in_any_order():
    body = assembled(ball(), count=20).bodies[0]
    moved = np.random.default_rng(0).normal(size=(80, 3))
    expected = body.carrier.carry(body.block.rest, moved)
    assert np.array_equal(body.carrier.carry(np.asfortranarray(body.block.rest), moved), expected)


@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
def test_known_cores_are_taken_where_they_are_of_these_gaussians(transfer):
    block, reduction, made = sampled(transfer)
    mirrored = with_points(made.carrier, lambda points: 2 * points.mean(axis=1, keepdims=True) - points)
    found = sample_cores(block, reduction, 0.01, 0.1, mirrored)
    assert found.carrier.levels == mirrored.levels
    assert np.array_equal(found.positions, mirrored.levels[0].cores.points.reshape(-1, 3))
    assert np.array_equal(found.volumes, made.volumes)
    assert found.notes == made.notes


@pytest.mark.parametrize(
    "change",
    [
        lambda levels: with_points(levels, lambda points: points + (0.0, 0.0, 1e-6)),
        lambda levels: with_points(levels, lambda points: points * (1.0, 1.0, 1.000001)),
        lambda levels: with_labels(levels, lambda labels: np.roll(labels, 1)),
        lambda levels: with_labels(levels, lambda labels: labels[:-1]),
        lambda levels: with_labels(levels, lambda labels: np.where(labels == 3, 4, labels)),
        lambda levels: Levels(levels=levels.levels[1:]),
        lambda levels: Levels(levels=levels.levels[::-1]),
        lambda levels: sampled("frame")[2].carrier,
        lambda levels: sampled("least-squares", count=12)[2].carrier,
    ],
)
def test_known_cores_that_are_of_other_gaussians_or_another_reduction_are_made_anew(change):
    block, reduction, made = sampled("least-squares")
    found = sample_cores(block, reduction, 0.01, 0.1, change(made.carrier))
    assert np.array_equal(found.positions, made.positions)
    assert np.array_equal(found.volumes, made.volumes)
    for own, expected in zip(found.carrier.levels, made.carrier.levels, strict=True):
        assert np.array_equal(own.transfer.labels, expected.transfer.labels)


def sampled(transfer, count=10):
    reduction = Reduction(mode="cores", count=count, levels=2, transfer=transfer)
    block = block_of(ball(200), 4)
    return block, reduction, sample_cores(block, reduction, 0.01, 0.1)


def with_points(levels, change):
    first, *others = levels.levels
    changed = Level(cores=Cores(points=change(first.cores.points)), transfer=first.transfer)
    return Levels(levels=(changed, *others))


def with_labels(levels, change):
    first, *others = levels.levels
    transfer = dataclasses.replace(first.transfer, labels=change(first.transfer.labels))
    return Levels(levels=(Level(cores=first.cores, transfer=transfer), *others))
