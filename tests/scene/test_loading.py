from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core import (
    Bend,
    BoxShape,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Floaters,
    Fluid,
    FrameSequence,
    HalfSpace,
    Impulse,
    MapChoice,
    Part,
    Pinned,
    PlyProperty,
    Precision,
    PythonMotion,
    RecordingChoice,
    Sand,
    Scene,
    Side,
    Snow,
    SphereShape,
    SplatObject,
    Swing,
    VaryingMaterial,
    Wave,
    Wind,
    load_scene,
    scene_to_toml,
)
from gasp_core.errors import SceneError

DESIGN = """
[scene]
duration = 2.0          # s
frame_rate = 25
gravity = [0, 0, -9.81]
[[object]]
name = "plant"
splat = "plant.splat"   # .ply .compressed.ply .splat .spz .sog, or a folder of frames
up = "-y"               # the file's up axis
height = 0.4            # m; or metres_per_unit
position = [0, 0, 0.5]
material = { model = "elastic", density = 400, youngs_modulus = 5e4, poissons_ratio = 0.3 }
reduction = { mode = "all" }
[[collider]]
shape = "plane"
height = 0.0
contact = "separate"
friction = 0.4
[engine]
name = "taichi-mpm"     # or "auto"
[accuracy]
resolution = 64
"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "plant.splat").write_bytes(b"")
    (tmp_path / "labels.npy").write_bytes(b"")

    def make(text: str) -> Path:
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return path

    return make


def test_the_scene_of_the_design(write):
    scene = load_scene(write(DESIGN))
    assert scene.duration == 2.0
    assert scene.frame_count == 51
    plant = scene.objects[0]
    assert plant.splat == write(DESIGN).parent / "plant.splat"
    assert plant.material == Elastic(density=400, youngs_modulus=5e4, poissons_ratio=0.3)
    assert plant.up == "-y"
    assert scene.colliders == (
        Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), contact=ContactCondition.SEPARATE, friction=0.4),
    )
    assert scene.engine == EngineChoice(name="taichi-mpm")
    assert scene.accuracy == EngineAccuracy(resolution=64)


SWUNG = 'kind = "swing", axis = [0, 1, 0], pivot = [0, 0, 0], amplitude = 3, frequency = 1'


def moving(keys):
    return DESIGN.replace("[[collider]]", "motion = { " + keys + " }\n[[collider]]")


def parted(keys):
    return DESIGN.replace("[[collider]]", "part = [{ " + keys + " }]\n[[collider]]")


REFUSED = {
    "unknown top key": ("gravty = 3\n" + DESIGN, ["gravty", "unknown key", "contact, domain"]),
    "unknown key": (DESIGN.replace("height = 0.4", "heigth = 0.4"), ["object[0].heigth", 'did you mean "height"']),
    "unknown material key": (DESIGN.replace("density = 400", "densty = 400"), ["object[0].material.densty", "density"]),
    "wrong type": (DESIGN.replace("duration = 2.0", 'duration = "long"'), ["scene.duration", "a number", "long"]),
    "boolean for a number": (DESIGN.replace("frame_rate = 25", "frame_rate = true"), ["scene.frame_rate", "true"]),
    "missing key": (DESIGN.replace("duration = 2.0", ""), ["scene.duration", "missing"]),
    "missing material key": (DESIGN.replace("density = 400, ", ""), ["object[0].material.density", "missing"]),
    "negative duration": (DESIGN.replace("duration = 2.0", "duration = -1"), ["scene.duration", "> 0", "-1"]),
    "nan": (DESIGN.replace("duration = 2.0", "duration = nan"), ["scene.duration", "finite", "nan"]),
    "huge integer": (DESIGN.replace("duration = 2.0", "duration = 1" + "0" * 400), ["scene.duration", "1e308"]),
    "negative density": (DESIGN.replace("density = 400", "density = -3"), ["object[0].material.density", "-3"]),
    "no stiffness": (DESIGN.replace("5e4", "0"), ["object[0].material.youngs_modulus", "> 0"]),
    "incompressible": (DESIGN.replace("poissons_ratio = 0.3", "poissons_ratio = 0.5"), ["poissons_ratio", "0.5"]),
    "axis without a sign": (DESIGN.replace('"-y"', '"z"'), ["object[0].up", 'did you mean "+z"']),
    "unknown view": (DESIGN + '[camera]\nview = "fron"\n', ["camera.view", 'did you mean "front"?']),
    "unknown precision": (
        DESIGN.replace("[engine]", '[engine]\nprecision = "flaot32"'),
        ["engine.precision", 'did you mean "float32"?'],
    ),
    "unknown covariance": (DESIGN + '[maps]\ncovariance = "exakt"\n', ["maps.covariance", 'did you mean "exact"?']),
    "unknown material": (DESIGN.replace('"elastic"', '"elastc"'), ["material.model", 'did you mean "elastic"']),
    "no such axis": (DESIGN.replace('"-y"', '"up"'), ["object[0].up", "+x, -x", "up"]),
    "height twice": (DESIGN.replace("height = 0.4", "height = 0.4\nmetres_per_unit = 2"), ["object[0].height"]),
    "short vector": (DESIGN.replace("[0, 0, 0.5]", "[0, 0.5]"), ["object[0].position", "3 numbers"]),
    "missing splat": (DESIGN.replace("plant.splat", "plnt.splat"), ["object[0].splat", "no such file", "plnt.splat"]),
    "no object": (DESIGN.replace("[[object]]", "[maps]"), ["object", "missing", "[[object]]"]),
    "object as a table": (DESIGN.replace("[[object]]", "[object]"), ["object", "[[object]]"]),
    "no such shape": (DESIGN.replace('"plane"', '"plan"'), ["collider[0].shape", "plane, box, sphere"]),
    "friction without separate": (DESIGN.replace('"separate"', '"slip"'), ["collider[0].friction", "slip"]),
    "tolerance": (DESIGN.replace("resolution = 64", "tolerance = 0.01"), ["accuracy.tolerance", "comes later"]),
    "auto": (DESIGN.replace('"taichi-mpm"', '"auto"'), ["engine.name", "comes later"]),
    "cores, no number": (DESIGN.replace('"all"', '"cores"'), ["object[0].reduction.mode", "fraction or a count"]),
    "cores, two numbers": (
        DESIGN.replace('mode = "all"', 'mode = "cores", count = 5, fraction = 0.1'),
        ["object[0].reduction.mode", "fraction or a count"],
    ),
    "no cores": (DESIGN.replace('mode = "all"', 'mode = "cores", fraction = 0'), ["reduction.fraction", "> 0", "0"]),
    "too many": (DESIGN.replace('mode = "all"', 'mode = "cores", fraction = 2'), ["reduction.fraction", "<= 1", "2"]),
    "half a core": (DESIGN.replace('mode = "all"', 'mode = "cores", count = 1.5'), ["reduction.count", "whole", "1.5"]),
    "no levels": (
        DESIGN.replace('mode = "all"', 'mode = "cores", count = 5, levels = 0'),
        ["reduction.levels", ">= 1", "0"],
    ),
    "no such transfer": (
        DESIGN.replace('mode = "all"', 'mode = "cores", count = 5, transfer = "linear"'),
        ["reduction.transfer", '"least-squares", "frame"', "linear"],
    ),
    "a number for all": (DESIGN.replace('mode = "all"', 'mode = "all", count = 5'), ["reduction.count", "no meaning"]),
    "no such mode": (
        DESIGN.replace('"all"', '"few"'),
        ["reduction.mode", '"all", "centres", "cores", "mesh" or "volume"', "few"],
    ),
    "coarse": (DESIGN.replace("resolution = 64", "resolution = 1"), ["accuracy.resolution", ">= 2"]),
    "fraction of a cell": (DESIGN.replace("resolution = 64", "resolution = 6.5"), ["accuracy.resolution", "whole"]),
    "not TOML": (DESIGN.replace("frame_rate = 25", "frame_rate 25"), ["not valid TOML", "line 4"]),
    "bad map": (DESIGN + "[maps]\nvertices = 5\n", ["maps.vertices", '3, 4, "auto"', "5"]),
    "bad precision": (DESIGN.replace("[accuracy]", 'precision = "half"\n[accuracy]'), ["engine.precision", "float64"]),
    "impulse with an end": (
        DESIGN + '[[drive]]\nkind = "impulse"\nend = 1\nregion = { shape = "sphere", center = [0,0,0], radius = 1 }\n',
        ["drive[0].end", "no meaning"],
    ),
    "drive without region": (DESIGN + '[[drive]]\nkind = "pinned"\n', ["drive[0].region", "missing"]),
    "empty window": (DESIGN + "[[wind]]\nstart = 2\nend = 1\n", ["wind[0].end", "start"]),
    "no such motion": (moving('kind = "bendd"'), ["object[0].motion.kind", 'did you mean "bend"']),
    "motion without a kind": (moving("rate = 1"), ["object[0].motion.kind", "missing", "frames"]),
    "no such key of a motion": (moving('kind = "frames", fps = 5'), ["object[0].motion.fps", "frame_rate"]),
    "no such composition": (
        moving('kind = "frames", composition = "melted"'),
        ["object[0].motion.composition", '"carried", "frozen"', "melted"],
    ),
    "velocity twice": (
        moving('kind = "frames", start_velocity = true'),
        ["object[0].motion.start_velocity", "keeps its velocity"],
    ),
    "no time between frames": (moving('kind = "frames", frame_rate = 0'), ["object[0].motion.frame_rate", "> 0"]),
    "no function": (moving('kind = "python"'), ["object[0].motion.function", "missing"]),
    "function of no module": (moving('kind = "python", function = "sway"'), ["motion.function", "module:function"]),
    "function as a number": (moving('kind = "python", function = 3'), ["motion.function", "must be a text", "3"]),
    "span backwards": (moving('kind = "python", function = "a:b", span = [2, 1]'), ["motion.span", "not after"]),
    "bend without an axis": (moving('kind = "bend", amplitude = 3'), ["object[0].motion.axis", "missing"]),
    "axis without direction": (moving(SWUNG.replace("[0, 1, 0]", "[0, 0, 0]")), ["motion.axis", "zero vector"]),
    "no frequency": (moving(SWUNG.replace("frequency = 1", "frequency = 0")), ["motion.frequency", "> 0"]),
    "motion of what is static": (
        moving(SWUNG).replace("reduction = {", "static = true\nreduction = {").replace("material = {", "# {"),
        ["object[0].motion", "no meaning with static"],
    ),
    "region of what is carried": (
        moving(SWUNG + ' }\nregion = { shape = "sphere", center = [0, 0, 0], radius = 1'),
        ["object[0].motion", "region", "frozen"],
    ),
    "part without a selector": (parted("pinned = true"), ["object[0].part[0]", "one of region, component and labels"]),
    "part with two": (parted("component = 1, labels = 'labels.npy', label = 1, pinned = true"), ["one of region"]),
    "part that is nothing": (
        parted("component = 1"),
        ["object[0].part[0]", "a material, pinned = true, rigid = true or driven = true"],
    ),
    "labels without a label": (parted("labels = 'labels.npy', pinned = true"), ["object[0].part[0].labels", "label"]),
    "label without labels": (parted("component = 1, label = 1, pinned = true"), ["part[0].labels", "go together"]),
    "half a label": (parted("labels = 'labels.npy', label = 1.5, pinned = true"), ["part[0].label:", "whole", "1.5"]),
    "no label": (parted("labels = 'labels.npy', label = [], pinned = true"), ["part[0].label:", "whole", "()"]),
    "labels that are not there": (
        parted("labels = 'gone.npy', label = 1, pinned = true"),
        ["part[0].labels", "no such file: gone.npy"],
    ),
    "labels of a number": (parted("labels = 3, label = 1, pinned = true"), ["part[0].labels", ".npy", "3"]),
    "labels of another kind": (
        parted("labels = 'plant.splat', label = 1, pinned = true"),
        ["must be a .npy", "plant.splat"],
    ),
    "property misspelt": (
        parted("labels = { proprety = 'a' }, label = 1, pinned = true"),
        ["part[0].labels.proprety", 'did you mean "property"'],
    ),
    "component 0": (parted("component = 0, pinned = true"), ["part[0].component", "from 1 on"]),
    "rigid and pinned": (parted("component = 1, pinned = true, rigid = true"), ["part[0].rigid", "pinned"]),
    "unknown key of a part": (parted("componnt = 1, pinned = true"), ["part[0].componnt", 'did you mean "component"']),
    "part as a table": (
        DESIGN.replace("[[collider]]", "part = {}\n[[collider]]"),
        ["object[0].part", "[[object.part]]"],
    ),
    "parts of one name": (
        parted("name = 'a', component = 1, pinned = true }, { name = 'a', component = 2, pinned = true"),
        ["object[0].parts", 'two named "a"'],
    ),
    "parts of what is static": (
        parted("component = 1, pinned = true")
        .replace("reduction = {", "static = true\nreduction = {")
        .replace("material = {", "# {"),
        ["object[0].parts", "no meaning with static"],
    ),
    "no such field": (DESIGN.replace("5e4", '"E.npy"'), ["material.youngs_modulus", "no such file: E.npy"]),
    "field of something else": (DESIGN.replace("5e4", "[1, 2]"), ["material.youngs_modulus", "a number"]),
    "inside out domain": (DESIGN + "[domain]\nlower = [1,1,1]\nupper = [0,0,0]\n", ["domain.upper"]),
}


@pytest.mark.parametrize("case", REFUSED, ids=str)
def test_a_bad_scene_is_refused_in_one_line_that_names_file_and_key(write, case):
    text, wanted = REFUSED[case]
    path = write(text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    for part in wanted:
        assert part in message, message


def test_two_objects_of_one_name(write):
    again = DESIGN[DESIGN.index("[[object]]") : DESIGN.index("[[collider]]")]
    with pytest.raises(SceneError, match=r'object\[1\]\.name: "plant" is taken'):
        load_scene(write(DESIGN + again))


def test_files_that_are_no_scene(tmp_path):
    with pytest.raises(SceneError, match="no such scene file"):
        load_scene(tmp_path / "nothing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="UTF-8"):
        load_scene(tmp_path / "binary.toml")
    with pytest.raises(SceneError, match="cannot be read"):
        load_scene(tmp_path)


def test_a_splat_may_be_a_folder_or_an_absolute_path(write, tmp_path):
    (tmp_path / "frames.sog").mkdir()
    scene = load_scene(write(DESIGN.replace("plant.splat", "frames.sog")))
    assert scene.objects[0].splat == tmp_path / "frames.sog"
    scene = load_scene(write(DESIGN.replace("plant.splat", str(tmp_path / "plant.splat"))))
    assert scene.objects[0].splat == tmp_path / "plant.splat"


MUD = Fluid(density=1500.0, bulk_modulus=1e5)

EVERYTHING = Scene(
    duration=1.25,
    frame_rate=24.0,
    gravity=(0.0, 0.1, -9.81),
    objects=(
        SplatObject(
            name='odd "name" \\ \u2603',
            splat=Path("/some/where/a.ply"),
            material=Sand(density=1.0, youngs_modulus=2.0, poissons_ratio=-0.1, friction_angle=12.0),
            up="+x",
            metres_per_unit=0.1,
            position=(1.0, 2.0, 3.0),
            rotation=(10.0, 20.0, 30.0),
            velocity=(1.0, 0.0, 0.0),
            angular_velocity=(0.0, 1.0, 0.0),
            min_opacity=0.25,
            region=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 2.0, 3.0)),
            floaters=Floaters.STILL,
            vertices=3,
        ),
        SplatObject(
            name="potted",
            splat=Path("/p.ply"),
            material=VaryingMaterial(
                base=Elastic(density=300.0, youngs_modulus=0.25, poissons_ratio=0.3),
                columns={"youngs_modulus": Path("/some/where/E.npy")},
            ),
            parts=(
                Part(name="pot", region=SphereShape(center=(0.0,) * 3, radius=1.0), pinned=True),
                Part(component=2, rigid=True),
                Part(name="leaves", labels=Path("/l.npy"), label=(3, 4), material=MUD),
                Part(name="soil", labels=Path("/l.npy"), label=0, material=MUD),
                Part(
                    labels=PlyProperty(property="label"),
                    label=-1,
                    material=VaryingMaterial.of(
                        Elastic, density=PlyProperty(property="rho"), youngs_modulus=2.0, poissons_ratio=0.1
                    ),
                    pinned=True,
                ),
            ),
        ),
        SplatObject(name="b", splat=Path("/b"), material=Fluid(density=1000.0, bulk_modulus=1e5), vertices="auto"),
        SplatObject(
            name="c",
            splat=Path("/c"),
            material=Snow(density=100.0, youngs_modulus=1e5, poissons_ratio=0.2),
            rotation=(1.0, 0.0, 0.0, 0.5),
            height=2.0,
        ),
        SplatObject(name="ground", splat=Path("/d"), static=True),
        *(
            SplatObject(name=f"moving {index}", splat=Path("/e"), material=MUD, motion=motion)
            for index, motion in enumerate(
                (
                    FrameSequence(frame_rate=12.5, start=0.2, rate=-1.0, composition="frozen", start_velocity=False),
                    PythonMotion(function="/some/where/sway.py:sway", span=(0.5, 2.0), step=0.01),
                    PythonMotion(function="package.module:psi", composition="frozen"),
                    Swing(axis=(0.0, 1.0, 0.0), pivot=(1.0, 2.0, 3.0), amplitude=-5.0, frequency=2.0, phase=90.0),
                    Bend(axis=(1.0, 0.0, 0.0), pivot=(0.0,) * 3, amplitude=3.0, frequency=1.0, length=0.5),
                    Wave(axis=(0.0, 0.0, 1.0), amplitude=0.1, frequency=2.0, wavelength=3.0, direction=(1.0, 0.0, 0.0)),
                )
            )
        ),
    ),
    colliders=(
        Collider(shape=HalfSpace(point=(0.0, 0.0, 1.0), normal=(0.0, 1.0, 0.0)), friction=0.3),
        Collider(shape=SphereShape(center=(0.0, 0.0, 0.0), radius=9.0), side=Side.INSIDE),
    ),
    drives=(
        Pinned(region=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), end=0.5),
        Driven(region=SphereShape(center=(0.0, 0.0, 0.0), radius=1.0), start=0.1, velocity=(1.0, 0.0, 0.0)),
        Impulse(region=SphereShape(center=(0.0, 0.0, 0.0), radius=1.0), impulse=(0.0, 0.0, 1.0)),
    ),
    force_fields=(Wind(velocity=(3.0, 0.0, 0.0), drag=0.5), Wind(region=SphereShape(center=(0.0,) * 3, radius=1.0))),
    domain=Domain(lower=(-1.0, -1.0, -1.0), upper=(1.0, 1.0, 1.0), policy=DomainPolicy.CLAMP),
    engine=EngineChoice(
        name="x",
        device="cpu",
        precision=Precision.FLOAT64,
        seed=3,
        options={"a": 1, "b": [1.5, "t\x7f\n"], "c d": True},
    ),
    accuracy=EngineAccuracy(resolution=32, substep=1e-5, spacing=0.1),
    maps=MapChoice(vertices=4, covariance="gram_schmidt", alpha=3.0, edge_floor=0.0),
    recording=RecordingChoice(velocities=True, checkpoint_frames=7),
)


def reread(scene: Scene) -> Scene:
    from gasp_core.scene.loading import read_scene

    return read_scene(scene_to_toml(scene), file="again", folder=None)


def test_a_scene_survives_its_own_text():
    assert reread(EVERYTHING) == EVERYTHING


def test_a_function_lies_beside_the_scene_file_or_is_installed(write, tmp_path):
    moving = DESIGN.replace("[[collider]]", 'motion = { kind = "python", function = "sway:psi" }\n[[collider]]')
    assert load_scene(write(moving)).objects[0].motion == PythonMotion(function="sway:psi")
    (tmp_path / "sway.py").write_text("")
    assert load_scene(write(moving)).objects[0].motion == PythonMotion(function=f"{tmp_path / 'sway.py'}:psi")


def test_a_function_in_memory_stands_in_the_text_by_its_name(tmp_path):
    item = SplatObject(name="a", splat=Path("/a"), material=MUD, motion=PythonMotion(function=lambda points, s: points))
    again = reread(Scene(duration=1, frame_rate=1, objects=(item,))).objects[0].motion
    assert isinstance(again, PythonMotion)
    assert again.function == f"{__name__}:function"


def test_paths_may_name_variables_of_the_environment(write, tmp_path, monkeypatch):
    monkeypatch.setenv("GASP_TEST_FOLDER", str(tmp_path))
    scene = load_scene(write(DESIGN.replace('"plant.splat"', '"$GASP_TEST_FOLDER/plant.splat"')))
    assert scene.objects[0].splat == tmp_path / "plant.splat"
    monkeypatch.delenv("GASP_TEST_FOLDER")
    with pytest.raises(SceneError, match=r"no such file.*\$GASP_TEST_FOLDER"):
        load_scene(write(DESIGN.replace('"plant.splat"', '"$GASP_TEST_FOLDER/plant.splat"')))


@given(
    st.floats(1e-3, 1e3),
    st.floats(1e-2, 1e3),
    st.text(min_size=1, max_size=200, alphabet=st.characters(exclude_categories=["C", "Z"])),
    st.one_of(st.just(math.inf), st.floats(1, 1e9)),
)
def test_any_number_and_any_name_survive(duration, frame_rate, name, alpha):
    scene = Scene(
        duration=duration,
        frame_rate=frame_rate,
        objects=(SplatObject(name=name, splat=Path("/a"), static=True),),
        maps=MapChoice(alpha=alpha),
    )
    assert reread(scene) == scene


@given(st.integers(1, 10_000), st.sampled_from([10, 24, 25, 29.97, 30, 60, 100]))
def test_a_duration_of_whole_frames_ends_on_a_frame(frames, rate):
    """`frames / rate` is rounded, and so is its product with the rate: two relative errors of 1.1e-16."""
    scene = Scene(
        duration=frames / rate, frame_rate=rate, objects=(SplatObject(name="a", splat=Path("/a"), static=True),)
    )
    assert scene.frame_count == frames + 1


def test_contradictions_in_python_are_refused_too():
    with pytest.raises(SceneError, match="material"):
        SplatObject(name="a", splat=Path("a"))
    with pytest.raises(SceneError, match="static"):
        SplatObject(name="a", splat=Path("a"), static=True, material=Fluid(density=1, bulk_modulus=1))
    with pytest.raises(SceneError, match="rotation"):
        SplatObject(name="a", splat=Path("a"), static=True, rotation=(1.0, 2.0))
    with pytest.raises(SceneError, match="zero quaternion"):
        SplatObject(name="a", splat=Path("a"), static=True, rotation=(0.0, 0.0, 0.0, 0.0))
    with pytest.raises(SceneError, match="objects"):
        Scene(duration=1, frame_rate=1, objects=())
    twin = SplatObject(name="a", splat=Path("a"), static=True)
    with pytest.raises(SceneError, match='two objects named "a"'):
        Scene(duration=1, frame_rate=1, objects=(twin, twin))
    with pytest.raises(SceneError, match="frames"):
        Scene(duration=1e9, frame_rate=1e9, objects=(twin,))


def test_a_splat_behind_a_link_of_the_project_stays_relative(tmp_path, scene_of):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "project").mkdir()
    (tmp_path / "project" / "data").symlink_to(tmp_path / "elsewhere")
    scene = scene_of(splat=tmp_path / "project" / "data" / "x.ply")
    assert 'splat = "data/x.ply"' in scene_to_toml(scene, beside=tmp_path / "project")
    scene = scene_of(splat=tmp_path / "project" / "data" / ".." / "x.ply")
    # Behind a link, ".." is the folder above where it leads.
    assert f'splat = "{tmp_path}/project/data/../x.ply"' in scene_to_toml(scene, beside=tmp_path / "project")
