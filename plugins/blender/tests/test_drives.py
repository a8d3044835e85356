"""Matter that is held for a time, and let go."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core.contract import Driven, Field, HalfSpace, Pinned, Rigid

MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})
EVERYWHERE = HalfSpace(point=(0.0, 0.0, 50.0), normal=(0.0, 0.0, 1.0))
STEP, GRAVITY = 5e-3, 9.81
ROUNDING = 1e-7
"""Of places below 1 m and velocities below 1 m/s, in single precision, which a step writes once."""


@pytest.mark.parametrize("rigid", [False, True], ids=["elastic", "rigid"])
@pytest.mark.parametrize("velocity", [0.0, 0.5], ids=["pinned", "driven"])
def test_what_is_held_is_let_go_when_its_time_is_over(kit, rigid, velocity):
    end, steps = 0.1, 10
    drive = (
        Driven(region=EVERYWHERE, end=end, velocity=(velocity, 0.0, 0.0))
        if velocity
        else Pinned(region=EVERYWHERE, end=end)
    )
    places = kit.block((2, 2, 2), 0.1)
    material = Rigid(density=1000.0) if rigid else kit.rubber
    with kit.open(kit.problem(places, 0.1, material=material, drives=(drive,)), substep=STEP) as session:
        session.advance_to(end)
        held = session.read(MOVING)
        session.advance_to(end + steps * STEP)
        fallen = session.read(MOVING).positions
    way = np.array([velocity, 0.0, 0.0])
    np.testing.assert_allclose(held.positions, places + way * end, atol=ROUNDING)
    np.testing.assert_allclose(held.velocities, np.broadcast_to(way, places.shape), atol=ROUNDING)
    # Symplectic Euler from rest: the k-th step goes k g dt^2.
    drop = np.array([0.0, 0.0, -GRAVITY * STEP**2 * steps * (steps + 1) / 2])
    np.testing.assert_allclose(fallen, places + way * (end + steps * STEP) + drop, atol=(steps + 1) * ROUNDING)


@pytest.mark.parametrize("order", [1, -1], ids=["first the first", "first the last"])
def test_what_one_drive_lets_go_another_takes_from_where_it_is(kit, order):
    velocity = np.array([0.5, 0.0, 0.2])
    drives = (
        Pinned(region=EVERYWHERE, end=0.1),
        Driven(region=EVERYWHERE, start=0.1, velocity=tuple(velocity)),
    )
    places = kit.block((2, 2, 2), 0.1)
    with kit.open(kit.problem(places, 0.1, drives=drives[::order]), substep=STEP) as session:
        session.advance_to(0.2)
        positions = session.read(MOVING).positions
    np.testing.assert_allclose(positions, places + velocity * 0.1, atol=ROUNDING)
