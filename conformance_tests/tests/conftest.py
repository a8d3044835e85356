"""Before runs of pytest within a test: these forget the modules that they were the first to import.

Numba's cannot be imported twice, and some of them come only when something is compiled.
"""

from typing import Any

import numpy as np

from gasp_core.stepping.rigid.surfaces import distances
from gasp_core.stepping.rigid.world import RigidWorld

COMPILED: tuple[Any, ...] = (
    RigidWorld,
    distances(np.ones(27), 0, np.array([3, 3, 3]), np.zeros(3), 1.0, np.ones((1, 3))),
)
