"""Matter that starts within a collider: what a user has to be told of it, as a picture may not show it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gasp_core.contract import PointProblem, Side

__all__ = ["starts_inside"]

_DEPTH = 0.5
"""In cells: how far inside a collider a point may start. Walls act at nodes, and nodes are felt no finer."""


def starts_inside(problem: PointProblem, spacing: float, names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """For each body and each collider that it starts in: the body's number, and a sentence without its subject.

    It is told and not refused: a trained splat has a few points below any floor it is put on. Engines let nothing go
    further in, and throw nothing out.

    Parameters
    ----------
    problem
        As an engine is given it.
    spacing
        Of its grid or cage [m].
    names
        Of its colliders, as a user would call them.
    """
    points, masses = problem.points, problem.masses
    for body in np.unique(points.body_ids):
        own = points.body_ids == body
        for name, collider in zip(names, problem.colliders):
            sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
            depth = -sign * collider.shape.signed_distance(points.reference_positions[own])
            inside = depth > _DEPTH * spacing
            if inside.any():
                share = 100 * masses[own][inside].sum() / masses[own].sum()
                yield (
                    int(body),
                    f"{int(inside.sum()):,} points, {share:.3g} % of its mass, start inside {name}"
                    f" ({collider.shape.kind}), the deepest by {depth.max():.3g} m: they stay there, or leave, and are"
                    " not pushed out; move the object or the collider if that shows",
                )
