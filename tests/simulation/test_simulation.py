from __future__ import annotations

import dataclasses
import subprocess
import sys

import flying_points
import numpy as np
import pytest

import gasp_core
from gasp_core import (
    Collider,
    Elastic,
    EngineAccuracy,
    Floaters,
    HalfSpace,
    MapChoice,
    Recording,
    RecordingChoice,
    Sand,
    SplatObject,
)
from gasp_core.contract import Field, Status
from gasp_core.errors import (
    EngineCrashedError,
    EngineDivergedError,
    RecordingError,
    SceneError,
    SplatFormatError,
    UnknownEngineError,
    UnsupportedSceneError,
)


def frames_of(recording):
    return [recording.points(frame) for frame in range(recording.frame_count)]


def test_a_fall_is_a_fall(scene_of, run, tmp_path):
    scene = scene_of(velocity=(1.0, 0.0, 0.0))
    recording = run(scene, tmp_path / "a.gasp")
    assert (recording.status, recording.reason, recording.frame_count) == ("complete", "", 11)
    np.testing.assert_allclose(recording.times, np.arange(11) * 0.04, rtol=1e-15)
    start, end = recording.points(0), recording.points(10)
    # 400 steps of 1 ms, symplectic Euler: -g t (t + dt) / 2.
    np.testing.assert_allclose(end - start, np.tile([0.4, 0, -9.81 * 0.4 * 0.401 / 2], (len(start), 1)), atol=1e-6)
    before, after = recording.gaussians(0), recording.gaussians(10)
    np.testing.assert_allclose(after.means - before.means, (end - start)[: len(before)], atol=1e-6)
    np.testing.assert_allclose(after.covariances(), before.covariances(), rtol=1e-3, atol=1e-9)
    last = recording.diagnostics(10)
    assert last["substeps"] == 40 and last["degenerate"] == 0 and last["warnings"] == []
    mass = 1000.0 * np.unique(np.floor((start - start.min(axis=0)) / recording.header.spacing), axis=0).shape[0]
    mass *= recording.header.spacing**3
    np.testing.assert_allclose(last["kinetic_energy"], mass * (1 + (9.81 * 0.4) ** 2) / 2, rtol=1e-9)
    assert len(recording.diagnostics()) == 11


def test_frame_zero_is_the_splat(cloud, scene_of, run, tmp_path):
    splat = cloud(100, degree=3)
    frame = run(scene_of(splat), tmp_path / "a.gasp").gaussians(0)
    np.testing.assert_allclose(frame.means, splat.means, atol=1e-6)
    np.testing.assert_allclose(frame.covariances(), splat.covariances(), rtol=1e-9, atol=1e-12)
    assert np.array_equal(frame.harmonics, splat.harmonics)
    assert np.array_equal(frame.opacities, splat.opacities)


def test_a_turn_turns_shapes_and_colours(cloud, scene_of, run, tmp_path):
    from gasp_core.harmonics import basis

    splat = cloud(60, degree=2)
    scene = scene_of(splat, gravity=(0.0, 0.0, 0.0), options={"spin": 1.0}, angular_velocity=(0.0, 0.0, 0.0))
    recording = run(scene, tmp_path / "a.gasp")
    frame = recording.gaussians(10)
    # Explicit steps of a turn by 1e-3 rad stretch by 5e-7 each; 400 of them.
    cosine, sine = np.cos(0.4), np.sin(0.4)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    np.testing.assert_allclose(frame.covariances(), turn @ splat.covariances() @ turn.T, rtol=2e-3, atol=1e-5)
    directions = np.random.default_rng(0).normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    expected = np.einsum("nk,nkc->nc", basis(directions @ turn, 2), splat.harmonics)
    found = np.einsum("nk,nkc->nc", basis(directions, 2), frame.harmonics)
    np.testing.assert_allclose(found, expected, atol=2e-3 * 9)


def test_static_and_dropped_gaussians(cloud, scene_of, run, tmp_path):
    splat = cloud(50)
    opacities = splat.opacities.copy()
    opacities[:7] = 0.01
    splat = splat.with_(opacities=opacities)
    scene = scene_of(splat, min_opacity=0.05, region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    ground = SplatObject(name="ground", splat=cloud(9, 5, degree=1), static=True)
    scene = dataclasses.replace(scene, objects=(ground, *scene.objects))
    recording = run(scene, tmp_path / "a.gasp")
    assert len(recording.reference) == 9 + 43
    assert recording.reference.sh_degree == 1
    first, last = recording.gaussians(0), recording.gaussians(10)
    np.testing.assert_allclose(first.means[9:], splat.means[7:], atol=1e-12)
    moved = np.abs(last.means - first.means).max(axis=1) > 0.1
    assert np.array_equal(moved, recording.moving)
    assert np.array_equal(moved[9:], splat.means[7:, 2] <= 0)
    assert any("7 of 50 Gaussians are below min_opacity" in note for note in recording.notes)
    assert any("outside the region" in note for note in recording.notes)
    assert recording.header.objects[1].set_aside["faint"] == 7
    assert list(recording.simplices(10)) == ["thing"]


def test_what_starts_within_a_collider_is_told(cloud, scene_of, run, tmp_path):
    scene = scene_of(cloud(50))
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    recording = run(dataclasses.replace(scene, colliders=(floor,)), tmp_path / "a.gasp", frames=2)
    depth = -recording.start_points[:, 2]
    inside = int((depth > 0.5 * recording.header.spacing).sum())
    assert 0 < inside < len(depth)
    (note,) = (note for note in recording.notes if "inside collider" in note)
    assert note.startswith(f'object "thing": {inside} points, ')
    assert f"start inside collider 1 (plane), the deepest by {depth.max():.3g} m" in note


def test_a_body_far_out_keeps_the_shape_of_its_small_parts(cloud, scene_of, run, tmp_path):
    """At 1e4 m a float32 has a spacing of 1 mm; displacements less their mean know these edges to 1e-3 all the same."""
    splat = cloud(50)
    scene = scene_of(splat, position=(1e4, -1e4, 1e4), velocity=(2e4, 0.0, 0.0))
    recording = run(scene, tmp_path / "a.gasp")
    first, last = recording.gaussians(0), recording.gaussians(10)
    np.testing.assert_allclose(last.covariances(), first.covariances(), rtol=1e-3, atol=1e-7)
    np.testing.assert_allclose((last.means - first.means)[:, 0], 8000, rtol=1e-9)


def test_the_engine_is_given_the_spacing_and_its_typed_options(scene_of, tmp_path):
    engine = flying_points.Ballistic()
    scene = scene_of(options={"spin": 0}, accuracy=EngineAccuracy(resolution=10))
    gasp_core.simulate(scene, (flying_points.descriptor(), engine), tmp_path / "a.gasp")
    problem, accuracy, options, restart = engine.opened[0]
    assert accuracy.spacing == Recording.open(tmp_path / "a.gasp").header.spacing
    assert options == flying_points.Options(spin=0.0)
    assert restart is None
    assert problem.points.size > 10 * accuracy.spacing * 0.99


def test_without_a_place_it_is_temporary(scene_of, run):
    recording = run(scene_of(duration=0.08), None)
    assert recording.frame_count == 3 and recording.path.is_dir()


FAULTS = {
    "nan": (Status.NON_FINITE, "1 of 160 points are no longer finite, first 3"),
    "gain": (Status.ENERGY_GREW, "kinetic energy"),
    "jump": (Status.NOT_CONVERGED, "jumped"),
    "stretch": (Status.NOT_CONVERGED, "more than 20 times"),
    "limit": (Status.SUBSTEP_LIMIT, "too many substeps"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_run_that_is_no_longer_credible_stops_and_keeps_what_was_good(fault, scene_of, run, tmp_path):
    status, words = FAULTS[fault]
    path = tmp_path / "a.gasp"
    with pytest.raises(EngineDivergedError) as caught:
        run(scene_of(options={"fault": fault, "fault_time": 0.2}), path)
    error = caught.value
    assert error.report.status is status
    assert error.recording == path
    assert words in str(error) and "frame 5" in str(error) and "\n" not in str(error)
    if fault != "limit":
        assert "try substep_fraction = 0.4" in str(error)
    recording = Recording.open(path)
    assert (recording.status, recording.frame_count) == ("incomplete", 5)
    assert recording.reason == str(error)
    for points in frames_of(recording):
        assert np.isfinite(points).all()


def test_an_engine_for_which_no_step_is_too_long_is_given_no_shorter_one_as_a_remedy(scene_of, tmp_path):
    ballistic = flying_points.descriptor()
    can = dataclasses.replace(ballistic.capabilities, unconditionally_stable=True)
    engine = (dataclasses.replace(ballistic, capabilities=can), flying_points.Ballistic())
    for fault, advised in (("nan", False), ("gain", True)):
        scene = scene_of(options={"fault": fault, "fault_time": 0.2})
        with pytest.raises(EngineDivergedError) as caught:
            gasp_core.simulate(scene, engine, tmp_path / f"{fault}.gasp")
        assert ("try substep_fraction" in str(caught.value)) is advised
        assert ("no step is too long for ballistic" in str(caught.value)) is not advised


def test_an_engine_that_falls_over(scene_of, run, tmp_path):
    with pytest.raises(EngineCrashedError, match=r"ballistic failed while advancing to 0\.2 s: ZeroDivisionError"):
        run(scene_of(options={"fault": "error", "fault_time": 0.2}), tmp_path / "a.gasp")
    recording = Recording.open(tmp_path / "a.gasp")
    assert (recording.status, recording.frame_count) == ("incomplete", 5)
    assert "ZeroDivisionError: the engine fell over" in recording.reason


def test_ctrl_c_stops_cleanly_and_resuming_gives_the_same(scene_of, run, tmp_path):
    whole = run(scene_of(options={"fault": "interrupt", "fault_time": 9.0, "spin": 1.0}), tmp_path / "whole.gasp")
    scene = scene_of(options={"fault": "interrupt", "fault_time": 0.2, "spin": 1.0})
    recording = run(scene, tmp_path / "a.gasp")
    assert (recording.status, recording.frame_count) == ("incomplete", 6)
    assert "interrupted after frame 5 of 10" in recording.reason
    again = run(scene, tmp_path / "a.gasp", resume=True)
    assert (again.status, again.frame_count) == ("complete", 11)
    for a, b in zip(frames_of(whole), frames_of(again), strict=True):
        assert np.array_equal(a, b)
    assert whole.diagnostics() == again.diagnostics()


@pytest.mark.parametrize("checkpoints", [True, False])
def test_stopping_after_some_frames_and_going_on(checkpoints, scene_of, run, tmp_path):
    whole = run(scene_of(), tmp_path / "whole.gasp")
    part = run(scene_of(), tmp_path / "a.gasp", frames=4, checkpoints=checkpoints)
    assert (part.status, part.frame_count, part.frames_wanted) == ("incomplete", 4, 11)
    assert "as asked" in part.reason
    rest = run(scene_of(), tmp_path / "a.gasp", resume=True, checkpoints=checkpoints)
    assert (rest.status, rest.frame_count) == ("complete", 11)
    for a, b in zip(frames_of(whole), frames_of(rest), strict=True):
        assert np.array_equal(a, b)
    assert run(scene_of(), tmp_path / "b.gasp", frames=1).frame_count == 1


def test_a_finished_run_goes_on_for_longer(scene_of, run, tmp_path):
    whole = run(scene_of(duration=0.8), tmp_path / "whole.gasp")
    run(scene_of(duration=0.4), tmp_path / "a.gasp")
    longer = run(scene_of(duration=0.8), tmp_path / "a.gasp", resume=True)
    assert (longer.status, longer.frame_count) == ("complete", 21)
    for a, b in zip(frames_of(whole), frames_of(longer), strict=True):
        assert np.array_equal(a, b)


def test_resuming_what_is_finished_takes_nothing_back(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    first = run(scene_of(), path, checkpoints=False)
    stamp = (path / "commits" / "00000003" / "zarr.json").stat().st_mtime_ns
    again = run(scene_of(), path, checkpoints=False, resume=True)
    assert (again.status, again.frame_count) == ("complete", first.frame_count)
    assert (path / "commits" / "00000003" / "zarr.json").stat().st_mtime_ns == stamp
    run(scene_of(), tmp_path / "b.gasp", frames=6)
    fewer = run(scene_of(), tmp_path / "b.gasp", frames=3, resume=True)
    assert (fewer.status, fewer.frame_count) == ("incomplete", 6)
    assert "6 of 11" in fewer.reason


def test_resuming_where_nothing_is_begins(scene_of, run, tmp_path):
    assert run(scene_of(), tmp_path / "a.gasp", resume=True).status == "complete"


def test_resuming_something_else_is_refused(scene_of, run, tmp_path, cloud):
    path = tmp_path / "a.gasp"
    run(scene_of(), path)
    with pytest.raises(RecordingError, match="scene, or a file that it names, has changed"):
        run(scene_of(gravity=(0.0, 0.0, -1.0)), path, resume=True)
    with pytest.raises(RecordingError, match="scene, or a file that it names, has changed"):
        run(scene_of(cloud(40, 7)), path, resume=True)
    other = dataclasses.replace(scene_of(), engine=dataclasses.replace(scene_of().engine, seed=4))
    with pytest.raises(RecordingError, match=r"engine is not the one .*seed 0 -> 4"):
        run(other, path, resume=True)
    with pytest.raises(RecordingError, match="a recording is there already"):
        run(scene_of(), path)
    assert Recording.open(path).status == "complete"


def test_only_a_recording_is_overwritten(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    run(scene_of(), path)
    assert run(scene_of(duration=0.2), path, overwrite=True).frame_count == 6
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "dear.txt").write_text("diary")
    with pytest.raises(RecordingError, match="is no recording"):
        run(scene_of(), tmp_path / "notes", overwrite=True)
    assert (tmp_path / "notes" / "dear.txt").read_text() == "diary"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.gasp", "notes"]


def test_an_unwritable_place_leaves_nothing(scene_of, run, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be written"):
        run(scene_of(), tmp_path / "file" / "a.gasp")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_full_disk_keeps_the_frames_before(scene_of, run, tmp_path, monkeypatch):
    from gasp_core.recording import writer

    path, real = tmp_path / "a.gasp", writer.replace_file

    def full(file, content):
        if file.parent.name == "00000004":
            raise OSError(28, "No space left on device")
        real(file, content)

    monkeypatch.setattr(writer, "replace_file", full)
    with pytest.raises(RecordingError, match="frame 4 cannot be written: No space left"):
        run(scene_of(), path)
    recording = Recording.open(path)
    assert (recording.status, recording.frame_count) == ("incomplete", 4)
    monkeypatch.undo()
    assert run(scene_of(), path, resume=True).status == "complete"


def test_what_the_engine_cannot_do_is_refused_before_anything_is_written(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    sand = scene_of(material=Sand(density=1, youngs_modulus=1, poissons_ratio=0.2))
    with pytest.raises(UnsupportedSceneError, match=r'ballistic does not model sand \(object "thing"\)'):
        run(sand, path)
    with pytest.raises(UnsupportedSceneError, match="velocities"):
        run(scene_of(recording=RecordingChoice(velocities=True)), path, fields=frozenset())
    with pytest.raises(SceneError, match="spn"):
        run(scene_of(options={"spn": 1.0}), path)
    with pytest.raises(UnknownEngineError, match="no-such-engine"):
        gasp_core.simulate(scene_of(), engine="no-such-engine", out=path)
    with pytest.raises(SplatFormatError):
        run(scene_of(tmp_path / "missing.ply"), path)
    with pytest.raises(SceneError, match="frames"):
        run(scene_of(), path, frames=0)
    assert not any(tmp_path.iterdir())


def test_velocities_are_kept_where_asked_for(scene_of, run, tmp_path):
    recording = run(scene_of(recording=RecordingChoice(velocities=True)), tmp_path / "a.gasp")
    np.testing.assert_allclose(recording.velocities(10)[:, 2], -9.81 * 0.4, rtol=1e-6)
    with pytest.raises(RecordingError, match="velocities were not recorded"):
        run(scene_of(), tmp_path / "b.gasp").velocities(0)


def test_an_engine_that_shows_positions_only(scene_of, run, tmp_path):
    recording = run(scene_of(), tmp_path / "a.gasp", fields=frozenset())
    assert recording.diagnostics(10)["kinetic_energy"] is None
    assert recording.diagnostics(10)["inverted"] is None
    assert recording.status == "complete"


def test_clipping_is_counted(scene_of, run, tmp_path):
    recording = run(scene_of(options={"spin": 8.0}, maps=MapChoice(alpha=1.0)), tmp_path / "a.gasp")
    # Explicit steps of a fast turn stretch by 3e-5 each, so that alpha = 1 clips everything by the end.
    assert recording.diagnostics(0)["clipped"] == 0
    assert recording.diagnostics(10)["clipped"] == 40


def test_degenerate_simplices_keep_their_last_frame(scene_of, run, tmp_path, monkeypatch):
    """Points of one simplex that fall together have no shape: it keeps the last it had, and is counted.

    All numbers here are sums of a few powers of two, and so are their means over 128 points: float32 holds them.
    """
    count = 32
    splat = gasp_core.Gaussians(
        means=np.random.default_rng(0).integers(-16, 16, size=(count, 3)) / 16,
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), 2.0**-5),
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
    )
    scene = scene_of(splat, vertices=4, maps=MapChoice(edge_floor=0.0), gravity=(0.0, 0.0, 0.0))
    read = flying_points.Session.read

    def changed(self, fields):
        state = read(self, fields)
        positions = np.array(state.positions)
        stretch = 1.0 if self.time < 0.1 else 2.0 if self.time < 0.19 else 0.0
        positions[21:24] = positions[20] + stretch * (positions[21:24] - positions[20])
        return dataclasses.replace(state, positions=positions)

    monkeypatch.setattr(flying_points.Session, "read", changed)
    recording = run(scene, tmp_path / "a.gasp")
    assert [entry["degenerate"] for entry in recording.diagnostics()] == [0] * 5 + [1] * 6
    assert recording.commit(10).degenerate == [[[5, 4]]]
    rest = splat.covariances()[5]
    for frame, factor in ((0, 1), (4, 4), (5, 4), (10, 4)):
        np.testing.assert_allclose(recording.gaussians(frame).covariances()[5], factor * rest, rtol=1e-12, atol=1e-18)
    # A run that was stopped in between remembers as well.
    run(scene, tmp_path / "b.gasp", frames=8)
    again = run(scene, tmp_path / "b.gasp", resume=True)
    assert again.commit(10).degenerate == recording.commit(10).degenerate


def test_progress_goes_to_stderr_and_says_what_was_set_aside(cloud, scene_of, tmp_path, capfd):
    splat = cloud()
    splat = splat.with_(opacities=np.where(np.arange(40) < 3, 0.0, 1.0))
    scene = scene_of(splat, min_opacity=0.5, floaters=Floaters.DROP)
    gasp_core.simulate(
        scene, (flying_points.descriptor(), flying_points.Ballistic()), tmp_path / "a.gasp", progress=True
    )
    captured = capfd.readouterr()
    assert captured.out == ""
    assert "3 of 40 Gaussians are below min_opacity" in captured.err
    assert "10/10" in captured.err


def test_a_scene_of_several_bodies_with_other_vertices(cloud, scene_of, run, tmp_path):
    scene = scene_of(vertices=3)
    other = SplatObject(
        name="other",
        splat=cloud(7, 3),
        material=Elastic(density=10, youngs_modulus=1e4, poissons_ratio=0.2),
        vertices=4,
        velocity=(0, 0, 5),
    )
    scene = dataclasses.replace(
        scene,
        objects=(*scene.objects, other),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, -9), normal=(0, 0, 1))),),
    )
    recording = run(scene, tmp_path / "a.gasp")
    simplices = recording.simplices(10)
    assert simplices["thing"].shape == (40, 3, 3) and simplices["other"].shape == (7, 4, 3)
    assert recording.points(10).shape == (40 * 3 + 7 * 4, 3)
    # The text does not hold the arrays of splats in memory, but all else.
    assert recording.scene.colliders == scene.colliders
    assert recording.scene.objects[1].material == other.material


def test_importing_the_package_imports_nothing_heavy():
    code = "import sys, gasp_core; print(sorted({'numpy', 'zarr', 'numba', 'scipy', 'rich'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_every_public_name_is_there():
    for name in gasp_core.__all__:
        assert getattr(gasp_core, name) is not None
    assert set(gasp_core.__all__) <= set(dir(gasp_core))
    assert set(gasp_core._HOME_OF) == set(gasp_core.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = gasp_core.nothing


def test_fields_named_in_the_contract_are_read(scene_of, run, tmp_path):
    fields = frozenset({Field.VELOCITIES})
    assert run(scene_of(), tmp_path / "a.gasp", fields=fields).diagnostics(1)["inverted"] is None


def told_of_sound(recording):
    """Frames with the warning, and the warnings."""
    entries = enumerate(recording.diagnostics())
    return [(frame, warning) for frame, entry in entries for warning in entry["warnings"] if "sound" in warning]


def test_matter_that_outruns_its_sound_is_told_once(scene_of, tmp_path, capfd):
    # c = 10 m/s; falling from rest at 30 m/s^2 it is that fast after a third of a second, within frame 9.
    scene = scene_of(gravity=(0.0, 0.0, -30.0))
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    recording = gasp_core.simulate(scene, engine, tmp_path / "a.gasp", progress=True)
    assert recording.status == "complete"
    [(frame, warning)] = told_of_sound(recording)
    assert frame == 9
    # At the end of that frame, 0.36 s.
    assert 'object "thing" goes at 10.8 m/s, faster than sound in it (elastic: sqrt(E/rho) = 10 m/s)' in warning
    assert "youngs_modulus above rho v^2 = 1.17e+05 Pa" in warning
    shown = [line for line in capfd.readouterr().err.splitlines() if "faster than sound" in line]
    assert [line.strip() for line in shown] == [f"frame 9: {warning}"]


def test_what_was_told_before_a_run_stopped_is_not_told_again(scene_of, run, tmp_path):
    scene = scene_of(velocity=(15.0, 0.0, 0.0))
    whole = run(scene, tmp_path / "whole.gasp")
    assert [frame for frame, _ in told_of_sound(whole)] == [1]
    run(scene, tmp_path / "a.gasp", frames=5)
    again = run(scene, tmp_path / "a.gasp", resume=True)
    assert whole.diagnostics() == again.diagnostics()
    # And what was not told before is told then.
    late = scene_of(gravity=(0.0, 0.0, -30.0))
    run(late, tmp_path / "b.gasp", frames=5)
    assert [frame for frame, _ in told_of_sound(run(late, tmp_path / "b.gasp", resume=True))] == [9]


def test_matter_slower_than_its_sound_is_not_told_of(scene_of, run, tmp_path):
    assert told_of_sound(run(scene_of(velocity=(9.0, 0.0, 0.0)), tmp_path / "a.gasp")) == []


def test_an_engine_that_shows_no_velocities_is_watched_by_the_way_gone(scene_of, run, tmp_path):
    recording = run(scene_of(velocity=(15.0, 0.0, 0.0)), tmp_path / "a.gasp", fields=frozenset())
    [(frame, warning)] = told_of_sound(recording)
    assert frame == 1 and "goes at 15 m/s" in warning
