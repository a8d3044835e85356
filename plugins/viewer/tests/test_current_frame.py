import numpy as np
import pytest
from gasp_viewer.current_frame import Moment, finite_difference

from gasp_core.rendering.footage import open_footage

GRAVITY = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def fast_run(tmp_path_factory, toy, scene_of, record):
    """With velocities recorded."""
    out = tmp_path_factory.mktemp("fast") / "run.gasp"
    record(scene_of(toy, frames=4, velocities=True), out)
    return out


def test_displacements_are_the_distances_from_the_start(toy_footage, falling):
    start = toy_footage.recording.start_points
    for frame in (0, 1, 5):
        truth = np.linalg.norm(falling.positions(start, frame / 25, GRAVITY) - start, axis=1)
        # Kept as float32 less the mean: a rounding of what each point moved against it, at most 2 m here; and the mean.
        np.testing.assert_allclose(Moment(toy_footage, frame).displacements, truth, atol=4 * 2.0**-24)


def test_speeds_are_mean_ones_since_the_frame_before(toy_footage, falling):
    start = toy_footage.recording.start_points
    radius = np.linalg.norm(start[:, :2], axis=1)
    for frame in (1, 3, 5):
        truth = np.linalg.norm(falling.velocities(start, frame / 25, GRAVITY), axis=1)
        # Half the acceleration (gravity and centripetal) times the step, by Taylor; float32 of 2 m over 1/25 s.
        bound = 0.5 / 25 * np.hypot(9.81, falling.TURN**2 * radius) + 8 * 25 * 2.0**-24
        error = np.abs(Moment(toy_footage, frame).speeds - truth)
        assert (error <= bound).all()
        assert error.max() > 0


def test_the_speed_at_frame_zero_is_that_until_frame_one(toy_footage):
    np.testing.assert_array_equal(Moment(toy_footage, 0).speeds, Moment(toy_footage, 1).speeds)


def test_a_run_of_one_frame_has_no_speed_yet(tmp_path, toy, scene_of, record):
    record(scene_of(toy), tmp_path / "run.gasp", frames=1)
    np.testing.assert_array_equal(Moment(open_footage(tmp_path / "run.gasp"), 0).speeds, np.zeros(4 * 2000))


def test_recorded_velocities_are_used_where_there_are_any(fast_run, falling):
    footage = open_footage(fast_run)
    truth = np.linalg.norm(falling.velocities(footage.recording.start_points, 2 / 25, GRAVITY), axis=1)
    # Components rounded to float32, so the length is off by at most as much; float64 from there on.
    np.testing.assert_allclose(Moment(footage, 2).speeds, truth, rtol=1.01 * 2.0**-24)


def test_a_finite_difference_is_exact_for_constant_velocity():
    rng = np.random.default_rng(0)
    before, velocity = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    found = finite_difference(before, before + velocity / 25, 25.0)
    # Rounding of positions below 8, 25 times.
    np.testing.assert_allclose(found, np.linalg.norm(velocity, axis=1), atol=25 * 8 * 2.0**-52)


def test_a_file_has_no_points(tmp_path, toy):
    from gasp_core.io import write_splat

    write_splat(tmp_path / "toy.ply", toy)
    moment = Moment(open_footage(tmp_path / "toy.ply", "+z"), 0)
    assert len(moment.points) == len(moment.displacements) == len(moment.speeds) == 0
    assert sum(len(body) for body in moment.simplices) == len(moment.splats) == 2000
