"""Where the numbers lie that kernels work on: points as rows of vectors of four, and what they are told and report.

Few arrays rather than many: every argument of a kernel costs some ten microseconds a launch.
"""

from __future__ import annotations

__all__: list[str] = []

# One point: vectors of four, because that is what a processor adds in one go. Three places are vectors of space; the
# fourth is zero, or holds a number that has to lie somewhere.
VELOCITY = 0
"""And 1: what a point gives to a node is its velocity and its mass, by the same weights."""
AFFINE = 1
"""The columns of C, three rows."""
STRESS = 4
"""The columns of the scaled Kirchhoff stress, three rows."""
DISPLACEMENT_GRADIENT = 7
"""The columns of F, three rows."""
POINT_ROWS = 10
# The fourth places, as (row, 3).
DILATION = 4
HISTORY = 5
MASS = 7
HALF_SIDE = 8

# What indices are cut to where it changes nothing, because they are below: a compiler that knows an index small knows
# what lies beside what.
POINT_BITS = 2**25 - 1
NODE_BITS = 2**28 - 1

# The control words.
LOWER = 0
SHAPE = 3
POINTS = 6
ACTIVE = 7
COLLIDERS = 8
WINDS = 9
DRIVES = 10
CLAMP = 11
SEEDING = 12
"""Only C is learnt: nothing moves and nothing deforms."""
COLOURS_AT = 13
"""Nine offsets into the list of tiles."""
PHASES_AT = 22
"""Offsets of the phases of a step into its tickets, and the end."""
TRACERS = 44
"""How many of them something can move."""
# Where things begin in the one table of who meets, see `gasp_mpm_host.bodies.Meetings`.
STANDS_AT = 45
APART_AT = 46
MEMBERS_AT = 47
MEMBER_BEGINS_AT = 48
PAIRS_AT = 49
PAIR_BEGINS_AT = 50
NEAR_AT = 51
NEAR_BEGINS_AT = 52
APART = 53
"""How many active blocks have one body only."""
PLACES = 54
"""How many places have several."""
SCRATCH_AT = 55
"""Where the scratch begins, behind the friction of the pairs."""
LOOKS = 56
"""Every so many steps it is looked how far apart bodies are,"""
FIRST_STEP = 57
"""and at the first since the host looked."""
MOVING = 58
"""1 where colliders have a set for every step, because any of them moves."""
WINDS_AT = 59
CARRIED_AT = 60
"""How far behind a node's row the one lies that has what points brought to it, before anything acts."""
HOLDING_AT = 61
"""Where it begins, behind the rows of what acts, which drive holds which body: 1 for every body that it does."""
BODIES = 62
APART_BODIES_AT = 63
"""In the table of who meets: whose the blocks are that have one body only,"""
MEMBER_BODIES_AT = 64
"""and those of the others."""
CARRIES = 65
"""1 where the carrier is written with the grid, because there are tracers that something can move: `TRACERS` is nought
in a part of a step that moves none."""
CONTROL_WIDTH = 66

# The phases of a step, each done before the next begins; of these two the first of eight colours.
CLEAR = 0
AVERAGE = 1
DIVIDE = 9
SCATTER = 10
UPDATE = 18
MOVE = 19
CARRY = 20
PHASES = 21

# A ticket's share of the work.
BLOCKS_A_TICKET = 8
POINTS_A_TICKET = 256

# What the threads of a march tell each other, a cache line each.
TICKET = 0
DONE = 16
HALTED = 32
HELD = 48
"""The ticket that each of them still has to do, or -1."""

# What kernels report.
DRIFTED = 0
CLAMPED = 1
REPORT_WIDTH = 4

# The batch's numbers, float64.
STEP = 0
GRAVITY = 1
WALL_LOW = 4
WALL_HIGH = 7
STEP_VECTOR = 10
"""(dt, dt, dt, 0)"""
MASS_AXIS = 14
"""(0, 0, 0, 1). The two are read from memory because a compiler that knows them treats the fourth place apart."""
BATCH_WIDTH = 18
