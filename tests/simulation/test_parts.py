"""Bodies with parts, through engines: springs in series, pots that stand still, labels that change under a run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from installed_engines import ready

from gasp_core import (
    BoxShape,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Gaussians,
    Part,
    Recording,
    Reduction,
    Scene,
    SplatObject,
    VaryingMaterial,
    Wind,
    read_splat,
    simulate,
)
from gasp_core.discovery.registry import discover
from gasp_core.errors import RecordingError, UnsupportedSceneError
from gasp_core.scene.loading import read_scene
from gasp_core.scene.selection import place_object

UPPER, LOWER = 1e6, 2.5e5
"""Young's moduli [Pa] of the halves of the bar."""
DENSITY, GRAVITY = 1000.0, 9.81
CELL = 0.05
GRIP = 0.2
"""Of the bar, that is held above its free metre."""


def bar():
    """Gaussians in a bar of 0.2 x 0.2 x 1.2 m, eight to a cell, standing on z = 0."""
    pitch = CELL / 2
    means = (np.indices((8, 8, 48)).reshape(3, -1).T + 0.5) * pitch - [0.1, 0.1, 0.0]
    count = len(means)
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), pitch / 4),
        opacities=np.full(count, 0.9),
        harmonics=np.zeros((count, 1, 3), dtype=np.float32),
    )


def hanging(engine, *parts, material):
    item = SplatObject(name="bar", splat=bar(), material=material, parts=parts, reduction=Reduction(mode="all"))
    return Scene(
        duration=0.5,
        frame_rate=10,
        objects=(item,),
        # Air that stands still: what would swing for good comes to rest.
        force_fields=(Wind(drag=70.0),),
        engine=EngineChoice(name=engine),
        accuracy=EngineAccuracy(spacing=CELL),
    )


def soft(stiffness, **others):
    return Elastic(**({"density": DENSITY, "youngs_modulus": stiffness, "poissons_ratio": 0.0} | others))


HEIGHTS = bar().means[:, 2]
LABELS = np.where(HEIGHTS > 1.0, 2, np.where(HEIGHTS > 0.5, 1, 0))
GRIPPED = BoxShape(center=(0, 0, 1.25), half_extents=(1, 1, 0.25))


def sagged(run):
    """Heights of the bar's layers of Gaussians, and by how much each hangs lower at the end."""
    layers = np.unique(HEIGHTS)
    fall = run.gaussians(0).means[:, 2] - run.gaussians(run.frame_count - 1).means[:, 2]
    return layers, np.array([fall[height == HEIGHTS].mean() for height in layers])


def springs(heights):
    """By how much a bar of two halves that hangs at z = 1 is longer above a height: integral of rho g z / E."""
    weight = DENSITY * GRAVITY / 2
    upper = weight * (1 - np.clip(heights, 0.5, 1.0) ** 2) / UPPER
    return upper + weight * (0.25 - np.clip(heights, 0.0, 0.5) ** 2) / LOWER


@pytest.fixture(scope="module")
def hung():
    """Runs the bar with an engine, held by labels or, for those that want a simple shape, by a region."""
    runs = {}

    def run(engine):
        ready(engine)
        if engine not in runs:
            shapes = {shape.kind for shape in discover().engines[engine].capabilities.region_shapes}
            by_labels = {"labels": LABELS, "label": 2} if "signed distance field" in shapes else {"region": GRIPPED}
            parts = (
                Part(name="upper", labels=LABELS, label=1, material=soft(UPPER)),
                Part(name="grip", **by_labels, material=soft(UPPER), pinned=True),
            )
            runs[engine] = simulate(hanging(engine, *parts, material=soft(LOWER)), progress=False)
        return runs[engine]

    return run


ENGINES = [
    "warp-mpm",
    *(pytest.param(name, marks=pytest.mark.thorough) for name in ("mujoco-flex", "taichi-mpm")),
    pytest.param("reference-mpm", marks=pytest.mark.slow),
]


@pytest.mark.parametrize("engine", ENGINES)
def test_two_halves_are_springs_in_series_and_do_not_part_at_the_seam(hung, engine):
    heights, found = sagged(hung(engine))
    # With nu = 0 the law is linear in the stretch, and springs are exact. Where strain jumps, at the grip and at the
    # seam, a grid knows it to half a cell.
    largest = DENSITY * GRAVITY * 0.5 / LOWER
    assert np.abs(found - springs(heights)).max() <= CELL / 2 * largest
    assert found[0] == pytest.approx(springs(heights)[0], rel=0.03)
    # The seam is between layers 19 and 20: it is strained by no less than what is above it, and like all else by no
    # more than the softer half is just below it.
    strains = -np.diff(found) / np.diff(heights)
    assert strains[24] < strains[19]
    assert strains.max() <= largest


def test_fields_with_the_numbers_of_parts_are_the_same_bar(hung):
    parted = hung("warp-mpm")
    column = np.where(LABELS == 0, LOWER, UPPER)
    material = VaryingMaterial.of(Elastic, density=DENSITY, youngs_modulus=column, poissons_ratio=0.0)
    run = simulate(hanging("warp-mpm", Part(labels=LABELS, label=2, pinned=True), material=material), progress=False)
    last = run.frame_count - 1
    assert any("youngs_modulus 2.5e+05 to 1e+06, as 2 materials, exactly" in note for note in run.notes)
    np.testing.assert_array_equal(run.points(last), parted.points(last))


def test_an_engine_that_knows_no_such_region_is_refused_with_the_name_of_the_part():
    # Refused by what it declares, whether or not its environment is there.
    scene = hanging("genesis-mpm", Part(name="grip", labels=LABELS, label=2, pinned=True), material=soft(LOWER))
    message = r'no signed distance field as a region \(object "bar", part "grip"\).*; engines that do: .*warp-mpm'
    with pytest.raises(UnsupportedSceneError, match=message):
        simulate(scene, progress=False)


def test_an_engine_without_rigid_matter_says_so_of_an_object_that_is_rigid_in_all_its_parts(tmp_path, run):
    parts = (Part(labels=LABELS, label=(0, 1, 2), rigid=True),)
    with pytest.raises(UnsupportedSceneError, match=r'ballistic does not model rigid \(object "bar"\)'):
        run(hanging("ballistic", *parts, material=soft(LOWER)), tmp_path / "a.gasp")


def test_labels_that_have_changed_since_a_run_began_end_its_going_on(tmp_path, run):
    np.save(tmp_path / "labels.npy", LABELS)
    parts = (Part(name="grip", labels=tmp_path / "labels.npy", label=2, material=soft(UPPER)),)
    scene = hanging("ballistic", *parts, material=soft(LOWER))
    out = tmp_path / "a.gasp"
    run(scene, out, frames=3)
    (note,) = [note for note in Recording.open(out).notes if "grip" in note]
    assert note.startswith('object "bar": part "grip", elastic: 512 Gaussians, 2,048 points, ')
    run(scene, out, frames=4, resume=True)
    np.save(tmp_path / "labels.npy", np.roll(LABELS, 1))
    with pytest.raises(RecordingError, match="the scene, or a file that it names, has changed"):
        run(scene, out, resume=True)
    np.save(tmp_path / "labels.npy", LABELS)
    assert run(scene, out, resume=True).status == "complete"
    # The folder may be moved as a whole, and the scene in the recording finds its labels there.
    tmp_path.rename(tmp_path.with_name("elsewhere"))
    kept = Recording.open(tmp_path.with_name("elsewhere") / "a.gasp").scene.objects[0].parts[0]
    assert kept == dataclasses.replace(parts[0], labels=tmp_path.with_name("elsewhere") / "labels.npy")
    tmp_path.with_name("elsewhere").rename(tmp_path)


PLANT = """
[scene]
duration = 0.4
frame_rate = 25
gravity = [0, 0, 0]
[[object]]
name = "plant"
splat = "{splat}"
height = 0.4
position = [0, 0, 0]
material = {{ model = "elastic", density = 300, youngs_modulus = 1e5, poissons_ratio = 0.3 }}
[[object.part]]
name = "pot"
{selector}
pinned = true
[[wind]]
velocity = [3, 0, 0]
drag = 2
"""


@pytest.mark.parametrize("by", ["region", "labels"])
@pytest.mark.thorough
def test_a_soft_plant_in_a_pot_that_stands_still(data, tmp_path, by):
    ready("warp-mpm")
    selectors = {
        "region": 'region = { shape = "box", center = [0, 0, 0.05], half_extents = [0.2, 0.2, 0.085] }',
        "labels": 'labels = "labels.npy"\nlabel = 1',
    }
    text = PLANT.format(splat=(data / "splats" / "plant.splat").absolute(), selector=selectors["region"])
    (item,) = read_scene(text, file="plant", folder=tmp_path).objects
    pot = place_object(item, read_splat(item.splat)).part_numbers == 0
    np.save(tmp_path / "labels.npy", pot.astype(np.uint8))
    text = PLANT.format(splat=(data / "splats" / "plant.splat").absolute(), selector=selectors[by])
    run = simulate(read_scene(text, file="plant", folder=tmp_path), progress=False)
    first, last = run.gaussians(0), run.gaussians(run.frame_count - 1)
    moved = np.linalg.norm(last.means - first.means, axis=1)
    high = first.means[:, 2] > 0.3
    # Wind of 3 m/s that takes hold at 2 1/s: free matter would go 2 * 3 * 0.4^2 / 2 = 0.48 m.
    assert 0.05 < np.median(moved[high]) < 0.48
    # Gaussians of the pot that lie at the seam follow points on both sides of it: a cell is 12.5 mm.
    assert np.median(moved[pot]) < 1e-6
    assert np.quantile(moved[pot], 0.99) < 1e-3
    # The bound on stretches, alpha, was never needed, at the seam or anywhere.
    assert [each["clipped"] for each in run.diagnostics()] == [0] * run.frame_count
