"""What is possible and probably not meant is told, by name."""

from __future__ import annotations

import pytest

from gasp_core import BoxShape, Elastic, Pinned, SphereShape, Wind


def notes(run, scene, tmp_path):
    return run(scene, tmp_path / "a.gasp", frames=1).notes


def jelly(density):
    return Elastic(density=density, youngs_modulus=1e5, poissons_ratio=0.3)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"material": jelly(1.6)}, 'object "thing": its density of 1.6 kg/m^3 is less than any solid'),
        ({"material": jelly(4e5)}, 'object "thing": its density of 400000 kg/m^3 is more than any metal'),
        ({"height": 300.0}, "lengths are in metres"),
        ({"height": 1e-4}, "lengths are in metres"),
        ({"metres_per_unit": 1000.0}, "lengths are in metres"),
        ({"drives": (Pinned(region=SphereShape(center=(0, 0, 9), radius=1)),)}, "drive 1 (pinned): its region holds"),
        ({"force_fields": (Wind(region=BoxShape(center=(9, 0, 0), half_extents=(1, 1, 1))),)}, "wind 1: its region"),
    ],
)
def test_it_is_told_by_name(run, scene_of, tmp_path, options, says):
    assert any(says in note for note in notes(run, scene_of(**options), tmp_path))


@pytest.mark.parametrize(
    "options",
    [
        {"material": jelly(400), "height": 0.4},
        {"drives": (Pinned(region=SphereShape(center=(0, 0, 0), radius=0.3)),)},
        # Matter may come to it until then.
        {"drives": (Pinned(region=SphereShape(center=(0, 0, -9), radius=1), start=0.1),)},
        {"force_fields": (Wind(velocity=(1, 0, 0)),)},
    ],
)
def test_what_is_usual_is_not(run, scene_of, tmp_path, options):
    found = notes(run, scene_of(**options), tmp_path)
    assert not any("region holds" in note or "density" in note or "in metres" in note for note in found)


def test_how_far_the_nearest_matter_is_helps_to_put_it_right(run, scene_of, tmp_path, cloud):
    splat = cloud()
    height = float(splat.means[:, 2].max())
    pin = Pinned(region=BoxShape(center=(0, 0, height + 3), half_extents=(9, 9, 1)))
    (note,) = [note for note in notes(run, scene_of(splat, drives=(pin,)), tmp_path) if "region holds" in note]
    off = float(note.split("matter is ")[1].split(" m off")[0])
    # Corners of Gaussians lie up to a scale beside their middle.
    assert 1.5 < off <= 2.0
