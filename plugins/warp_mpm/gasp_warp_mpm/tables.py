"""What every kernel is given: one structure of arrays and numbers, in the engine's units.

Rows of the arrays lie as `layout` says.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from typing import Any

import warp as wp

from gasp_warp_mpm.decompositions import algebra

__all__ = [
    "CLAMPED",
    "DRIFTED",
    "FIRST_STEP",
    "HALTED",
    "NEXT_STEP",
    "REPORT_WIDTH",
    "STEPS_DONE",
    "Acting",
    "stand_of",
    "tables_of",
]

# The report of some steps.
DRIFTED = 0
CLAMPED = 1
STEPS_DONE = 2
HALTED = 3
"""Set after the step in which a point drifted: what is launched from then on does nothing."""
NEXT_STEP = 4
"""Number of the batch's step to come, for kernels that are launched with the same arguments at every step."""
FIRST_STEP = 5
"""Number of the first step since the host looked."""
REPORT_WIDTH = 6


@wp.struct
class Acting:
    """What acts at grid nodes during a batch of steps."""

    gravity: wp.vec3d
    """Velocity gained in a step."""
    clamp: int
    wall_low: wp.vec3d
    wall_high: wp.vec3d
    colliders: int
    winds: int
    drives: int
    """How many of each; drives have a copy for every step of the batch, and so have colliders if any of them moves."""
    moving: int
    """1 where colliders have."""
    wind_begin: int
    """Where the rows of winds begin."""
    forcing: wp.array(dtype=wp.float64)
    """Rows of the colliders, the winds, the drives."""
    fields: wp.array(dtype=wp.float64)
    """Distances that rows name."""
    bodies: int
    holding_begin: int
    """Where it begins, behind these rows, which drive holds which body: 1 for every body that it does, by drive."""
    looks: int
    """Every so many steps it is looked how far apart bodies are."""


@wp.func
def stand_of(stands: wp.array(dtype=wp.int32), x: int):
    """How far the body at the grid's node or cell `x` along the first axis is from its place in the scene [cells]."""
    column = 3 * (x // 4)
    return wp.vec3i(stands[column], stands[column + 1], stands[column + 2])


@cache
def tables_of(real: Any) -> Any:
    """The structure for wp.float32 or wp.float64; positions are float64 in both."""
    types = algebra(real)

    @wp.struct
    class Tables:
        x: wp.array(dtype=wp.vec3d)
        points: wp.array(dtype=real)
        labels: wp.array(dtype=wp.int32)
        count: int
        materials: wp.array(dtype=wp.float64)
        step: wp.float64
        grid: wp.array(dtype=types.vec4)
        carried: wp.array(dtype=types.vec4)
        """The grid before anything acts on it, where there is matter that flows."""
        means: wp.array(dtype=types.vec2)
        lower: wp.vec3i
        shape: wp.vec3i
        active: wp.array(dtype=wp.int32)
        active_count: int
        tiles: wp.array(dtype=wp.int32)
        colours: wp.array(dtype=wp.int32)
        report: wp.array(dtype=wp.int32)
        tracers: wp.array(dtype=wp.vec3d)
        tracer_homes: wp.array(dtype=wp.int32)
        tracer_count: int
        """How many are carried: none in a part of a step that does something else."""
        carrier: wp.array(dtype=types.vec4)
        carries: int
        """1 where that is written with the grid, because there are tracers to be carried in some part of the step."""
        stands: wp.array(dtype=wp.int32)
        """Of the body in each column of blocks, three numbers; the rest is `gasp_mpm_host.bodies.Meetings`."""
        apart: wp.array(dtype=wp.int32)
        apart_bodies: wp.array(dtype=wp.int32)
        apart_count: int
        members: wp.array(dtype=wp.int32)
        member_bodies: wp.array(dtype=wp.int32)
        places: wp.array(dtype=wp.int32)
        place_count: int
        pairs: wp.array(dtype=wp.int32)
        friction: wp.array(dtype=wp.float64)
        pair_begins: wp.array(dtype=wp.int32)
        near: wp.array(dtype=wp.int32)
        near_begins: wp.array(dtype=wp.int32)
        scratch: wp.array(dtype=real)

    return Tables
