# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""What acts on a grid node besides stress: gravity, winds, drives, colliders, the domain's walls.

All of it is float64 in every precision: only active nodes are visited, a node's distance from a face far from the
origin needs the digits, and a velocity that gravity has changed is rounded once.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
import warp as wp
from gasp_mpm_host import layout as at

from gasp_warp_mpm.tables import Acting

__all__ = ["constrain"]

_ZERO = wp.float64(0.0)
_ONE = wp.float64(1.0)
_TOUCH = wp.float64(at.TOUCH)
_HELD = wp.float64(1e-6)
"""Of a node's speed: what the domain's edge takes of it beyond this is more than rounding."""


@wp.func
def _triple(table: wp.array(dtype=wp.float64), start: int):
    return wp.vec3d(table[start], table[start + 1], table[start + 2])


@wp.func
def _distance(table: wp.array(dtype=wp.float64), row: int, node: wp.vec3d):
    """Signed distance of a node to the shape at `row`, negative inside."""
    kind = int(table[row])
    a = _triple(table, row + 1)
    b = _triple(table, row + 4)
    distance = -_ONE
    if kind == at.PLANE:
        distance = wp.dot(node - a, b)
    elif kind == at.BOX:
        q = wp.abs(node - a) - b
        distance = wp.length(wp.max(q, wp.vec3d())) + wp.min(wp.max(q), _ZERO)
    elif kind == at.SPHERE:
        distance = wp.length(node - a) - b[0]
    return distance


@wp.func
def _normal(table: wp.array(dtype=wp.float64), row: int, node: wp.vec3d):
    """Outward unit normal of the shape at `row`, as `gasp_core.contract.shapes` defines it."""
    kind = int(table[row])
    offset = node - _triple(table, row + 1)
    b = _triple(table, row + 4)
    normal = b
    if kind == at.BOX:
        q = wp.abs(offset) - b
        sign = wp.vec3d(_ONE)
        for d in range(3):
            if offset[d] < _ZERO:
                sign[d] = -_ONE
        normal = wp.cw_mul(wp.max(q, wp.vec3d()), sign)
        length = wp.length(normal)
        if length > _ZERO:
            normal = normal / length
        elif q[0] >= q[1] and q[0] >= q[2]:
            normal = wp.vec3d(sign[0], _ZERO, _ZERO)
        elif q[1] >= q[2]:
            normal = wp.vec3d(_ZERO, sign[1], _ZERO)
        else:
            normal = wp.vec3d(_ZERO, _ZERO, sign[2])
    elif kind == at.SPHERE:
        length = wp.length(offset)
        normal = wp.vec3d(_ZERO, _ZERO, _ONE)
        if length > _ZERO:
            normal = offset / length
    return normal


@wp.func
def _blown(s: Acting, velocity: wp.vec3d, node: wp.vec3d):
    u = velocity * _ONE
    for wind in range(s.winds):
        row = s.colliders * at.COLLIDER_WIDTH + wind * at.WIND_WIDTH
        if _distance(s.forcing, row, node) <= _ZERO:
            rate = s.forcing[row + 11]
            u = (u + rate * _triple(s.forcing, row + 8)) / (_ONE + rate)
    return u


@wp.func
def _driven(s: Acting, velocity: wp.vec3d, node: wp.vec3d, drive_set: int):
    u = velocity * _ONE
    begin = s.colliders * at.COLLIDER_WIDTH + s.winds * at.WIND_WIDTH
    for drive in range(s.drives):
        row = begin + (drive_set * s.drives + drive) * at.DRIVE_WIDTH
        arm = node - _triple(s.forcing, row + 11)
        back = wp.vec3d(
            wp.dot(_triple(s.forcing, row + 14), arm),
            wp.dot(_triple(s.forcing, row + 17), arm),
            wp.dot(_triple(s.forcing, row + 20), arm),
        )
        if _distance(s.forcing, row, back + _triple(s.forcing, row + 8)) <= _TOUCH:
            u = _triple(s.forcing, row + 23) + wp.cross(_triple(s.forcing, row + 26), arm)
    return u


@wp.func
def _collided(s: Acting, velocity: wp.vec3d, node: wp.vec3d):
    u = velocity * _ONE
    for collider in range(s.colliders):
        row = collider * at.COLLIDER_WIDTH
        side = s.forcing[row + 10]
        if side * _distance(s.forcing, row, node) <= _TOUCH:
            contact = int(s.forcing[row + 8])
            normal = side * _normal(s.forcing, row, node)
            along = wp.dot(u, normal)
            if contact == at.STICK:
                u = wp.vec3d()
            elif contact == at.SLIP:
                u = u - along * normal
            elif along < _ZERO:
                u = u - along * normal
                friction = s.forcing[row + 9]
                speed = wp.length(u)
                if friction > _ZERO and speed > _ZERO:
                    u = u * wp.max(_ZERO, _ONE + friction * along / speed)
    return u


@wp.func
def constrain(s: Acting, velocity: wp.vec3d, node: wp.vec3d, drive_set: int):
    """Velocity of a node after everything that acts there, and whether the domain's edge held it.

    Parameters
    ----------
    velocity
        After stress.
    node
        Absolute position [cells].
    drive_set
        Which copy of the drives holds for this step: drives move.
    """
    free = _collided(s, _driven(s, _blown(s, velocity + s.gravity, node), node, drive_set), node)
    u = free * _ONE
    held = int(0)
    if s.clamp == 1:
        for d in range(3):
            if node[d] <= s.wall_low[d] + _TOUCH:
                u[d] = wp.max(u[d], _ZERO)
            if node[d] >= s.wall_high[d] - _TOUCH:
                u[d] = wp.min(u[d], _ZERO)
        # Beyond rounding: matter that glides along the edge is not held by it.
        if wp.length(u - free) > _HELD * wp.length(free):
            held = int(1)
    return u, held
