"""Colliders that move are in the picture."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from splat_shells import SHAPES as SPLATS
from splat_shells import shell

from gasp_core import Elastic, Recording, SplatObject, write_splat
from gasp_core.contract import BoxShape, Collider, HalfSpace, KeyframedMotion, SignedDistanceField, SphereShape
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import RecordedFootage, SceneFootage
from gasp_core.rendering.forecast import Forecast
from gasp_core.rendering.framing import frame_motion, motion_of
from gasp_core.rendering.movers import Movers
from gasp_core.scene.file_shapes import SplatShape

COMING = KeyframedMotion(times=(0.0, 0.4), places=((-3, 0, 0), (-1, 0, 0)), center=(0, 0, 0))
SOFT = Elastic(density=300, youngs_modulus=1e4, poissons_ratio=0.3)
BALL = SphereShape(center=(0, 0, 0), radius=0.2)
SHAPES = {
    "box": BoxShape(center=(0, 0, 0), half_extents=(0.1, 0.2, 0.3)),
    "ball": BALL,
    "field": SignedDistanceField.sampled(BALL, (-0.4, -0.4, -0.4), (0.4, 0.4, 0.4), 0.05),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_dots_lie_on_the_surface_and_go_with_it(shape):
    movers = Movers.of([Collider(shape=shape, motion=COMING)], 10.0)
    assert np.abs(shape.signed_distance(movers.at(0.2) - [-2, 0, 0])).max() <= 0.05 + 1e-9
    extent = np.ptp(movers.at(0.2), axis=0)
    wanted = 2 * np.asarray(getattr(shape, "half_extents", [0.2] * 3))
    assert (np.abs(extent - wanted) <= 0.11).all()


def test_what_stands_has_no_end_or_is_much_larger_is_none():
    plane = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
    colliders = [Collider(shape=BALL), Collider(shape=plane, motion=COMING), Collider(shape=BALL, motion=COMING)]
    assert Movers.of(colliders, 0.1).colliders == ()
    assert Movers.of(colliders, 1.0).colliders == (colliders[2],)
    assert Movers.of((), 1.0).at(0.3).shape == (0, 3)


def test_they_are_measured_and_not_drawn(scene_of, run, tmp_path):
    scene = dataclasses.replace(
        scene_of(duration=0.4, height=1.0), colliders=(Collider(shape=SHAPES["box"], motion=COMING),)
    )
    scene = dataclasses.replace(scene, gravity=(0, 0, 0))
    path = tmp_path / "a.gasp"
    # The engine of the tests takes planes alone.
    recorded = run(dataclasses.replace(scene, colliders=()), path)
    footage = RecordedFootage(Recording.open(recorded.path))
    footage.__dict__["_colliders"] = scene.colliders
    dots = footage.movers.at(0.0)
    assert len(dots) > 100
    assert len(footage.drawn(0)) == len(footage.matter(0)) == len(footage.subject(0)) - len(dots)
    assert isinstance(footage.subject(0), RenderInput) and (footage.subject(0).opacities[-len(dots) :] == 1).all()
    for moving in (footage, Forecast(footage, scene, footage.frame_count)):
        camera = frame_motion(motion_of(moving), width=300, height=200, around=20, above=20)
        for frame in range(footage.frame_count):
            seen, depths = camera.project(footage.movers.at(frame / 25))
            assert (depths > 0).all()
            assert ((seen >= 0) & (seen <= [300, 200])).all()


def test_a_splat_that_is_an_object_too_is_drawn_once_and_twice_where_one_of_them_goes_elsewhere(scene_of, tmp_path):
    file = tmp_path / "ball.ply"
    write_splat(file, shell(SPLATS["sphere"], count=3_000))
    placed = {"up": "+z", "height": 0.5, "position": (1.0, 2.0, 3.0)}
    shape = SplatShape(file=file, **placed)
    standing = SplatObject(name="statue", splat=file, static=True, **placed)
    falling = dataclasses.replace(standing, static=False, material=SOFT)

    def drawn(collider, item):
        scene = scene_of()
        scene = dataclasses.replace(scene, objects=(*scene.objects, item), colliders=(collider,))
        return len(SceneFootage(scene, tmp_path / "a.toml").colliders)

    assert drawn(Collider(shape=shape), standing) == 0
    assert drawn(Collider(shape=dataclasses.replace(shape, height=0.6)), standing) == 1
    assert drawn(Collider(shape=shape, motion=COMING), standing) == 1
    assert drawn(Collider(shape=shape), falling) == 1
