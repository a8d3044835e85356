# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""What acts on a grid node besides stress: gravity, winds, drives, colliders, the domain's walls.

All of it is float64 in every precision: only active nodes are visited, a node's distance from a face far from the
origin needs the digits, and a velocity that gravity has changed is rounded once.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import WALL_FADE, WALL_REACH
from gasp_warp_mpm.tables import Acting

__all__ = ["acted", "confined", "constrain", "kept_out", "open_share"]

_ZERO = wp.float64(0.0)
_ONE = wp.float64(1.0)
_WALL_FADE = wp.float64(WALL_FADE)
_WALL_REACH = wp.float64(WALL_REACH)
_TOUCH = wp.float64(at.TOUCH)
_HELD = wp.float64(1e-6)
"""Of a node's speed: what the domain's edge takes of it beyond this is more than rounding."""


@wp.func
def _triple(table: wp.array(dtype=wp.float64), start: int):
    return wp.vec3d(table[start], table[start + 1], table[start + 2])


@wp.func
def _field_at(fields: wp.array(dtype=wp.float64), begin: int, place: wp.vec3d):
    """Distance [cells] that a field has at a place counted in its spacings, without the way to it from beyond."""
    shape = wp.vec3d(fields[begin], fields[begin + 1], fields[begin + 2])
    low = wp.vec3i()
    part = wp.vec3d()
    for d in range(3):
        within = wp.clamp(place[d], _ZERO, shape[d] - _ONE)
        low[d] = wp.min(int(within), int(shape[d]) - 2)
        part[d] = within - wp.float64(low[d])
    across = int(shape[2])
    along = int(shape[1]) * across
    first = begin + 3 + low[0] * along + low[1] * across + low[2]
    found = _ZERO
    for i in range(2):
        for j in range(2):
            at_line = first + i * along + j * across
            line = (_ONE - part[2]) * fields[at_line] + part[2] * fields[at_line + 1]
            share_x = wp.where(i == 1, part[0], _ONE - part[0])
            share_y = wp.where(j == 1, part[1], _ONE - part[1])
            found += share_x * share_y * line
    return found


@wp.func
def _field_distance(s: Acting, row: int, node: wp.vec3d, shift: wp.vec3d):
    """Signed distance of a node, shifted by so many of its spacings, to the surface of the field that `row` names."""
    spacing = s.forcing[row + 4]
    begin = int(s.forcing[row + 5])
    place = (node - _triple(s.forcing, row + 1)) / spacing + shift
    beyond = wp.vec3d()
    for d in range(3):
        beyond[d] = place[d] - wp.clamp(place[d], _ZERO, s.fields[begin + d] - _ONE)
    return _field_at(s.fields, begin, place) + spacing * wp.length(beyond)


@wp.func
def _field_slope(s: Acting, row: int, node: wp.vec3d):
    """Its gradient over one spacing, times that."""
    slope = wp.vec3d()
    for d in range(3):
        half = wp.vec3d()
        half[d] = wp.float64(0.5)
        slope[d] = _field_distance(s, row, node, half) - _field_distance(s, row, node, -half)
    return slope


@wp.func
def _distance(s: Acting, row: int, node: wp.vec3d):
    """Signed distance of a node to the shape at `row`, negative inside."""
    kind = int(s.forcing[row])
    a = _triple(s.forcing, row + 1)
    b = _triple(s.forcing, row + 4)
    distance = -_ONE
    if kind == at.PLANE:
        distance = wp.dot(node - a, b)
    elif kind == at.BOX:
        q = wp.abs(node - a) - b
        distance = wp.length(wp.max(q, wp.vec3d())) + wp.min(wp.max(q), _ZERO)
    elif kind == at.SPHERE:
        distance = wp.length(node - a) - b[0]
    elif kind == at.FIELD:
        distance = _field_distance(s, row, node, wp.vec3d())
    return distance


@wp.func
def _normal(s: Acting, row: int, node: wp.vec3d):
    """Outward unit normal of the shape at `row`, as `gasp_core.contract` defines it."""
    kind = int(s.forcing[row])
    offset = node - _triple(s.forcing, row + 1)
    b = _triple(s.forcing, row + 4)
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
    elif kind == at.SPHERE or kind == at.FIELD:
        if kind == at.FIELD:
            offset = _field_slope(s, row, node)
        length = wp.length(offset)
        normal = wp.vec3d(_ZERO, _ZERO, _ONE)
        if length > _ZERO:
            normal = offset / length
    return normal


@wp.func
def _turned(s: Acting, row: int, v: wp.vec3d):
    """By the rotation whose rows at `row` are."""
    return wp.vec3d(
        wp.dot(_triple(s.forcing, row), v),
        wp.dot(_triple(s.forcing, row + 3), v),
        wp.dot(_triple(s.forcing, row + 6), v),
    )


@wp.func
def _turned_back(s: Acting, row: int, v: wp.vec3d):
    """By its inverse."""
    return v[0] * _triple(s.forcing, row) + v[1] * _triple(s.forcing, row + 3) + v[2] * _triple(s.forcing, row + 6)


@wp.func
def _before(s: Acting, row: int, place: wp.vec3d):
    """Where a place is for the collider at `row`, in the frame in which that stands."""
    found = place * _ONE
    if s.forcing[row + 11] > _ZERO:
        found = _turned(s, row + 18, place - _triple(s.forcing, row + 15)) + _triple(s.forcing, row + 12)
    return found


@wp.func
def _carried(s: Acting, begin: int, arm: wp.vec3d):
    """Velocity of what is `arm` from the place of what moves by the velocities from `begin` on."""
    spin = _triple(s.forcing, begin + 3)
    around = wp.cross(spin, arm)
    return _triple(s.forcing, begin) + around + s.forcing[begin + 6] * wp.cross(spin, around)


@wp.func
def _surface(s: Acting, row: int, place: wp.vec3d, before: wp.vec3d):
    """Of the collider at `row`, at a place: the normal towards where matter may be, and its own velocity."""
    normal = s.forcing[row + 10] * _normal(s, row, before)
    own = wp.vec3d()
    if s.forcing[row + 11] > _ZERO:
        normal = _turned_back(s, row + 18, normal)
        own = _carried(s, row + 27, place - _triple(s.forcing, row + 15))
    return normal, own


@wp.func
def _blown(s: Acting, velocity: wp.vec3d, node: wp.vec3d):
    u = velocity * _ONE
    for wind in range(s.winds):
        row = s.wind_begin + wind * at.WIND_WIDTH
        if _distance(s, row, node) <= _ZERO:
            rate = s.forcing[row + 11]
            u = (u + rate * _triple(s.forcing, row + 8)) / (_ONE + rate)
    return u


@wp.func
def _driven(s: Acting, velocity: wp.vec3d, node: wp.vec3d, body: int, drive_set: int):
    u = velocity * _ONE
    held = int(0)
    begin = s.wind_begin + s.winds * at.WIND_WIDTH
    for drive in range(s.drives):
        row = begin + (drive_set * s.drives + drive) * at.DRIVE_WIDTH
        arm = node - _triple(s.forcing, row + 11)
        holds = s.forcing[s.holding_begin + drive * s.bodies + body] > _ZERO
        if holds and _distance(s, row, _turned(s, row + 14, arm) + _triple(s.forcing, row + 8)) <= _TOUCH:
            u = _carried(s, row + 23, arm)
            held = 1
    return u, held


@wp.func
def _collided(s: Acting, velocity: wp.vec3d, node: wp.vec3d, wall_set: int):
    """What moves is met in its own frame: the node where it would be there, velocities relative to its own."""
    u = velocity * _ONE
    for collider in range(s.colliders):
        row = (s.moving * wall_set * s.colliders + collider) * at.COLLIDER_WIDTH
        before = _before(s, row, node)
        if s.forcing[row + 10] * _distance(s, row, before) <= _TOUCH:
            contact = int(s.forcing[row + 8])
            normal, own = _surface(s, row, node, before)
            u = u - own
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
            u = u + own
    return u


@wp.func
def kept_out(s: Acting, velocity: wp.vec3d, place: wp.vec3d, half_width: wp.float64, step: wp.float64, wall_set: int):
    """Velocity with which a point moves so that what it stands for enters no collider; see gasp-reference-mpm's."""
    u = velocity * _ONE
    for collider in range(s.colliders):
        row = (s.moving * wall_set * s.colliders + collider) * at.COLLIDER_WIDTH
        before = _before(s, row, place)
        room = s.forcing[row + 10] * _distance(s, row, before) - half_width
        # What is a cell away does not arrive within a step.
        if room < _ONE:
            normal, own = _surface(s, row, place, before)
            along = wp.dot(u - own, normal)
            lacking = -wp.max(room, _ZERO) / step - along
            if lacking > _ZERO:
                across = u - own - along * normal
                speed = wp.length(across)
                if int(s.forcing[row + 8]) == at.SEPARATE and speed > _ZERO:
                    across = across * wp.max(_ZERO, _ONE - s.forcing[row + 9] * lacking / speed)
                u = own + (along + lacking) * normal + across
    return u


@wp.func
def open_share(s: Acting, place: wp.vec3d, wall_set: int):
    """How much the grid sees of matter at a place, for the colliders near by (`gasp_core.stepping.flow`)."""
    share = _ONE * _ONE
    for collider in range(s.colliders):
        row = (s.moving * wall_set * s.colliders + collider) * at.COLLIDER_WIDTH
        way = s.forcing[row + 10] * _distance(s, row, _before(s, row, place))
        if way < _WALL_REACH:
            share = share / (_ONE + wp.exp(-_WALL_FADE * wp.max(way, _ZERO)))
    return share


@wp.func
def acted(s: Acting, velocity: wp.vec3d, node: wp.vec3d, body: int, drive_set: int):
    """Velocity of a node after gravity, wind and drives, and whether a drive prescribes it.

    Parameters
    ----------
    velocity
        After stress.
    node
        Absolute position [cells].
    body
        Whose node it is.
    drive_set
        Which copy of the drives holds for this step: drives move.
    """
    return _driven(s, _blown(s, velocity + s.gravity, node), node, body, drive_set)


@wp.func
def confined(s: Acting, velocity: wp.vec3d, node: wp.vec3d, wall_set: int):
    """Velocity of a node after the colliders and the domain's edge, and whether the edge held it; see `acted`."""
    free = _collided(s, velocity, node, wall_set)
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


@wp.func
def constrain(s: Acting, velocity: wp.vec3d, node: wp.vec3d, body: int, drive_set: int):
    """Both, where no other body is near: `acted`, then `confined`."""
    u, _driven_there = acted(s, velocity, node, body, drive_set)
    return confined(s, u, node, drive_set)
