"""Views that are kept become a camera that a scene file, and gasp render, understand."""

import numpy as np
from gasp_viewer.shots import Shots

from gasp_core.scene.loading import load_camera


def test_one_view_is_a_camera_that_stands(tmp_path):
    assert Shots().to_toml() == ""
    shots = Shots().kept(0.4, (1.0, -2.5, 0.3), (0.0, 0.1, 0.2), 35.0)
    (tmp_path / "camera.toml").write_text(shots.to_toml())
    choice = load_camera(tmp_path / "camera.toml")
    assert (choice.position, choice.target, choice.field_of_view) == ((1.0, -2.5, 0.3), (0.0, 0.1, 0.2), 35.0)


def test_several_are_a_path_in_the_order_of_their_times(tmp_path):
    shots = Shots().kept(1.0, (1, 0, 0), (0, 0, 0), 40.0).kept(0.04, (-1e-7, 2, 1e5), (0, 0, 1), 40.0)
    shots = shots.kept(1.0, (0, 3, 0), (0, 0, 0), 50.0)
    (tmp_path / "camera.toml").write_text(shots.to_toml())
    choice = load_camera(tmp_path / "camera.toml")
    assert [point.time for point in choice.path] == [0.04, 1.0]
    assert choice.path[1].position == (0, 3, 0) and choice.field_of_view == 50.0
    np.testing.assert_allclose(choice.path[0].position, (0, 2, 1e5), rtol=1e-5)
