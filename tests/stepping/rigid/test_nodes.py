"""Which nodes of a grid carry matter that touches a rigid body."""

import numpy as np
from rigid_clouds import block, problem_of

from gasp_core.stepping.rigid.bodies import rigid_bodies_of
from gasp_core.stepping.rigid.nodes import nodes_near
from gasp_core.stepping.rigid.surfaces import rigid_surfaces_of
from gasp_core.stepping.rigid.welds import NO_HOST
from gasp_core.stepping.rigid.world import RigidWorld

SIDE, SPACING = 0.02, 0.04
ORIGIN = np.array([0.003, -0.002, 0.001])


def around(bodies, points, whose, open_gap=SPACING):
    """Nodes near cubes of 8 sides at places `bodies`, for points (N, 3) of bodies (N,)."""
    problem = problem_of([block((8, 8, 8), SIDE, place) for place in bodies], SIDE)
    rigid = rigid_bodies_of(problem)
    surfaces, world = rigid_surfaces_of(problem, rigid), RigidWorld.of(problem, rigid, None, "tested")
    halves = np.full(len(points), SIDE / 2)
    return nodes_near(
        surfaces, world.poses(), points, halves, whose, SPACING, ORIGIN, open_gap, np.full(len(bodies), NO_HOST)
    )


def test_matter_on_top_of_a_body_touches_it_from_above_along_its_edge_too():
    on_top = block((12, 12, 4), SIDE, (0.0, 0.0, 0.08 + 2 * SIDE))
    found = around([(0.0, 0.0, 0.0)], on_top, np.zeros(len(on_top), dtype=np.int64))
    places = found.nodes * SPACING + ORIGIN
    assert len(found.nodes) > 9
    above = (np.abs(places[:, :2]) < 0.08 - SPACING).all(axis=1)
    np.testing.assert_allclose(found.normals[above], np.tile([0.0, 0.0, 1.0], (above.sum(), 1)), atol=0.01)
    np.testing.assert_allclose(found.gaps[above], 0.0, atol=1e-6)
    # No node has a normal of the edge, which is round by half a cell: what lies on it is flat there, too.
    np.testing.assert_allclose(found.normals, np.tile([0.0, 0.0, 1.0], (len(found.nodes), 1)), atol=0.05)


def test_a_corner_of_matter_on_a_face_has_the_normal_of_the_face():
    corner = block((4, 4, 4), SIDE)
    # Stood on one of its edges, turned by 45 degrees about y.
    turn = np.array([[1.0, 0.0, 1.0], [0.0, np.sqrt(2), 0.0], [-1.0, 0.0, 1.0]]) / np.sqrt(2)
    corner = corner @ turn.T
    corner[:, 2] += 0.08 - corner[:, 2].min() + SIDE / 2
    found = around([(0.0, 0.0, 0.0)], corner, np.zeros(len(corner), dtype=np.int64))
    assert len(found.nodes) > 3
    np.testing.assert_allclose(found.normals, np.tile([0.0, 0.0, 1.0], (len(found.nodes), 1)), atol=0.05)


def test_a_gap_is_that_between_the_surfaces():
    for gap in (0.0, 0.01, 0.03):
        above = block((4, 4, 4), SIDE, (0.0, 0.0, 0.08 + gap + 2 * SIDE))
        found = around([(0.0, 0.0, 0.0)], above, np.zeros(len(above), dtype=np.int64))
        np.testing.assert_allclose(found.gaps.min(), gap, atol=1e-6)


def test_what_is_farther_than_asked_for_is_left_out():
    above = block((4, 4, 4), SIDE, (0.0, 0.0, 0.2))
    found = around([(0.0, 0.0, 0.0)], above, np.zeros(len(above), dtype=np.int64), open_gap=0.01)
    assert len(found.nodes) == 0


def test_matter_between_two_bodies_meets_each_at_its_own_nodes_and_no_node_twice():
    between = block((4, 4, 4), SIDE)
    two = np.concatenate([between, between + [0.0, 0.3, 0.0]])
    whose = np.repeat([0, 1], len(between))
    places = [(0.0, 0.0, -0.12), (0.0, 0.0, 0.12), (0.0, 0.3, 0.12), (5.0, 0.0, 0.0)]
    found = around(places, two, whose)
    assert set(found.rigid) == {0, 1, 2}
    assert set(zip(found.bodies, found.rigid)) == {(0, 0), (0, 1), (1, 2)}
    keys = np.column_stack([found.bodies, found.nodes])
    assert len(np.unique(keys, axis=0)) == len(keys)


def test_bodies_that_are_near_and_touch_nothing():
    """Of each something is near, and nothing near enough."""
    points = np.concatenate([block((2, 2, 2), SIDE, (x, 0.0, 0.08 + 0.08)) for x in (0.0, 0.5)])
    found = around([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)], points, np.zeros(16, dtype=np.int64), open_gap=0.01)
    assert len(found.nodes) == 0
