"""Watches every frame for a state that is no longer credible, whatever the engine thinks of it.

There is no guarantee in advance that an explicit material point method stays stable (Bai and Schroeder 2022,
10.1111/cgf.14620), and some engines reset or clamp in silence. Pure functions over arrays; `inspect` joins them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    Elastic,
    Fluid,
    Material,
    Metal,
    NeoHookean,
    PointProblem,
    PointState,
    Status,
)
from gasp_core.simulation.driving import drive_speed, work_starts
from gasp_core.simulation.initial_overlap import rigid_bodies_overlap
from gasp_core.stepping.body_faces import body_faces

__all__ = [
    "FASTER_THAN_SOUND",
    "Verdict",
    "Watch",
    "excess_displacement",
    "flattened",
    "inspect",
    "kinetic_energy",
    "non_finite_rows",
    "outrun_sound",
    "released_potential",
    "sound_speed",
    "stretched_out",
    "thickness",
    "watch_over",
]

Array = NDArray[Any]

_ENERGY_MARGIN = 1.05
_JUMP = 0.5
"""Of the diagonal of the largest body."""
_VOLUME_RATIOS = (0.05, 20.0)
_STRETCHED_SHARE = 0.01
"""Of the elastic points. A few torn-off points far outside the range are an ugly film; a hundredth of a body is a
blow-up on its way."""
_PLANE = 1e-3
"""Of its diagonal: what is thinner at the start is a plane."""
_FLATTEST = 0.02
"""Of its thickness at the start: a body that is flatter, as a whole, is no longer one."""
_INVISIBLE = 1e-4
"""A motion of this fraction of the size within a frame is not seen, nor its energy minded."""

FASTER_THAN_SOUND = "faster than sound in it"
"""Within whatever `outrun_sound` says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """What the frames of a run are measured against.

    Parameters
    ----------
    problem
        What is simulated.
    masses : (N,) [kg]
    elastic : (N,) bool
        Points whose deformation gradient is that of an elastic solid. What flows or yields may end at any ratio.
    thicknesses : (B,) [m]
        Of each body that keeps its shape, along its thinnest direction, at the start; infinite for the others, for
        sheets, and for those of which something is led: their shape is somebody's wish.
    kinetic_energy
        At the start [J].
    diagonal
        Of the bounding box of the largest body at the start [m].
    frame_step
        Time from frame to frame [s].
    work_start
        Time [s] from which something does work on the matter: energy says nothing from there on.
    pushed_apart
        A rigid body starts inside something, out of which engines move it: what it is lifted by, nobody pays for.
    """

    problem: PointProblem
    masses: Array
    elastic: Array
    thicknesses: Array
    kinetic_energy: float
    diagonal: float
    frame_step: float
    work_start: float
    pushed_apart: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the detector thinks of a frame.

    Parameters
    ----------
    status
        OK, or why the run must end.
    reason
        One sentence where it must.
    kinetic_energy, released_potential
        [J], of the points; None where the state is not finite, or the engine shows no velocities.
    inverted
        Points with det F < 0; None where the engine shows no deformation gradients.
    stretched
        Elastic points with det F outside 0.05..20; None likewise.
    """

    status: Status
    reason: str
    kinetic_energy: float | None
    released_potential: float | None
    inverted: int | None
    stretched: int | None


def watch_over(problem: PointProblem, frame_step: float) -> Watch:
    """The measure of a run, from its problem."""
    points = problem.points
    masses = problem.masses
    elastic_ids = [
        index for index, material in enumerate(problem.materials) if isinstance(material, (Elastic, NeoHookean))
    ]
    diagonal = 0.0
    shapely = [isinstance(material, Elastic | NeoHookean | Metal) for material in problem.materials]
    thicknesses = np.full(int(points.body_ids.max()) + 1, math.inf)
    led = () if problem.trajectories is None else np.unique(points.body_ids[problem.trajectories.rows])
    sheets = body_faces(problem)
    for body in np.unique(points.body_ids):
        rows = points.body_ids == body
        own = points.reference_positions[rows]
        across, thick = float(np.linalg.norm(np.ptp(own, axis=0))), thickness(own)
        # A plane has no thickness that it could lose, and a sheet that falls down flat is whole.
        keeps = all(shapely[index] for index in np.unique(points.material_ids[rows]))
        if keeps and body not in led and body not in sheets and thick > _PLANE * across:
            thicknesses[body] = thick
        diagonal = max(diagonal, across)
    return Watch(
        problem=problem,
        masses=masses,
        elastic=_judged(problem, np.isin(points.material_ids, elastic_ids)),
        thicknesses=thicknesses,
        kinetic_energy=kinetic_energy(masses, points.initial_velocities),
        diagonal=diagonal,
        frame_step=frame_step,
        work_start=work_starts(problem),
        pushed_apart=rigid_bodies_overlap(problem),
    )


def _judged(problem: PointProblem, elastic: Array) -> Array:
    """Those of the elastic points (N,) whose deformation is the engine's: what is led deforms as somebody wants it."""
    if problem.trajectories is not None:
        elastic[problem.trajectories.rows] = False
    return elastic


def non_finite_rows(*arrays: Array | None) -> Array:
    """Rows, ascending, in which any of the arrays (N, ...) is not finite."""
    given = [array for array in arrays if array is not None]
    finite: Array = np.ones(len(given[0]) if given else 0, dtype=np.bool_)
    for array in given:
        finite &= np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    return np.flatnonzero(~finite)


def kinetic_energy(masses: Array, velocities: Array) -> float:
    """Sum of m v^2 / 2 [J]; inf where it overflows."""
    with np.errstate(over="ignore"):
        return float(0.5 * np.einsum("n,ni,ni->", masses, velocities, velocities))


def released_potential(masses: Array, gravity: Sequence[float], displacements: Array) -> float:
    """Work of gravity [J] on points displaced by (N, 3) [m] from the start; negative where they rose."""
    return float((masses @ displacements) @ np.asarray(gravity))


def excess_displacement(before: PointState, now: PointState, gravity: Sequence[float], speed: float) -> Array:
    """How much farther (N,) [m] points went between two states than their speed explains.

    Explained is the larger of the speeds at both ends, or `speed` [m/s] if that is more, plus what gravity adds in
    between: a projectile goes far and is fine.
    """
    step = now.time - before.time
    explained = np.full(len(now.positions), speed)
    for state in (before, now):
        if state.velocities is not None:
            explained = np.maximum(explained, np.linalg.norm(state.velocities, axis=1))
    explained = explained * step + math.hypot(*gravity) * step * step
    return np.linalg.norm(now.positions - before.positions, axis=1) - explained


def stretched_out(determinants: Array, elastic: Array) -> Array:
    """Mask (N,) of elastic points whose volume ratio is outside 0.05..20."""
    low, high = _VOLUME_RATIOS
    return elastic & ~((determinants >= low) & (determinants <= high))


def thickness(positions: Array) -> float:
    """Of a cloud (N, 3) [m] along its thinnest direction: that of a slab of the same second moment."""
    arms = positions - positions.mean(axis=0)
    return math.sqrt(12 * max(float(np.linalg.eigvalsh(arms.T @ arms / len(arms))[0]), 0.0))


def flattened(watch: Watch, positions: Array) -> str:
    """One sentence where a body, its points at positions (N, 3) [m], is next to a plane; else nothing.

    For engines that show no deformation gradient, and laws of which it is not all.
    """
    bodies = watch.problem.points.body_ids
    for body in np.flatnonzero(np.isfinite(watch.thicknesses)):
        thick = thickness(positions[bodies == body])
        if not thick > _FLATTEST * watch.thicknesses[body]:
            return (
                f"body {body} is pressed flat: it is {thick:.3g} m thick, {watch.thicknesses[body]:.3g} m at the start;"
                " slow it down, or make it stiffer or rigid"
            )
    return ""


def sound_speed(material: Material) -> float:
    """Speed of sound [m/s] in matter at rest: sqrt(E/rho) along a bar of a solid, sqrt(K/rho) in a fluid.

    Infinite where a material has no such modulus.
    """
    modulus = _sound_modulus(material)
    return math.inf if modulus is None else math.sqrt(modulus[1] / material.density)


def _sound_modulus(material: Material) -> tuple[str, float] | None:
    """Name and value [Pa] of the modulus that its speed of sound goes with."""
    name = "bulk_modulus" if isinstance(material, Fluid) else "youngs_modulus"
    value: float | None = getattr(material, name, None)
    return None if value is None else (name, value)


def outrun_sound(watch: Watch, before: PointState, now: PointState, body_names: Sequence[str]) -> str:
    """One sentence where a point goes faster than sound in its material, of the one that does so most; else nothing.

    Such matter is in no danger as long as it flies. What it runs into strains it by v / c or so, which is more than any
    law here is meant for.

    Parameters
    ----------
    watch
        The measure.
    before, now
        States of the frame before and of this one, both finite. The speeds at both ends count, and the mean between.
    body_names
        By `PointCloud.body_ids`.
    """
    problem = watch.problem
    speeds = np.zeros(len(now.positions))
    if now.time > before.time:
        speeds = np.linalg.norm(now.positions - before.positions, axis=1) / (now.time - before.time)
    for state in (before, now):
        if state.velocities is not None:
            speeds = np.maximum(speeds, np.linalg.norm(state.velocities, axis=1))
    sound = np.array([sound_speed(material) for material in problem.materials])[problem.points.material_ids]
    row = int(np.argmax(speeds / sound))
    speed = float(speeds[row])
    if not speed > sound[row]:
        return ""
    material = problem.materials[problem.points.material_ids[row]]
    modulus = _sound_modulus(material)
    assert modulus is not None, "nothing outruns what has no speed of sound"
    symbol = "K" if isinstance(material, Fluid) else "E"
    return (
        f'object "{body_names[problem.points.body_ids[row]]}" goes at {speed:.3g} m/s, {FASTER_THAN_SOUND}'
        f" ({material.kind}: sqrt({symbol}/rho) = {sound[row]:.3g} m/s): an impact at that speed crushes it;"
        f" slow it down, or give it a {modulus[0]} above rho v^2 = {material.density * speed**2:.3g} Pa"
    )


def inspect(watch: Watch, before: PointState, now: PointState) -> Verdict:
    """Judge a frame.

    Parameters
    ----------
    watch
        The measure.
    before, now
        States of the frame before and of this one. Without velocities neither energy nor jumps can be judged.
    """
    problem = watch.problem
    bad = non_finite_rows(now.positions, now.velocities)
    if len(bad):
        first = ", ".join(str(row) for row in bad[:5])
        return Verdict(
            status=Status.NON_FINITE,
            reason=f"{len(bad)} of {len(now.positions)} points are no longer finite, first {first}",
            kinetic_energy=None,
            released_potential=None,
            inverted=None,
            stretched=None,
        )
    energy = None if now.velocities is None else kinetic_energy(watch.masses, now.velocities)
    released = released_potential(watch.masses, problem.gravity, now.positions - problem.points.reference_positions)
    inverted: int | None = None
    stretched: int | None = None
    status, reason = Status.OK, ""
    if now.deformation_gradients is not None:
        determinants = np.linalg.det(now.deformation_gradients)
        inverted = int((determinants < 0).sum())
        stretched = int(stretched_out(determinants, watch.elastic).sum())
        if stretched > _STRETCHED_SHARE * max(int(watch.elastic.sum()), 1):
            low, high = _VOLUME_RATIOS
            pressed = int((determinants[watch.elastic] < low).sum())
            status = Status.CRUSHED if 2 * pressed > stretched else Status.NOT_CONVERGED
            reason = (
                f"{stretched} elastic points are at less than {low:g} or more than {high:g} times their volume:"
                " the material is too soft for its load, or the run is unstable"
            )
    flat = flattened(watch, now.positions)
    # What flies through itself is flat for a moment.
    if flat and flattened(watch, before.positions):
        status, reason = Status.CRUSHED, flat
    bound = _energy_bound(watch, released, now.time)
    if energy is not None and now.time <= watch.work_start and not energy <= bound:
        status = Status.ENERGY_GREW
        reason = f"kinetic energy is {energy:.4g} J, where the start and gravity account for {bound:.4g} J"
    jump = "" if now.velocities is None else _jump(watch, before, now)
    if jump:
        status, reason = Status.NOT_CONVERGED, jump
    return Verdict(
        status=status,
        reason=reason,
        kinetic_energy=energy,
        released_potential=released,
        inverted=inverted,
        stretched=stretched,
    )


def _energy_bound(watch: Watch, released: float, time: float) -> float:
    """Largest credible kinetic energy [J]."""
    gravity, mass = math.hypot(*watch.problem.gravity), float(watch.masses.sum())
    # Rounding stirs matter at rest, where nothing has been released; speeds nobody can see are let pass.
    drop = _INVISIBLE * watch.diagonal
    unseen = 0.5 * (drop / watch.frame_step) ** 2 + gravity * drop
    credible = watch.kinetic_energy + max(released, -watch.kinetic_energy)
    if watch.pushed_apart:
        # Wherever matter is put, gravity's power is no more than g sqrt(2 M E): sqrt(2 E) grows by g sqrt(M) a second.
        credible = 0.5 * (math.sqrt(2 * watch.kinetic_energy) + gravity * time * math.sqrt(mass)) ** 2
    return _ENERGY_MARGIN * credible + unseen * mass


def _jump(watch: Watch, before: PointState, now: PointState) -> str:
    speed = drive_speed(
        watch.problem, now.time, now.time - before.time, float(np.linalg.norm(np.ptp(now.positions, axis=0)))
    )
    # One place has no diagonal: a point that only flies is measured by its speed alone, with room for rounding.
    limit = max(_JUMP * watch.diagonal, 1e-6 * float(np.abs(now.positions).max()), 1e-9)
    excess = excess_displacement(before, now, watch.problem.gravity, speed)
    count = int((excess > limit).sum())
    if not count:
        return ""
    return f"{count} points jumped by up to {float(excess.max()):.3g} m more than their speed explains within a frame"
