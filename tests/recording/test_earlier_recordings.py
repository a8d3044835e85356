"""Recordings of every version so far: their frames can be read, and runs be gone on with."""

from __future__ import annotations

import dataclasses
import importlib.util
import io
import json
import shutil
import sys
import zipfile
from pathlib import Path

import flying_points
import numpy as np
import pytest

from gasp_core import EngineChoice, Gaussians, Recording
from gasp_core.errors import RecordingError
from gasp_core.moving.packing import pack
from gasp_core.moving.reading import MovingSplat
from gasp_core.recording.migrations import VERSION
from gasp_core.recording.nodes import sealed
from gasp_core.scene.schema import SCHEMA
from gasp_core.scene.settings import CameraChoice, MapChoice

KEPT = Path(__file__).parents[1] / "recording_versions"
FIELDS = ("means", "quaternions", "scales", "opacities", "harmonics")


FRAMES_KEPT = 4
"""Of the seven that were wanted: the runs were stopped there."""


def _load(name):
    spec = importlib.util.spec_from_file_location(name, KEPT / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


_load("swaying")
scenes = _load("scenes")
VERSIONS = range(1, VERSION)
OTHER_CORES = 2


@pytest.fixture
def kept(tmp_path):
    """Unpacks the recording of a version, and what that version itself read in it."""

    def unpack(version):
        with zipfile.ZipFile(KEPT / f"version_{version}.zip") as packed:
            packed.extractall(tmp_path)
            truth = np.load(io.BytesIO(packed.read("truth.npz")))
        return tmp_path / "recording.gasp", truth

    return unpack


def test_a_body_of_an_object_that_there_is_not_is_refused(kept):
    path, _ = kept(3)

    def change(attributes):
        attributes["bodies"][0]["item"] = 9

    rewritten(path, change)
    with pytest.raises(RecordingError, match="the header of the recording is damaged"):
        Recording.open(path)


def rewritten(path, change):
    """The header of a recording, changed."""
    file = path / "zarr.json"
    node = json.loads(file.read_text())
    change(node["attributes"])
    file.write_bytes(sealed(node))


def compare(found: Gaussians, truth, frame):
    for name in FIELDS:
        # The same arithmetic on other processors: a few roundings of a double, of float32 for harmonics.
        tolerance = 1e-5 if name == "harmonics" else 1e-9
        np.testing.assert_allclose(getattr(found, name), truth[f"{name}_{frame}"], rtol=tolerance, atol=tolerance)


def test_there_is_a_recording_of_every_version_before_this_one():
    assert sorted(int(path.stem.removeprefix("version_")) for path in KEPT.glob("version_*.zip")) == list(VERSIONS)


@pytest.mark.parametrize("version", VERSIONS)
def test_its_frames_are_what_they_were(kept, version):
    path, truth = kept(version)
    assert json.loads((path / "zarr.json").read_text())["attributes"]["version"] == version
    recording = Recording.open(path)
    assert recording.frame_count == FRAMES_KEPT
    assert recording.forgotten == ()
    for frame in range(recording.frame_count):
        compare(recording.gaussians(frame), truth, frame)
    assert recording.has_velocities is (version == 1)


@pytest.mark.parametrize("version", VERSIONS)
def test_its_frames_need_nothing_of_its_scene_but_what_the_header_of_today_keeps(kept, version):
    """A key that has gone, and even a value that no scene has any more, harms no frame."""
    path, truth = kept(version)

    def age(attributes):
        text = attributes["scene"].replace("[scene]", "[scene]\ntempo = 3")
        attributes["scene"] = text.replace('model = "elastic"', 'model = "phlogiston"') + "[weather]\nrain = true\n"

    rewritten(path, age)
    recording = Recording.open(path)
    for frame in range(recording.frame_count):
        compare(recording.gaussians(frame), truth, frame)


@pytest.mark.parametrize("version", [version for version in VERSIONS if version != OTHER_CORES])
def test_a_run_of_it_is_gone_on_with(kept, run, tmp_path, version):
    """To the end that a run of today comes to, which never stopped; with the cores that it was begun with.

    Those of today are others: since 0.2.0 clusters are made in another way.
    """
    path, _ = kept(version)
    begun = Recording.open(path).start_points
    recording = run(scenes.scene(version), path, resume=True)
    whole = run(scenes.scene(version), tmp_path / "whole.gasp")
    assert (recording.status, recording.frame_count) == ("complete", whole.frame_count)
    assert np.array_equal(recording.start_points, begun)
    rows, points = np.ones(len(recording.reference), dtype=bool), np.ones(len(begun), dtype=bool)
    for body in recording.bodies:
        if body.carrier.kind == "cores":
            rows[body.rows], points[body.points] = False, False
    assert rows.any() and points.any()
    np.testing.assert_allclose(begun[points], whole.start_points[points], rtol=0, atol=1e-12)
    if all(body.carrier.kind == "all" for body in recording.bodies):
        assert recording.header.points_digest == whole.header.points_digest
    for frame in (FRAMES_KEPT, whole.frame_count - 1):
        for name in FIELDS:
            found, expected = (getattr(own.gaussians(frame), name) for own in (recording, whole))
            np.testing.assert_allclose(found[rows], expected[rows], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("version", [version for version in VERSIONS if version != OTHER_CORES])
def test_one_that_is_gone_on_with_says_what_with(kept, run, version):
    path, _ = kept(version)
    digest = Recording.open(path).header.scene_digest
    scene = dataclasses.replace(scenes.scene(version), duration=0.16, camera=CameraChoice(view="top"))
    found = run(scene, path, resume=True)
    assert (found.status, found.scene.duration, found.scene.camera) == ("complete", 0.16, scene.camera)
    assert found.header.scene_digest == digest
    assert run(scene, path, resume=True).status == "complete"


def test_where_the_points_have_become_others_that_is_said(kept, run):
    """Since version 4 a core has the moments of its vertices: a run of before cannot go on with those of today."""
    path, _ = kept(OTHER_CORES)
    with pytest.raises(RecordingError, match="makes other points of the scene than the one that recorded it"):
        run(scenes.scene(OTHER_CORES), path, resume=True)
    assert Recording.open(path).frame_count == FRAMES_KEPT


@pytest.mark.parametrize("version", [*VERSIONS, VERSION])
def test_another_scene_or_other_options_are_refused_whatever_the_version(kept, run, tmp_path, version):
    if version == VERSION:
        path = tmp_path / "now.gasp"
        run(scenes.scene(version), path, frames=2)
    else:
        path, _ = kept(version)
    scene = scenes.scene(version)
    before = sorted(file.relative_to(path) for file in path.rglob("*"))
    for changed, says in (
        ({"gravity": (0.0, 0.0, -1.6)}, "the scene, or a file that it names, has changed"),
        (
            {"engine": EngineChoice(name="ballistic", options={"spin": 0.6})},
            r"options \(spin = 3.0\) -> \(spin = 0.6\)",
        ),
        ({"engine": EngineChoice(name="ballistic", options={"spin": 3.0}, seed=1)}, "seed 0 -> 1"),
    ):
        fields = {name: getattr(scene, name) for name in scene.__dataclass_fields__} | changed
        with pytest.raises(RecordingError, match=says):
            run(type(scene)(**fields), path, resume=True)
    assert sorted(file.relative_to(path) for file in path.rglob("*")) == before


def test_a_key_that_has_gone_and_decided_nothing_does_not_keep_a_run_from_going_on(run, tmp_path):
    """It was at its default, so the digest of today's version never knew of it."""
    path = tmp_path / "run.gasp"
    run(scenes.scene(1), path, frames=3)
    rewritten(path, lambda attributes: attributes.update(scene=attributes["scene"] + "[weather]\nrain = false\n"))
    assert Recording.open(path).forgotten == ("weather",)
    assert run(scenes.scene(1), path, resume=True).status == "complete"


def test_a_key_that_has_gone_from_an_older_recording_is_named_where_it_may_have_decided(kept, run):
    path, _ = kept(1)
    rewritten(path, lambda attributes: attributes.update(scene=attributes["scene"] + "[weather]\nrain = true\n"))
    with pytest.raises(RecordingError, match=r"keys that this GASP does not know any more.*\(weather\)"):
        run(scenes.scene(1), path, resume=True)


def test_what_scenes_could_say_once_is_passed_over_where_it_did_nothing(cloud, run, tmp_path):
    """How a static object would be simulated; an alpha below 1 shrank what was at rest, and is 1."""
    path = tmp_path / "run.gasp"
    scene = dataclasses.replace(scenes.scene(1), maps=MapChoice(alpha=1.0))
    run(scene, path, frames=3)
    whole = Recording.open(path).gaussians(2)

    def age(attributes):
        attributes["maps"]["alpha"] = 0.5
        text = attributes["scene"].replace(f"schema = {SCHEMA}", "schema = 2").replace("alpha = 1.0", "alpha = 0.5")
        moving, still = text.split('name = "still"')
        still = still.replace("velocity = [0.0, 0.0, 0.0]", "velocity = [1.0, 0.0, 0.0]", 1)
        attributes["scene"] = f'{moving}name = "still"{still}'

    rewritten(path, age)
    kept = Recording.open(path)
    assert "alpha = 0.5" in kept.header.scene and "velocity = [1.0, 0.0, 0.0]" in kept.header.scene
    assert kept.scene.maps.alpha == 1 and kept.forgotten == ()
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(kept.gaussians(2), name), getattr(whole, name))
    pack(kept, tmp_path / "a.sog")
    assert MovingSplat.open(tmp_path / "a.sog").header.alpha == 1
    assert run(scene, path, resume=True).status == "complete"


def test_an_option_that_is_new_since_does_not_keep_a_run_from_going_on(run, tmp_path, monkeypatch):
    path = tmp_path / "run.gasp"
    run(scenes.scene(1), path, frames=3)
    later = dataclasses.make_dataclass("Options", [("glow", float, 0.0)], bases=(flying_points.Options,), frozen=True)
    monkeypatch.setattr(flying_points, "Options", later)
    assert run(scenes.scene(1), path, resume=True).status == "complete"
    shutil.rmtree(path)
    run(scenes.scene(1), path, frames=3)
    rewritten(path, lambda attributes: attributes["engine"]["options"].update(flavour="sweet"))
    with pytest.raises(RecordingError, match="flavour"):
        run(scenes.scene(1), path, resume=True)
