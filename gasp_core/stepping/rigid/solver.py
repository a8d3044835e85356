"""Impulses by which rigid bodies neither enter each other nor walls, with friction, and what nodes of a grid take.

Contacts take turns, again and again, each with the velocities that those before it have left (projected Gauss-Seidel;
Erleben 2007, "Velocity-based shock propagation for multibody dynamics animation", section 3). Nodes, of which there are
thousands, do not: what contact makes of a node's velocity is c -> c - W c of the velocity c relative to the body, with
W known from the last round, so that all nodes together are an inertia that the body has in addition (6 x 6), as if it
took them along. So a body of any weight meets matter of any weight without a bound on the step, momentum is kept to
rounding and energy does not rise.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["loaded", "settle_nodes", "share_of_change", "solve"]

Array = NDArray[Any]

_STICK, _SLIP = 0, 1
_HALVINGS = 20
"""Of the change of velocities, at most: a millionth of it is none."""
_LEFT = 0.1
"""Of the slope at the beginning: less of it is near enough to none."""


@numba.njit(inline="always", error_model="numpy")
def _speed_at(velocity: Array, center: Array, place: Array) -> tuple[float, float, float]:
    """Of a body that moves and turns with `velocity` (6,) about its centre, at a place."""
    rx, ry, rz = place[0] - center[0], place[1] - center[1], place[2] - center[2]
    return (
        velocity[0] + velocity[4] * rz - velocity[5] * ry,
        velocity[1] + velocity[5] * rx - velocity[3] * rz,
        velocity[2] + velocity[3] * ry - velocity[4] * rx,
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def loaded(
    inertias: Array,
    momenta: Array,
    centers: Array,
    velocities: Array,
    bodies: Array,
    places: Array,
    nodes: Array,
    masses: Array,
    normals: Array,
    conditions: Array,
    frictions: Array,
    rooms: Array,
    gates: Array,
) -> None:
    """Add to bodies what nodes do to them, given how fast the bodies are now.

    Parameters
    ----------
    inertias : (B, 6, 6)
        Of linear and angular velocity, added to.
    momenta : (B, 6)
        Linear and angular, about the centres, added to: A x = p are the velocities when all nodes have been met.
    centers : (B, 3) [m]
    velocities : (B, 6)
        Of the bodies.
    bodies : (K,)
        Which body each node meets.
    places, nodes, normals : (K, 3)
        Where the nodes are [m], how fast [m/s], and where out of the body is.
    masses : (K,) [kg]
    conditions, frictions : (K,)
    rooms : (K,) [m/s]
        Speed along the normal at which what is between the two closes within the step; infinite where two that stick
        or slip are not held together.
    gates : (K, 2)
        Filled: the shares of the relative velocity that contact takes along the normal and across it.
    """
    row = np.empty(3)
    jacobian = np.zeros((3, 6))
    for k in range(len(bodies)):
        b = bodies[k]
        rx, ry, rz = places[k, 0] - centers[b, 0], places[k, 1] - centers[b, 1], places[k, 2] - centers[b, 2]
        cx, cy, cz = _speed_at(velocities[b], centers[b], places[k])
        cx, cy, cz = cx - nodes[k, 0], cy - nodes[k, 1], cz - nodes[k, 2]
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        approach = cx * nx + cy * ny + cz * nz
        along, across = 1.0, 1.0
        if conditions[k] == _SLIP or conditions[k] == _STICK:
            if rooms[k] == np.inf:
                along, across = 0.0, 0.0
            elif conditions[k] == _SLIP:
                across = 0.0
        else:
            stopped = max(approach - rooms[k], 0.0)
            along = stopped / approach if stopped > 0 else 0.0
            tx, ty, tz = cx - approach * nx, cy - approach * ny, cz - approach * nz
            speed = (tx * tx + ty * ty + tz * tz) ** 0.5
            limit = frictions[k] * stopped
            across = 1.0 if limit >= speed and stopped > 0 else (limit / speed if speed > 0 else 0.0)
        gates[k, 0], gates[k, 1] = along, across
        if along == 0.0 and across == 0.0:
            continue
        m = masses[k]
        jacobian[0, 0] = jacobian[1, 1] = jacobian[2, 2] = 1.0
        jacobian[0, 4], jacobian[0, 5] = rz, -ry
        jacobian[1, 3], jacobian[1, 5] = -rz, rx
        jacobian[2, 3], jacobian[2, 4] = ry, -rx
        normal = (nx, ny, nz)
        for i in range(6):
            for d in range(3):
                row[d] = across * jacobian[d, i]
            inner = (along - across) * (nx * jacobian[0, i] + ny * jacobian[1, i] + nz * jacobian[2, i])
            for d in range(3):
                row[d] = m * (row[d] + inner * normal[d])
            for j in range(6):
                inertias[b, i, j] += row[0] * jacobian[0, j] + row[1] * jacobian[1, j] + row[2] * jacobian[2, j]
            momenta[b, i] += row[0] * nodes[k, 0] + row[1] * nodes[k, 1] + row[2] * nodes[k, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def share_of_change(
    inertias: Array,
    momenta: Array,
    centers: Array,
    velocities: Array,
    change: Array,
    bodies: Array,
    places: Array,
    nodes: Array,
    masses: Array,
    normals: Array,
    conditions: Array,
    frictions: Array,
    rooms: Array,
) -> float:
    """How much of a change of the bodies' velocities to take: what makes nodes and bodies lose most.

    Contact at a node is the gradient of a convex function of the bodies' velocities: m max(c_n - room, 0)^2 / 2 along
    the normal and, with friction as it is before the change, Huber's function of the speed across it. What `loaded`
    asks for goes down from where it is asked; nodes much heavier than the bodies throw these to and fro between one set
    of nodes that touch and another, unless they stop where the value is smallest on the way.

    Parameters
    ----------
    inertias, momenta
        Of the bodies alone.
    change : (B, 6)
        Of `velocities`, to what nodes that touch now would make of them. The others as in `loaded`.
    """
    count = len(bodies)
    relative, changes = np.empty((count, 3)), np.empty((count, 3))
    limits = np.zeros(count)
    for k in range(count):
        b = bodies[k]
        cx, cy, cz = _speed_at(velocities[b], centers[b], places[k])
        relative[k] = cx - nodes[k, 0], cy - nodes[k, 1], cz - nodes[k, 2]
        changes[k] = _speed_at(change[b], centers[b], places[k])
        approach = 0.0
        for d in range(3):
            approach += relative[k, d] * normals[k, d]
        limits[k] = frictions[k] * max(approach - rooms[k], 0.0)
    low, high = 0.0, 1.0
    share = 1.0
    start = 0.0
    for turn in range(_HALVINGS):
        at = 0.0 if turn == 0 else share
        slope = 0.0
        for b in range(len(velocities)):
            for i in range(6):
                lacking = -momenta[b, i]
                for j in range(6):
                    lacking += inertias[b, i, j] * (velocities[b, j] + at * change[b, j])
                slope += change[b, i] * lacking
        for k in range(count):
            if rooms[k] == np.inf:
                continue
            along, turning, square, crossing = -rooms[k], 0.0, 0.0, 0.0
            for d in range(3):
                along += (relative[k, d] + at * changes[k, d]) * normals[k, d]
                turning += changes[k, d] * normals[k, d]
            for d in range(3):
                across = relative[k, d] + at * changes[k, d] - (along + rooms[k]) * normals[k, d]
                square += across * across
                crossing += across * changes[k, d]
            if conditions[k] == _SLIP:
                slope += masses[k] * along * turning
            elif conditions[k] == _STICK:
                slope += masses[k] * (along * turning + crossing)
            else:
                slope += masses[k] * max(along, 0.0) * turning
                speed = square**0.5
                slope += masses[k] * (crossing if speed <= limits[k] else crossing * limits[k] / speed)
        if turn == 0:
            start = slope
            if start >= 0.0:
                return 1.0
            continue
        if turn == 1 and slope <= _LEFT * -start:
            return 1.0
        if abs(slope) <= _LEFT * -start:
            return share
        if slope > 0.0:
            high = share
        else:
            low = share
        share = 0.5 * (low + high)
    return share


@numba.njit(cache=True, nogil=True, error_model="numpy")
def settle_nodes(
    centers: Array,
    velocities: Array,
    bodies: Array,
    places: Array,
    nodes: Array,
    normals: Array,
    gates: Array,
) -> None:
    """What nodes have after contact with bodies of these velocities; `nodes` (K, 3) [m/s] is changed.

    The other arguments are those of `loaded`, with the gates that it found: the bodies' velocities have it already that
    they gave what nodes now get.
    """
    for k in range(len(bodies)):
        b = bodies[k]
        along, across = gates[k, 0], gates[k, 1]
        if along == 0.0 and across == 0.0:
            continue
        cx, cy, cz = _speed_at(velocities[b], centers[b], places[k])
        cx, cy, cz = cx - nodes[k, 0], cy - nodes[k, 1], cz - nodes[k, 2]
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        inner = (along - across) * (cx * nx + cy * ny + cz * nz)
        cx, cy, cz = across * cx + inner * nx, across * cy + inner * ny, across * cz + inner * nz
        nodes[k, 0] += cx
        nodes[k, 1] += cy
        nodes[k, 2] += cz


@numba.njit(inline="always", error_model="numpy")
def _speed_of(c: int, d: int, first: Array, second: Array, rows: Array, velocities: Array, offsets: Array) -> float:
    """Relative velocity [m/s] at a contact along a row of its frame."""
    speed = -offsets[c, d]
    for side in range(2):
        b = first[c] if side == 0 else second[c]
        if b >= 0:
            for i in range(6):
                speed += rows[c, d, side, i] * velocities[b, i]
    return speed


@numba.njit(inline="always", error_model="numpy")
def _given(
    c: int, d: int, after: float, first: Array, second: Array, pushes: Array, velocities: Array, impulses: Array
) -> float:
    """Let a contact's impulse along a row of its frame be `after` [N s]; returns by how much it has changed."""
    change = after - impulses[c, d]
    if change != 0.0:
        impulses[c, d] = after
        for side in range(2):
            b = first[c] if side == 0 else second[c]
            if b >= 0:
                for i in range(6):
                    velocities[b, i] += change * pushes[c, d, side, i]
    return change


@numba.njit(inline="always", error_model="numpy")
def _rubbed(
    impulse: tuple[float, float], speed: tuple[float, float], shares: tuple[float, float, float], limit: float
) -> tuple[float, float]:
    """Impulse [N s] of friction in both directions across a normal, no larger than `limit` [N s].

    What stops both where that is allowed; otherwise a step against what slides, drawn back onto the circle (de Saxce
    and Feng 1998, "The bipotential method"). It stays where it is only if it is opposite to what slides: a bound on
    each direction beside what the other has would hold any other place on the circle as well.

    Parameters
    ----------
    impulse, speed
        As they are [N s], [m/s].
    shares
        What an impulse in each direction changes of the speed in it [1/kg], and of that in the other.
    """
    one, two, both = shares
    whole = one * two - both * both
    x = impulse[0] - (two * speed[0] - both * speed[1]) / whole
    y = impulse[1] - (one * speed[1] - both * speed[0]) / whole
    if x * x + y * y <= limit * limit:
        return x, y
    # The longest step that overshoots in no direction.
    most = 0.5 * (one + two) + (0.25 * (one - two) ** 2 + both * both) ** 0.5
    x, y = impulse[0] - speed[0] / most, impulse[1] - speed[1] / most
    drawn = min(1.0, limit / max((x * x + y * y) ** 0.5, 1e-300))
    return drawn * x, drawn * y


@numba.njit(cache=True, nogil=True, error_model="numpy")
def solve(
    inverses: Array,
    velocities: Array,
    centers: Array,
    first: Array,
    second: Array,
    places: Array,
    frames: Array,
    offsets: Array,
    targets: Array,
    conditions: Array,
    frictions: Array,
    impulses: Array,
    tolerance: float,
    sweeps: int,
) -> int:
    """Let contacts take turns until none changes a velocity by more than `tolerance` [m/s]; returns how many rounds.

    Parameters
    ----------
    inverses : (B, 6, 6)
        Inverse inertias; zero for what is driven.
    velocities : (B, 6)
        Changed.
    first, second : (C,)
        Bodies; `second` < 0 for a wall.
    places : (C, 3) [m]
    frames : (C, 3, 3)
        Rows: the normal from the second to the first, and two directions across it.
    offsets : (C, 3) [m/s]
        Of the wall, along the rows of the frame.
    targets : (C,) [m/s]
        Along the normal nothing may be slower than this.
    conditions, frictions : (C,)
    impulses : (C, 3) [N s]
        Along the rows of the frame, from the last time; changed.
    """
    count = len(first)
    pushes = np.zeros((count, 3, 2, 6))
    rows = np.zeros((count, 3, 2, 6))
    shares = np.zeros((count, 3))
    mixed = np.zeros(count)
    for c in range(count):
        for d in range(3):
            nx, ny, nz = frames[c, d, 0], frames[c, d, 1], frames[c, d, 2]
            for side in range(2):
                b = first[c] if side == 0 else second[c]
                if b < 0:
                    continue
                sign = 1.0 if side == 0 else -1.0
                rx, ry, rz = places[c, 0] - centers[b, 0], places[c, 1] - centers[b, 1], places[c, 2] - centers[b, 2]
                rows[c, d, side, 0], rows[c, d, side, 1], rows[c, d, side, 2] = sign * nx, sign * ny, sign * nz
                rows[c, d, side, 3] = sign * (ry * nz - rz * ny)
                rows[c, d, side, 4] = sign * (rz * nx - rx * nz)
                rows[c, d, side, 5] = sign * (rx * ny - ry * nx)
                for i in range(6):
                    total = 0.0
                    for j in range(6):
                        total += inverses[b, i, j] * rows[c, d, side, j]
                    pushes[c, d, side, i] = total
                    shares[c, d] += total * rows[c, d, side, i]
                    if d == 2:
                        mixed[c] += total * rows[c, 1, side, i]
                for i in range(6):
                    velocities[b, i] += impulses[c, d] * pushes[c, d, side, i]
    for sweep in range(sweeps):
        largest = 0.0
        for c in range(count):
            if shares[c, 0] <= 0.0:
                continue
            sticks, slips = conditions[c] == _STICK, conditions[c] == _SLIP
            speed = _speed_of(c, 0, first, second, rows, velocities, offsets)
            after = impulses[c, 0] + (targets[c] - speed) / shares[c, 0]
            if not (sticks or slips):
                after = max(after, 0.0)
            change = _given(c, 0, after, first, second, pushes, velocities, impulses)
            largest = max(largest, abs(change) * shares[c, 0])
            if not sticks and frictions[c] == 0.0:
                continue
            limit = np.inf if sticks else frictions[c] * impulses[c, 0]
            one = _speed_of(c, 1, first, second, rows, velocities, offsets)
            two = _speed_of(c, 2, first, second, rows, velocities, offsets)
            across = (impulses[c, 1], impulses[c, 2])
            rubbed = _rubbed(across, (one, two), (shares[c, 1], shares[c, 2], mixed[c]), limit)
            for d in range(1, 3):
                change = _given(c, d, rubbed[d - 1], first, second, pushes, velocities, impulses)
                largest = max(largest, abs(change) * shares[c, d])
        if largest <= tolerance:
            return sweep + 1
    return sweeps
