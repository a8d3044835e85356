"""Which Gaussians a part has, what varies of them, and what is said where that cannot be."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gasp_core import (
    BoxShape,
    Elastic,
    Floaters,
    HalfSpace,
    Part,
    PlyProperty,
    Scene,
    SphereShape,
    SplatObject,
    VaryingMaterial,
    material_preset,
    scene_to_toml,
    write_splat,
)
from gasp_core.dynamics.placed_scene import read_source
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.floaters import components, floating
from gasp_core.scene.loading import read_scene, read_stored_scene
from gasp_core.scene.objects import laws_of
from gasp_core.scene.selection import drawn_rows, place_object

SOFT = Elastic(density=300, youngs_modulus=1e5, poissons_ratio=0.3)
STIFF = Elastic(density=900, youngs_modulus=1e7, poissons_ratio=0.2)
PINNED = {"pinned": True}


def blobs(*counts, apart=4.0):
    """Balls of Gaussians along x, `apart` of their size from each other."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(sum(counts), 3))
    means = directions / np.linalg.norm(directions, axis=1, keepdims=True) * rng.uniform(0, 0.5, (sum(counts), 1))
    means[:, 0] += np.repeat(np.arange(len(counts)) * apart, counts)
    return Gaussians(
        means=means,
        quaternions=rng.normal(size=means.shape[:1] + (4,)),
        scales=np.full(means.shape, 0.02),
        opacities=np.full(len(means), 0.9),
        harmonics=np.zeros((len(means), 1, 3), dtype=np.float32),
    )


def placed(splat, *parts, material=SOFT, **others):
    item = SplatObject(name="thing", splat=splat, material=material, parts=parts, **others)
    return place_object(item, splat)


def test_components_are_numbered_by_how_many_gaussians_they_have():
    splat = blobs(300, 500, 200)
    numbers = components(splat.means)
    assert [np.unique(each).tolist() for each in np.split(numbers, [300, 800])] == [[2], [1], [3]]
    assert not floating(splat.means).any()
    # What has no size is one.
    assert set(components(np.zeros((40, 3)))) == {1}
    assert len(components(np.zeros((0, 3)))) == 0


def test_what_floats_is_in_the_smallest_components():
    splat = blobs(3000, 5)
    numbers = components(splat.means)
    assert set(numbers[~floating(splat.means)]) == {1}
    assert numbers[floating(splat.means)].min() == 2


def test_each_way_of_saying_what_a_part_is_of_finds_the_same():
    splat = blobs(300, 500)
    labels = np.repeat([7, 4], [300, 500])
    ways = (
        Part(component=2, **PINNED),
        Part(labels=labels, label=7, **PINNED),
        Part(labels=labels.astype(np.float32), label=(7, 7), **PINNED),
        Part(region=SphereShape(center=(0, 0, 0), radius=1), **PINNED),
        Part(region=HalfSpace(point=(2, 0, 0), normal=(1, 0, 0)), material=STIFF),
    )
    for part in ways:
        assert placed(splat, part).part_numbers.tolist() == [0] * 300 + [-1] * 500


def test_labels_are_those_of_the_file_whatever_is_left_out():
    splat = blobs(300, 300)
    opacities = np.where(np.arange(600) % 3 == 0, 0.01, 0.9)
    splat = splat.with_(opacities=opacities)
    labels = np.arange(600) // 300
    found = placed(splat, Part(labels=labels, label=1, **PINNED), min_opacity=0.1)
    assert found.part_numbers.tolist() == (labels[opacities > 0.1] - 1).tolist()
    with_specks = blobs(3000, 5)
    labels = np.zeros(3005, dtype=int)
    labels[[0, 3004]] = 1
    found = placed(with_specks, Part(labels=labels, label=1, **PINNED), floaters=Floaters.DROP)
    assert np.flatnonzero(found.part_numbers == 0).tolist() == [0]


def test_components_are_numbered_among_what_is_drawn_and_say_where_they_are():
    splat = blobs(500, 300, 400)
    # Most of the largest is faint.
    faint = (np.arange(1200) < 450) | (np.arange(1200) == 1199)
    splat = splat.with_(opacities=np.where(faint, 0.05, 0.9))
    for least, found, place in ((0.0, 500, 0.0), (0.1, 399, 8.0)):
        pot = placed(splat, Part(name="pot", component=1, **PINNED), min_opacity=least, position=None)
        assert len(drawn_rows(splat, least)) == (1200 if least == 0 else 749)
        (told,) = pot.told_components()
        assert told.startswith(f'object "thing": part "pot" is component 1, of {found} Gaussians around (')
        middle = [float(value) for value in told.partition("around (")[2].rstrip(") m").split(", ")]
        assert middle == pytest.approx([place, 0, 0], abs=0.1)
    labels = np.repeat([0, 1], [300, 900])
    assert not placed(splat, Part(labels=labels, label=1, **PINNED)).told_components()


def test_a_region_is_in_the_world():
    splat = blobs(300, 300)
    box = BoxShape(center=(10, 0, 0.5), half_extents=(0.6, 0.6, 0.6))
    found = placed(splat, Part(region=box, **PINNED), position=(12, 0, 0))
    assert found.part_numbers.tolist() == [0] * 300 + [-1] * 300


SPLAT = blobs(300, 500)
HALVES = np.repeat([0, 1], [300, 500])


def changed(column, row, value):
    column = np.array(column)
    column[row] = value
    return column


def elastic(**numbers):
    given = {"density": 1, "youngs_modulus": 1, "poissons_ratio": 0.1}
    return VaryingMaterial.of(Elastic, **(given | numbers))


WRONG = {
    "labels of another length": (
        [Part(labels=HALVES[1:], label=1, **PINNED)],
        "part 1: labels: the given array has 799 numbers, and the splat 800 Gaussians",
    ),
    "half a label": (
        [Part(name="pot", labels=changed(HALVES.astype(float), [3, 9], 0.5), label=1, **PINNED)],
        'part "pot": labels must be whole numbers, the given array has 0.5 of Gaussian 3, and 1 more',
    ),
    "a label that is no number": (
        [Part(labels=changed(HALVES.astype(float), 3, np.nan), label=1, **PINNED)],
        "labels must be whole numbers, the given array has nan of Gaussian 3",
    ),
    "no such label": (
        [Part(labels=HALVES, label=(1, 2), **PINNED)],
        r"the given array has no label 2: its labels are 1 \(500 Gaussians\), 0 \(300 Gaussians\)$",
    ),
    "no such component": (
        [Part(component=3, **PINNED)],
        r"there is no component 3: they are 1 \(500 Gaussians\), 2 \(300 Gaussians\)$",
    ),
    "an empty region": (
        [Part(region=SphereShape(center=(0, 9, 0), radius=1), **PINNED)],
        "part 1: no Gaussian is inside its region: move it",
    ),
    "parts that overlap": (
        [Part(name="a", component=1, **PINNED), Part(region=SphereShape(center=(4, 0, 0), radius=0.3), material=STIFF)],
        r'part "a" and part 2 share \d+ Gaussians: each may be of one part only',
    ),
    "a property of what is no file": (
        [Part(labels=PlyProperty(property="label"), label=1, **PINNED)],
        'Gaussians in memory have no property "label": give an array',
    ),
    "no such file": (
        [Part(labels="/gone/labels.npy", label=1, **PINNED)],
        r"labels: .*labels\.npy: cannot be read",
    ),
    "a negative stiffness": (
        [Part(component=1, material=elastic(youngs_modulus=changed(np.ones(800), [350, 360], -3)))],
        "part 1: youngs_modulus must be > 0, is -3 of Gaussian 350 of the file, and 1 more",
    ),
    "no number": (
        [Part(component=1, material=elastic(density=changed(np.ones(800), 799, np.nan)))],
        "density must be > 0, is nan of Gaussian 799 of the file$",
    ),
    "infinitely stiff": (
        [Part(component=1, material=elastic(youngs_modulus=changed(np.ones(800), 799, np.inf)))],
        "youngs_modulus must be > 0, is inf of Gaussian 799",
    ),
    "incompressible": (
        [Part(component=1, material=elastic(poissons_ratio=changed(np.zeros(800), 799, 0.5)))],
        "poissons_ratio must be > -1 and < 0.5, is 0.5 of Gaussian 799",
    ),
    "a field of another length": (
        [Part(component=1, material=elastic(density=np.ones(3)))],
        "part 1: density: the given array has 3 numbers, and the splat 800 Gaussians",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_in_one_line_with_object_and_part(case):
    parts, message = WRONG[case]
    with pytest.raises(SceneError, match=message) as caught:
        placed(SPLAT, *parts)
    assert str(caught.value).startswith('object "thing", part' if "overlap" not in case else 'object "thing": part')
    assert "\n" not in str(caught.value)


def test_numbers_of_gaussians_that_they_do_not_matter_for_may_be_anything():
    field = np.where(HALVES == 0, np.nan, 2e5)
    material = VaryingMaterial.of(Elastic, density=300, youngs_modulus=field, poissons_ratio=0.3)
    assert placed(SPLAT, Part(component=1, material=material)).fields[1]["youngs_modulus"][-1] == 2e5


def test_a_part_of_what_is_not_simulated_is_refused():
    with pytest.raises(SceneError, match="none of its 300 Gaussians is simulated"):
        placed(SPLAT, Part(component=2, **PINNED), region=SphereShape(center=(4, 0, 0), radius=1))


@pytest.mark.parametrize("columns", [{"hardness": "a.npy"}, {"youngs_modulus": "a.npy", "friction_angle": "a.npy"}, {}])
def test_only_what_the_material_has_may_vary(columns):
    with pytest.raises(SceneError, match=r"VaryingMaterial\.columns"):
        VaryingMaterial(base=SOFT, columns=columns)


@pytest.fixture
def on_disk(tmp_path):
    write_splat(tmp_path / "a.ply", SPLAT)
    np.save(tmp_path / "labels.npy", HALVES)
    np.save(tmp_path / "E.npy", np.full(800, 2e5))
    material = VaryingMaterial(base=SOFT, columns={"youngs_modulus": tmp_path / "E.npy"})
    part = Part(labels=tmp_path / "labels.npy", label=1, **PINNED)
    return SplatObject(name="thing", splat=tmp_path / "a.ply", material=material, parts=(part,))


def test_the_source_of_an_object_is_its_columns_too(on_disk, tmp_path):
    before = read_source(on_disk)[1]
    assert before == read_source(on_disk)[1] != read_source(dataclasses.replace(on_disk, parts=()))[1]
    np.save(tmp_path / "labels.npy", 1 - HALVES)
    after = read_source(on_disk)[1]
    assert after != before
    np.save(tmp_path / "E.npy", np.full(800, 3e5))
    assert read_source(on_disk)[1] not in (before, after)


def test_a_scene_is_the_same_wherever_its_columns_lie(on_disk, tmp_path):
    scene = Scene(duration=1, frame_rate=10, objects=(on_disk,))
    text = scene_to_toml(scene, tmp_path)
    assert 'labels = "labels.npy"' in text
    assert 'youngs_modulus = "E.npy"' in text
    moved, forgotten = read_stored_scene(text, file="kept", beside=tmp_path / "elsewhere")
    assert not forgotten
    assert moved.objects[0].parts[0].labels == tmp_path / "elsewhere" / "labels.npy"
    assert scene_digest(moved, ["00"]) == scene_digest(scene, ["00"])
    other = dataclasses.replace(on_disk.parts[0], label=0)
    relabelled = dataclasses.replace(scene, objects=(dataclasses.replace(on_disk, parts=(other,)),))
    assert scene_digest(relabelled, ["00"]) != scene_digest(scene, ["00"])


def test_columns_in_memory_are_kept_as_a_mark(on_disk):
    item = dataclasses.replace(on_disk, parts=(Part(labels=HALVES, label=1, **PINNED),))
    scene = Scene(duration=1, frame_rate=10, objects=(item,))
    text = scene_to_toml(scene)
    assert 'labels = "memory:' in text
    kept, _ = read_stored_scene(text, file="kept")
    assert scene_digest(kept, ["00"]) == scene_digest(scene, ["00"])


def test_materials_of_parts_are_said_as_those_of_objects():
    text = """
    [scene]
    duration = 1
    frame_rate = 10
    [[object]]
    name = "a"
    splat = "a.ply"
    material = "rubber"
    [[object.part]]
    component = 1
    material = { preset = "rubber", youngs_modulus = "E.npy" }
    [[object.part]]
    component = 2
    material = "steel"
    """
    scene = read_scene(text, file="a.toml", folder=None)
    (item,) = scene.objects
    varying, steel = (part.material for part in item.parts)
    assert steel == material_preset("steel")
    assert varying == VaryingMaterial(base=material_preset("rubber"), columns={"youngs_modulus": "E.npy"})
    assert varying.base.density == item.material.density
    assert [law.name for law in laws_of(item)] == ["rubber", "rubber", "steel"]
    again = read_scene(scene_to_toml(scene), file="again", folder=None)
    assert scene_digest(again, ["00"]) == scene_digest(scene, ["00"])
    assert again.objects[0].parts[0].material.base.name == "rubber"


def test_a_number_is_a_number_whoever_made_it():
    varying = VaryingMaterial.of(
        Elastic, density=np.float32(400), youngs_modulus=np.full(3, 1e5), poissons_ratio=np.int64(0)
    )
    assert set(varying.columns) == {"youngs_modulus"} and varying.base.density == 400
