"""Drives, winds and impulses of which nothing comes, or not what was meant: told by name before a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Drive,
    Driven,
    ForceField,
    Impulse,
    Pinned,
    PointProblem,
    Rigid,
    Shape,
    SignedDistanceField,
    SphereShape,
    Wind,
)
from gasp_core.reduction.assembly import Assembly
from gasp_core.simulation.driving import work_starts
from gasp_core.stepping.grid import grid_node

__all__ = ["idle_acts"]

Array = NDArray[Any]

_TOUCH = 1e-3
"""In cells: how far outside a region a node still counts as in it, as it does in engines that have such nodes."""


def idle_acts(assembly: Assembly, end: float) -> Iterator[str]:
    """A sentence for each drive, impulse and wind that does nothing.

    Parameters
    ----------
    assembly
        What an engine is given.
    end
        Time [s] of the last frame; where it is 0, nothing acts, and that is told elsewhere.
    """
    problem, spacing = assembly.problem, assembly.spacing
    for name, drive in zip(assembly.drive_names, problem.drives):
        yield from _of_act(f"{name} ({drive.kind})", drive, problem, spacing, end)
    for number, wind in enumerate(problem.force_fields, start=1):
        yield from _of_act(f"wind {number}", wind, problem, spacing, end)


def _of_act(name: str, act: Drive | ForceField, problem: PointProblem, spacing: float, end: float) -> Iterator[str]:
    """The first sentence that fits: what never acts is not looked at any further."""
    if 0 < end <= act.start:
        yield f"{name}: {_too_late(act, end)}"
    elif isinstance(act, Wind) and act.drag == 0:
        yield f"{name}: with drag = 0 it takes nothing along: drag says how fast matter takes on its velocity, in 1/s"
    elif act.region is not None:
        sentence = _of_region(act, act.region, problem, spacing)
        if sentence:
            yield f"{name}: {sentence}"


def _too_late(act: Drive | ForceField, end: float) -> str:
    if act.start > end:
        return f"it starts at {act.start:g} s, and the run ends at {end:g} s: it never acts"
    why = "an impulse at the very end is never given" if isinstance(act, Impulse) else "it never acts"
    return f"it starts at {act.start:g} s, just when the run ends: {why}, as no step begins then"


def _of_region(act: Drive | ForceField, region: Shape, problem: PointProblem, spacing: float) -> str:
    """What is odd about where it acts, as far as that can be known before anything has moved."""
    known = act.start == 0 or _rests_until(problem, act.start)
    inside: Array | None = None
    if known:
        distances = region.signed_distance(problem.points.reference_positions)
        nearest = float(distances.min())
        if nearest > 0:
            when = "at the start" if act.start == 0 else f"as it begins, at {act.start:g} s, until when all is at rest"
            return (
                f"its region holds nothing {when}, the nearest matter is {nearest:.3g} m off:"
                " gasp inspect FILE --height shows where things are (world coordinates, metres, +z up)"
            )
        inside = distances <= 0
    # A rigid body is held with any point of it, wherever nodes are.
    if not isinstance(act, (Pinned, Driven)) or _may_be_rigid(problem, inside):
        return ""
    return _between_nodes(act, region, problem, spacing)


def _rests_until(problem: PointProblem, time: float) -> bool:
    """Whether matter is sure to be where it begins until a time [s]: nothing pulls, pushes or touches it."""
    return (
        not any(problem.gravity)
        and not problem.points.initial_velocities.any()
        and not problem.points.body_ids.any()
        and not problem.colliders
        and work_starts(problem) >= time
    )


def _may_be_rigid(problem: PointProblem, inside: Array | None) -> bool:
    """Whether some matter of those points (N,), or of all where nobody knows which, is rigid."""
    ids = problem.points.material_ids
    used = np.unique(ids if inside is None else ids[inside])
    return any(isinstance(problem.materials[row], Rigid) for row in used)


def _between_nodes(drive: Pinned | Driven, region: Shape, problem: PointProblem, spacing: float) -> str:
    """A sentence where a region has no node of the grid that the engine is asked for, or as it moves not always one."""
    nodes = _nodes_within(region, grid_node(problem, spacing), spacing)
    if nodes is None:
        return ""
    moves = isinstance(drive, Driven) and (any(drive.velocity) or any(drive.angular_velocity))
    if moves and _width(region) < spacing:
        what, when = "is narrower than a cell", " wherever it is between nodes on its way"
    elif not (region.signed_distance(nodes) <= _TOUCH * spacing).any():
        what, when = "has no node of the grid in it", " where it begins" if moves else ""
    else:
        return ""
    return (
        f"its region, {_told(region)}, {what}: an engine that moves matter by a grid, as MPM does, here of cells of"
        f" {spacing:.3g} m, holds nothing by it{when}; {_larger(region, spacing)}"
    )


def _nodes_within(region: Shape, node: Array, spacing: float) -> Array | None:
    """Nodes (N, 3) [m] of which one is in the region if any is, of a grid with a node at `node` (3,) [m].

    None where there is no need to ask: half of space has nodes wherever its plane is.
    """
    match region:
        case BoxShape(center=center) | SphereShape(center=center):
            # What lies evenly around its middle has the node next to that, if it has any.
            return (node + spacing * np.round((np.asarray(center) - node) / spacing))[None]
        case SignedDistanceField(origin=origin, spacing=step, values=values):
            low = np.ceil((np.asarray(origin) - node) / spacing)
            high = np.floor((np.asarray(origin) + step * (np.array(values.shape) - 1) - node) / spacing)
            counts = (high - low + 1).astype(int).tolist()
            return node + spacing * (low + np.indices(counts).reshape(3, -1).T)
        case _:
            return None


def _width(region: Shape) -> float:
    """Of its narrowest side [m]."""
    match region:
        case BoxShape(half_extents=half_extents):
            return 2 * min(half_extents)
        case SphereShape(radius=radius):
            return 2 * radius
        case _:
            return math.inf


def _told(region: Shape) -> str:
    match region:
        case BoxShape(half_extents=half_extents):
            return f"a box of {' x '.join(f'{2 * half:.3g}' for half in half_extents)} m"
        case SphereShape(radius=radius):
            return f"a sphere of {radius:.3g} m radius"
        case _:
            return "what lies nearest to it"


def _larger(region: Shape, spacing: float) -> str:
    """What has a node in it wherever it is: a box from half a cell on, a sphere from half of a cell's diagonal on."""
    match region:
        case BoxShape():
            return f"give it half_extents of {0.51 * spacing:.3g} m or more, or raise the resolution"
        case SphereShape():
            return f"give it a radius of {0.88 * spacing:.3g} m or more, or raise the resolution"
        case _:
            return "raise the resolution"
