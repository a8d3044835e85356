"""What pushes matter but neither holds it nor stands in its way: wind, and blows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Impulse, Wind
from gasp_mujoco_flex.body_mass import Matter
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.state import State

__all__ = ["blow", "strike"]

Array = NDArray[Any]


def blow(winds: Sequence[Wind], model: Model, state: State, step: float) -> None:
    """Drag towards the air's velocity, dv/dt = k (u - v), as if implicit in v: it never overshoots.

    Parameters
    ----------
    winds
        Those that blow.
    model, state
        What they blow on: the forces applied in `state` are set.
    step
        To come [s].
    """
    units, count = model.units, model.nodes
    forces = state.data.qfrc_applied
    forces[:] = 0.0
    masses = model.nodal_masses * units.mass
    places, speeds = state.places, state.velocities
    for wind in winds:
        rate = wind.drag / (1 + step * wind.drag)
        inside = np.ones(count) if wind.region is None else wind.region.signed_distance(places) <= 0
        pull = (rate * masses * inside)[:, None] * (np.asarray(wind.velocity) - speeds)
        forces[: 3 * count] += pull.ravel() / units.force
        for number, body in enumerate(model.bodies):
            turn, centre = state.pose(number)
            if wind.region is not None and wind.region.signed_distance(centre[None])[0] > 0:
                continue
            velocity, spin = state.twist(number)
            own = forces[3 * count + 6 * number :]
            own[:3] += rate * body.matter.mass * (np.asarray(wind.velocity) - velocity) / units.force
            own[3:6] -= rate * body.inertia @ (turn.T @ spin) / (units.force * units.length)


def strike(impulse: Impulse, model: Model, state: State) -> bool:
    """Share an impulse among the matter in its region, in proportion to mass; whether there is any."""
    struck: list[tuple[Array, Array]] = []
    for part, places in _matter(model, state):
        inside = impulse.region.signed_distance(places) <= 0
        struck.append((np.where(inside, part.masses, 0.0), places))
    total = sum(float(masses.sum()) for masses, _ in struck)
    if total == 0.0:
        return False
    change = np.asarray(impulse.impulse) / total
    speeds = state.velocities
    for cage, first, (masses, _) in zip(model.cages, model.first_nodes, struck):
        own = slice(first, first + len(cage.masses))
        share = np.asarray(cage.embedding.weights().T @ masses) / np.maximum(cage.masses, 1e-300)
        speeds[own] += share[:, None] * change
    state.send(np.ones(len(speeds), dtype=bool), speeds)
    for number, (masses, places) in enumerate(struck[len(model.cages) :]):
        body = model.bodies[number]
        turn, centre = state.pose(number)
        velocity, spin = state.twist(number)
        kick = masses.sum() * change
        torque = np.cross(masses @ (places - centre), change)
        inertia = turn @ body.inertia @ turn.T
        state.push(number, velocity + kick / body.matter.mass, spin + np.linalg.solve(inertia, torque))
    return True


def _matter(model: Model, state: State) -> list[tuple[Matter, Array]]:
    """All matter of each cage and body, and where it is now, (N, 3) [m]."""
    found: list[tuple[Matter, Array]] = []
    moved = state.displacements
    for cage, first in zip(model.cages, model.first_nodes):
        out = np.empty_like(cage.matter.positions)
        rows = np.arange(len(out), dtype=np.int32)
        cage.embedding.carry(moved[first : first + len(cage.masses)], cage.matter.positions, rows, out)
        found.append((cage.matter, out))
    for number, body in enumerate(model.bodies):
        turn, centre = state.pose(number)
        found.append((body.matter, centre + (body.matter.positions - body.centre) @ turn.T))
    return found
