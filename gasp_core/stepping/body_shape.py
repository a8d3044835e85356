"""What the surface of a body is, for engines that want more of it than the points inside."""

from __future__ import annotations

from dataclasses import dataclass

from gasp_core.contract import PointProblem, SignedDistanceField

__all__ = ["BodyShape", "body_shapes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyShape:
    """The region that a body fills at the points' reference positions, a hint of `PointProblem.hints`.

    An engine that moves rigid bodies lets them touch with this surface. Mass and inertia are those of the points.

    Parameters
    ----------
    body
        Its number in `PointCloud.body_ids`.
    shape
        Where it is.
    """

    body: int
    shape: SignedDistanceField


def body_shapes(problem: PointProblem) -> dict[int, SignedDistanceField]:
    """The shapes of the bodies of a problem that are known, by their numbers."""
    return {hint.body: hint.shape for hint in problem.hints if isinstance(hint, BodyShape)}
