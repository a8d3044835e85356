"""Start and stride of a run, told apart by when its frames were there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

__all__ = ["split_times"]


def split_times(begin: float, frames: Sequence[float], end: float) -> tuple[float, float]:
    """Seconds until a run was in its stride, and those of its frames in their stride.

    Parameters
    ----------
    begin, end
        When its process was started, and when it had ended [s].
    frames
        When each frame was recorded, from frame 0 on, on the same clock.

    Returns
    -------
    start, run
        What a first frame took above the median of the later ones is start, not run.
    """
    if not frames:
        return end - begin, 0.0
    steps = [after - before for before, after in pairwise(frames)]
    hidden = max(0.0, steps[0] - median(steps[1:])) if len(steps) > 1 else 0.0
    return frames[0] - begin + hidden, frames[-1] - frames[0] - hidden
