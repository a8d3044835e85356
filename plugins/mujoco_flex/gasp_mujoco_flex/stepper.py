# pyright: reportAttributeAccessIssue=false
# MuJoCo makes its names when it is imported; no stub lists them.
"""A running scene: one step with all that acts on it, and the points that follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import ContactCondition, Driven, EngineAccuracy, Impulse, PointProblem, Wind
from gasp_core.stepping.embedding import carry_rigidly
from gasp_core.stepping.forcing import force_fields_at
from gasp_core.stepping.led_cage import HOLDS_NOTHING, LedCage
from gasp_mujoco_flex.external_forces import blow, strike
from gasp_mujoco_flex.kinematic_constraints import TOUCH, Grip, grips, sticking
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.state import State

__all__ = ["Motion"]

Array = NDArray[Any]

_HELD = 1e8
"""Inertia of what is held, in mean nodes: nothing moves it but its drive."""
_FACTORED, _ITERATED = 1e-14, 1e-6
"""MuJoCo's tolerance, over the one asked for. It is an absolute one of contacts, of mass times acceleration squared: a
body of a ten-thousandth of the mass, at a hundredth of the acceleration, is 1e-8. By Newton's method exactness costs a
tenth of a step; conjugate gradients end at their last iteration first."""
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
    accuracy
        Tolerance and bound of what is iterated.
    """

    def __init__(self, problem: PointProblem, model: Model, accuracy: EngineAccuracy) -> None:
        self._problem = problem
        self._model = model
        self._state = State(model)
        self._armature = model.mj.dof_armature
        self._room = TOUCH * min((float(cage.grid.sides.min()) for cage in model.cages), default=0.0)
        self._stuck = np.zeros(model.nodes, dtype=bool)
        self._stuck_bodies = np.zeros(len(model.bodies), dtype=bool)
        self._sticky = any(one.contact is ContactCondition.STICK for one in problem.colliders)
        owners = _owners(problem, model)
        self.led = _led_nodes(problem, model, self._state.rest, owners)
        """What takes nodes along."""
        model.mj.opt.tolerance = accuracy.solver_tolerance * (_FACTORED if model.factored else _ITERATED)
        if accuracy.iteration_limit is not None:
            model.mj.opt.iterations = accuracy.iteration_limit
        self.iterations = 0
        self._gentle = [
            (references, gentle)
            for references, gentle in (
                (model.mj.geom_solref, model.gentle_geoms),
                (model.mj.flex_solref, model.gentle_flexes),
            )
            if gentle.any()
        ]
        self._radii = [float(np.linalg.norm(body.arms, axis=1).max()) for body in model.bodies]
        self._holding = False
        self._idle: list[str] = []
        if self.led is not None and self.led.holds_nothing(owners):
            self._idle.append(HOLDS_NOTHING)
        self._begun = False

    # Stepping ---------------------------------------------------------------------------------------------------------

    def step(self, time: float, step: float) -> str:
        """Take one step from `time` [s]; what went wrong, or nothing."""
        mj = self._model.mj
        mj.opt.timestep = step / self._model.units.time
        for references, gentle in self._gentle:
            # Stopped within a step, and not pushed back.
            references[gentle] = (-1e-12, -1.0 / mj.opt.timestep)
        self._begun = True
        if self._problem.force_fields:
            winds = [one for one in force_fields_at(self._problem.force_fields, time) if isinstance(one, Wind)]
            blow(winds, self._model, self._state, step)
        active = grips(self._problem.drives, time, step)
        if not active and not self._sticky and self.led is None:
            # A rigid body's step takes microseconds: nothing is looked at that nothing holds.
            if self._holding:
                self._armature[:] = 0.0
                self._holding = False
            return self._free_step()
        self._holding = True
        self._look_for_idle(active, time)
        held, ends, velocities = self._grip_nodes(active, time, step)
        bodies = self._grip_bodies(active, step)
        failure = self._stepped()
        self._state.place(held, ends, velocities)
        for number, turn, centre, velocity, spin in bodies:
            self._state.lay(number, turn, centre)
            self._state.push(number, velocity, spin)
        return failure

    def _free_step(self) -> str:
        """A step of what nothing holds: it is known then what becomes of momenta."""
        if not self._model.cages:
            return self._stepped()
        places, speeds = self._state.nodal_motion()
        failure = self._stepped()
        if not failure:
            self._state.keep_momenta(places, speeds)
        return failure

    def _stepped(self) -> str:
        """Let MuJoCo take the step; what went wrong, or nothing."""
        try:
            mujoco.mj_step(self._model.mj, self._state.data)
            self.iterations += int(self._state.data.solver_niter.sum())
        except mujoco.FatalError as error:
            return f"MuJoCo gave up: {' '.join(str(error).split())}"
        return ""

    def _look_for_idle(self, active: list[Grip], time: float) -> None:
        """Note which drives begin at `time` [s] and reach nothing: a region may be smaller than what it is to hold."""
        for grip in active:
            if max(grip.drive.start, 0.0) != time:
                continue
            bodies = (self._shown(number) for number in range(len(self._model.bodies)))
            if not any(grip.holds(places, self._room).any() for places in (self._state.places, *bodies)):
                self._idle.append(
                    f"a drive ({type(grip.drive).__name__}) reaches no node and no rigid body as it begins,"
                    f" at {time:.3g} s: give it a region of a cell at least, or one where matter is"
                )

    def _shown(self, number: int) -> Array:
        """Where the centre of a rigid body and some of its points are, (K, 3) [m]."""
        turn, centre = self._state.pose(number)
        arms = self._model.bodies[number].arms
        return np.concatenate([centre + arms[:: max(1, len(arms) // _SAMPLE)] @ turn.T, centre[None]])

    def _grip_nodes(self, active: list[Grip], time: float, step: float) -> tuple[Array, Array, Array]:
        """Make held nodes go where they are taken: which they are, and their places and velocities at the end."""
        places = self._state.places
        if self._sticky:
            self._stuck |= sticking(self._problem.colliders, places, self._room)
        held, ends, velocities = self._stuck.copy(), places.copy(), np.zeros_like(places)
        for grip in active:
            # Where several hold a node, the last one does.
            inside = grip.holds(places, self._room)
            held |= inside
            ends[inside] = grip.taken(places[inside])
            velocities[inside] = grip.velocities(ends[inside])
        if self.led is not None:
            led = self.led.nodes
            held[led] = True
            ends[led] = self.led.positions(time + step)
            velocities[led] = (ends[led] - places[led]) / step
        self._armature[: 3 * len(places)] = np.repeat(np.where(held, _HELD, 0.0), 3)
        self._state.send(held, (ends - places) / step)
        return held, ends, velocities

    def _grip_bodies(self, active: list[Grip], step: float) -> list[tuple[int, Array, Array, Array, Array]]:
        """As nodes: number, turn, centre, velocity and spin at the end, of every rigid body that is held."""
        found: list[tuple[int, Array, Array, Array, Array]] = []
        first = 3 * self._model.nodes
        for number in range(len(self._model.bodies)):
            turn, centre = self._state.pose(number)
            shown = self._shown(number)
            if self._sticky:
                touching = np.concatenate([shown, centre + self._model.bodies[number].surface @ turn.T])
                self._stuck_bodies[number] |= sticking(self._problem.colliders, touching, self._room).any()
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

    def strike(self, impulse: Impulse) -> None:
        """Share an impulse among the matter in its region, in proportion to mass."""
        if not strike(impulse, self._model, self._state):
            self._idle.append(
                f"an impulse reaches nothing, at {impulse.start:.3g} s: give it a region where matter is at that time"
            )
            return
        self._begun = True

    # Looking ----------------------------------------------------------------------------------------------------------

    def speed(self) -> float:
        """Of the fastest node or body [m/s]."""
        nodes = np.linalg.norm(self._state.velocities, axis=1)
        bodies = [float(np.linalg.norm(self._state.twist(number)[0])) for number in range(len(self._model.bodies))]
        return max(float(nodes.max(initial=0.0)), *bodies, 0.0)

    def bounds(self) -> tuple[Array, Array]:
        """Corners (3,), (3,) [m] of a box that no point is outside of: that of nodes, and of balls around bodies."""
        found = [self._state.places]
        for number, radius in enumerate(self._radii):
            centre = self._state.pose(number)[1]
            found.append(np.stack([centre - radius, centre + radius]))
        places = np.concatenate(found)
        return places.min(axis=0), places.max(axis=0)

    def lost(self) -> str:
        """What is no longer finite, in a sentence; nothing where all is."""
        data = self._state.data
        if np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all():
            return ""
        bad = np.flatnonzero(~np.isfinite(self.positions()).all(axis=1))
        return f"{len(bad)} points are no longer finite, first {', '.join(map(str, bad[:5])) or 'none alone'}"

    def complaints(self) -> list[str]:
        """What went on since the last look that need not end a run."""
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
        found += self._mirrored()
        found += self._idle
        self._idle = []
        return found

    def _mirrored(self) -> list[str]:
        places = self._state.places
        flags = [
            cage.inside_out(places[first : first + len(cage.masses)])
            for cage, first in zip(self._model.cages, self._model.first_nodes)
        ]
        count = sum(int(each.sum()) for each in flags)
        if not count:
            return []
        return [
            f"{count} of {sum(map(len, flags))} cells are turned inside out, and what is in them is shown so: matter is"
            " hit harder than it can bear; make it stiffer"
        ]

    def positions(self) -> Array:
        """Of the scene's points, (N, 3) [m], as if none of them were led."""
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
        """As `positions`, (N, 3) [m/s]; those given, as long as no step was taken."""
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
            "begun": np.array(self._begun),
        }

    def restore(self, checkpoint: Mapping[str, Array]) -> None:
        """Go on from what `checkpoint` gave."""
        self._state.restore(checkpoint["state"])
        self._stuck, self._stuck_bodies = np.split(np.array(checkpoint["stuck"], dtype=bool), [len(self._stuck)])
        self._begun = bool(checkpoint["begun"])


def _owners(problem: PointProblem, model: Model) -> Array:
    """The bodies (M,) of the nodes of all cages."""
    bodies = [np.full(len(cage.masses), problem.points.body_ids[cage.matter.rows[0]]) for cage in model.cages]
    return np.concatenate([np.zeros(0), *bodies])


def _led_nodes(problem: PointProblem, model: Model, places: Array, owners: Array) -> LedCage | None:
    """What takes nodes along, which begin at places (M, 3) [m], of bodies (M,); None where nothing does."""
    side = min((float(cage.grid.sides.min()) for cage in model.cages), default=0.0)
    return LedCage.of(problem, places, owners, side)
