"""A rigid body on nodes of a grid: what each node gives and gets."""

import numpy as np
import pytest
from rigid_clouds import block, problem_of

from gasp_core.contract import BodyContact, Elastic, Rigid
from gasp_core.stepping.rigid import world as rigid_world
from gasp_core.stepping.rigid.grid_nodes import GridNodes
from gasp_core.stepping.rigid.side import RigidSide

SIDE, STEP, FRICTION = 0.02, 1e-3, 0.3


def slid(ratio, seed):
    """What nodes under a block get that slides over them at 1 m/s and comes down on them; its loss, and its mass.

    Together they are `ratio` times as heavy; they jump as heavy matter does that is pressed and let go.
    """
    parts = [block((4, 4, 4), SIDE, (0.0, 0.0, 2 * SIDE)), block((8, 8, 2), SIDE, (0.0, 0.0, -SIDE))]
    problem = problem_of(
        parts,
        SIDE,
        velocities=[np.array([1.0, 0.0, -0.05]), np.zeros(3)],
        materials=[Rigid(density=500.0), Elastic(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3)],
        body_contact=BodyContact(friction=FRICTION),
        gravity=(0.0, 0.0, -9.81),
    )
    world = RigidSide.of(problem, None, "tested").world
    rng = np.random.default_rng(seed)
    places = block((5, 5, 1), SIDE)
    count, mass = len(places), float(world.bodies.masses[0])
    nodes = GridNodes(
        rigid=np.zeros(count, dtype=np.int64),
        others=np.ones(count, dtype=np.int64),
        places=places,
        velocities=rng.normal(scale=0.05, size=(count, 3)),
        masses=ratio * mass / count * rng.uniform(0.1, 1.9, count),
        normals=np.tile([0.0, 0.0, -1.0], (count, 1)),
        gaps=rng.uniform(0.0, 5e-5, count),
        welded=np.zeros(count, dtype=bool),
        wanted=np.zeros((count, 3)),
        led=np.zeros(count, dtype=bool),
        held_together=0.0,
    )
    before = world.state.velocities[0].copy()
    after = world.step(0.0, STEP, nodes)
    impulses = nodes.masses[:, None] * (after - nodes.velocities)
    lost = mass * (before + STEP * np.asarray(problem.gravity) - world.state.velocities[0])
    return impulses, lost, nodes


@pytest.mark.parametrize("ratio", [0.1, 1.0, 100.0, 1e4])
def test_friction_is_what_each_node_bears_however_heavy_it_is(ratio):
    for seed in range(5):
        impulses, lost, nodes = slid(ratio, seed)
        borne, across = -impulses[:, 2], np.linalg.norm(impulses[:, :2], axis=1)
        # The block is found to a hundred thousandth of what gravity gives in a step, and gives nodes as much of it.
        rounding = 1e-5 * 9.81 * STEP * nodes.masses
        assert (borne >= -rounding).all()
        assert (borne > rounding).any()
        assert (np.abs(across - FRICTION * borne) <= 10 * rounding).all()
        np.testing.assert_allclose(impulses.sum(axis=0), lost, rtol=0, atol=1e-12)


def test_without_the_least_value_on_the_way_heavy_nodes_rub_too_hard(monkeypatch):
    """That is what the search is for: the test above would fail."""
    monkeypatch.setattr(rigid_world, "share_of_change", lambda *_: 1.0)
    excess = 0.0
    for seed in range(5):
        impulses, _, _ = slid(1e4, seed)
        across = np.linalg.norm(impulses[:, :2], axis=1)
        excess = max(excess, across.sum() / -impulses[:, 2].sum() / FRICTION - 1)
    assert excess > 1.0


@pytest.mark.parametrize("step", [STEP, 1e-10, 5.5e-17])
def test_what_has_room_keeps_its_velocity_to_the_last_bit_however_short_the_step_is(step):
    """A gap over a step is a speed that may be large: none of it stays behind in what does not touch."""
    problem = problem_of(
        [block((4, 4, 4), SIDE, (0.0, 0.0, 2 * SIDE)), block((8, 8, 2), SIDE, (0.0, 0.0, -SIDE))],
        SIDE,
        materials=[Rigid(density=500.0), Elastic(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3)],
        gravity=(0.0, 0.0, 0.0),
    )
    world = RigidSide.of(problem, None, "tested").world
    rng = np.random.default_rng(0)
    places = block((5, 5, 1), SIDE)
    count = len(places)
    nodes = GridNodes(
        rigid=np.zeros(count, dtype=np.int64),
        others=np.ones(count, dtype=np.int64),
        places=places,
        velocities=rng.normal(scale=0.1, size=(count, 3)),
        masses=rng.uniform(1e-3, 1e-2, count),
        normals=np.tile([0.0, 0.0, -1.0], (count, 1)),
        gaps=rng.uniform(0.1, 0.3, count) * SIDE,
        welded=np.zeros(count, dtype=bool),
        wanted=np.zeros((count, 3)),
        led=np.zeros(count, dtype=bool),
        held_together=0.0,
    )
    np.testing.assert_array_equal(world.step(0.0, step, nodes), nodes.velocities)
    assert not world.state.velocities.any()
