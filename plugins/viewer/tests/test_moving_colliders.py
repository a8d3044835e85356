"""Colliders on the stage: those that move, and those without a formula."""

from unittest.mock import MagicMock

import numpy as np
import pytest
from gasp_viewer.display_units import Stage
from gasp_viewer.scenery import add_scenery, pose_on_stage, surface_of

from gasp_core.contract import BoxShape, Collider, SignedDistanceField, SphereShape, SteadyMotion
from gasp_core.gaussians import rotation_matrices
from gasp_core.stepping.rigid_motion import pose_of

STAGE = Stage(origin=np.array([0.3, -0.2, 0.5]), unit=4.0)
MOTION = SteadyMotion(velocity=(1.0, 0.5, -0.2), angular_velocity=(0.3, -1.0, 2.0), center=(0.1, 0.2, 0.3))
STANDING = Collider(shape=BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1)))
MOVING = Collider(shape=SphereShape(center=(0.1, 0.2, 0.4), radius=0.1), motion=MOTION)


@pytest.mark.parametrize("time", [0.0, 0.4, 3.0])
def test_the_frame_takes_what_hangs_in_it_to_where_it_is(time):
    pose = pose_of(MOTION, time)
    position, quaternion = pose_on_stage(pose, STAGE)
    places = np.random.default_rng(1).normal(size=(9, 3))
    now = (places - pose.center) @ pose.rotation.T + pose.place
    hung = STAGE.place(places) @ rotation_matrices(quaternion[None])[0].T + position
    np.testing.assert_allclose(hung, STAGE.place(now), atol=1e-12)


def test_only_what_moves_hangs_in_a_frame():
    scene = MagicMock()
    (mover,) = add_scenery(scene, [STANDING, MOVING], STAGE)
    scene.add_frame.assert_called_once_with("/colliders/1", show_axes=False)
    assert scene.add_box.call_args.args[0] == "/colliders/0"
    assert scene.add_icosphere.call_args.args[0] == "/colliders/1/shape"
    mover.show(2.0)
    position, quaternion = pose_on_stage(pose_of(MOTION, 2.0), STAGE)
    np.testing.assert_array_equal(mover.handle.position, position)
    np.testing.assert_array_equal(mover.handle.wxyz, quaternion)


def test_a_field_is_shown_by_its_surface_which_faces_out():
    ball = SphereShape(center=(0.3, -0.2, 0.5), radius=0.4)
    field = SignedDistanceField.sampled(ball, (-0.1, -0.6, 0.1), (0.7, 0.2, 0.9), 0.05)
    scene = MagicMock()
    add_scenery(scene, [Collider(shape=field)], STAGE)
    assert scene.add_mesh_simple.call_args.args == ("/colliders/0",)
    shown = scene.add_mesh_simple.call_args.kwargs["vertices"] / STAGE.unit
    # Trilinear, of distances to a ball: off by h^2 / 8 R at most, and no more off than that in its box's field.
    assert np.abs(np.linalg.norm(shown, axis=1) - 0.4).max() < 0.05**2 / (8 * 0.4) * 3
    vertices, faces = surface_of(field)
    one, two, three = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("fi,fi->f", one, np.cross(two, three)).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 0.4**3, rel=0.02)
