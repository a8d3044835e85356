"""Which simplices the control rule bounds and which give no frame, told without making any Gaussian.

A run wants both of every frame, for its report; the Gaussians themselves are made where somebody looks at them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.linalg3 import chunk_count
from gasp_core.reduction import kernels
from gasp_core.reduction.bodies import Body, carried_simplices, shapes
from gasp_core.scene.settings import MapChoice

__all__ = ["shape_flags"]

Array = NDArray[Any]

_ROUNDING = 1e-6
"""Share by which a bound is lowered: far above the rounding of a sum of nine squares, and it costs a few rows."""


def shape_flags(body: Body, displacements: Array, maps: MapChoice, drift: Array | None = None) -> tuple[Array, Array]:
    """Where `moved_gaussians` of the same arguments is degenerate, and where it is clipped.

    Parameters
    ----------
    body
        Whose points.
    displacements : (P, 3) [m]
        From the positions at the start, less any common translation.
    maps
        Which inverse and which bound.
    drift : `Body.drifting` [m]
        How far the body has moved by itself.

    Returns
    -------
    degenerate, clipped : (N,) bool
    """
    moved, before = carried_simplices(body, displacements, drift)
    local = body.block.local
    if maps.covariance == "exact" and before is None:
        rows = np.flatnonzero(_in_question(moved, local, maps.alpha))
    else:
        rows = np.arange(len(local))
    degenerate, clipped = np.zeros(len(local), dtype=bool), np.zeros(len(local), dtype=bool)
    if len(rows):
        some = shapes(moved[rows], local.select(rows), maps, before=None if before is None else before[rows])
        degenerate[rows], clipped[rows] = some.degenerate, some.clipped
    return degenerate, clipped


def _in_question(simplices: Array, reference: Gaussians, alpha: float) -> Array:
    """Rows (N,) that may be clipped by `limit_stretches` or give no frame; the others surely neither.

    No stretch exceeds the Frobenius norm of the deformation gradient, whose square is the sum over the edges, their
    directions at rest being orthonormal, of their squared lengths over those at rest. An edge that is missing counts
    as one, as does the unit normal that stands in for it.
    """
    found = np.empty(len(simplices), dtype=np.bool_)
    scales = np.ascontiguousarray(reference.scales, dtype=np.float64)
    bound = alpha**2 * (1 - _ROUNDING)
    kernels.rows_in_question(np.ascontiguousarray(simplices), scales, bound, found, chunk_count(len(found)))
    return found
