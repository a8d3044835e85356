import dataclasses
import json

import flying_points
import numpy as np
import pytest
import trimesh
from PIL import Image

import gasp_core as gasp
from gasp_core.errors import RecordingError, RenderingError, SplatFormatError
from gasp_core.recording import Recording
from gasp_core.recording.nodes import sealed
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.footage import RecordedFootage, SceneFootage, open_footage
from gasp_core.rendering.forecast import Forecast
from gasp_core.rendering.framing import motion_of
from gasp_core.rendering.live import LiveFilm
from gasp_core.rendering.painting import FramePainter, parse_background, to_bytes
from gasp_core.rendering.scenery import nearest_hits
from gasp_core.rendering.viewpoints import read_choice
from gasp_core.scene.file_shapes import MeshShape

SIZE = (96, 64)


def painted(path):
    return np.asarray(Image.open(path))


def test_a_run_becomes_film_sheet_and_pictures_in_one_go(recording, dots, tmp_path):
    gasp.render(recording, tmp_path / "a.mp4", tmp_path / "a.png", tmp_path / "frames", size=SIZE)
    assert sorted(path.name for path in (tmp_path / "frames").iterdir()) == [f"frame_{k:04d}.png" for k in range(7)]
    assert painted(tmp_path / "frames" / "frame_0000.png").shape == (64, 96, 3)
    # Once for all three; beside it, what the lamp sees of them, for the shadow.
    assert dots.sizes.count(SIZE) == 7 and sum(width == height for width, height in dots.sizes) == 7


def test_only_key_frames_are_painted_for_a_sheet(run_of, falling_scene, dots, tmp_path):
    run = run_of(dataclasses.replace(falling_scene, duration=1.6), name="long.gasp")
    assert run.frame_count == 41
    gasp.render(run.path, tmp_path / "a.png", size=SIZE)
    assert dots.sizes.count(SIZE) == 12


def test_the_first_frame_shows_the_file(recording, dots, tmp_path, cameras_of):
    gasp.render(recording, tmp_path / "a.png", size=SIZE, frames=[0], background="black")
    splats, picture = recording.splats(0), painted(tmp_path / "a.png")
    (camera,) = cameras_of(RecordedFootage(recording), numbers=[0])
    places, depths = camera.project(splats.means)
    nearest = np.argmin(depths)
    x, y = np.floor(places[nearest]).astype(int)
    assert picture[y, x] == pytest.approx(to_bytes(0.5 + 0.2820948 * splats.harmonics[nearest, 0]), abs=1)


def test_what_is_behind_a_collider_is_hidden_and_what_is_before_it_is_not(run_of, falling_scene, dots):
    floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0.2), normal=(0, 0, 1)))
    run = run_of(dataclasses.replace(falling_scene, colliders=(floor,)))
    footage = RecordedFootage(run)
    painter = FramePainter(footage, dots, motion=motion_of(footage), background=(1, 1, 1))
    above = look_at((0, -3, 3), (0, 0, 0.2), width=200, height=200)
    picture = painter.paint(6, above)
    means = run.splats(6).means
    # The engine of the tests knows no floor: a part has sunk below it.
    sunk = means[:, 2] < 0.2
    assert 5 < sunk.sum() < len(sunk) - 5
    x, y = np.floor(above.project(means)[0]).astype(int).T
    colourful = np.ptp(picture[y, x].astype(int), axis=1) > 20
    trained = np.ptp(to_bytes(0.5 + 0.2820948 * run.splats(6).harmonics[:, 0]).astype(int), axis=1) > 20
    # One of the others may stand before a sunk one, in its pixel of 40,000; two or three at the most.
    assert colourful[sunk].sum() <= 3
    assert (colourful | ~trained)[~sunk].all()


def test_transparent_pictures_have_straight_colours(recording, dots, tmp_path):
    gasp.render(recording, tmp_path / "frames", size=SIZE, background="transparent")
    first = painted(tmp_path / "frames" / "frame_0000.png")
    assert first.shape == (64, 96, 4)
    assert (first[:, :, 3] == 255).any()
    with pytest.raises(RenderingError, match="cannot be transparent"):
        gasp.render(recording, tmp_path / "a.mp4", size=SIZE, background="transparent")


def test_on_a_transparent_background_there_is_no_floor_unless_it_is_asked_for(recording, tmp_path):
    seen = {}
    for name, asked in {"default": None, "with": True, "without": False}.items():
        options = {} if asked is None else {"colliders": asked}
        gasp.render(recording, tmp_path / name, size=SIZE, background="transparent", frames=[0], **options)
        seen[name] = painted(tmp_path / name / "frame_0000.png")[:, :, 3] > 0
    np.testing.assert_array_equal(seen["default"], seen["without"])
    assert seen["without"].any() and seen["with"].sum() > seen["without"].sum() + 500
    gasp.render(recording, tmp_path / "white", tmp_path / "a.png", size=SIZE, frames=[0])
    gasp.render(recording, tmp_path / "bare", size=SIZE, frames=[0], colliders=False)
    assert not np.array_equal(
        painted(tmp_path / "white" / "frame_0000.png"), painted(tmp_path / "bare" / "frame_0000.png")
    )


def test_nothing_to_write_is_told(recording):
    with pytest.raises(RenderingError, match=r"name what to write: film\.mp4"):
        gasp.render(recording)


def test_a_scene_that_runs_code_is_shown_without_it_and_that_is_told(dots, recording, tmp_path, caplog):
    gasp.write_splat(tmp_path / "blob.ply", recording.gaussians(0))
    (tmp_path / "a.toml").write_text(
        '[scene]\nduration = 1\nframe_rate = 10\n[[object]]\nname = "blob"\nsplat = "blob.ply"\n'
        'material = "rubber"\nmotion = { kind = "python", function = "nowhere.py:f" }\n'
    )
    gasp.render(tmp_path / "a.toml", tmp_path / "a.png", size=SIZE)
    told = [record.message for record in caplog.records if "runs code" in record.message]
    assert len(told) == 1 and 'object "blob" is shown as its file has it' in told[0]


def test_a_turn_around_a_splat_file(tmp_path, dots, recording):
    gasp.write_splat(tmp_path / "blob.ply", recording.gaussians(0))
    gasp.render(tmp_path / "blob.ply", tmp_path / "frames", size=SIZE, turntable=True, up="+z")
    pictures = sorted((tmp_path / "frames").iterdir())
    assert len(pictures) == 100
    quarter, half = painted(pictures[25]), painted(pictures[50])
    assert not np.array_equal(quarter, half)
    gasp.render(tmp_path / "blob.ply", tmp_path / "one.png", size=SIZE, up="+z")
    assert painted(tmp_path / "one.png").shape == (64, 96, 3)


def test_the_camera_of_the_scene_and_of_a_file(run_of, falling_scene, tmp_path, cameras_of):
    """One camera said three ways: by its place, and by two files in the frame of the splat."""
    eye, aim = (0.5, -3.0, 0.8), (0.0, 0.0, 0.2)
    direct = look_at(eye, aim, width=120, height=80, field_of_view=40)
    own = {"position": direct.position.tolist(), "rotation": direct.rotation.T.tolist(), "fx": direct.focal_x}
    size = {"width": 120, "height": 80, "fy": direct.focal_y, "img_name": "a"}
    (tmp_path / "cameras.json").write_text(json.dumps([own | size]))
    for choice in (
        gasp.CameraChoice(position=eye, target=aim, field_of_view=40),
        gasp.CameraChoice(file=tmp_path / "cameras.json", view="a"),
        gasp.CameraChoice(file=tmp_path / "cameras.json", object="blob"),
    ):
        run = run_of(dataclasses.replace(falling_scene, camera=choice), overwrite=True)
        footage = RecordedFootage(Recording.open(run.path))
        assert footage.camera == choice
        camera = cameras_of(footage, size=(60, 40))[0]
        means = run.splats(0).means
        # Placement is the identity here; cameras.json keeps sixteen digits.
        assert camera.project(means)[0] == pytest.approx(direct.resized(60, 40).project(means)[0], abs=1e-9)


def test_a_camera_of_a_file_follows_its_splat_into_the_world(run_of, falling_scene, tmp_path, cameras_of):
    """Turned, scaled and moved by the scene, the splat looks the same from its own camera."""
    native = look_at((0.5, -3.0, 0.8), (0.0, 0.0, 0.2), width=120, height=80)
    entry = {"position": native.position.tolist(), "rotation": native.rotation.T.tolist(), "id": 0}
    entry |= {"width": 120, "height": 80, "fx": native.focal_x, "fy": native.focal_y}
    (tmp_path / "cameras.json").write_text(json.dumps([entry]))
    (item,) = falling_scene.objects
    placed = dataclasses.replace(item, up="-x", height=0.3, position=(1, 2, 3), rotation=(10, 20, 30))
    run = run_of(dataclasses.replace(falling_scene, objects=(placed,)))
    choice = read_choice(f"{tmp_path}/cameras.json:0")
    footage = RecordedFootage(run)
    camera = cameras_of(footage, choice, size=(120, 80))[0]
    assert camera.project(run.splats(0).means)[0] == pytest.approx(native.project(item.splat.means)[0], abs=1e-6)


def test_the_camera_decides_nothing(run_of, falling_scene):
    """A run goes on with another camera."""
    run_of(falling_scene, frames=3)
    moved = dataclasses.replace(falling_scene, camera=gasp.CameraChoice(position=(1, 1, 1), target=(0, 0, 0)))
    assert run_of(moved, resume=True).status == "complete"


def test_colours():
    assert parse_background("white") == (1, 1, 1)
    assert parse_background("#ff0000") == (1, 0, 0)
    assert parse_background("transparent") is None
    with pytest.raises(RenderingError, match='background "blurple" is no colour'):
        parse_background("blurple")
    assert to_bytes(np.array([-1.0, 0.0, 0.5, 1.0, 7.0])).tolist() == [0, 0, 128, 255, 255]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"camera": "sideways"}, 'no view "sideways": choose one of three-quarter, front'),
        ({"camera": "fornt"}, r'no view "fornt": choose one .* camera.toml, did you mean "front"\?'),
        ({"camera": "none.json"}, "there is no such camera file"),
        (
            {"camera": gasp.CameraChoice(position=(1, 1, 1), target=(0, 0, 0)), "turntable": True},
            "a turntable starts from a named view",
        ),
        ({"frames": [7]}, "has frames 0 to 6, not 7"),
        ({"frames": []}, "holds no frame yet"),
        ({"size": (0, 3)}, "width must be 1 to"),
        ({"size": (20_000, 3)}, "width must be 1 to"),
        ({"slower": 0.0}, "slower must be a number > 0"),
        ({"slower": float("nan")}, "slower must be a number > 0"),
        ({"background": "blurple"}, "is no colour"),
    ],
)
def test_what_cannot_be_shown(recording, dots, tmp_path, options, says):
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RenderingError, match=says):
        gasp.render(recording, tmp_path / "a.mp4", **({"size": SIZE} | options))
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_neither_run_nor_splat(tmp_path):
    with pytest.raises(RecordingError, match="there is no such recording, scene or splat file"):
        open_footage(tmp_path / "none")
    (tmp_path / "empty.gasp").mkdir()
    with pytest.raises(RecordingError, match="is no recording"):
        open_footage(tmp_path / "empty.gasp")
    (tmp_path / "text.ply").write_text("hello")
    with pytest.raises(SplatFormatError):
        open_footage(tmp_path / "text.ply")


def test_a_recording_without_placements_refuses_cameras_of_files(recording):
    file = recording.path / "zarr.json"
    node = json.loads(file.read_text())
    del node["attributes"]["objects"][0]["placement"]
    file.write_bytes(sealed(node))
    with pytest.raises(RecordingError, match="does not say how its objects were placed"):
        Recording.open(recording.path).placement("blob")
    with pytest.raises(RecordingError, match='has no object "pot", its objects are blob'):
        recording.placement("pot")


@pytest.fixture
def live(falling_scene, dots, tmp_path):
    def make(*names, scene=falling_scene, **options):
        paths = [tmp_path / name for name in names]
        return LiveFilm(tmp_path / "run.gasp", scene, paths, width=SIZE[0], height=SIZE[1], **options)

    return make


def test_a_run_is_filmed_while_it_goes_on(run_of, falling_scene, live, tmp_path):
    film = live("frames", "a.png")
    seen = []

    def recorded(frame):
        seen.append(frame)
        assert Recording.open(tmp_path / "run.gasp").frame_count == frame + 1
        film.recorded(frame)

    with film:
        run_of(falling_scene, recorded=recorded)
    assert seen == list(range(7))
    assert film.problem == ""
    assert len(list((tmp_path / "frames").iterdir())) == 7 and (tmp_path / "a.png").exists()


def test_a_run_that_goes_on_is_filmed_from_its_beginning(run_of, falling_scene, live, tmp_path):
    run_of(falling_scene, frames=3)
    with live("frames") as film:
        run_of(falling_scene, resume=True, recorded=film.recorded)
    assert len(list((tmp_path / "frames").iterdir())) == 7


def test_a_run_that_fails_leaves_the_film_of_its_frames(run_of, falling_scene, live, tmp_path):
    engine = dataclasses.replace(falling_scene.engine, options={"fault": "nan", "fault_time": 0.12})
    scene = dataclasses.replace(falling_scene, engine=engine)
    with pytest.raises(gasp.GaspError), live("frames", scene=scene) as film:
        run_of(scene, recorded=film.recorded)
    assert len(list((tmp_path / "frames").iterdir())) == 3


def test_a_film_that_fails_does_not_stop_the_run(run_of, falling_scene, live, dots, tmp_path, monkeypatch):
    film = live("frames")
    calls = []

    def failing(*args, **options):
        calls.append(1)
        raise RenderingError("no more paper")

    monkeypatch.setattr(dots, "render", failing)
    with film:
        run = run_of(falling_scene, recorded=film.recorded)
    assert run.status == "complete"
    assert film.problem == "no more paper" and len(calls) == 1
    assert not film.anew
    assert [path.name for path in tmp_path.iterdir()] == ["run.gasp"]


def test_no_frame_no_film_and_no_complaint(live, tmp_path):
    with live("frames", "a.mp4") as film:
        pass
    assert film.problem == "" and list(tmp_path.iterdir()) == []


def test_what_is_thrown_is_expected_where_it_goes(run_of, falling_scene, live):
    (item,) = falling_scene.objects
    thrown = dataclasses.replace(falling_scene, objects=(dataclasses.replace(item, velocity=(10.0, 0, 0)),))
    with live("frames", scene=thrown) as film:
        run_of(thrown, recorded=film.recorded)
    assert film.problem == "" and not film.anew


def test_a_film_that_lost_its_subject_is_made_anew(run_of, falling_scene, live, dots, tmp_path):
    # A wind that the forecast knows nothing of.
    blown = dataclasses.replace(falling_scene, gravity=(150.0, 0, 0))
    with live("frames", "a.mp4", scene=falling_scene) as film:
        run = run_of(blown, recorded=film.recorded)
    assert film.problem == "" and film.anew
    assert dots.sizes.count(SIZE) == 2 * 7
    assert len(list((tmp_path / "frames").iterdir())) == 7 and (tmp_path / "a.mp4").exists()
    for frame, camera in enumerate(film.cameras):
        places, depths = camera.project(run.splats(frame).means)
        assert (depths > 0).all() and (places > 0).all() and (places < SIZE).all()
    assert not list(tmp_path.glob(".*"))


def test_a_run_that_is_over_is_filmed_once_from_where_all_of_it_is_seen(run_of, falling_scene, live, dots):
    run = run_of(dataclasses.replace(falling_scene, gravity=(150.0, 0, 0)))
    with live("frames", scene=falling_scene) as film:
        film.recorded(run.frame_count - 1)
    assert film.problem == "" and not film.anew
    assert dots.sizes.count(SIZE) == 7
    for frame, camera in enumerate(film.cameras):
        places, depths = camera.project(run.splats(frame).means)
        assert (depths > 0).all() and (places > 0).all() and (places < SIZE).all()


def test_a_camera_that_the_scene_places_stays_there(run_of, falling_scene, live):
    choice = gasp.CameraChoice(position=(0, -1, 0), target=(0, -2, 0))
    away = dataclasses.replace(falling_scene, camera=choice)
    with live("frames", scene=away) as film:
        run_of(away, recorded=film.recorded)
    assert not film.anew


def flown(recording, scene, count=7):
    """How far the mean of the forecast's subject goes from the first frame to the last."""
    forecast = Forecast(RecordedFootage(recording), scene, count)
    assert forecast.positions(0) == pytest.approx(RecordedFootage(recording).splats(0).means)
    return (forecast.positions(count - 1) - forecast.positions(0)).mean(axis=0)


def test_where_matter_will_be(recording, falling_scene):
    free = dataclasses.replace(falling_scene, colliders=())
    # In steps of a hundredth of a second, of first order: g t dt / 2 too far.
    assert flown(recording, free) == pytest.approx([0, 0, -0.5 * 9.81 * 0.24 * 0.25], abs=1e-9)
    (item,) = free.objects
    thrown = dataclasses.replace(free, objects=(dataclasses.replace(item, velocity=(2.0, 1.0, 0)),))
    assert flown(recording, thrown)[:2] == pytest.approx([0.48, 0.24])
    assert (flown(recording, dataclasses.replace(free, gravity=(0.0, 0, 0))) == 0).all()


def test_what_falls_is_expected_to_lie_on_what_is_below_it(recording, falling_scene):
    lowest = recording.splats(0).means[:, 2].min()
    long = dataclasses.replace(falling_scene, duration=4.0)
    # The floor is at -0.5.
    assert flown(recording, long, 101)[2] == pytest.approx(-0.5 - lowest, abs=1e-6)
    box = gasp.Collider(shape=gasp.BoxShape(center=(0, 0, -0.6), half_extents=(1, 1, 0.4)))
    assert flown(recording, dataclasses.replace(long, colliders=(box,)), 101)[2] == pytest.approx(
        -0.2 - lowest, abs=1e-6
    )
    # A box around it, whose walls stop it as well.
    room = gasp.Collider(shape=gasp.BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1)), side=gasp.Side.INSIDE)
    (item,) = long.objects
    thrown = dataclasses.replace(long, colliders=(room,), objects=(dataclasses.replace(item, velocity=(3.0, 0, 0)),))
    furthest = recording.splats(0).means[:, 0].max()
    assert flown(recording, thrown, 101)[0] == pytest.approx(1 - furthest, abs=1e-6)


def test_friction_stops_what_is_expected_to_slide(recording, falling_scene):
    lowest = float(recording.splats(0).means[:, 2].min())
    floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, lowest), normal=(0, 0, 1)), friction=0.5)
    (item,) = falling_scene.objects
    slid = dataclasses.replace(
        falling_scene,
        duration=4.0,
        colliders=(floor,),
        objects=(dataclasses.replace(item, velocity=(2.0, 0, 0)),),
    )
    # v^2 / (2 mu g), to half a step at its first speed.
    assert flown(recording, slid, 101)[0] == pytest.approx(4 / (2 * 0.5 * 9.81), abs=0.01 * 2)


def test_what_is_held_is_expected_to_stay_or_to_be_led(recording, falling_scene):
    everywhere = gasp.SphereShape(center=(0, 0, 0.5), radius=0.1)
    pinned = dataclasses.replace(falling_scene, drives=(gasp.Pinned(region=everywhere),))
    assert (flown(recording, pinned) == 0).all()
    led = gasp.Driven(region=everywhere, velocity=(0.0, 1.0, 0.0), end=0.12)
    moved = flown(recording, dataclasses.replace(falling_scene, drives=(led,)))
    # Led for half of the time, then let go.
    assert moved[1] == pytest.approx(0.24) and moved[2] == pytest.approx(-0.5 * 9.81 * 0.12 * 0.13, rel=1e-6)


def test_a_collider_of_a_file_is_drawn_and_left_out_where_the_file_is_gone(falling_scene, tmp_path, caplog):
    box = tmp_path / "box.ply"
    trimesh.creation.box(extents=(0.4, 0.4, 0.2)).export(box)
    shape = MeshShape(file=box, up="+z", position=(0, 0, 0))
    scene = dataclasses.replace(falling_scene, colliders=(gasp.Collider(shape=shape),))
    (drawn,) = SceneFootage(scene, tmp_path).colliders
    eye = np.array([0.0, 0.0, 3.0])
    hit = nearest_hits([drawn], eye, np.array([[0.0, 0.0, -1.0], [0.3, 0.0, -1.0]])).depth
    # The box stands on the floor; its field has 96 cells along it, whose corners are rounded, not its faces.
    assert hit == pytest.approx([2.8, np.inf], abs=0.4 / 96)
    box.unlink()
    assert SceneFootage(scene, tmp_path).colliders == ()
    assert "collider 1 is not drawn" in caplog.text and "no such file" in caplog.text


def test_a_frame_alone_is_seen_from_where_the_film_sees_it(run_of, falling_scene, dots, tmp_path):
    run = run_of(dataclasses.replace(falling_scene, camera=gasp.CameraChoice(turns=1.0)))

    def rotations(out, **options):
        dots.cameras.clear()
        gasp.render(run, tmp_path / out, size=SIZE, colliders=False, **options)
        return [camera.rotation for camera in dots.cameras if (camera.width, camera.height) == SIZE]

    film = rotations("film")
    assert len(film) == 7 and np.abs(film[4] - film[0]).max() > 0.5
    (alone,) = rotations("one.png", frames=[4])
    np.testing.assert_allclose(alone, film[4], atol=1e-9)
    # Those of a turntable go around once, whichever they are.
    around = rotations("around", frames=[2, 4], turntable=True)
    np.testing.assert_allclose(around[1][2], around[0][2] * [-1, -1, 1], atol=1e-9)


def test_a_run_at_an_address_is_filmed(run_of, falling_scene, dots, tmp_path, monkeypatch):
    pytest.importorskip("fsspec")
    monkeypatch.setenv("GASP_CACHE", str(tmp_path / "cache"))
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    gasp.simulate(falling_scene, engine=engine, out="memory://films/run.gasp", frames=2, progress=False)
    gasp.render("memory://films/run.gasp", tmp_path / "a.png", size=SIZE, frames=[1])
    assert painted(tmp_path / "a.png").shape == (64, 96, 3)


def test_a_pack_is_framed_as_its_run_is_and_no_backdrop_is_in_the_picture(run_of, falling_scene, cameras_of, tmp_path):
    (blob,) = falling_scene.objects
    beside = [
        dataclasses.replace(blob, name=name, static=True, material=None, height=height, position=(0, away, 0))
        for name, height, away in (("pot", 0.5, 0.5), ("house", 9.0, 8.0))
    ]
    run = run_of(dataclasses.replace(falling_scene, objects=(beside[1], blob, beside[0])))
    gasp.pack(run, tmp_path / "a.sog")
    film, packed = RecordedFootage(run), open_footage(tmp_path / "a.sog")
    assert len(packed.subject(0)) == len(film.subject(0)) == 2 * len(blob.splat)
    assert packed.in_subject.sum() == film.in_subject.sum()
    for one, other in zip(cameras_of(film), cameras_of(packed)):
        # Places of a .sog are of 16 bits of what is there, scales of a codebook.
        np.testing.assert_allclose(other.position, one.position, atol=0.02)
