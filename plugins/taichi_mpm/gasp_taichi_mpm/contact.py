"""What acts on a grid node besides stress and gravity: winds, drives, colliders, the domain's walls.

All of it is float64 in every precision: only active nodes are visited, a node's distance from a face far from the
origin needs the digits, and a velocity that gravity has changed is rounded once.
"""

from gasp_mpm_host import layout as at

from gasp_taichi_mpm import words
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["constrain", "is_touched"]

_BLOCK_RADIUS = 1.5 * 3**0.5
"""From the centre of a block of 4^3 nodes to its corners."""


@ti.func
def _triple(table: ti.template(), start):
    return ti.Vector([table[start], table[start + 1], table[start + 2]])


@ti.func
def _distance(table: ti.template(), row, node):
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
    return distance


@ti.func
def _normal(table: ti.template(), row, node):
    """Outward unit normal of the shape at `row`, as `gasp_core.contract.shapes` defines it."""
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
    elif kind == at.SPHERE:
        offset = node - a
        length = offset.norm()
        if length > 0:
            normal = offset / length
        else:
            normal = ti.Vector([ti.f64(0.0), ti.f64(0.0), ti.f64(1.0)])
    return normal


@ti.func
def is_touched(centre, forcing: ti.template(), control: ti.template()):
    """Whether anything besides gravity may act on a node of the block of 4^3 around `centre` [cells].

    Where a collider is farther from the centre than the corners are, it touches none of the nodes: no signed distance
    changes by more than the way between two places.
    """
    touched = control[words.CLAMP] == 1 or control[words.WINDS] > 0 or control[words.DRIVES] > 0
    row = 0
    while row < control[words.COLLIDERS] * at.COLLIDER_WIDTH:
        if forcing[row + 10] * _distance(forcing, row, centre) <= ti.f64(_BLOCK_RADIUS + 2 * at.TOUCH):
            touched = True
        row += at.COLLIDER_WIDTH
    return touched


@ti.func
def constrain(
    v, node, batch: ti.template(), forcing: ti.template(), control: ti.template(), report: ti.template(), drive_set
):
    """Velocity of a node after everything that acts there.

    Parameters
    ----------
    v
        After gravity, float64.
    node
        Absolute position [cells], float64.
    drive_set
        Which copy of the drives holds for this step: drives move.
    """
    u = v
    row = 0
    colliders_end = control[words.COLLIDERS] * at.COLLIDER_WIDTH
    winds_end = colliders_end + control[words.WINDS] * at.WIND_WIDTH
    row = colliders_end
    while row < winds_end:
        if _distance(forcing, row, node) <= 0.0:
            rate = forcing[row + 11]
            air = _triple(forcing, row + 8)
            u = (u + rate * air) / (1.0 + rate)
        row += at.WIND_WIDTH
    row = winds_end + drive_set * control[words.DRIVES] * at.DRIVE_WIDTH
    drives_end = row + control[words.DRIVES] * at.DRIVE_WIDTH
    while row < drives_end:
        arm = node - _triple(forcing, row + 11)
        back = ti.Vector(
            [
                _triple(forcing, row + 14).dot(arm),
                _triple(forcing, row + 17).dot(arm),
                _triple(forcing, row + 20).dot(arm),
            ]
        )
        if _distance(forcing, row, back + _triple(forcing, row + 8)) <= ti.f64(at.TOUCH):
            u = _triple(forcing, row + 23) + _triple(forcing, row + 26).cross(arm)
        row += at.DRIVE_WIDTH
    row = 0
    while row < colliders_end:
        side = forcing[row + 10]
        if side * _distance(forcing, row, node) <= ti.f64(at.TOUCH):
            contact = ti.cast(forcing[row + 8], ti.i32)
            n = side * _normal(forcing, row, node)
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
