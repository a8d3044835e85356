"""Choices of the explicit material point method for matter that flows, in one place for every engine that is one.

One lets it go where it goes whatever the step is, one keeps the volume of what is a liquid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Elastic, Fluid, Material, NeoHookean, PointProblem
from gasp_core.stepping.time_step import inviscid_bound, rest_bound

__all__ = [
    "CROWDED_VOLUME_RATIO",
    "CROWDING_DECAY",
    "CROWDING_TOLERANCE",
    "FLUID_SUBGRID_DECAY",
    "FLUID_VOLUME_RATIOS",
    "SUBGRID_DECAY",
    "WALL_FADE",
    "WALL_REACH",
    "crowding_decay",
    "is_flowing",
    "subgrid_decay",
    "wall_share",
]

SUBGRID_DECAY = 0.2
"""What share of the velocities that the grid does not see dies away in a stable step of the material at rest.

An affine transfer gives back what the grid knows of the points' velocities and forgets the rest. That is a damping by
the step: a front of sand or water comes to rest earlier the smaller the steps are (of a column of water a tenth of the
step takes a third of its way, of a block that bounces three times a third of its height). For what flows the rest,
r = v - sum_i w_i v_i and R = C - C[v_i] with the nodes' velocities v_i before anything acts on them, is not forgotten
but fades:

    v' = sum_i w_i v_i' + k r,   C' = C[v_i'] + k (R - q Q),   k = max(0, 1 - decay dt),

so what is lost depends on how long it takes and not on the number of steps. Where dt = 1 / decay, that is the affine
transfer. v and C fade together because each alone is answered by the other: with C forgotten and v kept (Fei et al.
2021, 10.1145/3450626.3459820) energy grows. Points go with the velocity that they have, so r x m v adds nothing to the
angular momentum; r and R carry no momentum and no angular momentum, since P2G and G2P both conserve them.
Q = dt sym(C L) is by how much a velocity gradient falls as matter carries it along, of which the symmetric part has no
spin; q = (C[v_i'] - C[v_i]) : Q / (Q : Q), held within 0 and 1, takes it into account as far as forces bear it. Without
it what spins steadily is drawn in (a rod falls apart within ten turns), with q = 1 a point that nothing touches runs
away. Elastic solids keep the affine transfer.
"""

FLUID_SUBGRID_DECAY = 1.0
"""The same of a fluid, in which nothing but the grid keeps points apart.

What it loses is what the affine transfer loses at the whole stable step, whatever the step is. At 0.2 a front would go
2 % farther in the whole step than in a tenth of it, at 1 it is 9 % (affine: 40 %); but points then scatter until a tank
of 24 cells stands 5 % too high.
"""

CROWDING_DECAY = 0.05
"""By what share of itself, per stable step at rest, a fluid's volume ratio falls where points are too many."""

CROWDED_VOLUME_RATIO = 0.95
"""Below which a fluid's volume ratio does not fall for being crowded.

Where there is more volume than room from the start, the pressure that makes room is energy from nowhere: with a ratio
that went on falling a cloud that flew through itself ended with 25 times what it had. This much presses with .062 K,
six times what lies under a column whose weight is a hundredth of K, and its work is no more than that times the volume
that is wanted; a tank of 12 cells stands as it does without a limit.
"""

CROWDING_TOLERANCE = 0.15
"""Points that lie at random are up to this much too many in a quarter of all places."""

FLUID_VOLUME_RATIOS = (0.5, 10.0)
"""Within which a fluid's volume ratio J is kept.

At half its volume a fluid presses with 18 K, which stops what comes at four times its speed of sound. Below that there
is no liquid left, but there are points of next to no mass, cut off a body by its surface: nodes that they alone belong
to throw them about, their J becomes .2 and less, and as J^-8 the step of everybody a three hundredth.
"""

WALL_FADE = 2.565
"""Per cell. What the grid sees of matter that fills a half space is 1 / (1 + exp(-fade d)) of what it sees inside, to
3 %, d [cells] being the way to the plane: two quadratic splines one after the other have the variance 1/2 of this
logistic law."""

WALL_REACH = 3.0
"""In cells: from there on no node between a point and a wall is missing."""


def subgrid_decay(material: Material, spacing: float) -> float:
    """`SUBGRID_DECAY` per second on a grid of `spacing` [m]; nought for what does not flow, which keeps nothing."""
    if not is_flowing(material):
        return 0.0
    if isinstance(material, Fluid):
        return FLUID_SUBGRID_DECAY / inviscid_bound(material, spacing)
    return SUBGRID_DECAY / rest_bound(material, spacing)


def crowding_decay(problem: PointProblem, index: int, spacing: float) -> float:
    """`CROWDING_DECAY` of a problem's material `index`, per second; nought for what is no fluid.

    A fluid's pressure comes from J = V / V0, which sums up the divergences of its flow and their errors: after a few
    waves in a tank half the volume may be gone, with a mean J of 1.02. So J is held against the density that the grid
    sees, rho = sum_i w_i m_i / dx^3. Where there is more volume than room,

        x = J rho / (rho0 open) - 1 - tolerance > 0,   dJ/dt = -decay J x,

    with `open` the product of `WALL_FADE`'s law over the walls near by, as long as J is above `CROWDED_VOLUME_RATIO`;
    the pressure then makes room, and conserves momentum, as pressures do. Never the other way: beside a free surface
    the grid sees too little. A fluid that shares a body with other matter is left alone, since a node does not tell
    whose mass it has.
    """
    material, points = problem.materials[index], problem.points
    if not isinstance(material, Fluid):
        return 0.0
    own = points.material_ids == index
    if bool(np.isin(points.body_ids[~own], points.body_ids[own]).any()):
        return 0.0
    # What is viscous steps for longer, and loses no more.
    return CROWDING_DECAY / inviscid_bound(material, spacing)


def wall_share(distances: NDArray[Any]) -> NDArray[Any]:
    """How much of what it sees inside the grid sees of matter (...) that is so far from a wall [cells], `WALL_FADE`."""
    near = np.clip(distances, 0.0, WALL_REACH)
    return np.where(distances < WALL_REACH, 1 / (1 + np.exp(-WALL_FADE * near)), 1.0)


def is_flowing(material: Material) -> bool:
    """Whether matter takes other shapes for good: everything but what is elastic alone."""
    return not isinstance(material, Elastic | NeoHookean)
