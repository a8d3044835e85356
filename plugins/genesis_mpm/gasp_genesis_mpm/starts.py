"""Matter that starts within a collider: what a user has to be told of it, as a picture may not show it."""

from __future__ import annotations

from collections.abc import Iterator

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import Side

__all__ = ["starts_inside"]

_DEPTH = 0.5
"""In cells: how far inside a collider a point may start. Walls act at nodes, and nodes are felt no finer."""


def starts_inside(problem: PointProblem, spacing: float) -> Iterator[str]:
    """One line for each collider that points start in, on a grid of `spacing` [m].

    Nodes in a wall let nothing go further in, whatever is there already: such points stay where they are, or leave, as
    with every engine that has its contact at nodes. A trained splat has a few of them.
    """
    masses = problem.masses
    for number, collider in enumerate(problem.colliders, start=1):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        depth = -sign * collider.shape.signed_distance(problem.points.reference_positions)
        inside = depth > _DEPTH * spacing
        if inside.any():
            deepest = int(depth.argmax())
            share = 100 * masses[inside].sum() / masses.sum()
            yield (
                f"{int(inside.sum())} point(s), {share:.3g} % of all mass, start inside collider {number}"
                f" ({collider.shape.kind}), point {deepest} the deepest with {depth.max():.3g} m: the wall holds them"
                " there and does not push them out; move the object or the collider if that shows"
            )
