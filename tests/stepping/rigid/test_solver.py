"""Impulses: what one gets another gives, and energy does not rise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.stepping.rigid.solver import loaded, settle_nodes, solve

STICK, SLIP, SEPARATE = 0, 1, 2


def body_and_nodes(seed, count, weight):
    rng = np.random.default_rng(seed)
    mass = 10.0**weight
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    inertia = np.zeros((1, 6, 6))
    inertia[0, [0, 1, 2], [0, 1, 2]] = mass
    inertia[0, 3:, 3:] = turn @ np.diag(mass * rng.uniform(0.05, 0.2, 3)) @ turn.T
    velocity = rng.normal(size=(1, 6))
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nodes = {
        "places": rng.normal(size=(count, 3)),
        "velocities": rng.normal(size=(count, 3)),
        "masses": 10.0 ** rng.uniform(-3, 1, count),
        "normals": normals,
        "conditions": rng.choice([STICK, SLIP, SEPARATE], count),
        "frictions": rng.uniform(0, 1, count),
        "rooms": np.where(rng.uniform(size=count) < 0.3, rng.uniform(0, 2, count), 0.0),
    }
    return inertia, velocity, nodes


def met(inertia, velocity, nodes, rounds=8):
    """Velocities of the body and of the nodes after contact."""
    centers, whose = np.zeros((1, 3)), np.zeros(len(nodes["masses"]), dtype=np.int64)
    momentum = np.einsum("bij,bj->bi", inertia, velocity)
    gates = np.zeros((len(whose), 2))
    found = velocity
    for _ in range(rounds):
        heavier, more = inertia.copy(), momentum.copy()
        own = [nodes[name] for name in ("velocities", "masses", "normals", "conditions", "frictions", "rooms")]
        loaded(heavier, more, centers, found, whose, nodes["places"], *own, gates)
        found = np.linalg.solve(heavier, more[..., None])[..., 0]
    after = nodes["velocities"].copy()
    settle_nodes(centers, found, whose, nodes["places"], after, nodes["normals"], gates)
    return found, after


def momenta(inertia, velocity, nodes, velocities):
    given = np.einsum("bij,bj->bi", inertia, velocity)[0]
    carried = nodes["masses"][:, None] * velocities
    turning = np.cross(nodes["places"], carried)
    return given + np.concatenate([carried.sum(axis=0), turning.sum(axis=0)])


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40), weight=st.floats(-3, 3))
def test_nodes_get_what_a_body_gives_and_energy_does_not_rise(seed, count, weight):
    inertia, velocity, nodes = body_and_nodes(seed, count, weight)
    found, after = met(inertia, velocity, nodes)
    before, later = (momenta(inertia, v, nodes, n) for v, n in ((velocity, nodes["velocities"]), (found, after)))
    scale = np.abs(momenta(inertia, np.abs(velocity), nodes, np.abs(nodes["velocities"]))).max()
    scale += (nodes["masses"] * np.linalg.norm(nodes["places"], axis=1)).sum() * 10
    assert np.abs(later - before).max() < 1e-10 * scale

    def energy(v, n):
        own = np.einsum("bi,bij,bj->", v, inertia, v)
        return own + (nodes["masses"][:, None] * n**2).sum()

    start = energy(velocity, nodes["velocities"])
    assert energy(found, after) <= start * (1 + 1e-9)


def test_a_weight_on_light_nodes_is_borne_in_one_step():
    """However heavy it is: nodes that hold a thousandth of it stop as they would under a wall."""
    inertia, _, _ = body_and_nodes(0, 1, 3.0)
    rng = np.random.default_rng(1)
    count = 50
    places = np.column_stack([rng.uniform(-1, 1, (count, 2)), np.full(count, -1.0)])
    nodes = {
        "places": places,
        "velocities": np.zeros((count, 3)),
        "masses": np.full(count, 1e-2),
        "normals": np.tile([0.0, 0.0, -1.0], (count, 1)),
        "conditions": np.full(count, SEPARATE),
        "frictions": np.zeros(count),
        "rooms": np.zeros(count),
    }
    found, after = met(inertia, np.array([[0.0, 0.0, -1.0, 0, 0, 0]]), nodes)
    np.testing.assert_allclose(after[:, 2], found[0, 2] + np.cross(found[0, 3:], places)[:, 2], atol=1e-9)
    assert found[0, 2] == pytest.approx(-1.0, abs=1e-3)


def resting(friction, slope, sweeps=200):
    """A block on four corners on a slope, for a step of gravity's 1 m/s: its velocities after it."""
    inverse = np.diag([1.0, 1.0, 1.0, 6.0, 6.0, 6.0])[None]
    velocities = np.array([[np.sin(slope), 0.0, -np.cos(slope), 0, 0, 0]])
    places = np.array([[x, y, -0.5] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    frames = np.tile(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), (4, 1, 1))
    first, second = np.zeros(4, dtype=np.int64), np.full(4, -1)
    impulses = np.zeros((4, 3))
    ways = (np.full(4, SEPARATE), np.full(4, friction))
    nothing = np.zeros((4, 3))
    solve(
        inverse,
        velocities,
        np.zeros((1, 3)),
        first,
        second,
        places,
        frames,
        nothing,
        np.zeros(4),
        *ways,
        impulses,
        1e-12,
        sweeps,
    )
    return velocities[0], impulses


def test_what_lies_on_a_slope_stays_below_its_angle_of_friction():
    velocities, impulses = resting(0.5, 0.4)
    np.testing.assert_allclose(velocities, 0.0, atol=1e-9)
    assert (impulses[:, 0] >= 0).all()


def test_and_slides_above_it():
    velocities, _ = resting(0.2, 0.4)
    assert velocities[0] == pytest.approx(np.sin(0.4) - 0.2 * np.cos(0.4), rel=1e-6)
    np.testing.assert_allclose(velocities[1:3], 0.0, atol=1e-9)


@pytest.mark.parametrize("aside", [0.0, 0.5, np.pi / 4, 2.0])
def test_friction_is_opposite_to_what_slides_whatever_the_directions_it_is_found_in(aside):
    """A bound on one direction beside what the other has would hold them where they are, off the line."""
    rng = np.random.default_rng(0)
    count, friction = 30, 0.4
    places = np.column_stack([rng.uniform(-1.0, 1.0, (count, 2)), np.full(count, -0.5)])
    ways = aside + rng.uniform(-0.3, 0.3, count)
    zero, along = np.zeros(count), np.column_stack([np.cos(ways), np.sin(ways)])
    frames = np.stack([[[0.0, 0, 1], [x, y, 0], [-y, x, 0]] for x, y in along])
    velocities = np.array([[1.0, 0.0, -1.0, 0, 0, 0]])
    inverse = np.diag([1.0, 1.0, 1.0, 6.0, 6.0, 6.0])[None]
    bodies = (np.zeros(count, dtype=np.int64), np.full(count, -1))
    impulses = np.zeros((count, 3))
    rounds = solve(
        inverse,
        velocities,
        np.zeros((1, 3)),
        *bodies,
        places,
        frames,
        np.zeros((count, 3)),
        zero,
        np.full(count, SEPARATE),
        np.full(count, friction),
        impulses,
        1e-12,
        20000,
    )
    assert rounds < 20000
    # Where a round leaves 99 % of what is lacking at the most, a hundred times its last change is.
    np.testing.assert_allclose(velocities[0], [1.0 - friction, 0, 0, 0, 0, 0], atol=1e-10)
    pushed = np.einsum("ci,cij->cj", impulses, frames)
    np.testing.assert_allclose(pushed[:, 0], -friction * impulses[:, 0], atol=1e-10)
    np.testing.assert_allclose(pushed[:, 1], 0.0, atol=1e-10)


def test_what_sticks_is_held_in_every_direction_however_unlike_they_are():
    """A long body that is met at its end gives way across its length, and its directions move each other."""
    inverse = np.diag([1.0, 1.0, 1.0, 30.0, 1.0, 30.0])[None]
    place, turn = np.array([[0.3, 2.0, -0.5]]), 0.7
    frames = np.array([[[0.0, 0, 1], [np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0]]])
    velocities, impulses = np.array([[1.0, 2.0, -1.0, 0.5, 0.2, 3.0]]), np.zeros((1, 3))
    none = np.zeros((1, 3))
    bodies = (np.zeros(1, dtype=np.int64), np.full(1, -1))
    ways = (np.full(1, SEPARATE), np.full(1, 50.0))
    solve(inverse, velocities, none, *bodies, place, frames, none, np.zeros(1), *ways, impulses, 1e-13, 20000)
    speed = velocities[0, :3] + np.cross(velocities[0, 3:], place[0])
    np.testing.assert_allclose(speed, 0.0, atol=1e-10)
    assert np.hypot(*impulses[0, 1:]) < 50.0 * impulses[0, 0]
