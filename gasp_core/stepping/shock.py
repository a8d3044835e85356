"""The bulk viscosity that stops shocks in elastic matter, in one place for every engine that is explicit MPM."""

from __future__ import annotations

__all__ = ["SHOCK_VISCOSITY"]

SHOCK_VISCOSITY = 0.5
"""c^2 of the pressure that matter bears which was compressed at a rate D = -tr L > 0 in a step dt:

    q = c^2 rho dx^2 D min(D, 1 / (12 c^2 dt)), a part of the Kirchhoff stress, rho at rest.

What meets a wall faster than sound in it cannot tell what is behind in time, and is pressed flat by that: a law that
reaches no volume at a finite energy, as the fixed-corotated one does, has nothing to set against it. A viscosity that
is quadratic in the rate (von Neumann and Richtmyer 1950, 10.1063/1.1699639) spreads the front over some cells, and
makes heat where a shock makes heat. c^2 = 1/2 is enough at three times the speed of sound; at ten matter is crushed all
the same, and that is said (`benchmarks/impacts.py`). Slow motion does not feel it: over the modulus, q is of the order
of the square of what a cell is compressed by while sound crosses it.

Up to 1 / (12 c^2 dt) a step stops what an isolated point does, and does not turn it round (`time_step`). What flows has
its own ways of taking up energy, and none of this.
"""
