"""What is possible and probably not meant is told, by name."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core import BoxShape, Elastic, Gaussians, Pinned, SphereShape, Wind, write_splat


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
        ({"height": 30.0}, "it is 3"),
        ({"material": Elastic(density=400, youngs_modulus=200, poissons_ratio=0.3)}, "sinks into a heap under its own"),
        ({"gravity": (0, 0, 9.81)}, "gravity = [0, 0, 9.81] pulls up: in a scene down is -z"),
        ({"gravity": (0, -9.81, 0)}, "gravity = [0, -9.81, 0] pulls sideways"),
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
        {"gravity": (1, 1, -9)},
        {"gravity": (0, 0, 0), "material": Elastic(density=400, youngs_modulus=200, poissons_ratio=0.3)},
    ],
)
def test_what_is_usual_is_not(run, scene_of, tmp_path, options):
    found = notes(run, scene_of(**options), tmp_path)
    told = ("region holds", "density", "in metres", "gravity", "under its own weight", "narrow end")
    assert not any(what in note for note in found for what in told)


def test_how_far_the_nearest_matter_is_helps_to_put_it_right(run, scene_of, tmp_path, cloud):
    splat = cloud()
    height = float(splat.means[:, 2].max())
    pin = Pinned(region=BoxShape(center=(0, 0, height + 3), half_extents=(9, 9, 1)))
    (note,) = [note for note in notes(run, scene_of(splat, drives=(pin,)), tmp_path) if "region holds" in note]
    off = float(note.split("matter is ")[1].split(" m off")[0])
    # Corners of Gaussians lie up to a scale beside their middle.
    assert 1.5 < off <= 2.0


@pytest.mark.parametrize(("up", "told"), [("+z", False), ("-y", True), ("+y", True)])
def test_what_stands_on_its_narrow_end_is_told(run, scene_of, tmp_path, up, told):
    cone = 'up = "+z"'
    splat = tmp_path / "cone.ply"
    write_splat(splat, standing_cone())
    found = notes(run, scene_of(splat, up=up), tmp_path)
    assert any("stands it on a narrow end" in note and cone in note for note in found) == told


def standing_cone():
    rng = np.random.default_rng(0)
    heights = 1 - np.cbrt(rng.random(3000))
    angle, radius = 2 * np.pi * rng.random(3000), (1 - heights) * np.sqrt(rng.random(3000)) / 2
    return Gaussians(
        means=np.stack([radius * np.cos(angle), radius * np.sin(angle), heights], axis=1).astype(np.float32),
        quaternions=np.tile([1.0, 0, 0, 0], (3000, 1)),
        scales=np.full((3000, 3), 0.01),
        opacities=np.ones(3000),
        harmonics=np.zeros((3000, 1, 3)),
    )
