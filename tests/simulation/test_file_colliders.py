"""Matter that lands on splats and meshes, in every engine that takes them."""

import dataclasses

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import (
    Collider,
    ContactCondition,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Scene,
    SplatObject,
    simulate,
)
from gasp_core.contract import BodyContact, SignedDistanceField
from gasp_core.discovery.registry import discover
from gasp_core.discovery.status import engine_rows
from gasp_core.errors import RecordingError
from gasp_core.scene.file_shapes import MeshShape
from gasp_core.scene.objects import Reduction
from gasp_core.simulation.oddities import oddities
from gasp_core.simulation.splat_sources import prepare

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")

SIZE = 0.3
"""Of what falls [m]; what it falls on is as large."""
CELLS = 8
STIFF = Elastic(density=400, youngs_modulus=2e5, poissons_ratio=0.3)
SLOW = ("reference-mpm", "mujoco-flex")
"""Minutes. That the first agrees with the others among such colliders, their own tests show; that the second's bodies
rest on them, plugins/mujoco_flex/tests/test_known_shapes.py does."""
FURTHER = ("taichi-mpm", "blender")
"""The first is compiled for it alone, and of the same kind as one that is not. The second takes half a minute a run;
its own tests show that what is rigid slides on a field and is held by one."""


def _marks(name):
    if name in SLOW:
        return pytest.mark.slow
    return pytest.mark.thorough if name in FURTHER else ()


ENGINES = [
    pytest.param(row.name, marks=_marks(row.name))
    for row in engine_rows(discover())
    if row.status == "ready"
    and SignedDistanceField in discover().offer(row.name).descriptor.capabilities.collider_shapes
]


def cube(**options):
    return SplatObject(
        splat=shell(SHAPES["cube"], count=4000), metres_per_unit=SIZE / SHAPES["cube"].size, up="+z", **options
    )


def scene_on(colliders=(), shelf=None, engine="warp-mpm", **options):
    falling = cube(name="falling", position=(0, 0, SIZE + 0.01), material=STIFF, reduction=Reduction(mode="volume"))
    return Scene(
        duration=0.4,
        frame_rate=25,
        objects=(falling, *([shelf] if shelf else [])),
        colliders=colliders,
        accuracy=EngineAccuracy(resolution=CELLS),
        engine=EngineChoice(name=engine),
        **options,
    )


def lowest_at_rest(recording):
    """Mean over the last frames of the height of the lowest simplices [m], and how far they slid."""
    last = range(recording.frame_count - 3, recording.frame_count)
    places = np.mean([recording.simplices(frame)["falling"].reshape(-1, 3) for frame in last], axis=0)
    start = recording.simplices(0)["falling"].reshape(-1, 3)
    return np.percentile(places[:, 2], 2), np.linalg.norm((places - start).mean(axis=0)[:2])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_block_rests_on_a_splat_that_stands_still(tmp_path, engine):
    shelf = cube(name="shelf", position=(0, 0, 0), static=True, collider=BodyContact(friction=0.5))
    found = simulate(scene_on(shelf=shelf, engine=engine), out=tmp_path / "run.gasp")
    low, slid = lowest_at_rest(found)
    # Walls act at nodes, which are felt from a cell and a half: it rests within one of the surface.
    assert abs(low - SIZE) <= SIZE / CELLS
    assert slid <= 0.2 * SIZE / CELLS


@pytest.mark.parametrize("engine", ENGINES)
def test_a_block_rests_on_a_mesh(tmp_path, engine):
    trimesh.creation.box(extents=(1, 1, 1)).export(tmp_path / "box.stl")
    table = MeshShape(file=tmp_path / "box.stl", height=SIZE, position=(0, 0, 0), cells=48)
    found = simulate(scene_on((Collider(shape=table, friction=0.5),), engine=engine), out=tmp_path / "run.gasp")
    assert abs(lowest_at_rest(found)[0] - SIZE) <= SIZE / CELLS


def test_without_a_collider_it_falls_through_and_that_is_told(tmp_path):
    shelf = cube(name="shelf", position=(0, 0, 0), static=True)
    found = simulate(scene_on(shelf=shelf), out=tmp_path / "run.gasp")
    assert lowest_at_rest(found)[0] < 0.5 * SIZE
    assert [note for note in found.notes if "drawn only, nothing collides with it" in note and '"shelf"' in note]


def test_a_turned_splat_is_where_it_is_drawn(tmp_path):
    """A cube on its edge: its ridge is at a diagonal's height."""
    shelf = cube(name="shelf", position=(0, 0, 0), rotation=(45, 0, 0), static=True, collider=BodyContact())
    field = prepare(scene_on(shelf=shelf)).assembly.problem.colliders[0].shape
    ridge = np.array([[0.0, 0.0, SIZE * np.sqrt(2) + off * field.spacing] for off in (-1.0, 1.0)])
    assert (np.sign(field.signed_distance(ridge)) == [-1, 1]).all()


def test_matter_that_starts_in_a_static_object_is_told_by_its_name(tmp_path):
    shelf = cube(name="shelf", position=(0, 0, 0.1), static=True, collider=BodyContact(contact=ContactCondition.SLIP))
    found = simulate(dataclasses.replace(scene_on(shelf=shelf), duration=0.04), out=tmp_path / "run.gasp")
    assert [note for note in found.notes if 'inside object "shelf"' in note]


def test_a_run_is_not_gone_on_with_among_other_colliders(tmp_path):
    box = tmp_path / "box.stl"
    trimesh.creation.box(extents=(1, 1, 1)).export(box)
    table = Collider(shape=MeshShape(file=box, height=SIZE, position=(0, 0, 0), cells=32))
    short = dataclasses.replace(scene_on((table,)), duration=0.08)
    simulate(short, out=tmp_path / "run.gasp")
    longer = dataclasses.replace(short, duration=0.12)
    assert simulate(longer, out=tmp_path / "run.gasp", resume=True).frame_count == 4
    trimesh.creation.box(extents=(1, 1, 2)).export(box)
    with pytest.raises(RecordingError):
        simulate(dataclasses.replace(short, duration=0.2), out=tmp_path / "run.gasp", resume=True)


@pytest.mark.parametrize(("unit", "told"), [(1.0, True), (0.001, False)])
def test_a_mesh_in_millimetres_is_told_of(tmp_path, unit, told):
    box = tmp_path / "box.stl"
    trimesh.creation.box(extents=(600, 400, 40)).export(box)
    table = Collider(shape=MeshShape(file=box, metres_per_unit=unit, position=(0, 0, -60 * unit), cells=32))
    scene = scene_on((table,))
    prepared = prepare(scene)
    found = [note for note in oddities(scene, prepared.objects, prepared.assembly) if "if it is in mm" in note]
    assert bool(found) == told
