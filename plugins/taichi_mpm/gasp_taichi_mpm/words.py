"""Where the numbers lie that kernels are given beside the rows of `gasp_mpm_host.layout`.

Few arrays rather than many: every argument of a kernel costs some ten microseconds a launch.
"""

from __future__ import annotations

__all__: list[str] = []

# The control words.
LOWER = 0
SHAPE = 3
POINTS = 6
ACTIVE = 7
COLLIDERS = 8
WINDS = 9
DRIVES = 10
CLAMP = 11
COLOURS_AT = 12
"""Nine offsets into the list of tiles."""
CONTROL_WIDTH = 24

# What kernels report.
DRIFTED = 0
STEPS_DONE = 1
CLAMPED = 2
REPORT_WIDTH = 4

# The batch's numbers, float64.
STEP = 0
GRAVITY = 1
WALL_LOW = 4
WALL_HIGH = 7
BATCH_WIDTH = 10
