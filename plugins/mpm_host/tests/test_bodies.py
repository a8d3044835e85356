"""Bodies beside each other on one grid, and where they meet, against the obvious."""

import itertools

import numpy as np
import pytest
from gasp_mpm_host import layout as at
from gasp_mpm_host.bodies import bodies_of_columns, home_boxes, meetings, stands_for
from gasp_mpm_host.cells import BLOCK, arrange, grid_box
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gasp_core.contract import BodyContact, ContactCondition, Elastic, PointCloud, PointProblem

REACH = np.stack(np.meshgrid(*[np.arange(-1, 4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
COUNT = 24
HOMES = arrays(np.int32, (COUNT, 3), elements=st.integers(-20, 20))
BODIES = arrays(np.int32, COUNT, elements=st.integers(0, 3))


def problem_of(bodies, **contacts):
    points = PointCloud(
        reference_positions=np.zeros((len(bodies), 3)),
        initial_velocities=np.zeros((len(bodies), 3)),
        reference_volumes=np.ones(len(bodies)),
        material_ids=np.zeros(len(bodies)),
        body_ids=bodies,
    )
    material = Elastic(density=1.0, youngs_modulus=1.0, poissons_ratio=0.3)
    return PointProblem(points=points, materials=(material,), **contacts)


def arranged(home, bodies, **contacts):
    """Stands, cells and bodies in their new order, tables and meetings."""
    count = int(bodies.max()) + 1
    stands = stands_for(home_boxes(home, bodies, count), np.zeros((count, 3), dtype=np.int64))
    cells = (home + stands[bodies]).astype(np.int32)
    tables, order = arrange(cells, 2**40)
    cells, bodies = cells[order], bodies[order]
    met = meetings(problem_of(bodies, **contacts), bodies, stands, tables.active, tables)
    return stands, cells, bodies, tables, met


@given(HOMES, BODIES)
def test_no_block_is_in_reach_of_two_bodies(home, bodies):
    stands, cells, bodies, tables, _ = arranged(home, bodies)
    assert (stands % (2 * BLOCK) == 0).all()
    nodes = cells[:, None, :] + REACH
    owners = {}
    for block, body in zip((nodes // BLOCK).reshape(-1, 3).tolist(), np.repeat(bodies, len(REACH))):
        assert owners.setdefault(tuple(block), body) == body
    columns = bodies_of_columns(home_boxes(cells, bodies, len(stands)), tables)
    for block, body in owners.items():
        assert np.array_equal(stands[columns[block[0] - tables.lower[0] // BLOCK]], stands[body])


@given(HOMES, BODIES)
def test_bodies_that_do_not_move_stay_where_they_stand(home, bodies):
    boxes = home_boxes(home, bodies, 4)
    stands = stands_for(boxes, np.zeros((4, 3), dtype=np.int64))
    assert np.array_equal(stands_for(boxes, stands), stands)


def test_a_body_that_flies_away_takes_no_empty_grid_with_it():
    home = np.array([[0, 0, 0], [5, 0, 0]], dtype=np.int32)
    bodies = np.array([0, 1])
    stands = stands_for(home_boxes(home, bodies, 2), np.zeros((2, 3), dtype=np.int64))
    home[1] = (5, 0, 10_000_000)
    cells = home + stands_for(home_boxes(home, bodies, 2), stands)[bodies]
    _, shape = grid_box(cells.min(axis=0), cells.max(axis=0), 2**40)
    assert shape.prod() < 10_000


@given(HOMES, BODIES)
def test_who_can_share_a_node_meets_there(home, bodies):
    stands, cells, bodies, tables, met = arranged(home, bodies)
    blocks = tables.shape // BLOCK
    places = {}
    for cell, body in zip(cells, bodies):
        for node in cell + REACH - stands[body]:
            places.setdefault(tuple(node // BLOCK), set()).add(int(body))
    expected = {place: sorted(who) for place, who in places.items() if len(who) > 1}
    found = {}
    for begin, end, first, last in zip(met.places, met.places[1:], met.pair_begins, met.pair_begins[1:]):
        where = np.stack(np.unravel_index(met.members[begin:end], blocks), axis=1) + tables.lower // BLOCK
        columns = bodies_of_columns(home_boxes(cells, bodies, len(stands)), tables)
        who = columns[where[:, 0] - tables.lower[0] // BLOCK]
        place = where - stands[who] // BLOCK
        assert (place == place[0]).all()
        found[tuple(place[0])] = who.tolist()
        pairs = [tuple(pair) for pair in met.pairs[first:last, :2]]
        assert pairs == list(itertools.combinations(range(begin, end), 2))
    assert found == expected
    assert sorted([*met.apart, *met.members]) == tables.active.tolist()


@given(HOMES, BODIES)
def test_a_member_knows_every_point_that_may_reach_it(home, bodies):
    _, cells, _, tables, met = arranged(home, bodies)
    blocks = tables.shape // BLOCK
    reached = (cells[:, None, :] + REACH - tables.lower) // BLOCK
    numbers = np.ravel_multi_index(tuple(np.moveaxis(reached, 2, 0)), blocks)
    for row, block in enumerate(met.members):
        near = met.near[met.near_begins[row] : met.near_begins[row + 1]]
        assert np.array_equal(np.sort(near), np.flatnonzero((numbers == block).any(axis=1)))


@pytest.mark.parametrize(("bodies", "condition", "friction"), [([0, 1], at.STICK, 0.0), ([0, 2], at.SEPARATE, 0.3)])
def test_pairs_meet_as_the_problem_says(bodies, condition, friction):
    contacts = {
        "body_contact": BodyContact(friction=0.3),
        "pair_contacts": {(0, 1): BodyContact(contact=ContactCondition.STICK)},
    }
    *_, met = arranged(np.zeros((2, 3), dtype=np.int32), np.array(bodies), **contacts)
    assert set(met.pairs[:, 2]) == {condition}
    assert set(met.friction) == {friction}
