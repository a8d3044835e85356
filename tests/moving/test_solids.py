"""Colliders in a moving splat: where they were, in every frame, and damage that is told."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest

from gasp_core import MovingSplat, Recording, Reduction, pack
from gasp_core.contract import (
    BoxShape,
    Collider,
    HalfSpace,
    KeyframedMotion,
    Side,
    SignedDistanceField,
    SphereShape,
    SteadyMotion,
)
from gasp_core.errors import RecordingError, SplatFormatError
from gasp_core.moving.header import COLLIDERS, HEADER
from gasp_core.moving.solids import entries_of, solids_of
from gasp_core.stepping.rigid_motion import pose_of

TIMES = np.arange(7) / 10
BALL = SphereShape(center=(0.2, -0.1, 0.3), radius=0.25)
FIELD = SignedDistanceField.sampled(BALL, (-0.2, -0.5, -0.1), (0.6, 0.3, 0.7), 0.02)
COLLIDERS_OF_ALL_KINDS = [
    Collider(shape=HalfSpace(point=(0, 0, 0.1), normal=(0, 0, 1))),
    Collider(shape=BoxShape(center=(0, 1, 0), half_extents=(1, 2, 3)), side=Side.INSIDE),
    Collider(shape=BALL, motion=SteadyMotion(velocity=(1, 2, 3), angular_velocity=(3, 2, 1), center=(0.1, 0, 0))),
    Collider(
        shape=FIELD,
        motion=KeyframedMotion(
            times=(0.1, 0.35, 0.5),
            places=((0, 0, 0), (1, 0, 0), (1, 1, 0)),
            quaternions=((1, 0, 0, 0), (0, 1, 0, 0), (0.5, 0.5, 0.5, 0.5)),
            center=(0.2, -0.1, 0.3),
        ),
    ),
]


def read_back(colliders, times=TIMES):
    entries, files = entries_of(colliders, times)
    return solids_of(json.loads(json.dumps(entries)), lambda name, most: files[name][: most + 1], times)


def test_they_are_what_they_were():
    found = read_back(COLLIDERS_OF_ALL_KINDS)
    assert [one.shape.kind for one in found] == [one.shape.kind for one in COLLIDERS_OF_ALL_KINDS]
    assert [one.side for one in found] == [one.side for one in COLLIDERS_OF_ALL_KINDS]
    for one, other in zip(found[:3], COLLIDERS_OF_ALL_KINDS):
        assert one.shape == other.shape
    assert [one.motion is None for one in found] == [True, True, False, False]


def test_they_are_where_they_were_in_every_frame():
    places = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    for one, other in zip(read_back(COLLIDERS_OF_ALL_KINDS)[2:], COLLIDERS_OF_ALL_KINDS[2:]):
        for time in TIMES:
            before, wanted = (pose_of(motion, time).before(places) for motion in (one.motion, other.motion))
            np.testing.assert_allclose(before, wanted, atol=1e-12)


def test_a_field_is_within_half_a_step_of_itself_near_its_surface():
    (found,) = read_back([Collider(shape=FIELD)])
    near = np.abs(FIELD.values) < 1.9 * FIELD.spacing
    assert near.sum() > 1000
    # Half a step of 1/64 of a spacing; a whole one outside, where what is rounded to nothing stays outside.
    off = np.abs(found.shape.values - FIELD.values)[near]
    assert off.max() <= FIELD.spacing / 64 * (1 + 1e-3)
    assert np.array_equal(found.shape.values > 0, FIELD.values > 0)


@pytest.mark.parametrize("count", [255, 257, 331, 530])
def test_a_field_of_many_nodes_is_made_coarser_and_stays_where_it_is(count):
    spacing = 1.0 / (count - 1)
    field = SignedDistanceField.sampled(
        SphereShape(center=(0.5, 0.1, 0.1), radius=0.08), (2 * spacing, 0, 0), (1 - 2 * spacing, 0.2, 0.2), spacing
    )
    assert 0 <= field.values.shape[0] - count <= 1
    (found,) = read_back([Collider(shape=field)])
    assert max(found.shape.values.shape) <= 256
    around = np.array([0.5, 0.1, 0.1]) + 0.08 * np.concatenate([np.eye(3), -np.eye(3)])
    # A ball's distances are off by its curvature over a step: h^2 / (8 r).
    step = found.shape.spacing
    assert np.abs(found.shape.signed_distance(around)).max() < step / 64 + 3 * step**2 / (8 * 0.08)


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("count", [300, 600])
def test_a_sheet_that_nodes_would_pass_over_has_no_holes(offset, count):
    """A plate a little thicker than a spacing, of more nodes than are kept."""
    spacing = 1 / count
    plate = BoxShape(center=(0.5, 0.2, (0.5 + offset) * spacing), half_extents=(0.5, 0.2, 0.6 * spacing))
    field = SignedDistanceField.sampled(plate, (0, 0, -2 * spacing), (1, 0.4, 3 * spacing), spacing)
    (found,) = read_back([Collider(shape=field)])
    across = np.stack(np.meshgrid(np.linspace(0.05, 0.95, 41), np.linspace(0.05, 0.35, 17), [0.0]), -1).reshape(-1, 3)
    depths = np.linspace(-3, 5, 65) * spacing
    met = np.stack([found.shape.signed_distance(across + [0, 0, depth]) for depth in depths]) <= 0
    assert met.any(axis=0).all()


def test_what_is_hardly_deep_is_there():
    values = np.full((5, 5, 5), 0.02)
    values[2, 2, 2] = -1e-4
    (found,) = read_back([Collider(shape=SignedDistanceField(origin=(0, 0, 0), spacing=0.02, values=values))])
    assert (found.shape.values < 0).sum() == 1


def test_a_pack_of_more_than_anyone_reads_is_refused():
    moving = Collider(shape=BALL, motion=SteadyMotion(velocity=(1, 0, 0)))
    with pytest.raises(ValueError, match="poses of colliders that move"):
        entries_of([moving] * 100, np.arange(10_000) / 10)
    with pytest.raises(ValueError, match="1,001 colliders"):
        solids_of([{"kind": "torus"}] * 1001, lambda *_: b"", TIMES)
    huge = {"kind": FIELD.kind, "side": "outside", "origin": [0, 0, 0], "spacing": 1.0, "nodes": [256, 256, 256]}
    with pytest.raises(ValueError, match="nodes of signed distance fields"):
        solids_of([{**huge, "nodes": [1024, 1024, 1024]}], lambda *_: b"", TIMES)


def test_a_moving_splat_has_them(recorded, tmp_path):
    recording = recorded(Reduction(mode="volume"))
    pack(recording, tmp_path / "a.sog", colliders=COLLIDERS_OF_ALL_KINDS)
    splat = MovingSplat.open(tmp_path / "a.sog")
    assert [one.shape.kind for one in splat.colliders] == [one.shape.kind for one in COLLIDERS_OF_ALL_KINDS]
    assert np.array_equal(splat.colliders[2].motion.times, splat.times)


def test_kinds_of_later_versions_are_left_out():
    entries, files = entries_of(COLLIDERS_OF_ALL_KINDS, TIMES)
    entries[0]["kind"] = "torus"
    found = solids_of(entries, lambda name, _: files[name], TIMES)
    assert [one.shape.kind for one in found] == ["box", "sphere", "signed distance field"]


def altered(**changes):
    def change(entries):
        entries[3].update(changes)

    return change


def without(name):
    def change(entries):
        del entries[3][name]

    return change


DAMAGE = {
    "no side": (without("side"), {}),
    "no spacing": (without("spacing"), {}),
    "spacing of nothing": (altered(spacing=0.0), {}),
    "too many nodes": (altered(nodes=[10**4, 10**4, 10**4]), {}),
    "negative nodes": (altered(nodes=[-4, -4, 4]), {}),
    "nodes that are none": (altered(nodes="many"), {}),
    "other nodes": (altered(nodes=[3, 3, 3]), {}),
    "a center that is none": (altered(moves=[1.0]), {}),
    "a center of words": (altered(moves="x" * 100_000), {}),
    "nodes without end": (altered(nodes=[float("inf"), 4, 4]), {}),
    "spacing beyond all numbers": (altered(spacing=10**400), {}),
    "a field cut off": (None, {"3/field": lambda data: data[:100]}),
    "poses cut off": (None, {"3/poses": lambda data: data[:-8]}),
    "poses of nowhere": (None, {"3/poses": lambda data: b"\xff" * len(data)}),
    "no field": (None, {"3/field": None}),
    "no poses": (None, {"3/poses": None}),
}


@pytest.fixture(scope="module")
def packed(flown, tmp_path_factory):
    path = tmp_path_factory.mktemp("packed") / "a.sog"
    pack(Recording.open(flown(Reduction(mode="cores", count=30))), path, colliders=COLLIDERS_OF_ALL_KINDS)
    return path


@pytest.mark.parametrize("what", DAMAGE)
def test_damage_is_one_clear_line(packed, tmp_path, what):
    change, files = DAMAGE[what]
    with zipfile.ZipFile(packed) as source, zipfile.ZipFile(tmp_path / "b.sog", "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == HEADER and change is not None:
                header = json.loads(content)
                change(header["colliders"])
                content = json.dumps(header).encode()
            alter = files.get(name.removeprefix(COLLIDERS), lambda data: data)
            if alter is not None:
                target.writestr(name, alter(content))
    with pytest.raises((RecordingError, SplatFormatError), match=r"b\.sog") as caught:
        MovingSplat.open(tmp_path / "b.sog")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000
