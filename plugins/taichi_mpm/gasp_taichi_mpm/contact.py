"""What acts on a grid node besides stress and gravity: winds, drives, colliders, the domain's walls.

All of it is float64 in every precision: only active nodes are visited, a node's distance from a face far from the
origin needs the digits, and a velocity that gravity has changed is rounded once.
"""

from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import WALL_FADE, WALL_REACH
from gasp_taichi_mpm import words
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["acted", "confined", "constrain", "is_touched", "kept_out", "open_share"]

_BLOCK_RADIUS = 1.5 * 3**0.5
"""From the centre of a block of 4^3 nodes to its corners."""


@ti.func
def _triple(table: ti.template(), start):
    return ti.Vector([table[start], table[start + 1], table[start + 2]])


@ti.func
def _field_distance(table: ti.template(), fields: ti.template(), row, node, shift):
    """Signed distance of a node, shifted by so many of its spacings, to the surface of the field that `row` names."""
    spacing = table[row + 4]
    begin = ti.cast(table[row + 5], ti.i32)
    place = (node - _triple(table, row + 1)) / spacing + shift
    low = ti.Vector([0, 0, 0])
    part = place * 0
    beyond = place * 0
    for d in ti.static(range(3)):
        count = fields[begin + d]
        within = ti.min(ti.max(place[d], ti.f64(0.0)), count - 1)
        low[d] = ti.min(ti.cast(within, ti.i32), ti.cast(count, ti.i32) - 2)
        part[d] = within - low[d]
        beyond[d] = place[d] - within
    across = ti.cast(fields[begin + 2], ti.i32)
    along = ti.cast(fields[begin + 1], ti.i32) * across
    first = begin + 3 + low[0] * along + low[1] * across + low[2]
    found = ti.f64(0.0)
    for i in range(2):
        for j in range(2):
            line = first + i * along + j * across
            share = (1 - i + (2 * i - 1) * part[0]) * (1 - j + (2 * j - 1) * part[1])
            found += share * ((1 - part[2]) * fields[line] + part[2] * fields[line + 1])
    return found + spacing * beyond.norm()


@ti.func
def _field_slope(table: ti.template(), fields: ti.template(), row, node):
    """Its gradient over one spacing, times that."""
    slope = ti.Vector([ti.f64(0.0), ti.f64(0.0), ti.f64(0.0)])
    for d in ti.static(range(3)):
        half = slope * 0
        half[d] = 0.5
        slope[d] = _field_distance(table, fields, row, node, half) - _field_distance(table, fields, row, node, -half)
    return slope


@ti.func
def _distance(table: ti.template(), fields: ti.template(), row, node):
    """Signed distance of a node to the shape at `row`, negative inside."""
    kind = ti.cast(table[row], ti.i32)
    a = _triple(table, row + 1)
    b = _triple(table, row + 4)
    distance = ti.f64(-1.0)
    if kind == at.PLANE:
        distance = (node - a).dot(b)
    elif kind == at.BOX:
        q = ti.abs(node - a) - b
        distance = ti.max(q, ti.f64(0.0)).norm() + ti.min(q.max(), ti.f64(0.0))
    elif kind == at.SPHERE:
        distance = (node - a).norm() - b[0]
    elif kind == at.FIELD:
        distance = _field_distance(table, fields, row, node, node * 0)
    return distance


@ti.func
def _normal(table: ti.template(), fields: ti.template(), row, node):
    """Outward unit normal of the shape at `row`, as `gasp_core.contract` defines it."""
    kind = ti.cast(table[row], ti.i32)
    a = _triple(table, row + 1)
    b = _triple(table, row + 4)
    normal = b
    if kind == at.BOX:
        offset = node - a
        q = ti.abs(offset) - b
        sign = ti.Vector([ti.f64(1.0), ti.f64(1.0), ti.f64(1.0)])
        for d in ti.static(range(3)):
            if offset[d] < 0:
                sign[d] = -1.0
        normal = ti.max(q, ti.f64(0.0)) * sign
        length = normal.norm()
        if length > 0:
            normal = normal / length
        else:
            normal = q * 0
            if q[0] >= q[1] and q[0] >= q[2]:
                normal[0] = sign[0]
            elif q[1] >= q[2]:
                normal[1] = sign[1]
            else:
                normal[2] = sign[2]
    elif kind == at.SPHERE or kind == at.FIELD:
        offset = node - a
        if kind == at.FIELD:
            offset = _field_slope(table, fields, row, node)
        length = offset.norm()
        if length > 0:
            normal = offset / length
        else:
            normal = ti.Vector([ti.f64(0.0), ti.f64(0.0), ti.f64(1.0)])
    return normal


@ti.func
def _turned(table: ti.template(), row, v):
    """By the rotation whose rows at `row` are."""
    return ti.Vector([_triple(table, row + 3 * d).dot(v) for d in range(3)])


@ti.func
def _first_wall(control: ti.template(), wall_set):
    """Where the rows of the colliders begin for this step."""
    return control[words.MOVING] * wall_set * control[words.COLLIDERS] * at.COLLIDER_WIDTH


@ti.func
def _before(forcing: ti.template(), row, place):
    """Where a place is for the collider at `row`, in the frame in which that stands."""
    found = place
    if forcing[row + 11] > 0:
        found = _turned(forcing, row + 18, place - _triple(forcing, row + 15)) + _triple(forcing, row + 12)
    return found


@ti.func
def _carried(forcing: ti.template(), begin, arm):
    """Velocity of what is `arm` from the place of what moves by the velocities from `begin` on."""
    spin = _triple(forcing, begin + 3)
    around = spin.cross(arm)
    return _triple(forcing, begin) + around + forcing[begin + 6] * spin.cross(around)


@ti.func
def _surface(forcing: ti.template(), fields: ti.template(), row, place, before):
    """Of the collider at `row`, at a place: the normal towards where matter may be, and its own velocity."""
    normal = forcing[row + 10] * _normal(forcing, fields, row, before)
    own = normal * 0
    if forcing[row + 11] > 0:
        back = normal * 0
        for d in ti.static(range(3)):
            back += normal[d] * _triple(forcing, row + 18 + 3 * d)
        normal = back
        own = _carried(forcing, row + 27, place - _triple(forcing, row + 15))
    return normal, own


@ti.func
def is_touched(centre, forcing: ti.template(), fields: ti.template(), control: ti.template(), wall_set):
    """Whether anything besides gravity may act on a node of the block of 4^3 around `centre` [cells].

    Where a collider is farther from the centre than the corners are, it touches none of the nodes: no signed distance
    changes by more than the way between two places; an interpolated one by no more than twice that.
    """
    touched = control[words.CLAMP] == 1 or control[words.WINDS] > 0 or control[words.DRIVES] > 0
    row = _first_wall(control, wall_set)
    end = row + control[words.COLLIDERS] * at.COLLIDER_WIDTH
    while row < end:
        reach = ti.f64(_BLOCK_RADIUS + 2 * at.TOUCH)
        if ti.cast(forcing[row], ti.i32) == at.FIELD:
            reach = 2 * reach
        if forcing[row + 10] * _distance(forcing, fields, row, _before(forcing, row, centre)) <= reach:
            touched = True
        row += at.COLLIDER_WIDTH
    return touched


@ti.func
def kept_out(
    velocity, place, half_width, step, forcing: ti.template(), fields: ti.template(), control: ti.template(), wall_set
):
    """Velocity with which a point moves so that what it stands for enters no collider; see gasp-reference-mpm's."""
    u = velocity
    row = _first_wall(control, wall_set)
    end = row + control[words.COLLIDERS] * at.COLLIDER_WIDTH
    while row < end:
        before = _before(forcing, row, place)
        room = forcing[row + 10] * _distance(forcing, fields, row, before) - half_width
        # What is a cell away does not arrive within a step.
        if room < 1.0:
            n, own = _surface(forcing, fields, row, place, before)
            along = (u - own).dot(n)
            lacking = -ti.max(room, 0.0) / step - along
            if lacking > 0.0:
                across = u - own - along * n
                speed = across.norm()
                if ti.cast(forcing[row + 8], ti.i32) == at.SEPARATE and speed > 0.0:
                    across = across * ti.max(0.0, 1.0 - forcing[row + 9] * lacking / speed)
                u = own + (along + lacking) * n + across
        row += at.COLLIDER_WIDTH
    return u


@ti.func
def open_share(place, forcing: ti.template(), fields: ti.template(), control: ti.template(), wall_set):
    """How much the grid sees of matter at a place, for the colliders near by (`gasp_core.stepping.flow`)."""
    share = ti.f64(1.0)
    row = _first_wall(control, wall_set)
    end = row + control[words.COLLIDERS] * at.COLLIDER_WIDTH
    while row < end:
        way = forcing[row + 10] * _distance(forcing, fields, row, _before(forcing, row, place))
        if way < ti.f64(WALL_REACH):
            share /= 1.0 + ti.exp(-ti.f64(WALL_FADE) * ti.max(way, 0.0))
        row += at.COLLIDER_WIDTH
    return share


@ti.func
def acted(v, node, body, forcing: ti.template(), fields: ti.template(), control: ti.template(), drive_set):
    """Velocity of a node after winds and drives, and whether a drive prescribes it.

    Parameters
    ----------
    v
        After gravity, float64.
    node
        Absolute position [cells], float64.
    body
        Whose node it is.
    drive_set
        Which copy of the drives holds for this step: drives move.
    """
    u = v
    held = False
    row = control[words.WINDS_AT]
    winds_end = row + control[words.WINDS] * at.WIND_WIDTH
    while row < winds_end:
        if _distance(forcing, fields, row, node) <= 0.0:
            rate = forcing[row + 11]
            air = _triple(forcing, row + 8)
            u = (u + rate * air) / (1.0 + rate)
        row += at.WIND_WIDTH
    row = winds_end + drive_set * control[words.DRIVES] * at.DRIVE_WIDTH
    drives_end = row + control[words.DRIVES] * at.DRIVE_WIDTH
    holds = control[words.HOLDING_AT] + body
    while row < drives_end:
        arm = node - _triple(forcing, row + 11)
        back = _turned(forcing, row + 14, arm) + _triple(forcing, row + 8)
        if forcing[holds] > 0 and _distance(forcing, fields, row, back) <= ti.f64(at.TOUCH):
            u = _carried(forcing, row + 23, arm)
            held = True
        row += at.DRIVE_WIDTH
        holds += control[words.BODIES]
    return u, held


@ti.func
def confined(
    v,
    node,
    batch: ti.template(),
    forcing: ti.template(),
    fields: ti.template(),
    control: ti.template(),
    report: ti.template(),
    wall_set,
):
    """Velocity of a node after the colliders and the domain's edge; parameters as `acted`.

    What moves is met in its own frame: the node where it would be there, velocities relative to its own.
    """
    u = v
    row = _first_wall(control, wall_set)
    colliders_end = row + control[words.COLLIDERS] * at.COLLIDER_WIDTH
    while row < colliders_end:
        before = _before(forcing, row, node)
        if forcing[row + 10] * _distance(forcing, fields, row, before) <= ti.f64(at.TOUCH):
            contact = ti.cast(forcing[row + 8], ti.i32)
            n, own = _surface(forcing, fields, row, node, before)
            u = u - own
            along = u.dot(n)
            if contact == at.STICK:
                u = u * 0
            elif contact == at.SLIP:
                u = u - along * n
            elif along < 0:
                u = u - along * n
                friction = forcing[row + 9]
                speed = u.norm()
                if friction > 0 and speed > 0:
                    u = u * ti.max(0, 1 + friction * along / speed)
            u = u + own
        row += at.COLLIDER_WIDTH
    if control[words.CLAMP] == 1:
        free = u
        for d in ti.static(range(3)):
            if node[d] <= batch[words.WALL_LOW + d] + ti.f64(at.TOUCH):
                u[d] = ti.max(u[d], 0)
            if node[d] >= batch[words.WALL_HIGH + d] - ti.f64(at.TOUCH):
                u[d] = ti.min(u[d], 0)
        # Beyond rounding: matter that glides along the edge is not held by it.
        if (u - free).norm() > 1e-6 * free.norm():
            ti.atomic_add(report[words.CLAMPED], 1)
    return u


@ti.func
def constrain(
    v,
    node,
    body,
    batch: ti.template(),
    forcing: ti.template(),
    fields: ti.template(),
    control: ti.template(),
    report: ti.template(),
    drive_set,
):
    """Both, where no other body is near: `acted`, then `confined`."""
    u, _ = acted(v, node, body, forcing, fields, control, drive_set)
    return confined(u, node, batch, forcing, fields, control, report, drive_set)
