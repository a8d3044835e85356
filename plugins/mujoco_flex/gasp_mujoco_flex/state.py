# pyright: reportAttributeAccessIssue=false
# MuJoCo makes its names when it is imported; no stub lists them.
"""MuJoCo's state in metres: the nodes of all cages, and how each rigid body lies and moves."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gasp_mujoco_flex.balance import rigid_share
from gasp_mujoco_flex.model import Model

__all__ = ["State"]

Array = NDArray[Any]

_SAVED = mujoco.mjtState.mjSTATE_INTEGRATION


class State:
    """What changes.

    MuJoCo holds displacements of nodes, the positions and quaternions of bodies, and of these the spin in their own
    axes; all in `Model.units`.

    Parameters
    ----------
    model
        Whose state it is; at first, that of the start.
    """

    def __init__(self, model: Model) -> None:
        self.data: Any = mujoco.MjData(model.mj)
        self._model = model
        self._length, self._time, self._speed = model.units.length, model.units.time, model.units.speed
        count, bodies = model.nodes, len(model.bodies)
        self.rest: Array = np.concatenate([np.zeros((0, 3)), *(cage.positions for cage in model.cages)])
        """Of the nodes, (M, 3) [m]."""
        self._moved = self.data.qpos[: 3 * count].reshape(count, 3)
        self._speeds = self.data.qvel[: 3 * count].reshape(count, 3)
        self._masses = np.ascontiguousarray(model.nodal_masses)
        # All three axes of a node are damped alike.
        self._damping = model.mj.dof_damping[: 3 * count : 3].copy()
        self._rest = model.units.place(self.rest)
        self._cages = [slice(first, first + len(cage.masses)) for cage, first in zip(model.cages, model.first_nodes)]
        self._poses = self.data.qpos[3 * count :].reshape(bodies, 7)
        self._turning = self.data.qvel[3 * count :].reshape(bodies, 6)
        self._speeds[:] = np.concatenate([np.zeros((0, 3)), *(cage.velocities for cage in model.cages)]) / self._speed
        for row, body in zip(self._turning, model.bodies):
            row[:3], row[3:] = body.velocity / self._speed, body.spin * self._time

    @property
    def displacements(self) -> Array:
        """Of the nodes, (M, 3) [m]."""
        return self._moved * self._length

    @property
    def places(self) -> Array:
        """Where the nodes are, (M, 3) [m]."""
        return self.rest + self.displacements

    @property
    def velocities(self) -> Array:
        """Of the nodes, (M, 3) [m/s]."""
        return self._speeds * self._speed

    def place(self, which: Array, positions: Array, velocities: Array) -> None:
        """Put the nodes `which` (M,) at positions (M, 3) [m], with velocities (M, 3) [m/s]."""
        self._moved[which] = (positions - self.rest)[which] / self._length
        self._speeds[which] = velocities[which] / self._speed

    def send(self, which: Array, velocities: Array) -> None:
        """Give the nodes `which` (M,) velocities (M, 3) [m/s]."""
        self._speeds[which] = velocities[which] / self._speed

    def nodal_motion(self) -> tuple[Array, Array]:
        """Copies of places and velocities of the nodes, (M, 3), in `Model.units`."""
        return self._rest + self._moved, self._speeds.copy()

    def keep_momenta(self, places: Array, speeds: Array) -> None:
        """Take from the last step what it did to the momenta of cages without a cause outside of them.

        Parameters
        ----------
        places, speeds : (M, 3)
            Of `nodal_motion` before the step.
        """
        option = self._model.mj.opt
        outer = (self.data.qfrc_applied + self.data.qfrc_constraint)[: speeds.size].reshape(-1, 3)
        masses, damping = self._masses[:, None], option.timestep * self._damping
        missing = masses * (speeds - self._speeds + option.timestep * option.gravity) + option.timestep * outer
        # Dampers of nodes, after Rayleigh in proportion to mass, hold to no other node: what they take stays taken.
        # They resist the velocity that a step ends with, and so what is given back as well. Damping in proportion to
        # stiffness is between nodes, and takes nothing.
        missing -= damping[:, None] * self._speeds
        inertia = self._masses + damping
        for own in self._cages:
            change = rigid_share(inertia[own], places[own], missing[own])
            self._speeds[own] += change
            self._moved[own] += option.timestep * change

    def pose(self, number: int) -> tuple[Array, Array]:
        """How a body has turned (3, 3), and where its centre is (3,) [m]."""
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, self._poses[number, 3:])
        start = self._model.bodies[number].centre
        way = self._poses[number, :3] - self._model.units.place(start)
        return turn.reshape(3, 3), start + way * self._length

    def twist(self, number: int) -> tuple[Array, Array]:
        """Velocity of a body's centre and its spin, (3,) [m/s], (3,) [rad/s], in the axes of the world."""
        velocity, spin = self._turning[number, :3] * self._speed, self._turning[number, 3:] / self._time
        return velocity, self.pose(number)[0] @ spin

    def lay(self, number: int, turn: Array, centre: Array) -> None:
        """Turn a body (3, 3) and put its centre (3,) [m]."""
        self._poses[number, :3] = self._model.units.place(centre)
        mujoco.mju_mat2Quat(self._poses[number, 3:], turn.ravel())

    def push(self, number: int, velocity: Array, spin: Array) -> None:
        """Give a body's centre a velocity (3,) [m/s] and it a spin (3,) [rad/s], in the axes of the world."""
        self._turning[number, :3] = velocity / self._speed
        self._turning[number, 3:] = self.pose(number)[0].T @ spin * self._time

    def save(self) -> Array:
        """All of it, in one row of MuJoCo's own order."""
        state = np.zeros(mujoco.mj_stateSize(self._model.mj, _SAVED))
        mujoco.mj_getState(self._model.mj, self.data, state, _SAVED)
        return state

    def restore(self, state: Array) -> None:
        """What `save` saved."""
        mujoco.mj_setState(self._model.mj, self.data, np.array(state, dtype=np.float64), _SAVED)
