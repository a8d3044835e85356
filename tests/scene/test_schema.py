"""Scenes and recordings of yesterday under the program of today."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

import gasp_core
from gasp_core import Elastic, Scene, SplatObject
from gasp_core.contract import (
    MATERIALS,
    BoxShape,
    Collider,
    Domain,
    Driven,
    EngineAccuracy,
    HalfSpace,
    Impulse,
    KeyframedMotion,
    Pinned,
    SphereShape,
    SteadyMotion,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.recording.layout import BodyEntry, Commit, EngineRecord, Header, ObjectEntry
from gasp_core.recording.migrations import VERSION
from gasp_core.scene.body_contacts import ContactRule
from gasp_core.scene.columns import PlyProperty
from gasp_core.scene.digest import scene_digest, what_differs
from gasp_core.scene.loading import read_scene, read_stored_scene
from gasp_core.scene.motions import MOTIONS
from gasp_core.scene.objects import Reduction
from gasp_core.scene.parts import Part
from gasp_core.scene.schema import SCHEMA, migrated
from gasp_core.scene.settings import CameraChoice, EngineChoice, MapChoice, RecordingChoice, Viewpoint
from gasp_core.scene.tables import Table
from gasp_core.scene.varying import VaryingMaterial
from gasp_core.scene.writing import scene_to_toml
from gasp_core.solid import SolidOptions

KEPT = Path(__file__).parent / "schema.json"


def numbered(text, number):
    return text.replace("[scene]", f"[scene]\nschema = {number}")


SCENE_CLASSES = (
    Scene, SplatObject, Part, VaryingMaterial, PlyProperty, Reduction, SolidOptions, EngineChoice, MapChoice,
    RecordingChoice, CameraChoice, Viewpoint, EngineAccuracy,
    HalfSpace, BoxShape, SphereShape, ContactRule, Collider, SteadyMotion, KeyframedMotion, Domain,
    Pinned, Driven, Impulse, Wind,
    *MATERIALS.values(), *MOTIONS.values(),
)  # fmt: skip
RECORDING_CLASSES = (Header, ObjectEntry, BodyEntry, EngineRecord, Commit)

TEXT = """
[scene]
duration = 1.0
frame_rate = 10
[[object]]
name = "a"
splat = "a.ply"
material = { model = "elastic", density = 400, youngs_modulus = 5e4, poissons_ratio = 0.3 }
"""


def fields_of(kind: type) -> dict[str, str]:
    """Every field with its default as text; "required" where it has none."""
    found: dict[str, str] = {}
    for field in dataclasses.fields(kind):
        if field.default is not dataclasses.MISSING:
            found[field.name] = repr(field.default)
        elif field.default_factory is not dataclasses.MISSING:
            found[field.name] = repr(field.default_factory())
        else:
            found[field.name] = "required"
    return found


def today() -> dict[str, object]:
    return {
        "scene": {"schema": SCHEMA, **{kind.__name__: fields_of(kind) for kind in SCENE_CLASSES}},
        "recording": {"version": VERSION, **{kind.__name__: fields_of(kind) for kind in RECORDING_CLASSES}},
    }


def test_no_field_of_a_scene_or_a_recording_changes_without_thought():
    """What is written once has to be read for good, so a change of what is written is a decision.

    A new key of a scene whose default leaves every scene what it was: write it into schema.json, and that is all. A
    key renamed or gone, a default that changed: raise SCHEMA, and give gasp_core/scene/schema.py a step. Anything else
    in a recording: raise VERSION, give gasp_core/recording/migrations.py a step, and tests/recording_versions a small
    recording of the version before. Then write the new fields with `python tests/scene/test_schema.py`.
    """
    assert today() == json.loads(KEPT.read_text()), (
        test_no_field_of_a_scene_or_a_recording_changes_without_thought.__doc__
    )


def test_a_scene_says_its_number_and_a_newer_one_is_refused(tmp_path):
    scene = read_scene(TEXT, file="a.toml", folder=None)
    assert f"schema = {SCHEMA}\n" in scene_to_toml(scene)
    assert read_scene(scene_to_toml(scene), file="b.toml", folder=None).duration == 1.0
    newer = TEXT.replace("[scene]", f"[scene]\nschema = {SCHEMA + 1}")
    with pytest.raises(SceneError, match=rf"a.toml: scene.schema: is {SCHEMA + 1}, this GASP knows scenes up to"):
        read_scene(newer, file="a.toml", folder=None)
    for nonsense in ("0", '"two"', "1.5", "true"):
        with pytest.raises(SceneError, match=r"scene\.schema: must be a whole number"):
            read_scene(TEXT.replace("[scene]", f"[scene]\nschema = {nonsense}"), file="a.toml", folder=None)


def test_an_older_scene_goes_through_every_step_since():
    def first(tables):
        return {**tables, "scene": {**tables["scene"], "steps": ["1 to 2"]}}

    def second(tables):
        return {**tables, "scene": {**tables["scene"], "steps": [*tables["scene"].get("steps", []), "2 to 3"]}}

    def steps_taken(number, unnumbered=3):
        head = {"duration": 1.0} if number is None else {"schema": number}
        table = Table("a", "", {"scene": head})
        return migrated(table, unnumbered, schema=3, steps=(first, second)).values["scene"].get("steps")

    assert steps_taken(None, 1) == steps_taken(1) == ["1 to 2", "2 to 3"]
    assert steps_taken(2) == ["2 to 3"]
    assert steps_taken(3) is steps_taken(None) is None


def test_keys_that_are_gone_are_passed_over_in_a_scene_that_was_kept_and_nowhere_else():
    text = TEXT.replace("name =", "glow = 3\nname =") + "[weather]\nrain = true\n"
    with pytest.raises(SceneError, match="weather"):
        read_scene(text, file="a.toml", folder=None)
    scene, forgotten = read_stored_scene(text, file="a.toml")
    assert forgotten == ("weather", "object[0].glow")
    assert scene == read_scene(numbered(TEXT, 1), file="a.toml", folder=None)


def test_a_scene_of_number_1_has_every_vertex_and_64_cells():
    """As its recordings have them, which said no number at first; what it says itself stays."""
    today = read_scene(TEXT, file="a.toml", folder=None)
    assert (today.objects[0].reduction.mode, today.accuracy.resolution) == ("auto", "auto")
    older = read_scene(numbered(TEXT, 1), file="a.toml", folder=None)
    assert (older.objects[0].reduction.mode, older.accuracy.resolution) == ("all", 64)
    assert read_stored_scene(TEXT, file="kept")[0] == older
    said = TEXT + "reduction = { count = 5, levels = 2 }\n[accuracy]\nspacing = 0.01\n"
    with pytest.raises(SceneError, match=r'object\[0\].reduction.count: has no meaning with mode = "all"'):
        read_scene(numbered(said, 1), file="a.toml", folder=None)
    said = said.replace("{ count", '{ mode = "cores", count')
    assert read_scene(numbered(said, 1), file="a.toml", folder=None) == dataclasses.replace(
        read_scene(said, file="a.toml", folder=None), accuracy=EngineAccuracy(spacing=0.01, substep_fraction=0.5)
    )
    for broken in ("object = 3", "[object]\na = 1", "accuracy = 2", "[[object]]\nreduction = 2"):
        with pytest.raises(SceneError, match=r"a\.toml: "):
            read_scene(f"{broken}\n", file="a.toml", folder=None)
        with pytest.raises(SceneError, match=r"a\.toml: "):
            read_stored_scene(f"{broken}\n", file="a.toml")


def test_a_scene_of_number_3_takes_half_steps_and_moves_its_colliders_about_the_origin():
    ball = '[[collider]]\nshape = "sphere"\ncenter = [0, 0, 1]\nradius = 0.2\n'
    text = f"{TEXT}{ball}motion = {{ angular_velocity = [0, 0, 1] }}\n"
    today, older = (read_scene(each, file="a.toml", folder=None) for each in (text, numbered(text, 3)))
    assert (today.accuracy.substep_fraction, older.accuracy.substep_fraction) == (0.8, 0.5)
    assert (today.colliders[0].motion.center, older.colliders[0].motion.center) == ((0, 0, 1), (0, 0, 0))
    said = text.replace("[0, 0, 1] }", "[0, 0, 1], center = [1, 0, 0] }") + "[accuracy]\nsubstep_fraction = 0.3\n"
    assert read_scene(numbered(said, 3), file="a", folder=None) == read_scene(said, file="a", folder=None)
    for broken in ("accuracy = 2", "collider = 3", "[[collider]]\nmotion = 2", "collider = [1]"):
        with pytest.raises(SceneError, match=r"a\.toml: "):
            read_scene(f"{broken}\n[scene]\nschema = 3\n", file="a.toml", folder=None)


def test_a_scene_of_number_2_may_say_what_means_nothing_today():
    """How a static object is simulated, which did nothing; and an alpha below 1, which shrank what was at rest."""
    still = TEXT.replace('name = "a"\n', 'name = "a"\nstatic = true\n').replace("material", "# material")
    said = 'velocity = [1, 0, 0]\nangular_velocity = [0, 0, 1]\nvertices = 3\nreduction = { mode = "all" }\n'
    said = still + said + 'region = { shape = "sphere", center = [9, 9, 9], radius = 1 }\n[maps]\nalpha = 0.5\n'
    plain = read_scene(still, file="a.toml", folder=None)
    older = read_scene(numbered(said, 2), file="a.toml", folder=None)
    assert older == dataclasses.replace(plain, maps=MapChoice(alpha=1.0), accuracy=EngineAccuracy(substep_fraction=0.5))
    assert read_stored_scene(numbered(said, 2), file="kept")[0] == older
    with pytest.raises(SceneError, match=r"object\[0\]\.velocity: .*no meaning with static"):
        read_scene(said, file="a.toml", folder=None)
    moving = TEXT + "velocity = [1, 0, 0]\n[maps]\nalpha = 3\n[accuracy]\nsubstep_fraction = 0.5\n"
    assert read_scene(numbered(moving, 2), file="a", folder=None) == read_scene(moving, file="a", folder=None)
    for broken in ("[scene]\nschema = 2\n[maps]\nalpha = []", "maps = 3\nobject = [3]\n[scene]\nschema = 2"):
        with pytest.raises(SceneError, match=r"a\.toml: "):
            read_scene(f"{broken}\n", file="a.toml", folder=None)


def test_only_what_differs_from_the_defaults_enters_the_digest():
    @dataclasses.dataclass(frozen=True)
    class Before:
        density: float
        colour: str = "red"

    @dataclasses.dataclass(frozen=True)
    class After(Before):
        glow: float = 0.0

    assert what_differs(Before(400)) == what_differs(After(400.0)) == {"density": 400.0}
    assert what_differs(After(400, glow=1)) == {"density": 400.0, "glow": 1.0}
    assert what_differs(Elastic(density=1, youngs_modulus=2, poissons_ratio=0.3))["kind"] == "elastic"


@pytest.mark.parametrize(
    ("change", "same"),
    [
        (lambda scene: dataclasses.replace(scene, duration=9.0), True),
        (lambda scene: dataclasses.replace(scene, engine=EngineChoice(name="other")), True),
        (lambda scene: dataclasses.replace(scene, camera=CameraChoice(position=(1, 2, 3), target=(0, 0, 0))), True),
        (lambda scene: dataclasses.replace(scene, frame_rate=11.0), False),
        (lambda scene: dataclasses.replace(scene, maps=MapChoice(alpha=3.0)), False),
        (lambda scene: dataclasses.replace(scene, gravity=(0.0, 0.0, -1.6)), False),
        (
            lambda scene: dataclasses.replace(
                scene, objects=tuple(dataclasses.replace(item, min_opacity=0.1) for item in scene.objects)
            ),
            False,
        ),
    ],
)
def test_the_digest_knows_what_decides_the_frames(change, same):
    scene = read_scene(TEXT, file="a.toml", folder=None)
    digest = scene_digest(scene, ["00"])
    assert (scene_digest(change(scene), ["00"]) == digest) is same
    assert scene_digest(scene, ["01"]) != digest


def test_a_scene_kept_as_text_has_the_digest_of_the_scene(cloud):
    """Gaussians in memory stand in the text as a mark, whose axis up is still that of Gaussians in memory."""
    wave = gasp_core.Wave(axis=(1, 0, 0), amplitude=0.1, frequency=1, wavelength=1, direction=(0, 0, 1))
    item = SplatObject(
        name="a", splat=cloud(), material=Elastic(density=400, youngs_modulus=5e4, poissons_ratio=0.3), height=1
    )
    scene = Scene(
        duration=1,
        frame_rate=10,
        objects=(
            item,
            dataclasses.replace(
                item,
                name="b",
                motion=wave,
            ),
        ),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 2)), friction=1),),
        drives=(Pinned(region=SphereShape(center=(0, 0, 0), radius=1)),),
        maps=MapChoice(alpha=float("inf")),
    )
    kept, forgotten = read_stored_scene(scene_to_toml(scene), file="kept")
    assert not forgotten
    assert scene_digest(kept, ["00", "11"]) == scene_digest(scene, ["00", "11"])


if __name__ == "__main__":
    KEPT.write_text(json.dumps(today(), indent=1) + "\n")
