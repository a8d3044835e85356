"""The control rule: no Gaussian grows beyond alpha times what it was.

Engines tear and stretch points apart; a Gaussian follows, and one sees a spike. The rule acts on simplices, between
the engine and T^-1, in one form for each inverse. alpha = inf switches it off.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core import linalg3
from gasp_core.errors import SceneError
from gasp_core.games import Covariance, deformation_gradients, gram_schmidt_edges, to_simplices
from gasp_core.gaussians import Gaussians

__all__ = ["ControlRule", "control", "limit_as_printed", "limit_edges", "limit_stretches"]

Array = NDArray[Any]
ControlRule = Literal["bounded", "as_printed"]


def control(
    simplices: Array,
    reference: Gaussians,
    alpha: float,
    covariance: Covariance,
    before: Array | None = None,
    rule: ControlRule = "bounded",
) -> tuple[Array, Array]:
    """The rule that belongs to an inverse: `limit_stretches` for "exact", `limit_edges` for "gram_schmidt".

    Parameters
    ----------
    simplices : (N, 3 | 4, 3)
        Moved simplices, not magnified.
    reference
        The Gaussians at rest.
    alpha
        The bound.
    covariance
        The inverse.
    before : (N, 3 | 4, 3)
        The simplices that the engine moved, where they are not those at rest: the rule bounds what physics did to
        them, and lets pass what they did by themselves.
    rule
        "as_printed", only for "gram_schmidt": `limit_as_printed`.

    Returns
    -------
    simplices : (N, V, 3)
    clipped : (N,) bool

    Raises
    ------
    SceneError
        Where alpha is not > 0, or there is no such rule for the inverse.
    """
    if not alpha > 0:
        raise SceneError(f"alpha must be > 0 (inf: no control), found {alpha!r}")
    if math.isinf(alpha):
        return simplices, np.zeros(len(simplices), dtype=bool)
    if (covariance, rule) not in _RULES:
        raise SceneError(f'control = "{rule}" belongs to covariance = "gram_schmidt", not to "{covariance}"')
    return _RULES[covariance, rule](simplices, reference, alpha, before)


def _in_order(simplices: Array, edges: Array) -> Array:
    """Simplices (N, V, 3) with their edges in another order, (N, V - 1)."""
    ordered = np.array(simplices, dtype=np.float64)
    rows = np.flatnonzero((edges != np.arange(edges.shape[1])).any(axis=1))
    ordered[rows, 1:] = np.take_along_axis(ordered[rows, 1:], edges[rows, :, None], axis=1)
    return ordered


def limit_edges(
    simplices: Array, reference: Gaussians, alpha: float, before: Array | None = None
) -> tuple[Array, Array]:
    """The paper's rule, for `gram_schmidt`: s_i = min(s_i, alpha s_i(0)).

    As printed (s_i := alpha s_i(0) where |e_i| > alpha |e_i(0)|) the rule *inflates* a sheared triangle, whose s_3 is
    a projected length; with the minimum it only ever shrinks. The second edge is split along and across the first, and
    the part across, which is s_3, is what is bounded.

    Parameters
    ----------
    simplices : (N, 3 | 4, 3)
        Moved simplices, not magnified.
    reference
        The Gaussians at rest.
    alpha
        Bound on s_i / s_i(0).
    before : (N, 3 | 4, 3)
        What is bounded is s_i against its edges instead.

    Returns
    -------
    simplices : (N, V, 3)
    clipped : (N,) bool
    """
    rest = to_simplices(reference, 4 if simplices.shape[1] == 4 else 3) if before is None else before
    order = gram_schmidt_edges(reference.scales, simplices.shape[1])
    simplices, rest = _in_order(simplices, order), _in_order(rest, order)
    bound = alpha * np.linalg.norm(rest[:, 1:] - rest[:, :1], axis=2)
    edges = simplices[:, 1:] - simplices[:, :1]
    first, second = edges[:, -2], edges[:, -1]
    length = np.linalg.norm(first, axis=1)
    unit = _unit(first)
    along = np.einsum("ni,ni->n", second, unit)[:, None] * unit
    across = second - along
    height = np.linalg.norm(across, axis=1)
    # A hair of tolerance, or rounding at rest would count as clipping with alpha = 1.
    long = length > bound[:, -2] * (1 + 1e-12)
    high = height > bound[:, -1] * (1 + 1e-12)
    clipped = long | high
    limited = simplices.copy()
    shrink = np.where(high, bound[:, -1] / np.where(high, height, 1.0), 1.0)[:, None]
    rows = np.flatnonzero(clipped)
    limited[rows, -1] = (limited[:, 0] + along + across * shrink)[rows]
    rows = np.flatnonzero(long)
    limited[rows, -2] = limited[rows, 0] + unit[rows] * bound[rows, -2, None]
    if simplices.shape[1] == 4:
        normal = np.cross(unit, across / np.where(height > 0, height, 1.0)[:, None])
        depth = np.einsum("ni,ni->n", edges[:, 0], normal)
        deep = np.abs(depth) > bound[:, 0] * (1 + 1e-12)
        rows = np.flatnonzero(deep)
        excess = (depth - np.copysign(bound[:, 0], depth))[:, None] * normal
        limited[rows, 1] -= excess[rows]
        clipped |= deep
    return _in_order(limited, np.argsort(order, axis=1)), clipped


def limit_as_printed(
    simplices: Array, reference: Gaussians, alpha: float, before: Array | None = None
) -> tuple[Array, Array]:
    """The paper's rule to the letter: s_i := alpha s_i(0) where |e_i| > alpha |e_i(0)|; for `gram_schmidt`.

    What is compared is the edge, what is set is its part across the first. A triangle whose third edge is long because
    it leans is given a height that it never had: benchmarks/control_rules.py counts how often. Here for comparison.
    Parameters and results as in `limit_edges`.
    """
    rest = to_simplices(reference, 4 if simplices.shape[1] == 4 else 3) if before is None else before
    order = gram_schmidt_edges(reference.scales, simplices.shape[1])
    simplices, rest = _in_order(simplices, order), _in_order(rest, order)
    bound = alpha * np.linalg.norm(rest[:, 1:] - rest[:, :1], axis=2)
    edges = simplices[:, 1:] - simplices[:, :1]
    first, second = edges[:, -2], edges[:, -1]
    unit = _unit(first)
    along = np.einsum("ni,ni->n", second, unit)[:, None] * unit
    across = _unit(second - along)
    # A hair of tolerance, or rounding at rest would count as clipping with alpha = 1.
    long = np.linalg.norm(edges, axis=2) > bound * (1 + 1e-12)
    limited = simplices.copy()
    set_to = {-2: unit * bound[:, -2, None], -1: along + across * bound[:, -1, None]}
    if simplices.shape[1] == 4:
        normal = np.cross(unit, across)
        depth = np.einsum("ni,ni->n", edges[:, 0], normal)
        set_to[-3] = edges[:, 0] + (np.copysign(bound[:, 0], depth) - depth)[:, None] * normal
    for edge, wanted in set_to.items():
        rows = np.flatnonzero(long[:, edge])
        limited[rows, edge] = limited[rows, 0] + wanted[rows]
    return _in_order(limited, np.argsort(order, axis=1)), long.any(axis=1)


def _unit(vectors: Array) -> Array:
    """Vectors (N, 3) of length one, or zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def limit_stretches(
    simplices: Array, reference: Gaussians, alpha: float, before: Array | None = None
) -> tuple[Array, Array]:
    """The rule for `exact`: no principal stretch of the simplex's deformation gradient F = U S V^T above alpha.

    Edges and covariance become those of U min(S, alpha) V^T: what was sheared stays sheared, and what was shrunk stays
    shrunk. Parameters and results as in `limit_edges`; with `before` F leads from there to here.
    """
    vertices = 4 if simplices.shape[1] == 4 else 3
    gradients = deformation_gradients(simplices, reference)
    if before is not None:
        gradients = gradients @ _inverses(deformation_gradients(before, reference))
    gradients = np.ascontiguousarray(gradients)
    bounded, clipped = np.empty_like(gradients), np.empty(len(gradients), dtype=np.bool_)
    linalg3.bounded_stretches(gradients, alpha, bounded, clipped, linalg3.chunk_count(len(gradients)))
    limited = np.array(simplices, dtype=np.float64)
    rows = np.flatnonzero(clipped)
    rest = to_simplices(reference.select(rows), vertices) if before is None else before[rows]
    edges = rest[:, 1:] - rest[:, :1]
    limited[rows, 1:] = limited[rows, :1] + np.einsum("nij,nkj->nki", bounded[rows], edges)
    return limited, clipped


def _inverses(matrices: Array) -> Array:
    """Inverses (N, 3, 3); zero where there is none."""
    first, second, third = (matrices[:, :, k] for k in range(3))
    rows = np.stack([np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=1)
    determinants = np.einsum("ni,ni->n", first, rows[:, 0])
    sizes = np.prod([np.linalg.norm(column, axis=1) for column in (first, second, third)], axis=0)
    usable = np.abs(determinants) > 1e-12 * sizes
    return np.where(usable, 1 / np.where(usable, determinants, 1.0), 0.0)[:, None, None] * rows


_RULES = {
    ("exact", "bounded"): limit_stretches,
    ("gram_schmidt", "bounded"): limit_edges,
    ("gram_schmidt", "as_printed"): limit_as_printed,
}
