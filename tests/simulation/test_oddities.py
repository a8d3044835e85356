"""What is possible and probably not meant is told, by name."""

from __future__ import annotations

import dataclasses

import flying_points
import numpy as np
import pytest

from gasp_core import (
    BoxShape,
    Driven,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Gaussians,
    Impulse,
    Part,
    Pinned,
    RecordingChoice,
    Reduction,
    Rigid,
    SphereShape,
    VaryingMaterial,
    Wave,
    Wind,
    simulate,
    write_splat,
)
from gasp_core.contract import (
    Collider,
    ContactCondition,
    KeyframedMotion,
    PointCloud,
    PointProblem,
    SignedDistanceField,
)
from gasp_core.simulation.estimate import estimate_run
from gasp_core.simulation.idle_acts import idle_acts
from gasp_core.simulation.oddities import own_contact
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.grid import grid_node


def notes(run, scene, tmp_path):
    return run(scene, tmp_path / "a.gasp", frames=1).notes


def jelly(density):
    return Elastic(density=density, youngs_modulus=1e5, poissons_ratio=0.3)


def varying(modulus):
    return VaryingMaterial.of(Elastic, density=400, youngs_modulus=np.full(40, modulus), poissons_ratio=0.3)


NEAR, FAR = SphereShape(center=(0, 0, 0), radius=0.3), SphereShape(center=(0, 0, -9), radius=1)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"material": jelly(1.6)}, 'object "thing": its density of 1.6 kg/m^3 is less than any solid'),
        ({"material": jelly(4e5)}, 'object "thing": its density of 400000 kg/m^3 is more than any metal'),
        ({"height": 300.0}, "lengths are in metres"),
        ({"velocity": (0, 4000, 0)}, 'object "thing": it starts at 4,000 m/s, faster than an airliner'),
        ({"height": 1e-4}, "lengths are in metres"),
        ({"height": 30.0}, "it is 3"),
        ({"material": Elastic(density=400, youngs_modulus=200, poissons_ratio=0.3)}, "sinks into a heap under its own"),
        ({"material": varying(200)}, "with youngs_modulus = 200 it sinks into a heap under its own"),
        ({"gravity": (0, 0, 9.81)}, "gravity = [0, 0, 9.81] pulls up: in a scene down is -z"),
        ({"gravity": (0, -9.81, 0)}, "gravity = [0, -9.81, 0] pulls sideways"),
        ({"metres_per_unit": 1000.0}, "lengths are in metres"),
        ({"drives": (Pinned(region=SphereShape(center=(0, 0, 9), radius=1)),)}, "drive 1 (pinned): its region holds"),
        ({"force_fields": (Wind(region=BoxShape(center=(9, 0, 0), half_extents=(1, 1, 1))),)}, "wind 1: its region"),
        (
            {"gravity": (0, 0, 0), "drives": (Pinned(region=FAR, start=0.1),)},
            "drive 1 (pinned): its region holds nothing as it begins, at 0.1 s",
        ),
        ({"drives": (Impulse(region=NEAR, start=0.5),)}, "(impulse): it starts at 0.5 s, and the run ends at 0.4 s"),
        (
            {"drives": (Impulse(region=NEAR, start=0.4),)},
            "when the run ends: an impulse at the very end is never given",
        ),
        (
            {"drives": (Pinned(region=NEAR, start=0.4),)},
            "(pinned): it starts at 0.4 s, just when the run ends: it never",
        ),
        ({"force_fields": (Wind(start=2.0),)}, "wind 1: it starts at 2 s, and the run ends at 0.4 s: it never acts"),
        ({"force_fields": (Wind(velocity=(9, 0, 0), drag=0),)}, "wind 1: with drag = 0 it takes nothing along"),
        # It lasts longer than its last frame.
        ({"drives": (Impulse(region=NEAR, start=0.41),), "duration": 0.43}, "at 0.41 s, and the run ends at 0.4 s"),
        ({"duration": 0.43}, "duration = 0.43 is no whole number of frames at 25 a second: the last one is at 0.4 s"),
        ({"duration": 0.3333333, "frame_rate": 30}, "the last one is at 0.3 s, and the 0.0333 s after it are left out"),
        ({"duration": 0.03}, "duration = 0.03 is less than a frame, which is 0.04 s at 25 frames a second: nothing is"),
    ],
)
def test_it_is_told_by_name(run, scene_of, tmp_path, options, says):
    assert any(says in note for note in notes(run, scene_of(**options), tmp_path))


@pytest.mark.parametrize(
    "options",
    [
        {"material": jelly(400), "height": 0.4},
        {"material": varying(1e5), "height": 0.4},
        {"drives": (Pinned(region=SphereShape(center=(0, 0, 0), radius=0.3)),)},
        # Matter may come to it until then.
        {"drives": (Pinned(region=SphereShape(center=(0, 0, -9), radius=1), start=0.1),)},
        {"force_fields": (Wind(velocity=(1, 0, 0)),)},
        {"drives": (Driven(region=NEAR, velocity=(1, 0, 0)), Impulse(region=NEAR, start=0.36))},
        {"gravity": (1, 1, -9)},
        {"gravity": (0, 0, 0), "material": Elastic(density=400, youngs_modulus=200, poissons_ratio=0.3)},
        {"gravity": (0, 0, 0), "velocity": (0, 0, 1), "drives": (Pinned(region=FAR, start=0.1),)},
        {"gravity": (0, 0, 0), "drives": (Impulse(region=NEAR), Pinned(region=FAR, start=0.1))},
    ],
)
def test_what_is_usual_is_not(run, scene_of, tmp_path, options):
    found = notes(run, scene_of(**options), tmp_path)
    told = (
        "its region",
        "holds nothing",
        "never",
        "duration",
        "density",
        "in metres",
        "gravity",
        "under its own weight",
        "narrow end",
    )
    assert not any(what in note for note in found for what in told)


@pytest.mark.parametrize(
    ("bodies", "declared", "says"),
    [
        ([0, 1], {}, ["objects that touch do what ballistic makes of it"]),
        ([0, 1], {"bodies_meet": False}, ["objects pass through each other: ballistic declares"]),
        ([0, 1], {"body_contacts": frozenset(ContactCondition)}, []),
        ([0, 0], {"bodies_meet": False}, []),
    ],
    ids=["its own way", "not at all", "as declared", "one body"],
)
def test_how_bodies_meet_is_told_where_the_engine_does_not_say_it(bodies, declared, says):
    engine = flying_points.descriptor()
    engine = dataclasses.replace(engine, capabilities=dataclasses.replace(engine.capabilities, **declared))
    points = PointCloud(
        reference_positions=np.eye(3)[:2],
        initial_velocities=np.zeros((2, 3)),
        reference_volumes=np.ones(2),
        material_ids=np.zeros(2),
        body_ids=np.array(bodies),
    )
    told = own_contact(PointProblem(points=points, materials=(jelly(1000.0),)), engine)
    assert len(told) == len(says)
    assert all(line.startswith(start) for line, start in zip(told, says))


def test_where_nothing_is_simulated_nothing_else_is_told_to_come_too_late(run, scene_of, tmp_path):
    scene = scene_of(duration=0.03, drives=(Pinned(region=NEAR),), force_fields=(Wind(velocity=(1, 0, 0), start=1.0),))
    recording = run(scene, tmp_path / "a.gasp")
    assert recording.frame_count == 1 and not any("never" in note for note in recording.notes)


def test_an_impulse_at_the_very_end_is_never_given(scene_of, tmp_path):
    for start, given in ((0.36, True), (0.4, False)):
        scene = scene_of(gravity=(0, 0, 0), drives=(Impulse(region=NEAR, impulse=(1, 0, 0), start=start),))
        scene = dataclasses.replace(
            scene, engine=EngineChoice(name="reference-mpm"), recording=RecordingChoice(velocities=True)
        )
        recording = simulate(dataclasses.replace(scene, accuracy=EngineAccuracy(resolution=8)), progress=False)
        assert (recording.velocities(10)[:, 0].max() > 0) == given
        assert any("never given" in note for note in recording.notes) != given


def test_a_dry_run_tells_of_all_the_scene_and_not_of_its_first_moments(scene_of, tmp_path):
    late = Impulse(region=NEAR, start=0.3)
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    told = estimate_run(scene_of(duration=0.43, drives=(late,)), tmp_path / "a.gasp", engine).notes
    assert not any("never" in note for note in told)
    assert sum("duration = 0.43 is no whole number" in note for note in told) == 1


CELL = 0.05
BLOCK = {
    "material": jelly(400),
    "reduction": Reduction(mode="all"),
    "accuracy": EngineAccuracy(spacing=CELL),
}


@pytest.fixture
def block():
    """Gaussians in a cube of four cells, and a place that is as far from nodes as one can be."""
    means = (np.indices((8, 8, 8)).reshape(3, -1).T + 0.5) * CELL / 2
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (len(means), 1)),
        scales=np.full((len(means), 3), CELL / 8),
        opacities=np.ones(len(means)),
        harmonics=np.zeros((len(means), 1, 3)),
    )


@pytest.fixture
def between(block, scene_of):
    assembly = prepare(scene_of(block, **BLOCK)).assembly
    x, y, z = np.mean(block.means, axis=0)
    node = grid_node(assembly.problem, CELL)
    return tuple(node + CELL * (np.round((np.array([x, y, z]) - node) / CELL) + 0.5))


def shifted(place, by):
    return tuple(np.array(place) + CELL * np.array(by))


@pytest.mark.parametrize("kind", [Pinned, Driven])
@pytest.mark.parametrize("start", [0.0, 0.1])
def test_what_is_to_be_held_between_nodes_is_told(scene_of, block, between, kind, start):
    def told(region, **others):
        drive = kind(region=region, start=start)
        return list(idle_acts(prepare(scene_of(block, drives=(drive,), **(BLOCK | others))).assembly, 0.4))

    (note,) = told(SphereShape(center=between, radius=0.8 * CELL))
    assert note.startswith(
        f"drive 1 ({kind.kind}): its region, a sphere of 0.04 m radius, has no node of the grid in it"
    )
    assert "cells of 0.05 m" in note and "give it a radius of 0.044 m or more, or raise the resolution" in note
    assert not told(SphereShape(center=between, radius=0.88 * CELL))
    # A node at the edge is held.
    assert not told(SphereShape(center=shifted(between, (0.3, 0.5, 0.5)), radius=0.2 * CELL))
    (note,) = told(BoxShape(center=between, half_extents=(1, 0.4 * CELL, 1)))
    assert "a box of 2 x 0.04 x 2 m" in note and "half_extents of 0.0255 m" in note
    assert not told(BoxShape(center=between, half_extents=(0.51 * CELL,) * 3))
    # Rigid bodies are held by any point.
    assert not told(SphereShape(center=between, radius=0.8 * CELL), material=Rigid(density=400))


def test_what_drives_matter_through_a_grid_is_wider_than_a_cell(scene_of, block, between):
    def told(**others):
        return list(idle_acts(prepare(scene_of(block, drives=(Driven(**others),), **BLOCK)).assembly, 0.4))

    on_a_node = SphereShape(center=shifted(between, (0.5, 0.5, 0.5)), radius=0.4 * CELL)
    assert not told(region=on_a_node)
    (note,) = told(region=on_a_node, velocity=(1, 0, 0))
    assert "is narrower than a cell:" in note and "wherever it is between nodes on its way" in note
    (note,) = told(region=SphereShape(center=between, radius=0.6 * CELL), angular_velocity=(1, 0, 0))
    assert "has no node of the grid in it" in note and "holds nothing by it where it begins" in note


def test_fields_are_asked_for_nodes_as_parts_are_held_by_them(scene_of, block, between):
    def told(radius):
        lower, upper = (shifted(between, (by, by, by)) for by in (-2, 2))
        ball = SphereShape(center=between, radius=radius * CELL)
        field = SignedDistanceField.sampled(ball, lower, upper, CELL / 8)
        return list(idle_acts(prepare(scene_of(block, drives=(Pinned(region=field),), **BLOCK)).assembly, 0.4))

    (note,) = told(0.8)
    assert "what lies nearest to it, has no node of the grid in it" in note and note.endswith("; raise the resolution")
    assert not told(0.9)
    lowest = (block.means[:, 2] < CELL).astype(int)
    part = Part(labels=lowest, label=1, pinned=True)
    assert not list(idle_acts(prepare(scene_of(block, parts=(part,), **BLOCK)).assembly, 0.4))


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


@pytest.mark.parametrize(("place", "told"), [((1, 0, -9), True), (FAR.center, False)])
def test_a_collider_that_its_motion_takes_elsewhere_at_once_is_told(scene_of, tmp_path, place, told):
    motion = KeyframedMotion(times=(0,), places=(place,), center=FAR.center)
    scene = scene_of(colliders=(Collider(shape=FAR, motion=motion),), accuracy=EngineAccuracy(resolution=8))
    found = simulate(scene, "reference-mpm", tmp_path / "a.gasp", frames=1, progress=False).notes
    said = "collider 1: its motion has its middle at [1, 0, -9] and not [0, 0, -9] from the start on"
    assert any(said in note for note in found) == told


@pytest.mark.parametrize(
    ("frequency", "options", "told"),
    [
        (24.0, {}, "swing 24 times a second, and are led by where they are at 25 frames a second"),
        (24.0, {"rate": 0.1}, ""),
        (3.0, {}, ""),
        (3.2, {}, "say frame_rate = 26"),
        (3.0, {"schedule": ((0, 0), (0.2, 0.2), (0.4, 0.8))}, "swing 9 times a second"),
        (24.0, {"composition": "carried"}, ""),
    ],
)
def test_a_swing_too_fast_for_the_frames_is_told_where_it_leads_matter(scene_of, tmp_path, frequency, options, told):
    motion = Wave(
        axis=(1, 0, 0), direction=(0, 0, 1), amplitude=0.01, wavelength=1e6, frequency=frequency,
        **{"composition": "driven", **options},
    )  # fmt: skip
    parts = (Part(region=NEAR, driven=True),) if motion.composition == "driven" else ()
    scene = scene_of(motion=motion, parts=parts, accuracy=EngineAccuracy(resolution=8))
    found = simulate(scene, "reference-mpm", tmp_path / "a.gasp", frames=1, progress=False).notes
    assert any("times a second" in note and told in note for note in found) == bool(told)
