"""Directions of a scene: of length 1, and the same to the last bit however often the scene is written and read."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core import Bend, Collider, Elastic, HalfSpace, Part, Pinned, Scene, SplatObject, Swing, Wave, Wind
from gasp_core.errors import SceneError
from gasp_core.scene import scene_to_toml
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.loading import read_stored_scene

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
NUMBERS = st.one_of(st.floats(-1, 1), st.floats(allow_nan=False, allow_infinity=False), st.just(0.0))
DIRECTIONS = st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(any)


def floor(normal):
    return HalfSpace(point=(0, 0, 0), normal=normal)


def scene(one, other):
    """With oblique ones wherever a direction may stand."""
    both = {"frequency": 1, "composition": "frozen", "axis": one, "pivot": (0, 0, 0), "amplitude": 1}
    motions = (
        Swing(**both),
        Bend(**both, direction=other, length=1),
        Wave(**both, direction=other, wavelength=1),
    )
    objects = [
        SplatObject(
            name=motion.kind,
            splat=Path("/a.ply"),
            up="+z",
            material=SOFT,
            motion=motion,
            region=floor(other),
            parts=(Part(region=floor(one), pinned=True),),
        )
        for motion in motions
    ]
    return Scene(
        duration=1.0,
        frame_rate=10.0,
        objects=tuple(objects),
        colliders=(Collider(shape=floor(one)), Collider(shape=floor(other))),
        drives=(Pinned(region=floor(other)),),
        force_fields=(Wind(velocity=(1, 0, 0), drag=1.0, region=floor(one)),),
    )


@given(DIRECTIONS, DIRECTIONS)
@settings(max_examples=200, deadline=None)
def test_a_scene_that_is_written_and_read_is_the_same(one, other):
    written = scene(one, other)
    kept, forgotten = read_stored_scene(scene_to_toml(written), file="a")
    assert kept == written
    assert forgotten == ()
    sources = ["a"] * len(written.objects)
    assert scene_digest(kept, sources) == scene_digest(written, sources)


@given(DIRECTIONS)
@settings(max_examples=200, deadline=None)
def test_a_direction_has_length_1_and_where_it_pointed(direction):
    found = floor(direction).normal
    # Each quotient is off by 3 roundings of 2^-53, the length that is taken of them by 2 more.
    assert abs(math.hypot(*found) - 1) <= 5 * 2**-53
    largest = max(map(abs, direction))
    index = [abs(component) for component in direction].index(largest)
    for own, wanted in zip(found, direction):
        # Below 1e-308 of the largest there is nothing to point by.
        assert own / found[index] == pytest.approx(wanted / direction[index], rel=8 * 2**-53, abs=1e-300)
    assert floor(found).normal == found


def test_zero_is_no_direction():
    with pytest.raises(SceneError, match=r"HalfSpace\.normal must not be the zero vector"):
        floor((0.0, -0.0, 0.0))
