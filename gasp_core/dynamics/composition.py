"""An object that moves by itself, from its file to what physics begins with and to how it drifts from there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.dynamics.analytic import AnalyticMotion, analytic_motion
from gasp_core.dynamics.d_miso.checkpoint import read_checkpoint
from gasp_core.dynamics.d_miso.motion import CheckpointMotion
from gasp_core.dynamics.frame_sequence import SequenceMotion, frame_files
from gasp_core.dynamics.function_motion import CallableMotion
from gasp_core.dynamics.motion import PlacedMotion, SceneMotion, velocities
from gasp_core.errors import SceneError
from gasp_core.games import Covariance, choose_vertices, edge_axes, invert_simplices, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.scene.motions import DMiSoMotion, FrameSequence, Motion, PythonMotion
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.selection import PlacedObject, bounded_by_region, settle
from gasp_core.scene.settings import MapChoice

__all__ = ["PrescribedMotion", "Played", "drifted", "play"]

Array = NDArray[Any]

_SAME = 1e-12
"""Of the extent: nearer than that, a simplex is where it is at rest."""
_WITH_MESH = 1e-6
"""Of how far the Gaussians reach: nearer than that, single precision has them where the file has them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A motion as an object plays it, over simulated time.

    Parameters
    ----------
    name
        Of the object.
    choice
        What was asked for.
    motion
        psi of the drawn Gaussians, about the place of the splat's origin in the world [m].
    vertices
        Of a simplex.
    """

    name: str
    choice: Motion
    motion: SceneMotion
    vertices: Literal[3, 4]

    def scene_time(self, time: float) -> float:
        """Scene time [s] at a simulated time [s]; psi stands still beyond its span."""
        return float(np.clip(self.choice.scene_time(time), *self.motion.span))

    def simplices(self, time: float) -> Array:
        """Simplices (N, V, 3) [m] at a simulated time [s].

        Raises
        ------
        SceneError
            Where they are not finite.
        """
        moment = self.scene_time(time)
        return self._checked(self.motion.simplices(moment), moment)

    def velocities(self) -> Array:
        """Of the simplices at the start, (N, V, 3) [m/s]; zero where physics is not to have them."""
        moment = self.scene_time(0.0)
        first, last = self.motion.span
        # Beyond its span psi stands still.
        rests = not first <= self.choice.scene_time(0.0) <= last
        if rests or self.choice.composition == "carried" or self.choice.start_velocity is False:
            return np.zeros((len(self.motion), self.vertices, 3))
        return self._checked(self.choice.rate_at_start * velocities(self.motion, moment), moment)

    def _checked(self, array: Array, moment: float) -> Array:
        bad = np.flatnonzero(~np.isfinite(array).all(axis=(1, 2)))
        if len(bad):
            first = ", ".join(str(row) for row in bad[:5])
            raise SceneError(
                f'object "{self.name}": its motion is not finite at scene time {moment:g} s,'
                f" in {len(bad)} of {len(array)} Gaussians, first {first}"
            )
        return array


@dataclass(frozen=True, slots=True, kw_only=True)
class PrescribedMotion:
    """psi(V, s) - psi(V, s0) of a body's simplices.

    The simplices of the Gaussians at s0 need not be psi(V, s0): T gives edges along principal axes, psi any that span
    the same. Their edges are combinations of psi's, at all times the same ones.

    Parameters
    ----------
    played
        The motion of all drawn Gaussians of the object.
    rows : (N,)
        Those of the body.
    start : (N, V, 3) [m]
        psi(V, s0).
    mixing : (N, V - 1, V - 1)
        Edges of the body at rest = mixing @ edges of psi(V, s0).
    """

    played: Played
    rows: Array
    start: Array
    mixing: Array

    @property
    def has_formula(self) -> bool:
        """Whether `unmoved` is all that is needed to have it again."""
        return isinstance(self.played.motion, AnalyticMotion)

    @property
    def unmoved(self) -> Array:
        """What its formula is applied to, (N, V, 3) [m]."""
        motion = self.played.motion
        assert isinstance(motion, AnalyticMotion), "only what has a formula"
        return motion.rest[self.rows]

    @classmethod
    def again(cls, name: str, choice: Motion, unmoved: Array, origin: Array, rest: Array) -> PrescribedMotion:
        """Of a body with a formula, as it was before.

        Parameters
        ----------
        name
            Of the object.
        choice
            Its motion.
        unmoved : (N, V, 3) [m]
            As it gave it.
        origin : (3,) [m]
            Where the splat's origin was put.
        rest : (N, V, 3) [m]
            Simplices at the start.

        Raises
        ------
        SceneError
            Where the motion has no formula.
        """
        motion = analytic_motion(choice, unmoved, origin)
        if motion is None:
            raise SceneError(f'object "{name}": a motion of kind "{choice.kind}" has no formula')
        played = Played(name=name, choice=choice, motion=motion, vertices=4 if unmoved.shape[1] == 4 else 3)
        return cls.of(played, np.ones(len(unmoved), dtype=bool), rest)

    @classmethod
    def of(cls, played: Played, moving: Array, rest: Array) -> PrescribedMotion:
        """For the body of the `moving` (mask) among the drawn Gaussians, whose simplices at rest are (N, V, 3) [m]."""
        rows = np.flatnonzero(moving)
        start = played.simplices(0.0)[rows]
        own, given = rest[:, 1:] - rest[:, :1], start[:, 1:] - start[:, :1]
        mixing = np.tile(np.eye(own.shape[1]), (len(own), 1, 1))
        largest = np.abs(own).max(axis=(1, 2), keepdims=True)
        other = np.flatnonzero((np.abs(own - given) > 1e-9 * largest).any(axis=(1, 2)))
        mixing[other] = own[other] @ np.linalg.pinv(given[other], rcond=1e-12)
        return cls(played=played, rows=rows, start=start, mixing=mixing)

    def select(self, rows: Array) -> PrescribedMotion:
        """That of some of the body's Gaussians."""
        return replace(self, rows=self.rows[rows], start=self.start[rows], mixing=self.mixing[rows])

    def at(self, time: float) -> Array:
        """At a simulated time [s], (N, V, 3) float32 [m], as recordings keep it; see `drifted`."""
        return self._drift(time).astype(np.float32)

    def displacements(self, time: float) -> Array:
        """Of the vertices at a simulated time [s] from the start, (N, V, 3) [m]."""
        return drifted(np.zeros_like(self.start), self._drift(time))

    def _drift(self, time: float) -> Array:
        return self._mixed(self.played.simplices(time)[self.rows] - self.start)

    def velocities(self) -> Array:
        """Of the vertices at the start, as far as physics is to have them, (N, V, 3) [m/s]."""
        return drifted(np.zeros_like(self.start), self._mixed(self.played.velocities()[self.rows]))

    def _mixed(self, differences: Array) -> Array:
        """Differences of the means, and of the edges of the body."""
        edges = self.mixing @ (differences[:, 1:] - differences[:, :1])
        return np.concatenate([differences[:, :1], edges], axis=1)


def drifted(rest: Array, drift: Array) -> Array:
    """Simplices (N, V, 3) at rest that have drifted by (N, V, 3): rows of the mean, and of the change of each edge.

    So kept, a float32 knows the change of the shortest edge to its own last digit, however far the mean has gone.
    """
    result = rest + drift[:, :1]
    result[:, 1:] += drift[:, 1:]
    return result


def play(item: SplatObject, gaussians: Gaussians, maps: MapChoice) -> tuple[PlacedObject, Played]:
    """Select and place an object that moves by itself, and let it be where it is at the start.

    Height, position and what is left out are those of the splat in the file; for a folder, of its first time.

    Parameters
    ----------
    item
        With a motion.
    gaussians
        As the file holds them.
    maps
        Of the scene.

    Raises
    ------
    SceneError, SplatFormatError
        Where the object cannot be placed, or its motion not be played.
    """
    choice = item.motion
    assert choice is not None
    placed = settle(item, gaussians)
    wanted = item.vertices or maps.vertices
    vertices = choose_vertices(placed.gaussians.select(placed.moving)) if wanted == "auto" else wanted
    origin = placed.placement.translation
    local = placed.gaussians.with_(means=placed.gaussians.means - origin)
    rest = to_simplices(local, vertices)
    motion = _motion_of(item, choice, gaussians, placed, rest)
    last, start = motion.span[1], choice.scene_time(0.0)
    if start > last and choice.schedule is None and choice.rate >= 0:
        raise SceneError(
            f'object "{item.name}": its motion would start = {start:g} s, after its last, at {last:g} s:'
            " nothing would move, start earlier"
        )
    played = Played(name=item.name, choice=choice, motion=motion, vertices=vertices)
    begins = played.simplices(0.0)
    if item.reduction.mode == "mesh":
        _refuse_parting(played, rest, begins)
    begun = _moved(local, rest, begins, maps.covariance)
    at_start = replace(placed, gaussians=begun.with_(means=begun.means + origin))
    return bounded_by_region(at_start), played


def _refuse_parting(played: Played, rest: Array, start: Array) -> None:
    """Refuse what has left its mesh when physics begins: only a formula says where it takes that.

    Raises
    ------
    SceneError
        With how far it is.
    """
    means = rest[:, 0]
    gone = float(np.linalg.norm(start[:, 0] - means, axis=1).max(initial=0.0))
    if not isinstance(played.motion, AnalyticMotion) and gone > _WITH_MESH * float(np.abs(means).max(initial=0.0)):
        raise SceneError(
            f'object "{played.name}": its motion of kind "{played.choice.kind}" starts up to {gone:.3g} m from where'
            " its file has it, and does not say where that takes its mesh: let it start there, or choose another"
            ' reduction.mode than "mesh"'
        )


def _motion_of(
    item: SplatObject, choice: Motion, gaussians: Gaussians, placed: PlacedObject, rest: Array
) -> SceneMotion:
    """The motion that is asked for."""
    analytic = analytic_motion(choice, rest, placed.placement.translation)
    if analytic is not None:
        return analytic
    vertices = 4 if rest.shape[1] == 4 else 3
    if isinstance(choice, FrameSequence):
        assert isinstance(item.splat, Path)  # SplatObject refuses all else
        files = frame_files(item.splat)
        own: SceneMotion = SequenceMotion(files, choice.frame_rate, vertices, choice.match)
    elif isinstance(choice, DMiSoMotion):
        assert isinstance(item.splat, Path)  # SplatObject refuses all else
        own = CheckpointMotion(read_checkpoint(item.splat, choice.iteration)[0], choice.duration, vertices)
    elif isinstance(choice, PythonMotion):
        own = CallableMotion(choice, to_simplices(gaussians, vertices))
    else:
        raise SceneError(f'object "{item.name}": this GASP knows no motion of kind "{choice.kind}"')
    return PlacedMotion(motion=own, rows=placed.rows, placement=placed.placement)


def _moved(local: Gaussians, rest: Array, start: Array, covariance: Covariance) -> Gaussians:
    """The Gaussians of simplices that psi has brought from rest to where they start."""
    away = np.abs(start - rest).max(axis=(1, 2)) > _SAME * np.ptp(rest, axis=(0, 1)).max()
    moved = invert_simplices(start, reference=local, covariance=covariance).gaussians
    scales = moved.scales if rest.shape[1] == 4 else _thin(moved.scales, local.scales)
    # What has not moved stays what it is: T^-1 T may name equal axes in another order.
    return Gaussians(
        means=np.where(away[:, None], moved.means, local.means),
        quaternions=np.where(away[:, None], moved.quaternions, local.quaternions),
        scales=np.where(away[:, None], scales, local.scales),
        opacities=local.opacities,
        harmonics=np.where(away[:, None, None], moved.harmonics, local.harmonics),
    )


def _thin(scales: Array, rest_scales: Array) -> Array:
    """Scales (N, 3) of triangles, the axis that they leave out no longer than the others: T must leave out the same."""
    seen = edge_axes(rest_scales, 3)
    left_out = 3 - seen.sum(axis=1, keepdims=True)
    bound = (1 - 1e-9) * np.take_along_axis(scales, seen, axis=1).min(axis=1, keepdims=True)
    result = scales.copy()
    np.put_along_axis(result, left_out, np.minimum(np.take_along_axis(scales, left_out, axis=1), bound), axis=1)
    return result
