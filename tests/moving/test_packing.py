"""Runs as moving splats: as near to what was recorded as asked for, in every way in which points carry Gaussians."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
import zipfile

import numpy as np
import pytest

from gasp_core import (
    Elastic,
    EngineAccuracy,
    MovingSplat,
    Part,
    PythonMotion,
    Recording,
    Reduction,
    SphereShape,
    Swing,
    pack,
    read_splat,
    simulate,
)
from gasp_core.errors import GaspError, RecordingError
from gasp_core.games import matter_rotations
from gasp_core.moving.header import HEADER
from gasp_core.moving.packing import _order


@pytest.mark.parametrize(
    "way", ["all", "cores", *(pytest.param(way, marks=pytest.mark.thorough) for way in ("levels", "frames")), "volume"]
)
@pytest.mark.parametrize("error", [pytest.param(1e-3, marks=pytest.mark.thorough), 1e-5])
def test_no_gaussian_is_farther_off_than_asked_for(recorded, ways, tmp_path, way, error):
    kind, reduction = ways[way]
    recording = recorded(reduction)
    told = pack(recording, tmp_path / "a.sog", error=error)
    splat = MovingSplat.open(tmp_path / "a.sog")
    assert [body.kind for body in splat.header.bodies] == [kind]
    assert len(splat) == recording.frame_count == told.frames
    np.testing.assert_allclose(splat.times, recording.times)
    order, _ = _order(recording)
    diagonal = np.linalg.norm(np.ptp(recording.reference.means, axis=0))
    assert told.allowed_error == pytest.approx(error * diagonal)
    largest = 0.0
    for frame in range(len(splat)):
        found, wanted = splat.gaussians(frame), recording.gaussians(frame).select(order)
        largest = max(largest, np.linalg.norm(found.means - wanted.means, axis=1).max())
    assert largest <= error * diagonal
    # The file knows it, of frames in float32.
    assert splat.header.largest_error == pytest.approx(largest, abs=1e-6 * diagonal)


@pytest.mark.parametrize("way", ["all", "cores", "levels", "frames", "volume"])
def test_shapes_and_turns_are_those_that_were_recorded(recorded, ways, tmp_path, way):
    recording = recorded(ways[way][1])
    pack(recording, tmp_path / "a.sog")
    splat = MovingSplat.open(tmp_path / "a.sog")
    order, _ = _order(recording)
    last = len(splat) - 1
    found, wanted = splat.gaussians(last).covariances(), recording.gaussians(last).select(order).covariances()
    rest = recording.reference.select(order).covariances()
    size = np.abs(wanted).max(axis=(1, 2))
    # Rotations of a .sog are known to 1/180, scales to the steps of its codebook: a few hundredths of a covariance.
    assert np.percentile(np.abs(found - wanted).max(axis=(1, 2)) / size, 99) < 0.06
    assert np.median(np.abs(wanted - rest).max(axis=(1, 2)) / size) > 0.3


def test_harmonics_turn_with_the_matter(recorded, tmp_path, ball):
    rng = np.random.default_rng(0)
    harmonics = np.concatenate([ball.harmonics, rng.normal(scale=0.2, size=(len(ball), 8, 3))], axis=1)
    recording = recorded(Reduction(mode="volume"), ball.with_(harmonics=harmonics.astype(np.float32)))
    pack(recording, tmp_path / "a.sog")
    splat, (order, _) = MovingSplat.open(tmp_path / "a.sog"), _order(recording)
    last = len(splat) - 1
    found, wanted = splat.gaussians(last), recording.gaussians(last).select(order)
    np.testing.assert_allclose(found.harmonics, wanted.harmonics, atol=0.05)
    assert np.abs(wanted.harmonics - recording.reference.select(order).harmonics).max() > 0.2
    drawn = splat.splats(last)
    np.testing.assert_array_equal(drawn.means, found.means)
    (rows, simplices), *_ = splat.simplices(last)
    turns = matter_rotations(simplices, splat.reference.select(rows), np.zeros(len(rows), dtype=bool))
    np.testing.assert_allclose(drawn.turns, turns, atol=1e-6)


def test_frames_in_any_order(recorded, tmp_path):
    recording = recorded(Reduction(mode="cores", count=30), duration=2.0)
    assert recording.frame_count > 2 * 24
    pack(recording, tmp_path / "a.sog")
    one, other = MovingSplat.open(tmp_path / "a.sog"), MovingSplat.open(tmp_path / "a.sog")
    inorder = [one.gaussians(frame).means for frame in range(len(one))]
    for frame in (50, 3, 3, 2, 49, 0, 24, 23):
        np.testing.assert_array_equal(other.gaussians(frame).means, inorder[frame])
    with pytest.raises(IndexError):
        one.gaussians(len(one))
    with pytest.raises(IndexError):
        one.gaussians(-1)


def test_whoever_reads_sog_sees_the_splat_at_rest(recorded, tmp_path):
    recording = recorded(Reduction(mode="volume"))
    pack(recording, tmp_path / "a.sog")
    splat, still = MovingSplat.open(tmp_path / "a.sog"), read_splat(tmp_path / "a.sog")
    order, _ = _order(recording)
    # It lies as trained splats do, y down, about the middle of where it stands.
    world = still.means[:, [0, 2, 1]] * [1, 1, -1] + splat.header.origin
    np.testing.assert_allclose(world, recording.reference.means[order], atol=3e-5)
    np.testing.assert_allclose(splat.reference.means, world, atol=1e-6)


def test_what_stands_still_and_what_moves_by_itself(recorded, scene_of, run, ball, tmp_path):
    swing = Swing(axis=(0, 0, 1), pivot=(0, 0, 0), amplitude=0.5, frequency=1.0)
    recording = recorded(Reduction(mode="cores", count=20), region=SphereShape(center=(0, 0, 0.3), radius=0.2))
    swinging = run(scene_of(ball, motion=swing, height=0.4, reduction=Reduction(mode="volume")), tmp_path / "b.gasp")
    for number, one in enumerate((recording, swinging)):
        pack(one, tmp_path / f"{number}.sog")
        splat, (order, _) = MovingSplat.open(tmp_path / f"{number}.sog"), _order(one)
        last = len(splat) - 1
        diagonal = np.linalg.norm(np.ptp(one.reference.means[one.moving], axis=0))
        off = splat.gaussians(last).means - one.gaussians(last).select(order).means
        # Those that never move are where a .sog has them.
        moving = one.moving[order]
        assert np.linalg.norm(off[moving], axis=1).max() <= 1e-4 * diagonal
        assert np.abs(off[~moving]).max(initial=0.0) <= 1e-4
    assert [body.kind for body in splat.header.bodies] == ["free"]


def test_a_single_gaussian(scene_of, run, cloud, tmp_path):
    recording = run(scene_of(cloud(1), velocity=(1.0, 0.0, 0.0)), tmp_path / "a.gasp")
    told = pack(recording, tmp_path / "a.sog")
    splat = MovingSplat.open(tmp_path / "a.sog")
    last = len(splat) - 1
    off = splat.gaussians(last).means - recording.gaussians(last).means
    assert np.linalg.norm(off) <= told.allowed_error == 1e-4 * recording.reference.scales.max()


def test_the_same_run_always_gives_the_same_bytes(recorded, tmp_path):
    recording = recorded(Reduction(mode="volume"))
    pack(recording, tmp_path / "a.sog")
    pack(recording, tmp_path / "b.sog")
    assert (tmp_path / "a.sog").read_bytes() == (tmp_path / "b.sog").read_bytes()


def test_errors_that_cannot_be_kept(recorded, tmp_path):
    recording = recorded(Reduction(mode="all"))
    with pytest.raises(RecordingError, match="above 0"):
        pack(recording, tmp_path / "a.sog", error=0.0)
    with pytest.raises(RecordingError, match="cannot be kept"):
        pack(recording, tmp_path / "a.sog", error=1e-12)
    assert [path.name for path in tmp_path.iterdir()] == ["a.gasp"]


@pytest.fixture(scope="module")
def packed(flown, tmp_path_factory):
    path = tmp_path_factory.mktemp("packed") / "good.sog"
    pack(Recording.open(flown(Reduction(mode="volume"))), path)
    return path.read_bytes()


def again(content, tmp_path, **changes):
    """The file with members exchanged: bytes, None to leave out, or a function of what was there."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(stream, "w") as new:
        for name in old.namelist():
            change = changes.get(name, old.read(name))
            if callable(change):
                change = change(old.read(name))
            if change is not None:
                new.writestr(name, change)
    path = tmp_path / "bad.sog"
    path.write_bytes(stream.getvalue())
    return path


def with_header(**changes):
    """A change of motion.json; of its first body where the name begins so."""

    def change(text):
        header = json.loads(text)
        for name, value in changes.items():
            if name.startswith("body_"):
                header["bodies"][0][name.removeprefix("body_")] = value
            else:
                header[name] = value
        return json.dumps(header).encode()

    return {HEADER: change}


BAD = {
    "of a newer version": (with_header(version=3), "of version 3, this GASP reads up to 2: update GASP"),
    "of another kind": (with_header(format="film"), "of no moving splat"),
    "of no frames": (with_header(frames=0), "frames"),
    "of more frames than there are": (with_header(frames=500), "it is cut off"),
    "of a body elsewhere": (with_header(body_last=10**6), "Gaussians that it does not have"),
    "of a body of nothing": (with_header(body_first=5, body_last=5), "one behind the other"),
    "carried by magic": (with_header(body_kind="magic"), "one of volume, cores, free"),
    "of fewer points": (with_header(body_points=7), "is damaged"),
    "of more points": (with_header(body_points=10**6), "is damaged"),
    "of fewer Gaussians": (with_header(body_last=700), "is damaged"),
    "of no quantum": (with_header(quantum=0), "quantum"),
    "of a rate that is none": (with_header(frame_rate="fast"), "frame_rate"),
    "without what carries": ({"motion/0/labels": None}, "lacks 'labels'"),
    "with points cut off": ({"motion/0/points": lambda data: data[:-4]}, "places are cut off"),
    "with points nowhere": ({"motion/0/points": lambda data: b"\xff" * len(data)}, "a place is no number"),
    "with labels that point nowhere": ({"motion/0/labels": lambda data: data[:2] + b"\xfe" * len(data[2:])}, "rows"),
    "with labels cut off": ({"motion/0/labels": lambda data: data[:-1]}, "cut off"),
    "with labels that go on": ({"motion/0/labels": lambda data: data + b"0"}, "too long"),
    "with weights of more than one": ({"motion/0/weights": lambda data: data[:2] + b"\x07" * len(data[2:])}, "weights"),
    "without frames": ({"motion/frames_0000": None}, "has lost motion/frames_0000"),
    "with frames cut off": ({"motion/frames_0000": lambda data: data[: len(data) // 2]}, "is damaged"),
    "with frames of nowhere": ({"motion/frames_0000": lambda data: b"\xff" * len(data)}, "is damaged"),
    "with frames that go on": ({"motion/frames_0000": lambda data: data + bytes(10**7)}, "longer than it can be"),
    "without a picture": ({"scales.webp": None}, "scales.webp"),
}


@pytest.mark.parametrize("what", BAD)
def test_damage_is_one_clear_line(packed, tmp_path, what):
    changes, told = BAD[what]
    path = again(packed, tmp_path, **changes)
    with pytest.raises(GaspError) as refused:
        splat = MovingSplat.open(path)
        for frame in range(len(splat)):
            splat.gaussians(frame)
    assert told in str(refused.value)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_cut_off_anywhere(packed, tmp_path):
    path = tmp_path / "cut.sog"
    for length in np.linspace(0, len(packed) - 1, 60).astype(int):
        path.write_bytes(packed[:length])
        with pytest.raises(GaspError) as refused:
            MovingSplat.open(path)
        assert "\n" not in str(refused.value)


def test_what_is_no_moving_splat(ball, tmp_path):
    from gasp_core import write_splat

    write_splat(tmp_path / "still.sog", ball)
    with pytest.raises(RecordingError, match=r"has no motion\.json"):
        MovingSplat.open(tmp_path / "still.sog")
    with pytest.raises(RecordingError, match="No such file"):
        MovingSplat.open(tmp_path / "missing.sog")
    with pytest.raises(RecordingError, match="Is a directory"):
        MovingSplat.open(tmp_path)


def test_a_run_that_stopped_before_its_first_frame(recorded, tmp_path):
    recording = recorded(Reduction(mode="all"))
    shutil.rmtree(recording.path / "commits")
    with pytest.raises(RecordingError):
        pack(Recording.open(recording.path), tmp_path / "a.sog")
    assert not (tmp_path / "a.sog").exists()


def test_a_run_that_goes_on_meanwhile(flight, tmp_path):
    reduction = Reduction(mode="cores", count=30)
    recording = flight(reduction, tmp_path / "a.gasp", frames=3)

    def go_on():
        if recording.frame_count == 3:
            flight(reduction, tmp_path / "a.gasp", frames=6, resume=True)

    told = pack(recording, tmp_path / "a.sog", progress=go_on)
    splat = MovingSplat.open(tmp_path / "a.sog")
    assert recording.frame_count == 6
    assert told.frames == len(splat) == 3
    order, _ = _order(recording)
    for frame in range(len(splat)):
        off = splat.gaussians(frame).means - recording.gaussians(frame).select(order).means
        assert np.linalg.norm(off, axis=1).max() <= told.allowed_error


@pytest.mark.parametrize("composition", ["carried", "driven"])
def test_what_psi_stretches_is_not_bounded(scene_of, cloud, tmp_path, composition):
    """Nine times as large, where physics may stretch by two, and an object beside it that physics alone moves."""
    everywhere = Part(region=SphereShape(center=(0, 0, 0), radius=9), driven=True)
    growing = PythonMotion(function=lambda points, s: (1 + 100 * s) * points, composition=composition)
    scene = scene_of(
        cloud(40),
        motion=growing,
        parts=(everywhere,) if composition == "driven" else (),
        duration=0.08,
        gravity=(0, 0, 0),
        # Coarse and soft: it is led, and what its stresses would do is nothing to see here.
        material=Elastic(density=1000, youngs_modulus=1e3, poissons_ratio=0.3),
        accuracy=EngineAccuracy(resolution=4),
    )
    other = dataclasses.replace(scene.objects[0], name="other", motion=None, parts=(), position=(50.0, 0, 0))
    scene = dataclasses.replace(scene, objects=(*scene.objects, other))
    recording = simulate(scene, "reference-mpm", tmp_path / "run.gasp", progress=False)
    pack(recording, tmp_path / "a.sog")
    splat, (order, _) = MovingSplat.open(tmp_path / "a.sog"), _order(recording)
    last = len(splat) - 1
    found, wanted = splat.gaussians(last), recording.gaussians(last).select(order)
    grown = np.sort(wanted.scales, axis=1) / np.sort(recording.reference.select(order).scales, axis=1)
    assert splat.header.alpha is None
    assert grown.max() == pytest.approx(9, rel=1e-3) and grown.min() == pytest.approx(1, rel=1e-2)
    # Scales to the steps of a codebook.
    np.testing.assert_allclose(np.sort(found.scales, axis=1), np.sort(wanted.scales, axis=1), rtol=0.06)


def test_whoever_allows_more_gets_no_more(recorded, ways, tmp_path):
    """Steps as coarse as all that is allowed would want corrections that take more than the steps save."""
    recording = recorded(ways["cores"][1])
    allowed = (1e-4, 1e-3, 1e-2, 0.1)
    sizes = [pack(recording, tmp_path / f"{error}.sog", error=error).motion for error in allowed]
    assert sizes == sorted(sizes, reverse=True)
