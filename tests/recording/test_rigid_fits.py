"""How a body moves as a whole, read from recordings of engines whose motion is known."""

from __future__ import annotations

import dataclasses

import flying_points
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scripted_engine import Scripted

from gasp_core import Recording, Swing, rigid_fit, simulate
from gasp_core.cli.export_motion import export_motion
from gasp_core.contract import Field, PointState, SteadyMotion
from gasp_core.errors import RecordingError
from gasp_core.scene.rigid_motions import read_moments
from gasp_core.stepping.rigid_motion import pose_of

TUMBLING = SteadyMotion(velocity=(0.3, -0.2, 1.0), angular_velocity=(2.0, 9.0, -5.0), center=(0.1, 0.0, 0.4))
SINGLE = 2.0**-24
"""Half of what float32 rounds to, relative."""


class Tumbling(Scripted):
    """All points go with TUMBLING, 1.7 turns in the second that a run takes; stretched along x by `growth` a second."""

    growth = 0.0

    def read(self, fields):
        start = np.asarray(self.problem.points.reference_positions, dtype=np.float64)
        pose = pose_of(TUMBLING, self.time)
        stretched = start * [1 + self.growth * self.time, 1, 1]
        return PointState(time=self.time, positions=pose.place + (stretched - pose.center) @ pose.rotation.T)


class Growing(Tumbling):
    growth = 0.2


def recorded(scene, engine, out) -> Recording:
    return simulate(
        scene,
        engine=(flying_points.descriptor(checkpoints=False, fields=frozenset({Field.POSITIONS})), engine),
        out=out,
        progress=False,
    )


@pytest.fixture
def tumbled(scene_of, tmp_path):
    return recorded(scene_of(duration=1.0), Tumbling(), tmp_path / "a.gasp")


def test_a_tumbling_body_is_where_its_motion_takes_it(tumbled):
    """Displacements are float32 less their mean: the points are off by half a rounding of at most twice the radius."""
    fit = rigid_fit(tumbled, "thing")
    assert len(fit.times) == tumbled.frame_count == 26
    start = tumbled.start_points
    radius = np.linalg.norm(start - start.mean(0), axis=1).max()
    rounding = 2 * radius * SINGLE * np.sqrt(3)
    assert (fit.residuals <= rounding).all()
    for time, place, (w, *vector) in zip(fit.times, fit.places, fit.quaternions):
        pose = pose_of(TUMBLING, time)
        turn = Rotation.from_quat([*vector, w])
        np.testing.assert_allclose(place, pose.place + pose.rotation @ (start.mean(0) - pose.center), atol=rounding)
        # Of many points the turn is better than that of one at the radius.
        assert (turn * Rotation.from_matrix(pose.rotation).inv()).magnitude() <= rounding / radius


def test_quaternions_do_not_jump(tumbled):
    quaternions = rigid_fit(tumbled, "thing").quaternions
    angle = np.linalg.norm(TUMBLING.angular_velocity) / 25
    np.testing.assert_allclose(quaternions[0], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose((quaternions[1:] * quaternions[:-1]).sum(1), np.cos(angle / 2), atol=1e-6)


def test_what_is_deformed_says_by_how_much(scene_of, tmp_path):
    """Stretched by 1 + e along x, the best rigid motion leaves e sqrt(mean x^2), x from the middle."""
    run = recorded(scene_of(duration=1.0), Growing(), tmp_path / "a.gasp")
    fit = rigid_fit(run, "thing")
    middle = run.start_points - run.start_points.mean(0)
    # The turn may lean a little where that brings points nearer: to second order in the stretch.
    np.testing.assert_allclose(fit.residuals[-1], 0.2 * np.sqrt((middle[:, 0] ** 2).mean()), rtol=0.2)
    assert fit.residuals[-1] <= 0.2 * np.sqrt((middle[:, 0] ** 2).mean())


def test_it_is_a_motion_for_colliders(tumbled):
    """In the frames a point of the body lies where a collider with that motion would have it."""
    fit = rigid_fit(tumbled, "thing")
    motion = fit.as_motion()
    for frame in (0, 7, 25):
        pose = pose_of(motion, fit.times[frame])
        moved = pose.place + (tumbled.start_points - pose.center) @ pose.rotation.T
        np.testing.assert_allclose(moved, tumbled.points(frame), atol=1e-6)


def test_each_object_has_its_own(scene_of, cloud, tmp_path):
    scene = scene_of(duration=0.2)
    second = dataclasses.replace(scene.objects[0], name="other", splat=cloud(seed=1), position=(3, 0, 0))
    scene = dataclasses.replace(scene, objects=(*scene.objects, second))
    run = recorded(scene, Tumbling(), tmp_path / "a.gasp")
    first, other = rigid_fit(run, "thing"), rigid_fit(run, "other")
    assert np.linalg.norm(other.center - first.center) > 2
    np.testing.assert_allclose(first.quaternions, other.quaternions, atol=1e-5)


def test_what_is_carried_is_where_it_is_seen(scene_of, run, tmp_path):
    """Its points fly on straight ahead and know nothing of the swing."""
    swing = Swing(axis=(0, 1, 0), pivot=(0.4, 0, 0), amplitude=30, frequency=1.0)
    scene = scene_of(motion=swing, velocity=(0.3, 0, 0), gravity=(0, 0, 0))
    recording = run(scene, tmp_path / "a.gasp")
    fit = rigid_fit(recording, "thing")
    start = recording.reference.means
    np.testing.assert_allclose(fit.center, start.mean(0), atol=1e-6)
    turns = Rotation.from_quat(np.roll(fit.quaternions, -1, axis=1))
    np.testing.assert_allclose(np.degrees(turns.magnitude().max()), 30, rtol=0.01)
    for frame in range(recording.frame_count):
        seen = fit.places[frame] + turns[frame].apply(start - fit.center)
        # Places of a recording are float32.
        np.testing.assert_allclose(seen, recording.gaussians(frame).means, atol=1e-6)
    assert fit.residuals.max() < 1e-6


def test_what_does_not_move_is_named(tumbled):
    with pytest.raises(RecordingError, match='nothing of the name "thong" moves; what moves: thing'):
        rigid_fit(tumbled, "thong")


def test_the_file_is_read_back_as_it_was(tumbled, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = export_motion(tumbled, "thing", None, overwrite=False)
    assert told.startswith("a_thing.csv: 26 moments")
    fit = rigid_fit(tumbled, "thing")
    assert read_moments(tmp_path / "a_thing.csv", tuple(fit.center)) == fit.as_motion()
