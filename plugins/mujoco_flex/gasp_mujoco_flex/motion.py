"""A running scene: one step with all that acts on it, and the points that follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import ContactCondition, Driven, Impulse, Wind
from gasp_mujoco_flex.embedding import carry_rigidly
from gasp_mujoco_flex.holding import TOUCH, Grip, grips, sticking
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.state import State

__all__ = ["Motion"]

Array = NDArray[Any]

_HELD = 1e8
"""Inertia of what is held, in mean nodes: nothing moves it but its drive."""
_FREE, _TOUCHING = 1e-6, 1e-4
"""MuJoCo's tolerance, over the one asked for, without and with contacts: it is one of a step's acceleration, and what
hundreds of steps leave undone of momentum adds up. Contacts take more iterations, and are less exact by themselves."""
_SAMPLE = 500
"""Points of a rigid body that are asked whether a drive reaches it."""


class Motion:
    """Steps a scene.

    Parameters
    ----------
    problem
        The scene.
    model
        Of it.
    tolerance
        Relative, of what is iterated.
    """

    def __init__(self, problem: PointProblem, model: Model, tolerance: float) -> None:
        self._problem = problem
        self._model = model
        self._state = State(model)
        count = model.nodes
        self._armature = model.mj.dof_armature
        self._nodal_masses = model.mj.body_mass[1 : 1 + count]
        self._room = TOUCH * min((float(cage.lattice.sides.min()) for cage in model.cages), default=0.0)
        self._stuck = np.zeros(count, dtype=bool)
        self._stuck_bodies = np.zeros(len(model.bodies), dtype=bool)
        self._sticky = any(one.contact is ContactCondition.STICK for one in problem.colliders)
        self._tolerance = tolerance
        self._touched = False
        self._begun = False

    # Stepping ---------------------------------------------------------------------------------------------------------

    def step(self, time: float, step: float) -> str:
        """Take one step from `time` [s]; what went wrong, or nothing."""
        mj, data = self._model.mj, self._state.data
        mj.opt.timestep = step
        mj.opt.tolerance = (_TOUCHING if self._touched else _FREE) * self._tolerance
        # Stopped within a step, and not pushed back.
        for references, gentle in (
            (mj.geom_solref, self._model.gentle_geoms),
            (mj.flex_solref, self._model.gentle_flexes),
        ):
            references[gentle] = (-1e-12, -1.0 / step)
        self._begun = True
        active = grips(self._problem.drives, time, step)
        data.qfrc_applied[:] = 0.0
        self._blow(time, step)
        nodes = self._grip_nodes(active, step)
        bodies = self._grip_bodies(active, step)
        try:
            mujoco.mj_step(mj, data)
        except mujoco.FatalError as error:
            return f"MuJoCo gave up: {' '.join(str(error).split())}"
        self._touched = bool(data.ncon)
        held, ends, velocities = nodes
        self._state.place(held, ends, velocities)
        for number, turn, centre, velocity, spin in bodies:
            self._state.lay(number, turn, centre)
            self._state.push(number, velocity, spin)
        return ""

    def _grip_nodes(self, active: list[Grip], step: float) -> tuple[Array, Array, Array]:
        """Make held nodes go where drives take them: which they are, and their places and velocities at the end."""
        places = self._state.rest + self._state.displacements
        if self._sticky:
            self._stuck |= sticking(self._problem.colliders, places, self._room)
        held, ends, velocities = self._stuck.copy(), places.copy(), np.zeros_like(places)
        for grip in active:
            # Where several hold a node, the last one does.
            inside = grip.holds(places, self._room)
            held |= inside
            ends[inside] = grip.taken(places[inside])
            velocities[inside] = grip.velocities(ends[inside])
        self._armature[: 3 * len(places)] = np.repeat(np.where(held, _HELD, 0.0), 3)
        self._state.send(held, (ends - places) / step)
        return held, ends, velocities

    def _grip_bodies(self, active: list[Grip], step: float) -> list[tuple[int, Array, Array, Array, Array]]:
        """As nodes: number, turn, centre, velocity and spin at the end, of every rigid body that is held."""
        found: list[tuple[int, Array, Array, Array, Array]] = []
        first = 3 * self._model.nodes
        if not active and not self._sticky:
            self._armature[first:] = 0.0
            return found
        for number, body in enumerate(self._model.bodies):
            turn, centre = self._state.pose(number)
            shown = centre + body.arms[:: max(1, len(body.arms) // _SAMPLE)] @ turn.T
            shown = np.concatenate([shown, centre[None]])
            if self._sticky:
                self._stuck_bodies[number] |= sticking(self._problem.colliders, shown, self._room).any()
            goal = (number, turn, centre, np.zeros(3), np.zeros(3)) if self._stuck_bodies[number] else None
            for grip in active:
                if grip.holds(shown, self._room).any():
                    end = grip.taken(centre)
                    turned = grip.turn @ turn if isinstance(grip.drive, Driven) else turn
                    goal = (number, turned, end, grip.velocities(end), grip.spin)
            self._armature[first + 6 * number : first + 6 * number + 6] = 0.0 if goal is None else _HELD
            if goal is not None:
                self._state.push(number, (goal[2] - centre) / step, goal[4])
                found.append(goal)
        return found

    def _blow(self, time: float, step: float) -> None:
        """Drag towards the air's velocity, dv/dt = k (u - v), as if implicit in v: it never overshoots."""
        winds = [one for one in self._problem.force_fields if isinstance(one, Wind) and one.start <= time < one.end]
        if not winds:
            return
        forces = self._state.data.qfrc_applied
        length, count = self._model.units.length, self._model.nodes
        places, speeds = self._state.rest + self._state.displacements, self._state.velocities
        for wind in winds:
            rate = wind.drag / (1 + step * wind.drag)
            inside = np.ones(count) if wind.region is None else wind.region.signed_distance(places) <= 0
            pull = (rate * self._nodal_masses * inside)[:, None] * (np.asarray(wind.velocity) - speeds)
            forces[: 3 * count] += pull.ravel() / length
            for number, body in enumerate(self._model.bodies):
                turn, centre = self._state.pose(number)
                if wind.region is not None and wind.region.signed_distance(centre[None])[0] > 0:
                    continue
                velocity, spin = self._state.twist(number)
                mass = body.matter.mass / self._model.units.mass
                inertia = body.inertia / (self._model.units.mass * length**2)
                own = forces[3 * count + 6 * number :]
                own[:3] += rate * mass * (np.asarray(wind.velocity) - velocity) / length
                own[3:6] -= rate * inertia @ (turn.T @ spin)

    def strike(self, impulse: Impulse) -> None:
        """Share an impulse among the matter in its region, in proportion to mass."""
        struck: list[tuple[Array, Array]] = []
        for part, places in self._matter():
            inside = impulse.region.signed_distance(places) <= 0
            struck.append((np.where(inside, part.masses, 0.0), places))
        total = sum(float(masses.sum()) for masses, _ in struck)
        if total == 0.0:
            return
        self._begun = True
        change = np.asarray(impulse.impulse) / total
        speeds = self._state.velocities
        for cage, first, (masses, _) in zip(self._model.cages, self._model.first_nodes, struck):
            own = slice(first, first + len(cage.masses))
            share = np.asarray(cage.embedding.weights().T @ masses) / np.maximum(cage.masses, 1e-300)
            speeds[own] += share[:, None] * change
        self._state.send(np.ones(len(speeds), dtype=bool), speeds)
        for number, (masses, places) in enumerate(struck[len(self._model.cages) :]):
            body = self._model.bodies[number]
            turn, centre = self._state.pose(number)
            velocity, spin = self._state.twist(number)
            kick = masses.sum() * change
            torque = np.cross(masses @ (places - centre), change)
            inertia = turn @ body.inertia @ turn.T
            self._state.push(number, velocity + kick / body.matter.mass, spin + np.linalg.solve(inertia, torque))

    def _matter(self) -> list[tuple[Any, Array]]:
        """All matter of each cage and body, and where it is now, (N, 3) [m]."""
        found: list[tuple[Any, Array]] = []
        moved = self._state.displacements
        for cage, first in zip(self._model.cages, self._model.first_nodes):
            out = np.empty_like(cage.matter.positions)
            rows = np.arange(len(out), dtype=np.int32)
            cage.embedding.carry(moved[first : first + len(cage.masses)], cage.matter.positions, rows, out)
            found.append((cage.matter, out))
        for number, body in enumerate(self._model.bodies):
            turn, centre = self._state.pose(number)
            found.append((body.matter, centre + (body.matter.positions - body.centre) @ turn.T))
        return found

    # Looking ----------------------------------------------------------------------------------------------------------

    def speed(self) -> float:
        """Of the fastest node or body [m/s]."""
        nodes = np.linalg.norm(self._state.velocities, axis=1)
        bodies = [float(np.linalg.norm(self._state.twist(number)[0])) for number in range(len(self._model.bodies))]
        return max(float(nodes.max(initial=0.0)), *bodies, 0.0)

    def lost(self) -> str:
        """What is no longer finite, in a sentence; nothing where all is."""
        data = self._state.data
        if np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all():
            return ""
        bad = np.flatnonzero(~np.isfinite(self.positions()).all(axis=1))
        return f"{len(bad)} points are no longer finite, first {', '.join(map(str, bad[:5])) or 'none alone'}"

    def complaints(self) -> list[str]:
        """What MuJoCo warned of since the last look, and need not end a run."""
        warning = self._state.data.warning
        told = {
            mujoco.mjtWarning.mjWARN_INERTIA: "its elastic solve did not converge within its iterations",
            mujoco.mjtWarning.mjWARN_CONTACTFULL: "it had no room for all contacts",
            mujoco.mjtWarning.mjWARN_CNSTRFULL: "it had no room for all constraints",
        }
        found = [
            f"MuJoCo, in {warning[kind].number} steps: {text}" for kind, text in told.items() if warning[kind].number
        ]
        for kind in told:
            warning[kind].number = 0
        return found

    def positions(self) -> Array:
        """Of the scene's points, (N, 3) [m]."""
        points = self._problem.points
        out = np.empty((len(points), 3))
        moved = self._state.displacements
        for cage, first in zip(self._model.cages, self._model.first_nodes):
            own = moved[first : first + len(cage.masses)]
            cage.embedding.carry(own, points.reference_positions, cage.matter.rows, out)
        for number, body in enumerate(self._model.bodies):
            turn, centre = self._state.pose(number)
            carry_rigidly(body.arms, turn, centre, body.matter.rows, out)
        return out

    def velocities(self) -> Array:
        """Of the scene's points, (N, 3) [m/s]; those given, as long as no step was taken."""
        points = self._problem.points
        if not self._begun:
            return points.initial_velocities.copy()
        out = np.empty((len(points), 3))
        speeds = self._state.velocities
        for cage, first in zip(self._model.cages, self._model.first_nodes):
            cage.embedding.spread(speeds[first : first + len(cage.masses)], cage.matter.rows, out)
        for number, body in enumerate(self._model.bodies):
            turn, _ = self._state.pose(number)
            velocity, spin = self._state.twist(number)
            x, y, z = spin
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            carry_rigidly(body.arms, cross @ turn, velocity, body.matter.rows, out)
        return out

    # Going on ---------------------------------------------------------------------------------------------------------

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes."""
        return {
            "state": self._state.save(),
            "stuck": np.concatenate([self._stuck, self._stuck_bodies]),
            "flags": np.array([self._begun, self._touched]),
        }

    def restore(self, checkpoint: Mapping[str, Array]) -> None:
        """Go on from what `checkpoint` gave."""
        self._state.restore(checkpoint["state"])
        self._stuck, self._stuck_bodies = np.split(np.array(checkpoint["stuck"], dtype=bool), [len(self._stuck)])
        self._begun, self._touched = (bool(flag) for flag in checkpoint["flags"])
