"""Rigid parts of bodies that deform: which points are beside a seam, and how it is brought back."""

import numpy as np
import pytest
from rigid_clouds import block, problem_of

from gasp_core.contract import Elastic, Rigid
from gasp_core.errors import SceneError
from gasp_core.stepping.rigid.nodes import nodes_near
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.rigid.welds import NO_HOST
from gasp_core.stepping.rigid_motion import Pose, rotation_matrix

SIDE, SPACING, STEP = 0.02, 0.04, 1e-3
SOFT, HARD = Elastic(density=300, youngs_modulus=1e5, poissons_ratio=0.3), Rigid(density=900)
ORIGIN = np.zeros(3)


def welded(rod, weight, **rest):
    return problem_of([rod, weight], SIDE, materials=[SOFT, HARD], **rest)


@pytest.fixture(scope="module")
def side():
    """A rod of 4 x 4 x 8 points on a block of 8 x 8 x 8, whose surface is at z = 0.08."""
    rod = block((4, 4, 8), SIDE, (0.0, 0.0, 0.08 + 4 * SIDE))
    found = RigidSide.of(welded(rod, block((8, 8, 8), SIDE), rigid_parts={1: 0}), None, "tested")
    assert found is not None
    return found


def pose(place=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    return Pose(
        center=np.zeros(3),
        place=np.array(place),
        rotation=rotation_matrix(np.array(turn)),
        velocity=np.zeros(3),
        angular_velocity=np.zeros(3),
    )


def test_the_first_layer_is_beside_the_seam(side):
    assert side.welds.hosts.tolist() == [0]
    assert len(side.welds.rows) == 16
    np.testing.assert_allclose(side.welds.starts[:, 2], 0.08 + SIDE / 2)


def test_what_is_where_it_was_on_its_part_is_left_alone(side):
    turned = pose((0.3, -0.2, 0.1), (0.4, 1.0, -0.7))
    there = side.welds.starts @ turned.rotation.T + turned.place
    places = np.random.default_rng(0).normal(size=(7, 3))
    wanted = side.welds.wanted([turned], there, np.zeros(7, dtype=int), places, STEP)
    np.testing.assert_allclose(wanted, 0.0, atol=1e-12)


def test_a_seam_that_is_off_comes_back_as_a_whole(side):
    shift, turn = np.array([0.001, -0.002, 0.003]), np.array([0.0, 0.0, 1e-3])
    middle = side.welds.starts.mean(axis=0)
    there = side.welds.starts - shift - np.cross(turn, side.welds.starts - middle)
    places = middle + np.random.default_rng(0).normal(size=(7, 3))
    parts = np.array([0, 0, 0, -1, 0, 0, 0])
    wanted = side.welds.wanted([pose()], there, parts, places, STEP)
    np.testing.assert_allclose(
        wanted[parts == 0], (0.05 / STEP * (shift + np.cross(turn, places - middle)))[parts == 0]
    )
    # What is welded to nothing is asked for nothing.
    assert not wanted[3].any()


def test_about_a_line_that_is_no_wider_than_a_point_nothing_is_turned():
    line = block((1, 1, 8), SIDE, (0.0, 0.0, 0.08 + 4 * SIDE))
    side = RigidSide.of(welded(line, block((8, 8, 8), SIDE), rigid_parts={1: 0}), None, "tested")
    assert len(side.welds.rows) == 1
    wanted = side.welds.wanted([pose()], side.welds.starts + 0.01, np.zeros(2, dtype=int), np.eye(3)[:2], STEP)
    np.testing.assert_allclose(wanted, -0.05 / STEP * 0.01)


def test_welded_nodes_are_those_in_the_part_and_close_to_it_however_far_the_matter(side):
    surfaces, world = side.world.surfaces, side.world
    rod = side.problem.points.reference_positions[side.soft_rows]
    for lifted in (0.0, 1.2 * SPACING):
        places = rod + [0, 0, lifted]
        given = (places, np.full(len(places), SIDE / 2), np.zeros(len(places), dtype=int), SPACING, ORIGIN, 0.01)
        welded = nodes_near(surfaces, world.poses(), *given, side.welds.hosts)
        free = nodes_near(surfaces, world.poses(), *given, np.full(1, NO_HOST))
        assert welded.welded.all()
        assert not free.welded.any()
        heights = welded.nodes[:, 2] * SPACING
        assert 0.08 - 1e-9 <= heights.max() < 0.08 + 0.75 * SPACING
        if lifted:
            assert len(free.nodes) == 0


def test_a_body_without_parts_has_no_seams():
    rod = block((4, 4, 8), SIDE, (0.0, 0.0, 0.08 + 4 * SIDE))
    side = RigidSide.of(welded(rod, block((8, 8, 8), SIDE)), None, "tested")
    assert side.welds.hosts.tolist() == [NO_HOST]
    assert len(side.welds.rows) == 0
    assert not side.welds.wanted(side.world.poses(), np.zeros((0, 3)), np.full(2, -1), np.zeros((2, 3)), STEP).any()


@pytest.mark.parametrize("parts", [{0: 1}, {1: 1}, {1: 2}, {2: 0}, {1: -1}])
def test_a_part_is_rigid_and_what_it_is_of_deforms(parts):
    rod, weight = block((2, 2, 2), SIDE), block((2, 2, 2), SIDE, (1.0, 0.0, 0.0))
    with pytest.raises(SceneError, match="must be one that is rigid of one that deforms"):
        welded(rod, weight, rigid_parts=parts)
