"""What has flowed, in a moving splat: grains as films of the run show them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from gasp_core import MovingSplat, Reduction, pack
from gasp_core.contract import Fluid, Sand
from gasp_core.errors import RecordingError
from gasp_core.moving.grains import PackedGrains
from gasp_core.moving.packing import _order
from gasp_core.recording.drawn import DrawnFrames

WATER = Fluid(density=1000, bulk_modulus=1e5)
SAND = Sand(density=1600, youngs_modulus=1e5, poissons_ratio=0.3, friction_angle=30)


@pytest.fixture(scope="module", params=[pytest.param(SAND, marks=pytest.mark.thorough), WATER], ids=["sand", "water"])
def sand(request, flowing, tmp_path_factory):
    """A ball that flies apart as it spins, its pack, and the frames as films have them."""
    recording = flowing(request.param)
    path = tmp_path_factory.mktemp("packed") / "a.sog"
    pack(recording, path)
    return recording, MovingSplat.open(path), DrawnFrames(recording)


def test_grains_are_those_of_the_run(sand):
    recording, splat, drawn = sand
    last = recording.frame_count - 1
    found, wanted = splat.drawn(last), drawn.splats(last)
    count = len(recording.reference)
    assert len(found) == len(wanted) > count
    spacing = splat.header.bodies[0].spacing
    # Where a grain is: the error of its point, half a step of its place about it, and of its width.
    off = np.linalg.norm(found.means[count:] - wanted.means[count:], axis=1)
    assert off.max() < 1e-3 + spacing * (2 * np.sqrt(3) / 2 / 32 + 3 / 63)
    # Half a step of rounding, and a step that is let stay; the same of how far it has flowed, which is rounded up, and
    # half a step of colours on the screen.
    assert np.abs(found.scales[count:] / wanted.scales[count:] - 1).max() <= 1.5 / 63 + 1e-6
    assert np.abs(found.opacities[count:] - wanted.opacities[count:]).max() <= 2 / 63 + 0.5 / 255
    assert np.abs(found.harmonics[count:] - wanted.harmonics[count:]).max() * 0.2821 <= 0.5 / 255 + 1e-6


def test_grains_know_whose_colours_they_have(sand):
    recording, splat, drawn = sand
    last, count = recording.frame_count - 1, len(recording.reference)
    found = splat.at(last)
    assert len(found.sources) == len(found.splats) <= count + splat.most_grains
    assert splat.most_grains == drawn.most_grains
    np.testing.assert_array_equal(found.sources[:count], np.arange(count))
    # A run goes to a point's Gaussian by way of matter, a pack straight: to the nearest.
    ((body, grains),) = drawn.grains
    chosen = grains.flow(recording.points(last)[body.points]).chosen
    points = recording.start_points[body.points][chosen]
    nearest = KDTree(splat.reference.means).query(points)[0]
    off = splat.reference.means[found.sources[count :: grains.offsets.shape[1]]] - points
    # Places of a .sog are of 16 bits.
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), nearest, atol=1e-4)


def test_gaussians_go_as_grains_come(sand):
    recording, splat, drawn = sand
    count = len(splat.reference)
    for frame in range(recording.frame_count):
        found, wanted = splat.drawn(frame), drawn.splats(frame)
        kept = np.sort(found.opacities[:count])
        assert np.abs(kept - np.sort(wanted.opacities[:count])).max() <= 2 / 63 + 1 / 255
    assert np.isclose(splat.drawn(0).opacities, splat.splats(0).opacities).all()
    assert (splat.drawn(recording.frame_count - 1).opacities[:count] < 0.01).any()


def test_what_is_seen_is_where_it_was_recorded(sand):
    """Gaussians that have gone are carried by points that nobody minds; those that anything is left of are not."""
    recording, splat, _ = sand
    order, _ = _order(recording)
    count, gone = len(order), 0
    diagonal = np.linalg.norm(np.ptp(recording.reference.means, axis=0))
    for frame in range(recording.frame_count):
        found = splat.drawn(frame)
        off = np.linalg.norm(found.means[:count] - recording.gaussians(frame).means[order], axis=1)
        seen = found.opacities[:count] > 0
        gone += (~seen).sum()
        # Means of a frame of the run are in float32.
        assert off[seen].max(initial=0.0) <= 1e-4 * diagonal * (1 + 1e-3)
    assert gone


def test_what_keeps_its_shape_has_none(recorded, tmp_path):
    pack(recorded(Reduction(mode="volume")), tmp_path / "a.sog")
    splat = MovingSplat.open(tmp_path / "a.sog")
    assert splat.header.bodies[0].grains == 0
    assert len(splat.drawn(len(splat) - 1)) == len(splat.reference)


@pytest.mark.parametrize(("column", "value"), [(0, 64), (0, -1), (1, 65), (1, -1)])
def test_numbers_of_nothing_are_refused(column, value):
    grains = PackedGrains(
        offsets=np.zeros((3, 1, 3)), colours=np.ones((3, 3)), opacities=np.ones(3), scale=0.1, labels=np.array([[0]])
    )
    numbers = np.zeros((3, 2), dtype=np.int64)
    numbers[1, column] = value
    with pytest.raises(ValueError, match="damaged"):
        grains.at(numbers, np.zeros((3, 3)))


@pytest.mark.parametrize("name", ["grains", "grain_colours"])
@pytest.mark.parametrize("damage", ["lost", "cut off", "longer"])
def test_damage_is_one_clear_line(sand, tmp_path, altered_zip, name, damage):
    change = {"lost": None, "cut off": lambda data: data[: len(data) // 2], "longer": lambda data: data + b"x"}[damage]
    with pytest.raises(RecordingError, match=r"b\.sog: what carries 'thing' is damaged") as caught:
        MovingSplat.open(altered_zip(sand[1].path, tmp_path / "b.sog", f"motion/0/{name}", change))
    assert "\n" not in str(caught.value)
