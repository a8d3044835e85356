import numpy as np
import pytest
from flown_water import flown_water
from gasp_viewer import layers
from gasp_viewer.current_frame import Moment
from gasp_viewer.display_units import SIZE, Stage, shown_motion
from gasp_viewer.faces import PackedFaces
from gasp_viewer.layers import LAYERS, PackedPoints, layers_of, thinned
from gasp_viewer.packing import PackedSplats
from splat_shells import SHAPES, shell

from gasp_core import pack
from gasp_core.io import write_splat
from gasp_core.rendering.footage import open_footage

# Positions on the stage are float32 numbers below 4.
ROUNDED = 4 * 2.0**-24


@pytest.fixture
def stage(toy_footage):
    return Stage.of(shown_motion(toy_footage, 0))


def colours_for(layer):
    return np.random.default_rng(0).uniform(size=(len(layer.elements), 3))


def test_a_run_has_gaussians_triangles_and_points(toy_footage, stage):
    assert list(layers_of(toy_footage, stage)) == ["gaussians", "triangles", "points"]


def test_a_file_has_a_body_and_no_points(tmp_path, toy):
    write_splat(tmp_path / "toy.ply", toy)
    footage = open_footage(tmp_path / "toy.ply", "+z")
    assert list(layers_of(footage, Stage.of(shown_motion(footage, 0)))) == ["gaussians", "triangles", "solid"]
    assert set(LAYERS) == {"gaussians", "triangles", "points", "solid"}


def test_the_body_of_a_file_is_dots_on_its_surface(tmp_path):
    ball = shell(SHAPES["sphere"], count=3_000)
    write_splat(tmp_path / "ball.ply", ball)
    footage = open_footage(tmp_path / "ball.ply", "+z")
    stage = Stage.of(shown_motion(footage, 0))
    layer = layers_of(footage, stage)["solid"]
    packed = layer.pack(Moment(footage, 0), colours_for(layer))
    assert isinstance(packed, PackedPoints)
    distances = SHAPES["sphere"].distance(stage.world(packed.points))
    # A node is moved along a slope of the distance that is its own.
    assert np.abs(distances).max() < 0.02
    assert np.ptp(stage.world(packed.points), axis=0) == pytest.approx(1.0, abs=0.05)
    assert layer.note.startswith("0.52")
    nearest = ball.means[layer.elements.gaussians]
    assert np.linalg.norm(nearest - stage.world(packed.points), axis=1).max() < 0.15


def test_a_file_without_a_body_says_so(tmp_path, toy):
    write_splat(tmp_path / "faint.ply", toy.with_(opacities=np.full(len(toy), 0.01)))
    footage = open_footage(tmp_path / "faint.ply", "+z")
    layer = layers_of(footage, Stage.of(shown_motion(footage, 0)))["solid"]
    assert len(layer.pack(Moment(footage, 0), colours_for(layer)).points) == 1
    assert layer.note == "nothing is inside"


def test_every_gaussian_goes_with_the_point_at_its_mean(toy_footage, stage):
    elements = layers_of(toy_footage, stage)["gaussians"].elements
    moment = Moment(toy_footage, 4)
    # Points and means come from the same displacements, the means by way of the inverse map: some float64 roundings.
    np.testing.assert_allclose(moment.points[elements.points], moment.splats.means, atol=1e-12)


def test_static_gaussians_go_with_no_point(tmp_path, toy, scene_of, record, falling):
    from gasp_core import Elastic, SplatObject

    moving = SplatObject(
        name="a",
        splat=toy,
        angular_velocity=(0, 0, falling.TURN),
        material=Elastic(density=1, youngs_modulus=1e5, poissons_ratio=0.3),
    )
    still = SplatObject(name="b", splat=toy.select(np.arange(100)), static=True)
    record(scene_of(toy, objects=(still, moving), frames=2), tmp_path / "run.gasp")
    footage = open_footage(tmp_path / "run.gasp")
    elements = layers_of(footage, Stage.of(shown_motion(footage, 0)))["gaussians"].elements
    assert (elements.points[:100] == -1).all()
    np.testing.assert_array_equal(elements.points[100:] % 4, 0)


def test_points_are_the_engines_and_know_their_gaussian(toy_footage, stage):
    layer = layers_of(toy_footage, stage)["points"]
    moment = Moment(toy_footage, 3)
    packed = layer.pack(moment, colours_for(layer))
    assert isinstance(packed, PackedPoints)
    np.testing.assert_allclose(packed.points, stage.place(moment.points), atol=ROUNDED)
    np.testing.assert_array_equal(layer.elements.gaussians, np.repeat(np.arange(2000), 4))
    assert SIZE / 500 <= packed.size <= SIZE / 100
    assert layer.note == ""


def test_faces_are_the_simplices(toy_footage, stage):
    layer = layers_of(toy_footage, stage)["triangles"]
    moment = Moment(toy_footage, 3)
    packed = layer.pack(moment, colours_for(layer))
    assert isinstance(packed, PackedFaces)
    # Four faces of 2000 tetrahedra, two halves each; every foot of a height lies in its tetrahedron's box.
    feet = packed.positions.reshape(2000, 8, 3)
    corners = stage.place(moment.simplices[0])
    assert (feet >= corners.min(axis=1, keepdims=True) - ROUNDED).all()
    assert (feet <= corners.max(axis=1, keepdims=True) + ROUNDED).all()
    np.testing.assert_array_equal(layer.elements.gaussians, np.repeat(np.arange(2000), 4))


def test_what_is_thinned_says_so_and_keeps_to_its_limit(toy_footage, stage, monkeypatch):
    monkeypatch.setattr(layers, "POINT_LIMIT", 1000)
    monkeypatch.setattr(layers, "FACE_LIMIT", 1000)
    found = layers_of(toy_footage, stage)
    moment = Moment(toy_footage, 2)
    points = found["points"].pack(moment, colours_for(found["points"]))
    faces = found["triangles"].pack(moment, colours_for(found["triangles"]))
    assert len(points.points) == len(points.colours) == 1000
    assert len(faces.positions) == len(faces.colours) == 2000
    assert found["points"].note == "1,000 of 8,000 points, drawn at random"
    assert found["triangles"].note == "1,000 of 8,000 triangles, drawn at random"
    rows = found["points"].elements.points
    np.testing.assert_allclose(points.points, stage.place(moment.points[rows]), atol=ROUNDED)
    # Every vertex of the simplices has its share: 250 of 1000, but for chance (five deviations of a binomial).
    assert (np.abs(np.bincount(rows % 4) - 250) < 5 * np.sqrt(1000 * 0.25 * 0.75)).all()


def test_thinning_is_always_the_same_and_in_order():
    rows = thinned(10_000, 100)
    np.testing.assert_array_equal(rows, thinned(10_000, 100))
    assert (np.diff(rows) > 0).all() and len(rows) == 100
    np.testing.assert_array_equal(thinned(7, 7), np.arange(7))


def test_gaussians_wear_the_colours_they_are_given(toy_footage, stage):
    layer = layers_of(toy_footage, stage)["gaussians"]
    colours = colours_for(layer)
    packed = layer.pack(Moment(toy_footage, 1), colours)
    assert isinstance(packed, PackedSplats)
    # Half a byte's step.
    np.testing.assert_allclose(packed.buffer[:, 7:].view(np.uint8)[:, :3] / 255, colours, atol=0.5 / 255 + 1e-12)


def test_what_has_flowed_is_shown_of_a_pack_as_of_its_run(tmp_path):
    recording = flown_water(tmp_path / "water.gasp")
    pack(recording, tmp_path / "water.sog")
    last, count = recording.frame_count - 1, len(recording.reference)
    buffers = []
    for name in ("water.gasp", "water.sog"):
        footage = open_footage(tmp_path / name)
        found = Moment(footage, last).drawn
        np.testing.assert_array_equal(found.splats.means, footage.drawn(last).means)
        np.testing.assert_array_equal(found.splats.opacities, footage.drawn(last).opacities)
        layer = layers_of(footage, Stage.of(shown_motion(footage, 0)))["gaussians"]
        buffers.append([layer.pack(Moment(footage, frame), colours_for(layer)).buffer for frame in (0, last)])
    (first, flown), (packed_first, packed_flown) = buffers
    # As many rows in every frame, of which those that there are not yet are nothing.
    assert len(first) == len(flown) == len(packed_first) == len(packed_flown) > count
    assert not packed_first[count:].any() and packed_flown[count:].any()
