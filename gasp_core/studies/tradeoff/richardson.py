"""How far the finest of a few runs still is from where finer and finer ones would go.

Let u_h be the run of spacing h and u the limit. Where h is small enough, u_h - u = C h^p with a field C that does not
depend on h, so that with |.| the root mean square over vertices and frames, and h1 > h2 > h3,

    |u_h1 - u_h2| / |u_h2 - u_h3| = (h1^p - h2^p) / (h2^p - h3^p)        gives p, and then
    |u_h3 - u|                    = |u_h2 - u_h3| h3^p / (h2^p - h3^p)   is what is left (Richardson 1911).

That is multiplied by a safety of 1.25 where p is within 0.5 of what the discretisation promises (Roache 1994,
10.1115/1.2910291); where it is not, the three are not yet, or never will be, in that regime: p = 1 and a safety of 3.

Substeps are a fraction of the stable bound, so they shrink with h, and what they do that is smooth is in C. The rest is
not: their number is a whole one and changes from frame to frame with the stretch of the matter, by jerks that no power
of h describes (a bar in 48 cells was off by half as much again as its order promised). So the finest run is made once
more with half the fraction, v, and is what all else is measured by; to first order in the substep

    |v - u| <= |u_h3 - u| + |u_h3 - v|

with the same safety of 1.25 on the second term. Whoever measures by v instead of u then knows, for |.| is a norm, that
an error reported as e is within [max(0, e - d), e + d] of the true one if d is no less than |v - u|.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Remainder", "remainder_of"]

_STEADY, _UNSTEADY = 1.25, 3.0
_NEAR = 0.5
_HIGHEST_ORDER = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Remainder:
    """What is left between the finest run and the limit.

    Parameters
    ----------
    value
        Its estimate with the safety, in the unit of the differences: the part of the spacing and that of the substeps.
    substeps
        The latter.
    order
        Seen in the three runs; 0 where they do not draw nearer to each other.
    expected_order
        That was promised.
    safety
        1.25 or 3.
    """

    value: float
    substeps: float
    order: float
    expected_order: float
    safety: float


def remainder_of(
    spacings: tuple[float, float, float], coarse: float, fine: float, halved: float, expected_order: float
) -> Remainder:
    """Estimate what is left.

    Parameters
    ----------
    spacings
        h1 > h2 > h3 > 0, in any unit.
    coarse, fine
        |u_h1 - u_h2| and |u_h2 - u_h3|, >= 0.
    halved
        |u_h3 - v|, >= 0.
    expected_order
        What the discretisation promises: 2 for smooth motion, 1 with contact.

    Raises
    ------
    ValueError
        Where the spacings do not fall.
    """
    h1, h2, h3 = spacings
    if not h1 > h2 > h3 > 0:
        raise ValueError(f"remainder_of: spacings must fall and be > 0, found {spacings}")
    order = _order(h1, h2, h3, coarse, fine)
    if abs(order - expected_order) <= _NEAR:
        # The smaller of the two leaves more.
        used, safety, difference = min(order, expected_order), _STEADY, fine
    else:
        # Where they do not draw nearer, the last step is not the measure of those to come.
        used, safety, difference = 1.0, _UNSTEADY, max(coarse, fine) if order == 0 else fine
    left = difference / ((h2 / h3) ** used - 1)
    return Remainder(
        value=safety * left + _STEADY * halved,
        substeps=_STEADY * halved,
        order=order,
        expected_order=expected_order,
        safety=safety,
    )


def _order(h1: float, h2: float, h3: float, coarse: float, fine: float) -> float:
    """The p of three runs, in 0..20."""
    if fine == 0:
        return _HIGHEST_ORDER if coarse > 0 else 0.0

    def ratio(order: float) -> float:
        # In units of h2, so that no power of a spacing overflows; it grows with the order.
        return math.expm1(order * math.log(h1 / h2)) / -math.expm1(order * math.log(h3 / h2))

    low, high = 0.0, _HIGHEST_ORDER
    if coarse / fine <= math.log(h1 / h2) / math.log(h2 / h3):
        return 0.0
    if coarse / fine >= ratio(high):
        return high
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if ratio(middle) < coarse / fine else (low, middle)
    return (low + high) / 2
