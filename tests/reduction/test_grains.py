"""What has flowed is drawn as grains: how much of it, where, in which colour."""

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import Elastic, EngineAccuracy, Fluid, Reduction, Sand
from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis
from gasp_core.recording.drawn import DrawnFrames
from gasp_core.reduction.grains import buried, colours_from_outside, grains_of
from gasp_core.reduction.point_frames import PointFrames

WATER = Fluid(density=1000, bulk_modulus=1e5)
SAND = Sand(density=1600, youngs_modulus=1e5, poissons_ratio=0.3)
JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)

CONSTANT = float(basis(np.array([[0.0, 0.0, 1.0]]), 0)[0, 0])


@pytest.fixture(scope="module")
def ball():
    return shell(SHAPES["sphere"], count=2_000)


@pytest.fixture
def recorded(ball, scene_of, run, tmp_path):
    """Runs a ball that flies, of some matter."""

    def go(material=WATER, mode="volume"):
        scene = scene_of(
            ball,
            material=material,
            up="+z",
            height=0.5,
            position=(0, 0, 1),
            reduction=Reduction(mode=mode),
            accuracy=EngineAccuracy(resolution=10),
            duration=0.04,
        )
        return run(scene, tmp_path / "a.gasp")

    return go


@pytest.fixture
def torn(recorded, monkeypatch):
    """The same, one half of it taken away in its last frame, as the engine's points have it."""

    def go(*arguments):
        recording = recorded(*arguments)
        points = recording.points

        def parted(frame):
            found = points(frame)
            return found + np.where(found[:, :1] > 0, [[1.0, 0, 0]], 0.0) if frame == 1 else found

        monkeypatch.setattr(recording, "points", parted)
        return recording

    return go


@pytest.fixture
def body(recorded):
    (body,) = recorded().bodies
    assert isinstance(body.carrier, PointFrames)
    return body


def stretched(carrier, factor):
    return carrier.points * [factor, 1, 1]


def test_what_keeps_its_shape_stays_as_it_was(body):
    grains = grains_of(body.carrier, body.block.local, 8)
    turn = rotation_matrices([[0.9, 0.1, -0.3, 0.2]])[0]
    for points in (body.carrier.points, body.carrier.points @ turn.T + [1, 2, 3], 0.5 * body.carrier.points):
        flowed = grains.at(points)
        assert len(flowed.means) == 0
        assert (flowed.left == 1).all()


def test_more_of_it_flows_the_farther_it_is_stretched(body):
    grains = grains_of(body.carrier, body.block.local, 8)
    seen = [grains.at(stretched(body.carrier, factor)) for factor in (1.2, 1.6, 2.0, 4.0)]
    opaque = [flowed.opacities.sum() for flowed in seen]
    assert 0 == opaque[0] < opaque[1] < opaque[2] < opaque[3]
    left = [flowed.left.sum() for flowed in seen]
    assert left[0] > left[1] > left[2] > left[3] == 0
    assert len(seen[3].means) == 8 * len(body.carrier.points)


def test_an_even_lattice_of_grains_shows_no_pitch(body):
    grains = grains_of(body.carrier, body.block.local, 1)
    assert grains.offsets.shape == (len(body.carrier.points), 1, 3) and not grains.offsets.any()
    width = grains.scale / body.carrier.spacing
    lattice = np.stack(np.meshgrid(*[np.arange(-5, 6)] * 3), axis=-1).reshape(-1, 3)
    places = np.random.default_rng(0).random((200, 3))
    density = np.exp(-((places[:, None] - lattice) ** 2).sum(axis=2) / (2 * width**2)).sum(axis=1)
    assert density.max() / density.min() < 1.01


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_the_colour_is_the_mean_of_what_is_seen_from_outside(cloud, degree):
    gaussians = cloud(20, 3, degree=degree)
    inside = gaussians.means + np.random.default_rng(1).normal(size=(20, 3))
    # Directions spread evenly (Fibonacci): each stands for as much of the sphere.
    number = np.arange(200_000) + 0.5
    z, angle = 1 - 2 * number / len(number), np.pi * (1 + 5**0.5) * number
    directions = np.stack([np.cos(angle) * np.sqrt(1 - z**2), np.sin(angle) * np.sqrt(1 - z**2), z], axis=1)
    shown = basis(directions, degree)
    constant = basis(np.array([[0.0, 0.0, 1.0]]), 0)[0, 0]
    axes = rotation_matrices(gaussians.quaternions)
    for row, found in enumerate(colours_from_outside(gaussians, inside)):
        normal = axes[row][:, gaussians.scales[row].argmin()]
        inwards = normal * np.sign((inside[row] - gaussians.means[row]) @ normal)
        # The eye looks from outside, along the direction.
        mean = (shown[directions @ inwards > 0] @ gaussians.harmonics[row]).mean(axis=0)
        np.testing.assert_allclose(found * constant, mean, atol=2e-4 * np.abs(gaussians.harmonics).max() * (degree + 1))


def test_where_it_is_torn_grains_come_and_elsewhere_nothing_changes(torn):
    recording = torn()
    drawn = DrawnFrames(recording)
    count = len(recording.reference)
    first = drawn.splats(0)
    assert len(first) == count
    np.testing.assert_array_equal(first.opacities, recording.splats(0).opacities)
    last = drawn.splats(1)
    faded = last.opacities[:count] < recording.reference.opacities
    # What follows points within a few of the cut, and no more.
    spacing = recording.bodies[0].carrier.spacing
    middle = np.abs(recording.reference.means[:, 0])
    assert middle[faded].max() < 5 * spacing
    assert faded[middle < spacing / 2].all()
    # On either side of the cut are grains, all over the disc that was inside.
    grains = last.means[count:]
    centre = recording.points(1).mean(axis=0)
    for side in (grains[:, 0] < 0.5, grains[:, 0] > 0.5):
        radii = np.linalg.norm(grains[side][:, 1:] - centre[1:], axis=1)
        assert radii.min() < 2 * spacing and radii.max() > 0.2
    np.testing.assert_array_equal(drawn.gaussians(1).means, last.means)


@pytest.mark.parametrize(("material", "mode"), [(JELLY, "volume"), (WATER, "all")], ids=["elastic", "surface"])
def test_what_does_not_flow_or_is_not_filled_has_no_grains(torn, material, mode):
    recording = torn(material, mode)
    assert len(DrawnFrames(recording).splats(1)) == len(recording.reference)


def test_a_film_thinner_than_its_points_has_no_holes_and_drops_stay_drops(body):
    grains = grains_of(body.carrier, body.block.local, 1)
    count, spacing = len(body.carrier.points), body.carrier.spacing
    side = int(np.ceil(np.sqrt(count)))
    lattice = np.stack([np.arange(count) % side, np.arange(count) // side, np.zeros(count)], axis=1)
    order = np.random.default_rng(0).permutation(count)
    inside = ((lattice > 1) & (lattice < side - 3)).all(axis=1, where=[True, True, False])
    for pitch, wider in ((1.0, 1.0), (1.5, 1.5), (2.0, 2.0), (8.0, 1.0)):
        flowed = grains.at(pitch * spacing * lattice[order])
        assert len(flowed.scales) == count
        np.testing.assert_allclose(flowed.scales[inside[order]], wider * grains.scale)


def test_grains_of_sand_are_finer_than_points_and_scatter_about_them(body):
    far = stretched(body.carrier, 4.0)
    grains = grains_of(body.carrier, body.block.local, 8)
    assert grains.scale == pytest.approx(grains_of(body.carrier, body.block.local, 1).scale / 2)
    flowed = grains.at(far)
    wider = (flowed.scales / grains.scale).reshape(-1, 8, 1)
    spread = (flowed.means.reshape(-1, 8, 3) - far[:, None]) / wider
    assert np.sqrt((spread**2).mean()) == pytest.approx(0.45 * body.carrier.spacing, rel=0.02)


def test_what_is_buried_has_matter_all_around():
    lattice = np.stack(np.meshgrid(*[np.arange(12)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5
    deep = buried(lattice - 5, 2.0)
    assert deep.sum() == 8**3
    # Cells of two points' distances: all but the outermost ones on each side.
    np.testing.assert_array_equal(deep, ((lattice > 2) & (lattice < 10)).all(axis=1))
    # A hole is seen into from all its sides, and one point far off makes no difference.
    holed = lattice[~((lattice > 4) & (lattice < 6)).all(axis=1)]
    shown = np.concatenate([holed, [[1e6, 0, 0]]])
    deep = buried(shown, 2.0)
    beside = (np.abs(shown - 5).max(axis=1) < 3) & (np.sort(np.abs(shown - 5), axis=1)[:, 1] < 1)
    assert beside.sum() == 6 * 8
    assert not deep[beside].any() and not deep[-1] and deep.sum() == 8**3 - 8 - 6 * 8


def test_nothing_is_seen_through_what_hides_the_buried(body):
    grains = grains_of(body.carrier, body.block.local, 1)
    # Along a line through a lattice of grains, in the worst place: between them, over one cell.
    width, spacing = grains.scale / body.carrier.spacing, 1.0
    passed = 1.0
    for _ in range(2):
        places = np.stack(np.meshgrid(np.arange(-4, 5), np.arange(-4, 5)), axis=-1).reshape(-1, 2) * spacing + 0.5
        alpha = 0.95 * np.exp(-(places**2).sum(axis=1) / (2 * width**2))
        passed *= np.prod(1 - alpha)
    assert passed < 0.02


def test_grains_have_the_colour_that_is_seen_around_them(body):
    """Red Gaussians that hide what is behind, and among them three times as many blue ones that nobody sees."""
    rng = np.random.default_rng(0)
    gaussians = body.block.local
    haze = rng.random(len(gaussians)) < 0.75
    colours = np.where(haze[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    painted = gaussians.with_(
        opacities=np.where(haze, 0.02, 0.9), harmonics=((colours - 0.5) / CONSTANT)[:, None].astype(np.float32)
    )
    grains = grains_of(body.carrier, painted, 1)
    shown = 0.5 + CONSTANT * grains.colours
    # Of 16 around a point a hundredth have no opaque one.
    assert (shown[:, 0] > 0.9).mean() > 0.95
    assert 0.2 < grains.opacities.mean() < 0.8
    hazy = grains_of(body.carrier, painted.with_(opacities=np.full(len(gaussians), 0.02)), 1)
    np.testing.assert_allclose(hazy.opacities, 0.95 * 0.02 / 0.5, rtol=1e-5)
    solid = grains_of(body.carrier, painted.with_(opacities=np.full(len(gaussians), 0.9)), 1)
    np.testing.assert_allclose(solid.opacities, 0.95, rtol=1e-5)


def test_no_colour_is_beyond_what_a_screen_shows(body):
    """Trained Gaussians cancel each other by colours that no screen has; each by itself is shown as it can be."""
    gaussians = body.block.local
    wild = np.where(np.arange(len(gaussians))[:, None] % 2, [3.0, -2.0, 0.5], [-2.0, 3.0, 0.5])
    painted = gaussians.with_(harmonics=((wild - 0.5) / CONSTANT)[:, None].astype(np.float32))
    shown = 0.5 + CONSTANT * grains_of(body.carrier, painted, 1).colours
    assert (shown > -1e-6).all() and (shown < 1 + 1e-6).all()
