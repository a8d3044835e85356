"""Gaussians as simplices and back: the maps T and T^-1.

A Gaussian N(m, R, S) with axes r_k and standard deviations s_k is the simplex (GaMeS; GASP, section 3)

    T(G) = (m, m + s_2 r_2, m + s_3 r_3), or, not flat, T(G) = (m, m + s_1 r_1, m + s_2 r_2, m + s_3 r_3),

three or four points. Points can be moved by any engine. Under an affine motion x -> F x + t the edges e_k = s_k r_k
become F e_k, and sum_k e_k e_k^T becomes F Sigma F^T: the covariance of the moved Gaussian, exactly, with no F asked of
anybody. That is the inverse `exact`; the paper's own, `gram_schmidt`, keeps the first edge and drops the shear.

All arrays here are float64: at a coordinate of 1 an edge of 1e-5 is known to half a percent in float32, and the thin
edge of a flat Gaussian not at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core import linalg3, simplex_frames
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians, rotation_matrices
from gasp_core.harmonics import turn_coefficients

__all__ = [
    "FLATNESS",
    "Covariance",
    "Flattened",
    "InvertedSimplices",
    "choose_vertices",
    "deformation_gradients",
    "demagnify",
    "edge_axes",
    "flatten",
    "from_simplices",
    "gram_schmidt_edges",
    "invert_simplices",
    "lengthened",
    "magnify",
    "matter_rotations",
    "polar_rotations",
    "to_simplices",
]

Array = NDArray[Any]
Covariance = Literal["exact", "gram_schmidt"]

FLATNESS = 1e-3
"""Smallest over middle scale below which a Gaussian is a disc: its thickness is then a thousandth of what one sees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InvertedSimplices:
    """What T^-1 gave.

    Parameters
    ----------
    gaussians
        All Gaussians; those without a frame of their own have the last valid one.
    degenerate : (N,) bool
        Where a simplex gives no frame: all its points in one place, or not finite; for `gram_schmidt` also collinear.
    """

    gaussians: Gaussians
    degenerate: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Flattened:
    """Gaussians made flat, and what that cost.

    Parameters
    ----------
    gaussians
        With the smallest scale set to zero.
    lost_share : (N,)
        Share of each Gaussian's variance (trace of its covariance) that was thrown away, 0..1/3.
    """

    gaussians: Gaussians
    lost_share: Array


def _flat_order(scales: Array) -> Array:
    """Axes of each Gaussian as its triangle has them, (N, 3): thin, longer in-plane, other; ties as in the kernel."""
    thin = np.argmin(scales, axis=1)
    second, third = (thin + 1) % 3, (thin + 2) % 3
    rows = np.arange(len(scales))
    swap = scales[rows, third] > scales[rows, second]
    return np.stack([thin, np.where(swap, third, second), np.where(swap, second, third)], axis=1)


def edge_axes(scales: Array, vertices: int) -> Array:
    """Which axis of its Gaussian each edge of a simplex follows, (N, vertices - 1)."""
    if vertices == 4:
        return np.broadcast_to(np.arange(3), scales.shape)
    return _flat_order(scales)[:, 1:]


def gram_schmidt_edges(scales: Array, vertices: int) -> Array:
    """Which edges of a simplex Gram-Schmidt takes, (N, vertices - 1): the last as second, the one before as first.

    In their own order but where, of four vertices, one of the last two is missing at rest; as in the kernel.
    """
    edges = np.broadcast_to(np.arange(vertices - 1), (len(scales), vertices - 1))
    if vertices == 3:
        return edges
    both = (scales[:, 1:] > 0).all(axis=1, keepdims=True)
    return np.where(both, edges, _flat_order(scales))


def _rest_edges(gaussians: Gaussians, vertices: int) -> tuple[Array, Array]:
    """Unit directions (N, vertices - 1, 3) and lengths (N, vertices - 1) of the edges of T(G)."""
    scales = gaussians.scales.astype(np.float64)
    axes = edge_axes(scales, vertices)
    directions = rotation_matrices(gaussians.quaternions).transpose(0, 2, 1)
    directions = np.take_along_axis(directions, axes[:, :, None], axis=1)
    return directions, np.take_along_axis(scales, axes, axis=1)


def choose_vertices(gaussians: Gaussians) -> Literal[3, 4]:
    """Three vertices where every Gaussian is flat already (`FLATNESS`), four otherwise: nothing is lost."""
    ordered = np.sort(gaussians.scales.astype(np.float64), axis=1)
    return 3 if bool((ordered[:, 0] <= FLATNESS * ordered[:, 1]).all()) else 4


def flatten(gaussians: Gaussians) -> Flattened:
    """Set each Gaussian's smallest scale to zero, and say what share of its variance that was."""
    scales = np.array(gaussians.scales)
    rows, thin = np.arange(len(scales)), np.argmin(scales, axis=1)
    variance = scales.astype(np.float64) ** 2
    lost = variance[rows, thin] / np.maximum(variance.sum(axis=1), np.finfo(np.float64).tiny)
    scales[rows, thin] = 0
    return Flattened(gaussians=gaussians.with_(scales=scales), lost_share=lost)


def to_simplices(gaussians: Gaussians, vertices: Literal[3, 4] = 3) -> Array:
    """T: the simplices of Gaussians.

    Parameters
    ----------
    gaussians
        N Gaussians.
    vertices
        3: (m, m + s_2 r_2, m + s_3 r_3), the smallest axis left out, the longer of the other two first (GaMeS).
        4: (m, m + s_1 r_1, m + s_2 r_2, m + s_3 r_3) in the order of the scales.

    Returns
    -------
    (N, vertices, 3) float64, in the unit and frame of the means; not magnified.

    Raises
    ------
    SceneError
        For any other number of vertices.
    """
    if vertices not in (3, 4):
        raise SceneError(f"vertices must be 3 or 4, found {vertices!r}")
    directions, lengths = _rest_edges(gaussians, vertices)
    simplices = np.empty((len(gaussians), vertices, 3))
    simplices[:, 0] = gaussians.means
    simplices[:, 1:] = simplices[:, :1] + directions * lengths[:, :, None]
    return simplices


def magnify(simplices: Array, floor: float) -> tuple[Array, Array]:
    """Lengthen edges that are too short for an engine to move: v_i = m + k_i (v_i - m), k_i >= 1.

    Below an engine's spacing its motion is affine, so a longer edge along the same direction is moved by the same map,
    and dividing by k_i afterwards loses nothing; in float32 it wins the digits a short edge does not have.

    Parameters
    ----------
    simplices : (N, V, 3)
    floor
        Length below which an edge is lengthened to it; 0 leaves the paper's own points.

    Returns
    -------
    magnified : (N, V, 3)
    factors : (N, V - 1)
        The k_i; 1 for edges of zero length, which have no direction to grow along.
    """
    edges = simplices[:, 1:] - simplices[:, :1]
    lengths = np.linalg.norm(edges, axis=2)
    short = (lengths < floor) & (lengths > 0)
    factors = np.where(short, floor / np.where(short, lengths, 1.0), 1.0)
    return lengthened(simplices, factors), factors


def lengthened(simplices: Array, factors: Array) -> Array:
    """Simplices (N, V, 3) with their edges times factors (N, V - 1), v_i = m + k_i (v_i - m)."""
    result = np.array(simplices, dtype=np.float64)
    edges = (result[:, 1:] - result[:, :1]) * factors[:, :, None]
    # Edges that stay as they are keep their end points to the last bit.
    result[:, 1:] = np.where(factors[:, :, None] == 1.0, result[:, 1:], result[:, :1] + edges)
    return result


def demagnify(simplices: Array, factors: Array) -> Array:
    """Undo `magnify` after the points have moved: edges (N, V - 1) divided by their factors."""
    result = np.array(simplices, dtype=np.float64)
    edges = (result[:, 1:] - result[:, :1]) / factors[:, :, None]
    # Edges that were not lengthened keep their end points to the last bit.
    result[:, 1:] = np.where(factors[:, :, None] == 1.0, result[:, 1:], result[:, :1] + edges)
    return result


def deformation_gradients(simplices: Array, reference: Gaussians) -> Array:
    """F of every simplex: the linear map that takes its edges at rest to its edges now.

    Where an edge is missing (three vertices, or a scale of zero) the unit normal of the other two stands in on both
    sides: the material is taken to keep its thickness. With one edge F is the stretch along it, and then the shortest
    rotation to where it points; with none the identity.

    Parameters
    ----------
    simplices : (N, 3 | 4, 3)
        Moved simplices, not magnified.
    reference
        The Gaussians at rest.

    Returns
    -------
    (N, 3, 3)
    """
    moved = np.ascontiguousarray(simplices, dtype=np.float64)
    quaternions = np.ascontiguousarray(reference.quaternions, dtype=np.float64)
    scales = np.ascontiguousarray(reference.scales, dtype=np.float64)
    gradients = np.empty((len(moved), 3, 3))
    simplex_frames.deformation_gradients(moved, quaternions, scales, gradients, linalg3.chunk_count(len(moved)))
    return gradients


def polar_rotations(matrices: Array) -> Array:
    """Nearest rotations R, (N, 3, 3), det +1, of matrices F = R U (N, 3, 3).

    An inverted F (det < 0) gives the rotation that is nearest all the same: the smallest stretch is taken as negative.
    """
    rotations = np.empty((len(matrices), 3, 3))
    source = np.ascontiguousarray(matrices, dtype=np.float64)
    linalg3.polar_rotations(source, rotations, linalg3.chunk_count(len(source)))
    return rotations


def matter_rotations(simplices: Array, reference: Gaussians, degenerate: Array) -> Array:
    """How far the matter of each Gaussian has turned, (N, 3, 3): the polar rotation of its deformation gradient.

    Parameters
    ----------
    simplices : (N, 3 | 4, 3)
        Moved simplices, not magnified.
    reference
        The Gaussians at rest.
    degenerate : (N,) bool
        Simplices that give no frame; theirs is the identity.
    """
    gradients = deformation_gradients(simplices, reference)
    gradients[degenerate] = np.eye(3)
    return polar_rotations(gradients)


def invert_simplices(
    simplices: ArrayLike,
    *,
    reference: Gaussians,
    covariance: Covariance = "exact",
    previous: Gaussians | None = None,
) -> InvertedSimplices:
    """T^-1, with account of what had no frame.

    Parameters
    ----------
    simplices : (N, 3 | 4, 3)
        Moved simplices, not magnified.
    reference
        The Gaussians at rest: their thickness (three vertices), colour and opacity, and which edge follows which axis.
    covariance
        "exact": Sigma = sum_k e_k e_k^T, then its principal axes; equal to F Sigma F^T for every affine motion.
        "gram_schmidt": r1 = e2 x e3, r2 = e2, r3 = Gram-Schmidt of e3, s2 = |e2|, s3 = <e3, r3> (GASP, equation 5);
        where e2 or e3 was missing at rest with the two that were there, the longer first, as of a triangle.
    previous
        Source of the frame where a simplex has none; the reference if not given.

    Returns
    -------
    InvertedSimplices
        Quaternions w x y z of rotations with det +1. The harmonics are turned with the material: by the polar rotation
        of the simplex's deformation gradient, not by the principal axes.

    Raises
    ------
    SceneError
        Where the shapes do not belong together, or `covariance` is neither.
    """
    moved = np.ascontiguousarray(simplices, dtype=np.float64)
    count = len(reference)
    if moved.ndim != 3 or moved.shape[0] != count or moved.shape[1] not in (3, 4) or moved.shape[2] != 3:
        raise SceneError(f"simplices have shape {moved.shape}, expected ({count}, 3 or 4, 3) as the reference has")
    if covariance == "gram_schmidt":
        frames = simplex_frames.gram_schmidt_frames
    elif covariance == "exact":
        frames = simplex_frames.flat_frames if moved.shape[1] == 3 else simplex_frames.full_frames
    else:
        raise SceneError(f'covariance must be "exact" or "gram_schmidt", found {covariance!r}')
    quaternions, scales, valid = np.empty((count, 4)), np.empty((count, 3)), np.empty(count, dtype=np.bool_)
    rest_scales = np.ascontiguousarray(reference.scales, dtype=np.float64)
    frames(moved, rest_scales, quaternions, scales, valid, linalg3.chunk_count(count))
    degenerate = ~valid
    if degenerate.any():
        last = reference if previous is None else previous
        norms = np.linalg.norm(last.quaternions[degenerate].astype(np.float64), axis=1, keepdims=True)
        quaternions[degenerate] = last.quaternions[degenerate] / np.where(norms > 0, norms, 1.0)
        scales[degenerate] = last.scales[degenerate]
    means = moved[:, 0].copy()
    # Only a simplex without a frame can have a mean that is not finite.
    lost = np.flatnonzero(degenerate)
    lost = lost[~np.isfinite(means[lost]).all(axis=1)]
    means[lost] = (reference if previous is None else previous).means[lost]
    harmonics = reference.harmonics
    if reference.sh_degree > 0:
        harmonics = turn_coefficients(harmonics, matter_rotations(moved, reference, degenerate))
    gaussians = Gaussians(
        means=means, quaternions=quaternions, scales=scales, opacities=reference.opacities, harmonics=harmonics
    )
    return InvertedSimplices(gaussians=gaussians, degenerate=degenerate)


def from_simplices(
    simplices: ArrayLike,
    *,
    reference: Gaussians,
    covariance: Covariance = "exact",
    previous: Gaussians | None = None,
) -> Gaussians:
    """T^-1: the Gaussians of moved simplices; see `invert_simplices`, whose count of degenerate ones it leaves out."""
    return invert_simplices(simplices, reference=reference, covariance=covariance, previous=previous).gaussians
