"""Elastic bodies in motion: Blender steps the springs, drives, wind and contact act on the nodes around it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.body_contact import Meeting
from gasp_blender.body_frames import Frames
from gasp_blender.boundary_contact import Bonds, touch
from gasp_blender.cage import gather, scatter
from gasp_blender.cloth import TENSION, cloth
from gasp_blender.impulses import Struck
from gasp_blender.kinematic_constraints import held_nodes, rigid_motion
from gasp_blender.softbody import HEAVIEST, LIGHTEST, SPRING, Gusts, soft_body
from gasp_blender.spring_model import Matter, connected, node_velocities
from gasp_blender.stepping import SLOWEST
from gasp_blender.volume import kept_open, middle_gradients
from gasp_core.contract import Driven, Impulse, Pinned, PointProblem, Wind
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.led_cage import HOLDS_NOTHING, LedCage

__all__ = ["Elastic"]

Array = NDArray[Any]

_UNIT = 0.2
"""In stable steps: what Blender takes for a unit of time, whatever steps are taken."""
_NEAR = 1e-6
"""In voxels: a node as near as this touches."""


class Elastic:
    """Elastic bodies of a problem that are one object of Blender's.

    Parameters
    ----------
    problem, matter
        What is simulated, and the network that stands for it.
    struck
        What impulses strike.
    spacing
        Length of a voxel [m].
    turbulence
        Root mean square acceleration [m/s^2], length [m] and seed; None for still air.
    name
        Before the names of what a checkpoint keeps of them.
    """

    def __init__(
        self,
        problem: PointProblem,
        matter: Matter,
        struck: Struck,
        spacing: float,
        turbulence: tuple[float, float, int] | None = None,
        *,
        name: str = "",
    ) -> None:
        self._problem = problem
        self._name = name
        self._matter = matter
        self._struck = struck
        nodes = matter.cage.nodes
        # Of the longest springs: a node is then never lighter than about 1.3 springs, with the stable step for a unit.
        self._length = matter.cage.coarseness * spacing
        self._unit = _UNIT * matter.stable_step
        bears, lightest = (TENSION, 0.0) if matter.is_cloth else (SPRING, LIGHTEST)
        masses = bears * matter.masses * self._length / (matter.forces * self._unit**2)
        if masses.max() > HEAVIEST or masses.min() < lightest:
            raise SceneError(
                f"the stiffest body makes steps of {self._unit:.3g} s, and masses then go from {masses.min():.2g} to"
                f" {masses.max():.2g}, of {lightest:g} to {HEAVIEST:g} that Blender knows: give the bodies more equal"
                " stiffness over density, or simulate them apart"
            )
        # Blender's turbulence lies in its own frame, which then has to stand still.
        self._still = turbulence is not None
        bodies = np.unique(connected(matter), return_inverse=True)[1].reshape(-1)
        if self._still:
            bodies = np.zeros_like(bodies)
        lows, highs = np.full((bodies.max() + 1, 3), np.inf), np.full((bodies.max() + 1, 3), -np.inf)
        np.minimum.at(lows, bodies, nodes)
        np.maximum.at(highs, bodies, nodes)
        self._frames = Frames(
            bodies=bodies,
            masses=matter.masses,
            places=(lows + highs) / 2,
            velocities=np.zeros_like(lows),
            length=self._length,
            unit=self._unit,
        )
        gravity = np.asarray(problem.gravity) * (self._unit**2 / self._length if self._still else 0.0)
        rows = np.arange(len(nodes))
        places = self._frames.place_within(nodes, rows)
        if matter.is_cloth:
            self._body = cloth(places, matter.cage.voxels, float(masses.mean()), gravity)
        else:
            gusts = None
            if turbulence is not None:
                acceleration, size, seed = turbulence
                force = acceleration * self._unit**2 / self._length * float(masses.mean())
                gusts = Gusts(force=force, size=size / self._length, seed=seed)
            self._body = soft_body(
                places, np.repeat(matter.edges, matter.quarters, axis=0), matter.weights, masses, gravity, gusts
            )
            self._gradients = middle_gradients(nodes / self._length, matter.cage.voxels)
        velocities = node_velocities(matter, problem.points.initial_velocities[matter.rows])
        state = np.concatenate([places, self._frames.velocity_within(velocities, rows)], axis=1)
        self._state = state.astype(np.float32) if self._still else self._frames.recentred(state)
        meets = not matter.is_cloth and matter.bodies.max() > 0
        self._meeting = Meeting(matter.cage, matter.bodies, matter.masses) if meets else None
        self.told = [] if self._meeting is None else self._meeting.told
        self._bonds = Bonds.at_start(problem.colliders, self._places(), matter.sizes)
        self._grips = np.full((len(problem.drives), len(nodes), 3), np.nan)
        owners = np.unique(problem.points.body_ids[matter.rows])[matter.bodies]
        self._led = LedCage.of(problem, nodes, owners, spacing)
        if self._led is not None and self._led.holds_nothing(owners):
            self.told = [*self.told, HOLDS_NOTHING]
        self._constrain(0.0, 0.0, 0.0)

    def step(self, now: float, end: float, step: float) -> bool:
        """From `now` to `end` [s]; False, and nothing changed, where Blender's state is not finite."""
        self._strike(now)
        self._blow(now, step)
        before = self._state
        speed = step / self._unit
        after = self._body.step(before, max(speed, SLOWEST))
        if speed < SLOWEST:
            # The shortest step there is tells the acceleration; of that a shorter one takes its share.
            velocities = before[:, 3:] + (after[:, 3:] - before[:, 3:]).astype(np.float64) * (speed / SLOWEST)
            after[:, 3:] = velocities
            after[:, :3] = before[:, :3] + velocities * speed
        if not np.isfinite(after).all():
            self._state = before
            return False
        self._state = after
        if not self._still:
            self._frames.fly(before, after, np.asarray(self._problem.gravity), step)
        self._keep_open()
        self._meet(step)
        self._constrain(now, end, step)
        return True

    def positions(self) -> Array:
        """Of the points (N, 3) [m]: their places at rest, and what the nodes have moved."""
        matter = self._matter
        rest = self._problem.points.reference_positions[matter.rows]
        return rest + gather(matter.cage, self._places() - matter.cage.nodes)

    def velocities(self) -> Array:
        """Of the points (N, 3) [m/s]."""
        return gather(self._matter.cage, self._velocities())

    def keep(self) -> dict[str, Array]:
        """Everything that changes."""
        meeting = {} if self._meeting is None else {"faces": self._meeting.faces.copy()}
        kept = meeting | {
            "state": self._state.copy(),
            "origins": self._frames.places.copy(),
            "drifts": self._frames.velocities.copy(),
            "bound": self._bonds.bound.copy(),
            "anchors": self._bonds.anchors.copy(),
            "depths": self._bonds.depths.copy(),
            "grips": self._grips.copy(),
        }
        return {self._name + name: array for name, array in kept.items()}

    def restore(self, kept: Mapping[str, Array]) -> None:
        """Go on from what `keep` gave.

        Raises
        ------
        SceneError
            Where it is of another scene.
        """
        expected = {name: np.shape(array) for name, array in self.keep().items()}
        found = checkpoint_arrays(kept, expected, "blender", may_be_nan=(self._name + "grips",))
        arrays = {name.removeprefix(self._name): array for name, array in found.items()}
        self._state = arrays["state"].astype(np.float32)
        if self._meeting is not None:
            self._meeting.faces = arrays["faces"].astype(np.int8)
        self._frames.places = arrays["origins"].astype(np.float64)
        self._frames.velocities = arrays["drifts"].astype(np.float64)
        self._bonds = Bonds(
            bound=arrays["bound"].astype(bool),
            anchors=arrays["anchors"].astype(np.float64),
            depths=arrays["depths"].astype(np.float64),
        )
        self._grips = arrays["grips"].astype(np.float64)

    def close(self) -> None:
        """Let go of Blender's scene."""
        self._body.close()

    def _places(self) -> Array:
        return self._frames.places_of(self._state)

    def _velocities(self) -> Array:
        return self._frames.velocities_of(self._state)

    def _put(self, places: Array | None, velocities: Array | None) -> None:
        """Write what differs, and leave the digits of all else alone."""
        changed = False
        if places is not None:
            rows = np.flatnonzero((places != self._places()).any(axis=1))
            self._state[rows, :3] = self._frames.place_within(places[rows], rows)
            changed |= len(rows) > 0
        if velocities is not None:
            rows = np.flatnonzero((velocities != self._velocities()).any(axis=1))
            self._state[rows, 3:] = self._frames.velocity_within(velocities[rows], rows)
            changed |= len(rows) > 0
        if changed and not self._still:
            self._state = self._frames.recentred(self._state)

    def _keep_open(self) -> None:
        """See `gasp_blender.volume`; all in Blender's units, in which a body's own motion is none of it."""
        if self._matter.is_cloth:
            return
        state = self._state.astype(np.float64)
        changed = kept_open(self._matter.cage.voxels, self._gradients, self._matter.masses, state[:, :3], state[:, 3:])
        if changed is not None:
            self._state[:, 3:] = changed

    def _meet(self, step: float) -> None:
        """Contact of bodies with each other."""
        found = None if self._meeting is None else self._meeting.touch(self._places(), self._velocities(), step)
        if found is not None:
            self._put(*found)

    def _share_within(self, inside: Array) -> Array:
        """Which part of its matter each node has among the points `inside` (N,), (V,)."""
        matter = self._matter
        share = scatter(matter.cage, matter.point_masses * inside)
        return share / np.where(matter.coupling > 0, matter.coupling, 1.0)

    def _blow(self, now: float, step: float) -> None:
        """Drag of the wind over a step, exactly: v goes to u as exp(-k t)."""
        for wind in self._problem.force_fields:
            if not (isinstance(wind, Wind) and wind.start <= now < wind.end):
                continue
            velocities = self._velocities()
            region = wind.region
            share = (
                np.ones(len(velocities))
                if region is None
                else self._share_within(region.signed_distance(self.positions()) <= 0)
            )
            taken = -math.expm1(-wind.drag * step) * share[:, None]
            self._put(None, velocities + taken * (np.asarray(wind.velocity) - velocities))

    def _strike(self, now: float) -> None:
        """Impulses that start now, on the points in their region in proportion to mass."""
        matter = self._matter
        for number, drive in enumerate(self._problem.drives):
            if isinstance(drive, Impulse) and drive.start == now:
                kick = self._struck.kick(number, drive)
                inside = drive.region.signed_distance(self.positions()) <= 0
                given = scatter(matter.cage, matter.point_masses * inside) / matter.masses
                self._put(None, self._velocities() + given[:, None] * kick)

    def _constrain(self, begun: float, now: float, step: float) -> None:
        """At the end of a step: contact, then what drives hold, which is stronger, then what is led."""
        if not (self._problem.colliders or self._problem.drives or self._led):
            return
        places, velocities = self._places(), self._velocities()
        if self._problem.colliders:
            reach = _NEAR * self._length
            sizes = self._matter.sizes
            places, velocities = touch(self._problem.colliders, self._bonds, places, velocities, sizes, reach, step)
        holding = [
            (drive, grips)
            for drive, grips in zip(self._problem.drives, self._grips)
            if isinstance(drive, (Pinned, Driven))
        ]
        for drive, grips in holding:
            if begun < drive.end <= now:
                # It held throughout the step, and lets go at its end; what holds on goes on from there.
                held = ~np.isnan(grips[:, 0])
                places[held], velocities[held] = rigid_motion(drive, now, grips[held])
        for drive, grips in holding:
            if not drive.start <= now < drive.end:
                grips[:] = np.nan
                continue
            held, grips[:] = held_nodes(drive, now, grips, places, self._share_within, self.positions())
            if held.any():
                places[held], velocities[held] = rigid_motion(drive, now, grips[held])
        if self._led is not None and step:
            led, ends = self._led.nodes, self._led.positions(now)
            places[led], velocities[led] = ends, (ends - self._led.positions(now - step)) / step
        self._put(places, velocities)
