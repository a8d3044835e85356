"""Values of a wrong kind, given in Python: refused where they are given, with what is wanted."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from gasp_core import (
    Collider,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    HalfSpace,
    Part,
    Recording,
    RecordingChoice,
    Reduction,
    Scene,
    SplatObject,
    load_scene,
    render,
    simulate,
)
from gasp_core.contract import BodyContact, ContactCondition, Precision, Side
from gasp_core.errors import GaspError, RecordingError, SceneError, SplatFormatError
from gasp_core.io import write_splat
from gasp_core.scene import scene_to_toml
from gasp_core.scene.file_shapes import MeshShape, SplatShape
from gasp_core.solid import SolidOptions

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
FLOOR = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))


def thing(**others) -> SplatObject:
    return SplatObject(**{"name": "thing", "splat": Path("a.ply"), "material": SOFT, **others})


def labelled(label) -> Part:
    return Part(labels=[1, 2], label=label, pinned=True)


def scene(**others) -> Scene:
    return Scene(**{"duration": 1.0, "frame_rate": 25.0, "objects": (thing(),), **others})


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: Collider(shape=FLOOR, contact="glue"), "Collider.contact must be one of ContactCondition.STICK"),
        (lambda: Collider(shape="plane"), "Collider.shape must be a shape, found str"),
        (lambda: Collider(shape=FLOOR, motion={"times": [0]}), "Collider.motion must be a SteadyMotion or Keyframed"),
        (
            lambda: thing(reduction="volume"),
            "SplatObject.reduction must be a Reduction, found 'volume', e.g. Reduction",
        ),
        (lambda: thing(splat=np.zeros((5, 3))), "SplatObject.splat must be a Path or Gaussians, found array"),
        (lambda: thing(material=3), "SplatObject.material must be a Material or VaryingMaterial or None, found 3"),
        (lambda: thing(floaters="away"), "SplatObject.floaters must be one of Floaters.DROP"),
        (lambda: scene(engine="taichi-mpm"), "Scene.engine must be an EngineChoice, found 'taichi-mpm', e.g. EngineCh"),
        (lambda: scene(accuracy=16), "Scene.accuracy must be an EngineAccuracy, found 16"),
        (lambda: scene(objects=thing()), "Scene.objects must be a tuple of SplatObject, found SplatObject"),
        (lambda: scene(colliders=(thing(),)), "Scene.colliders[0] must be a Collider, found SplatObject"),
        (lambda: EngineChoice(name="a", precision="half"), "EngineChoice.precision must be one of Precision.FLOAT32"),
        (lambda: Part(component=True, pinned=True), "Part.component must be a whole number from 1 on, found True"),
        (lambda: Part(component=1.0, pinned=True), "Part.component must be a whole number from 1 on, found 1.0"),
        (lambda: labelled(np.True_), "Part.label must be a whole number, or an array of them, found "),
        (lambda: labelled((1, True)), "Part.label must be a whole number, or an array of them, found (1, True)"),
        (lambda: labelled("12"), "Part.label must be a whole number, or an array of them, found '12'"),
        (lambda: labelled(()), "Part.label must be a whole number, or an array of them, found ()"),
        (lambda: Reduction(mode="cores", count=True), "Reduction.count must be a whole number, found True"),
        (lambda: SolidOptions(cells=32.5), "SolidOptions.cells must be a whole number, found 32.5"),
        (lambda: MeshShape(file="a.obj", cells=64.5), "MeshShape.cells must be a whole number, found 64.5"),
        (lambda: EngineAccuracy(resolution=24.5), "EngineAccuracy.resolution must be a whole number, found 24.5"),
        (lambda: EngineChoice(name="a", seed=0.5), "EngineChoice.seed must be a whole number, found 0.5"),
        (lambda: RecordingChoice(checkpoint_frames=2.5), "RecordingChoice.checkpoint_frames must be a whole number"),
        (lambda: MeshShape(file="a.obj", up="z"), "MeshShape.up must be one of +x, -x, +y, -y, +z, -z, found 'z'"),
        (lambda: SplatShape(file="a.ply", up="z"), "SplatShape.up must be one of +x"),
        (lambda: simulate("cube.toml"), "a Scene is simulated, found 'cube.toml': gasp_core.load_scene reads"),
        (lambda: simulate(scene(), precision="half"), "precision must be one of float32, float64, found 'half'"),
        (lambda: render(scene(), "a.png", size=64), "size must be (width, height) in pixels, found 64"),
        (lambda: render(scene(), "a.png", camera=(1, 1, 1)), "camera must be a text or a CameraChoice"),
        (lambda: render(scene(), "a.png", "a.png"), "a.png is named twice"),
    ],
)
def test_what_is_of_the_wrong_kind_is_refused_where_it_is_given(made, says):
    with pytest.raises(GaspError) as caught:
        made()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_what_can_mean_one_thing_alone_is_taken():
    assert Collider(shape=FLOOR, contact="stick", side="inside") == Collider(
        shape=FLOOR, contact=ContactCondition.STICK, side=Side.INSIDE
    )
    assert SplatObject(name="a", splat="a.ply", static=True, collider=True).collider == BodyContact()
    assert EngineChoice(name="a", precision="float64").precision is Precision.FLOAT64
    assert scene(objects=[thing()]).objects == (thing(),)


def test_numbers_of_numpy_are_numbers():
    """And can be written down."""
    made = scene(
        duration=np.float32(0.5),
        frame_rate=np.int64(25),
        objects=(thing(height=np.float32(0.25), reduction=Reduction(mode="cores", count=3)),),
        accuracy=EngineAccuracy(resolution=np.int64(16)),
    )
    assert type(made.duration) is float and type(made.frame_rate) is int
    assert type(made.objects[0].height) is float
    assert "frame_rate = 25\n" in scene_to_toml(made)
    for found, wanted in (
        (Part(component=np.int64(2), pinned=True).component, 2),
        (labelled(np.int64(-1)).label, -1),
        (labelled(np.array(7)).label, 7),
        (labelled([np.uint8(1), 2]).label, (1, 2)),
        (labelled(np.array([3, 4])).label, (3, 4)),
        (Reduction(mode="cores", count=np.int64(5), levels=np.int32(2)).count, 5),
        (SolidOptions(cells=np.int64(32)).cells, 32),
    ):
        assert found == wanted
        assert {type(one) for one in (found if isinstance(found, tuple) else (found,))} == {int}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("velocity", (1, 0, 0)),
        ("angular_velocity", (0, 0, 1)),
        ("reduction", Reduction(mode="volume")),
        ("region", FLOOR),
        ("vertices", 3),
        ("material", SOFT),
        ("parts", (Part(component=1, pinned=True),)),
    ],
)
def test_how_something_is_simulated_means_nothing_of_what_is_not(key, value):
    with pytest.raises(SceneError, match=rf'SplatObject.{key} of "a" ha(s|ve) no meaning with static: leave one of'):
        SplatObject(name="a", splat="a.ply", static=True, **{key: value})
    as_by_default = SplatObject(
        name="a", splat="a.ply", static=True, velocity=[0, 0, 0], angular_velocity=(0.0, 0, -0.0), reduction=Reduction()
    )
    assert as_by_default == SplatObject(name="a", splat="a.ply", static=True)
    assert scene(objects=(thing(), as_by_default)).with_cores(count=3).objects[1] == as_by_default


def test_one_change_is_one_of_several(tmp_path):
    (tmp_path / "a.ply").touch()
    (tmp_path / "a.toml").write_text(
        '[scene]\nduration = 1.0\nframe_rate = 25\n[[object]]\nname = "a"\nsplat = "a.ply"\nmaterial = "rubber"\n'
    )
    assert load_scene(tmp_path / "a.toml", "scene.duration=2").duration == 2
    with pytest.raises(SceneError, match='there is no object "aa", there is "a"'):
        load_scene(tmp_path / "a.toml", ["object.aa.height=3"])
    # As README has it, of another scene.
    with pytest.raises(SceneError, match='there is no object "plant", there is "a"'):
        load_scene(tmp_path / "a.toml", ["object.plant.height=3"])
    assert load_scene(tmp_path / "a.toml", ["object.solid.interior=filled"]).objects[0].solid.interior == "filled"


def test_a_frame_is_a_whole_number(scene_of, run, tmp_path):
    recording = Recording.open(run(scene_of(duration=0.08), tmp_path / "a.gasp").path)
    np.testing.assert_array_equal(recording.points(1.0), recording.points(1))
    for frame in (1.5, "1", np.float32(0.5)):
        with pytest.raises(RecordingError, match="a frame is a whole number, found "):
            recording.points(frame)


def test_a_scene_is_no_splat_and_no_recording(scene_of, run, tmp_path):
    path = run(dataclasses.replace(scene_of(duration=0.08)), tmp_path / "a.gasp").path
    with pytest.raises(SceneError, match="is a recording, and no scene file: gasp render"):
        load_scene(path)
    (tmp_path / "a.splat").write_bytes(b"\xff" * 32)
    with pytest.raises(SceneError, match="is a splat, and no scene file: gasp new"):
        load_scene(tmp_path / "a.splat")


def test_what_is_handed_over_in_another_order_is_told(scene_of, cloud, tmp_path):
    with pytest.raises(SplatFormatError, match=r"takes a path and Gaussians, in this order, found Gaussians and str"):
        write_splat(cloud(), "x.ply")
    with pytest.raises(SplatFormatError, match="found str and int"):
        write_splat("x.ply", 3)
    with pytest.raises(SceneError, match="out must be a path or an address, found 3"):
        simulate(scene_of(), out=3)
