"""The motion of a recorded object. Recordings know this file by its digest: not a byte of it may change."""

from __future__ import annotations

import math

import numpy as np


def sway(simplices: np.ndarray, time: float) -> np.ndarray:
    """Sideways, the more the higher: a motion that no formula of a scene tells."""
    moved = np.array(simplices)
    moved[..., 0] += 0.5 * math.sin(3 * time) * moved[..., 2]
    return moved
