"""Choices of the explicit material point method, in one place for every engine that is one.

Two are about how stress reaches the grid. With them engines that share the quadratic B-splines and the affine
transfers give the same numbers; without them a thin thing that lies across the grid bends too far, and one that keeps
its volume does not bend at all.
The third is about tracers, which have no mass and are carried by the grid alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Elastic, Foam, Material, Metal, NeoHookean, Plasticine

__all__ = [
    "BETTER_GAP",
    "FOREMOST",
    "FULL_PRESENCE",
    "GRADIENT_SHARE",
    "HELD_TOGETHER",
    "LOOK_TRAVEL",
    "TURNS",
    "TURN_BELOW",
    "averaged_lame",
    "presence",
]

GRADIENT_SHARE = 0.5
"""How much of the kernel by which stress acts is the spline's own gradient; the rest is moving least squares.

In moving-least-squares form (Hu et al. 2018, 10.1145/3197517.3201293) a point pulls at a node by 4/dx^2 w r, r being
the way to it. Along an axis that is a kernel, but in space it is not the gradient of one: where tension runs along a
free surface that lies askew to the grid, the pulls on the nodes beside it do not cancel, and the outermost points give
up a fifth of their strain. The spline's gradient cancels exactly and is rougher: its strain is noisier and its stable
step shorter. A sum of both, a 1/dx along an axis with

    a_k = (1 - s) 4 w_k r_k + s w'_k,   sum a_k = 0,   sum a_k r_k = 1,

has what both have (momentum and angular momentum are conserved, affine fields are exact), and used for the force as
well as for the rate of deformation it conserves energy too. A cantilever that bends by a quarter of its length (K = 2)
hangs too deep by 5.6, 3.2 and 2.3 % at 3, 6 and 12 cells across it for s = 1/4, by 3.6, 1.7 and 1.2 % for 1/2, of which
nothing is left with 64 points a cell (`benchmarks/stress_kernel.py`).
The stable step is shorter by the factor 1/sqrt(1 + s^2), `gasp_core.stepping.time_step`: 11 % at a half, 3 % at a
quarter. For the same error in bending a grid would have to be half as fine again, which costs five times as much.
"""

_OWN_LAME = 4.0
"""In shear moduli: lambda at Poisson's ratio 0.4."""


def averaged_lame(material: Material) -> float:
    """The part of Lame's lambda [Pa] that acts on the mean dilation around a point instead of the point's own.

    Where every point keeps its own volume, a grid that has fewer degrees of freedom than points locks: eight points a
    cell make eight constraints for three velocities. So of a lambda above 4 mu (Poisson's ratio 0.4) the excess acts
    through the average q_i = sum_p w_ip V_p q_p / sum_p w_ip V_p at the nodes (q the dilation, J - 1 or ln J), brought
    back to the points by the same weights. That is the energy

        1/2 sum_i (sum_p w_ip V_p sqrt(lambda_p) q_p)^2 / sum_p w_ip V_p,

    never above that of the points themselves (Cauchy-Schwarz), so the stable step is what it was, and a lone point
    feels no difference. Damping that is proportional to stiffness acts on it alike: q + b dq/dt is what is averaged.
    After the volume averaging of Zhao, Jiang and Choo 2023, "Circumventing volumetric locking in explicit material
    point methods", here of the energy rather than of the deformation gradient.

    What flows at constant volume has no shear stiffness while it does, and so locks at any Poisson's ratio, but little:
    with the excess averaged at a ratio of 0.49 a rod of metal, three cells thick and thrown on a floor, is shortened to
    0.861 of its length rather than 0.877 (0.836 at twice the resolution). With all of lambda averaged it would be 0.858
    there, and 0.843 rather than 0.844 at a ratio of 0.3, while the points' own volumes scatter by a fifth to a third
    more. So it is the excess here as well.
    """
    if isinstance(material, Elastic | NeoHookean | Metal | Plasticine | Foam):
        return max(0.0, material.lame_lambda - _OWN_LAME * material.shear_modulus)
    return 0.0


FULL_PRESENCE = 0.1
"""Mass, in mean point masses, from which on a node counts fully for a tracer."""


def presence(masses: NDArray[Any], point_mass: float) -> NDArray[Any]:
    """How much nodes of these masses [kg] count for tracers, 0 to 1; `point_mass` [kg] is the points' mean.

    A tracer has no mass of its own, and goes with velocity sum_i w_i h_i v_i / sum_i w_i h_i, h_i being this. Without
    it a tracer beside matter would lag, since the nodes without mass have no velocity; with h = 1 for every node that
    has any, it would listen to nodes at the rim of a point's reach, whose stress per mass grows beyond all bounds as
    their mass falls. Inside matter every h_i is 1, and affine velocity fields are exact.
    """
    return np.minimum(masses / (FULL_PRESENCE * point_mass), 1.0)


HELD_TOGETHER = 0.5
"""In cells: bodies that are nearer than this count as touching where contact holds them together, "stick" and "slip".

Where contact only keeps them apart nothing is counted: an open gap may close, and not more."""

LOOK_TRAVEL = 0.125
"""In cells: how far points may fly before it is looked again how far apart bodies are, and along which normals."""

TURNS = 3
"""How often a normal between two bodies is turned towards the direction along which they are farthest apart."""

TURN_BELOW = 0.02
"""In cells: a normal along which bodies overlap by less is good enough; it is off by a degree at most."""

FOREMOST = 20.0
"""Per cell: of a body's points those count as foremost that lie within a few times 1/20 of a cell of the first one.

More than one, since those of a lattice come in rows, and which of a row is first is a matter of rounding."""

BETTER_GAP = 1e-4
"""In cells: a direction is preferred to one that was tried before if the gap along it is larger by so much."""
