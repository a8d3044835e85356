"""Some rows of the grid and of the points, read and changed where they are: the memory of a GPU is not the host's."""

# No `from __future__ import annotations`: Warp reads the types themselves.
from types import SimpleNamespace
from typing import Any

import warp as wp
from gasp_mpm_host import layout as at

from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import tables_of

__all__ = ["make_rows"]


def make_rows(module: Any, double: bool) -> SimpleNamespace:
    """Kernels read_nodes, put_nodes, write_nodes, read_points, put_points and nudge_points; a thread a row.

    They are in Warp's module `module`.
    """
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, vec4 = types.vec3, types.vec4
    Tables = tables_of(real)
    Rows = wp.array(dtype=wp.int32)
    Vectors = wp.array(dtype=wp.vec3d)

    @wp.kernel(module=module, enable_backward=False)
    def read_nodes(s: Tables, rows: Rows, nodes: wp.array(dtype=vec4)):
        """What is at nodes."""
        k = wp.tid()
        nodes[k] = s.grid[rows[k]]

    @wp.kernel(module=module, enable_backward=False)
    def put_nodes(s: Tables, rows: Rows, nodes: wp.array(dtype=wp.vec4d)):
        """Give nodes momenta and masses."""
        k = wp.tid()
        s.grid[rows[k]] = vec4(nodes[k])

    @wp.kernel(module=module, enable_backward=False)
    def write_nodes(s: Tables, rows: Rows, velocities: Vectors):
        """Give nodes velocities, also where tracers read them."""
        k = wp.tid()
        node, v = rows[k], vec3(velocities[k])
        s.grid[node] = vec4(v[0], v[1], v[2], s.grid[node][3])
        if s.carries == 1:
            mass = s.carrier[node][3]
            s.carrier[node] = vec4(mass * v[0], mass * v[1], mass * v[2], mass)

    @wp.kernel(module=module, enable_backward=False)
    def read_points(s: Tables, rows: Rows, places: Vectors, velocities: Vectors):
        """Where points are, and how fast."""
        k = wp.tid()
        p = rows[k]
        o = p * at.POINT_WIDTH + at.VELOCITY
        places[k] = s.x[p]
        velocities[k] = wp.vec3d(vec3(s.points[o], s.points[o + 1], s.points[o + 2]))

    @wp.kernel(module=module, enable_backward=False)
    def put_points(s: Tables, rows: Rows, places: Vectors, velocities: Vectors):
        """Where points are from now on, and how fast."""
        k = wp.tid()
        p = rows[k]
        o = p * at.POINT_WIDTH + at.VELOCITY
        v = vec3(velocities[k])
        for d in range(3):
            s.points[o + d] = v[d]
        s.x[p] = places[k]

    @wp.kernel(module=module, enable_backward=False)
    def nudge_points(s: Tables, rows: Rows, change: Vectors, step: wp.float64):
        """Change the velocities of points, as if it had been so during the last step."""
        k = wp.tid()
        p = rows[k]
        o = p * at.POINT_WIDTH + at.VELOCITY
        v = vec3(change[k])
        for d in range(3):
            s.points[o + d] = s.points[o + d] + v[d]
        s.x[p] = s.x[p] + step * change[k]

    return SimpleNamespace(
        read_nodes=read_nodes,
        put_nodes=put_nodes,
        write_nodes=write_nodes,
        read_points=read_points,
        put_points=put_points,
        nudge_points=nudge_points,
    )
