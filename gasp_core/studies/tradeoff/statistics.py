"""What repeated measurements say: medians with their intervals, and which settings no other one beats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CHANCE", "Summary", "dominated", "summary"]

Array = NDArray[Any]

CHANCE = 0.05
"""A setting is on the front where the probability that another one beats it is below this."""
_RESAMPLES = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Of repeated measurements.

    Parameters
    ----------
    median
        Of them.
    deviation
        Median of their distances from it (MAD).
    low, high
        95 % interval of the median by the percentile bootstrap (Efron 1979); of one measurement that itself.
    """

    median: float
    deviation: float
    low: float
    high: float


def summary(values: Sequence[float], seed: int = 0) -> Summary:
    """Sum up measurements, at least one."""
    samples = np.asarray(values, dtype=np.float64)
    medians = _resampled_medians(samples, np.random.default_rng(seed))
    low, high = np.quantile(medians, [0.025, 0.975])
    median = float(np.median(samples))
    deviation = float(np.median(np.abs(samples - median)))
    return Summary(median=median, deviation=deviation, low=float(low), high=float(high))


def dominated(times: Sequence[Sequence[float]], errors: Sequence[Sequence[float]], seed: int = 0) -> Array:
    """Probability for each setting that some other one is no slower and no less accurate, and better in one of the two.

    Parameters
    ----------
    times, errors
        What was measured of each setting, at least once each. Medians of times, and of errors where repeats differ, are
        drawn by the bootstrap, each setting by itself.
    seed
        Of the bootstrap.

    Returns
    -------
    (S,) in 0..1
    """
    generator = np.random.default_rng(seed)
    slow = np.stack([_resampled_medians(np.asarray(own, dtype=np.float64), generator) for own in times])
    wrong = np.stack([_resampled_medians(np.asarray(own, dtype=np.float64), generator) for own in errors])
    beaten = np.empty(len(slow))
    for index in range(len(slow)):
        no_worse = (slow <= slow[index]) & (wrong <= wrong[index])
        better = (slow < slow[index]) | (wrong < wrong[index])
        beaten[index] = (no_worse & better).any(axis=0).mean()
    return beaten


def _resampled_medians(samples: Array, generator: np.random.Generator) -> Array:
    drawn = generator.integers(0, len(samples), size=(_RESAMPLES, len(samples)))
    return np.median(samples[drawn], axis=1)
