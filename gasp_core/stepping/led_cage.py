"""What points that are led do to the nodes of cages that other points ride in.

The nodes that are nearer to them than to others of their body, at the start, go with them, whatever else acts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.stepping.led_bodies import LedBodies, Slopes
from gasp_core.stepping.led_points import LedPoints

__all__ = ["HOLDS_NOTHING", "LedCage"]

Array = NDArray[Any]

HOLDS_NOTHING = (
    "what is driven holds no node of its body's cage, and takes nothing along: make it larger than a cell, or cells"
    " smaller"
)
"""What a user is told where `LedCage.holds_nothing`."""
_TOUCH = 2e-3
"""In cells: a node on the boundary itself is led, whichever way its place was rounded."""
_AROUND = 8
"""Led points that a node goes with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LedCage:
    """The led points of a problem, and the nodes that go with them.

    A node goes with the led points around it as the affine maps go that fit their motion since the start; where these
    points lie in a plane its normal goes along. So what moves all of them affinely moves nodes exactly.

    Parameters
    ----------
    points
        Those that are led.
    nodes : (L,)
        Those that go with them, rising.
    rest : (L, 3) [m]
        Where these begin.
    carried
        (L, K), sparse: displacements of nodes by those of points.
    sheets
        Fits around led points that lie in a plane with their neighbours.
    above
        (L, F), sparse [m]: how far nodes lie from the planes.
    """

    points: LedPoints
    nodes: Array
    rest: Array
    carried: Any
    sheets: Slopes
    above: Any

    @classmethod
    def of(cls, problem: PointProblem, nodes: Array, bodies: Array, side: float) -> Self | None:
        """Of a problem, the nodes of whose cages begin at (M, 3) [m], of bodies (M,); None where nothing is led.

        `side` is that of a cell [m].

        Raises
        ------
        SceneError
            Where the body of a led point is rigid.
        """
        points = LedPoints.of(problem)
        if points is None:
            return None
        led = LedBodies.of(problem, points)
        held = led.nearer(nodes, bodies, _TOUCH * side)
        around, weights = _around(led, nodes[held], bodies[held], _TOUCH * side)
        arms = nodes[held][:, None] - points.start[around]
        rows, within = np.unique(around, return_inverse=True)
        within = within.reshape(around.shape)
        slopes = Slopes.of(points.start, led.neighbours, rows)
        # A slope is a sum over neighbours, of what they are displaced by beyond the point, times these.
        shares = np.einsum("lanj,lajk,lak->lan", slopes.arms[within], slopes.inverses[within], arms)
        shares *= weights[:, :, None]
        columns = np.concatenate([around[:, :, None], slopes.neighbours[within]], axis=2)
        values = np.concatenate([(weights - shares.sum(axis=2))[:, :, None], shares], axis=2)
        sheets = Slopes.of(points.start, led.neighbours, rows[slopes.flat])
        node, place = np.nonzero(np.isin(within, slopes.flat))
        sheet = np.searchsorted(slopes.flat, within[node, place])
        heights = weights[node, place] * np.einsum("fj,fj->f", sheets.normals[sheet], arms[node, place])
        owners = np.repeat(np.arange(len(held)), columns.shape[1] * columns.shape[2])
        return cls(
            points=points,
            nodes=held,
            rest=nodes[held],
            carried=_summed(owners, columns.ravel(), values.ravel(), (len(held), len(points.rows))),
            sheets=sheets,
            above=_summed(node, sheet, heights, (len(held), len(sheets.rows))),
        )

    def holds_nothing(self, bodies: Array) -> bool:
        """Whether a body is led, of those of all nodes (M,), of which no node is."""
        return bool(np.setdiff1d(np.intersect1d(self.points.bodies, bodies), bodies[self.nodes]).size)

    def positions(self, time: float) -> Array:
        """Of the nodes at a time [s], (L, 3) [m]."""
        moved = self.points.positions(time) - self.points.start
        return self.rest + self.carried @ moved + self.above @ self.sheets.tilts(moved)


def _around(led: LedBodies, places: Array, bodies: Array, room: float) -> tuple[Array, Array]:
    """Led points (L, A) around places (L, 3) [m] of bodies (L,), and their weights (L, A), of sum 1."""
    around = np.zeros((len(places), _AROUND), dtype=np.intp)
    weights = np.zeros((len(places), _AROUND))
    for body, (tree, _) in led.trees.items():
        own = np.flatnonzero(bodies == body)
        rows = np.flatnonzero(led.points.bodies == body)
        count = min(_AROUND, len(rows))
        distances, nearest = tree.query(places[own], k=[*range(1, count + 1)])
        around[own, :count] = rows[nearest]
        # A place may lie upon a point.
        weights[own, :count] = 1 / (distances**2 + room**2)
    return around, weights / weights.sum(axis=1, keepdims=True)


def _summed(rows: Array, columns: Array, values: Array, shape: tuple[int, int]) -> Any:
    """The sparse matrix of these values; those in one place are added."""
    from scipy import sparse

    return sparse.csr_array((values, (rows, columns)), shape=shape)
