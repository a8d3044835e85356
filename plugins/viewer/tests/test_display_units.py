import numpy as np
from gasp_viewer.display_units import SIZE, Stage, shown_motion, three_quarter

from gasp_core.io import write_splat
from gasp_core.rendering.footage import open_footage
from gasp_core.rendering.framing import Motion


def test_what_is_shown_has_one_size_about_the_origin():
    rng = np.random.default_rng(0)
    for size, where in ((1e-3, 0.0), (1.0, 1e4), (1e5, -3.0)):
        lower = where + size * rng.uniform(-1, 0, 3)
        upper = lower + size * rng.uniform(0.5, 1, 3)
        stage = Stage.of(Motion(points=np.stack([lower, upper]), frames=np.zeros(2, dtype=int)))
        ends = stage.place(np.stack([lower, upper]))
        # A few float64 roundings of the place, magnified with the rest.
        slack = 16 * 2.0**-53 * (abs(where) + size)
        np.testing.assert_allclose(ends[0], -ends[1], atol=slack * stage.unit)
        np.testing.assert_allclose(np.linalg.norm(ends[1] - ends[0]), SIZE, atol=slack * stage.unit)
        np.testing.assert_allclose(stage.world(ends), [lower, upper], atol=slack)


def test_the_view_sees_all_of_the_motion_from_above_its_front_right(toy_footage):
    motion = shown_motion(toy_footage, 0)
    view = three_quarter(motion)
    forward = view.target - view.eye
    forward /= np.linalg.norm(forward)
    assert forward[0] < 0 < forward[1] and forward[2] < 0
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    points = motion.points - view.eye
    depth = points @ forward
    half = np.tan(view.field_of_view / 2)
    assert (depth > 0).all()
    assert (np.abs(points @ right) < half * depth).all()
    assert (np.abs(points @ up) < half * depth).all()


def test_a_single_gaussian_can_be_shown(tmp_path, cloud):
    write_splat(tmp_path / "one.ply", cloud(1).with_(scales=np.full((1, 3), 0.1)))
    motion = shown_motion(open_footage(tmp_path / "one.ply"), 0)
    # One deviation each way, to the float32 of the logarithm the file keeps.
    np.testing.assert_allclose(motion.upper - motion.lower, 0.2, rtol=4 * 2.0**-23)
    assert np.isfinite(three_quarter(motion).eye).all()


def test_a_gaussian_far_away_can_be_shown(tmp_path, cloud):
    one = cloud(1).with_(means=np.full((1, 3), 1e6), scales=np.full((1, 3), 1e-12))
    write_splat(tmp_path / "one.ply", one)
    stage = Stage.of(shown_motion(open_footage(tmp_path / "one.ply"), 0))
    assert np.isfinite(stage.unit) and np.isfinite(stage.place(np.full((1, 3), 1e6))).all()
