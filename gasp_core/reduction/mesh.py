"""The reduction `mesh`: the engine moves the vertices of a triangle mesh, and Gaussians go with its faces.

That is GaMeS (Waczynska et al. 2024, arXiv 2402.01459, section 3): a Gaussian's simplex is expressed in the two edges
of its face and in what stands on it, as long as the root of twice the face's area, and is exact for every motion that
is affine on the face. A closed mesh is a body: what it encloses is filled with points too, among which its vertices
have their share of the mass; they alone carry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.io.mesh_splats import FAR_OFF, face_frames, face_of_each, in_face_frames, share_off
from gasp_core.quantities import volume_told
from gasp_core.reduction.affine_fits import affine_fits
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.lattice import PER_CELL, lattice_inside, refuse_too_many
from gasp_core.reduction.occupancy import cell_volumes
from gasp_core.reduction.transfer_operator import Sample, bounds_of
from gasp_core.scene.placed_mesh import PlacedMesh
from gasp_core.solid.mesh_distance import field_of_mesh
from gasp_core.stepping.threads import processors

__all__ = ["OnFaces", "sample_mesh"]

Array = NDArray[Any]

_FEWEST_CELLS, _MOST_CELLS = 16, 512
"""Of the grid of distances to a mesh, along it."""
_ELSEWHERE = 0.5
"""Of the mesh's diagonal, that half of the Gaussians are off its faces: it is another thing's."""
_APART = 1.0
"""Cells between vertices of a sheet beyond which nothing holds them together."""
_THIN = 1e-6
"""Of the largest singular value of the places of a body: what extends less has no slope along that axis."""
_ROUNDING = 1e-9
"""Of a body's size, that points made elsewhere may be off by and still be these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnFaces:
    """A `TransferOperator` of points of which some are the corners of faces.

    Parameters
    ----------
    points : (P, 3) [m]
        At rest, about the centre of the body.
    corners : (N, 3) int32
        Points: those of the face of each Gaussian.
    coefficients : (N, V, 3)
        Where each vertex of its simplex is from the first of these, in edges and height.
    standing_for : (P,) int32
        A Gaussian near each point.
    """

    kind: ClassVar[str] = "mesh"
    points: Array
    corners: Array
    coefficients: Array
    standing_for: Array

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`."""
        moves = np.asarray(displacements, dtype=np.float64)
        before = self.points[self.corners]
        after = before + moves[self.corners]
        frames = face_frames(before), face_frames(after)
        # The difference of both: at displacement zero nothing is added, to the last bit.
        moved = rest + moves[self.corners[:, :1]] + self.coefficients @ (frames[1] - frames[0])
        if drifted is None:
            return moved
        gradients = np.linalg.solve(frames[0], frames[1])
        return moved + (drifted - rest) @ gradients

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`."""
        return self.follower(rest)(velocities)

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`: the affine field that is nearest to them, exact where they are rigid, and what is
        left of those around each point, which on the surface goes on along it."""
        places = np.append(rest.reshape(-1, 3), np.ones((rest.size // 3, 1)), axis=1)
        inverse = np.linalg.pinv(places, rcond=_THIN)
        ends = np.append(self.points, np.ones((len(self.points), 1)), axis=1)
        leading, clusters = np.unique(self.leaders, return_inverse=True)
        own = clusters[self.standing_for]
        leads = np.isin(np.arange(len(self.points)), leading)[:, None]

        def follow(values: Array) -> Array:
            affine = inverse @ values.reshape(-1, 3)
            fits = affine_fits(rest, values - (places @ affine).reshape(values.shape), clusters)
            slopes = np.einsum("pij,pj->pi", fits.slopes[own], self.points - fits.centres[own])
            return ends @ affine + fits.means[own] + np.where(leads, slopes, 0.0)

        return follow

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`: the corner that is nearest, as the face has it."""
        second, third = self.coefficients[:, 0, 0], self.coefficients[:, 0, 1]
        nearest = np.argmax(np.stack([1 - second - third, second, third], axis=1), axis=1)
        return np.take_along_axis(self.corners, nearest[:, None], axis=1)[:, 0].astype(np.int64)

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        return self.standing_for

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        return {
            "points": self.points,
            "corners": self.corners,
            "coefficients": self.coefficients,
            "standing_for": self.standing_for,
        }

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> OnFaces:
        """From what `arrays` gave."""
        return cls(**arrays)


def sample_mesh(block: Block, mesh: PlacedMesh, spacing: float, name: str, known: OnFaces | None = None) -> Sample:
    """The vertices of a mesh, and points that fill it, for an engine of this spacing [m].

    Parameters
    ----------
    block
        The simplices of the body.
    mesh
        In the world.
    spacing
        [m]
    name
        Of the object, for messages.
    known
        Points that were made of such a body before, on whatever machine, and are to be these where they can be.

    Raises
    ------
    SceneError, SplatFormatError
        Where the mesh is somewhere else, or libigl is not installed.
    """
    vertices = mesh.vertices - block.centre
    corners, distances = face_of_each(block.local, vertices, mesh.faces)
    off = share_off(block.local, distances, vertices, mesh.faces)
    if off > _ELSEWHERE:
        raise SceneError(
            f'object "{name}": half of its Gaussians are {off:.2g} diagonals of its mesh away from it: both are to have'
            " one frame and unit; mesh_up says which axis of the mesh is up"
        )
    inside, volumes = _inside(mesh, name, spacing) if mesh.filled else (np.zeros((0, 3)), np.zeros(0))
    points = np.concatenate([vertices, inside - block.centre])
    if len(inside):
        volumes = _shared(points, len(vertices), volumes)
    else:
        volumes = cell_volumes(mesh.vertices, spacing)
    carrier = OnFaces(
        points=points,
        corners=corners.astype(np.int32),
        coefficients=in_face_frames(block.rest, vertices[corners]),
        standing_for=_nearest(block.rest[:, 0], points).astype(np.int32),
    )
    if known is not None and known.points.shape == points.shape and len(known.corners) == len(corners):
        same = np.abs(known.points - points).max() <= _ROUNDING * np.ptp(points)
        carrier = known if same and np.array_equal(known.corners, corners) else carrier
    return Sample(
        positions=carrier.points,
        volumes=volumes,
        carrier=carrier,
        bounds=bounds_of(points),
        notes=tuple(_notes(mesh, carrier, float(volumes.sum()), spacing, off)),
        faces=mesh.faces if mesh.is_sheet and not len(inside) else None,
    )


def _inside(mesh: PlacedMesh, name: str, spacing: float) -> tuple[Array, Array]:
    """Points (P, 3) [m] of a lattice in what a mesh encloses, and their volumes (P,) [m^3]."""
    step = spacing / PER_CELL
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    cells = int(np.clip(np.ceil((upper - lower).max() / step), _FEWEST_CELLS, _MOST_CELLS))
    refuse_too_many(mesh.volume, step, name)
    field = field_of_mesh(mesh.vertices, mesh.faces, cells, name=f'object "{name}", its mesh')
    points, shares = lattice_inside(field.signed_distance, lower - step, upper + step, step)
    return points, shares * step**3


def _shared(points: Array, count: int, volumes: Array) -> Array:
    """Volumes (P,) of the first `count` points, vertices, and of the others, whose own (P - count,) are shared out:
    equally between each of these and the vertices that it is the nearest to."""
    nearest = _nearest(points[count:], points[:count])
    equal = volumes / (1 + np.bincount(nearest, minlength=len(volumes)))
    return np.concatenate([equal[nearest], equal])


def _nearest(of: Array, to: Array) -> Array:
    """The row of points (M, 3) nearest to each of (N, 3)."""
    from scipy.spatial import KDTree

    tree: Any = KDTree(of)
    return tree.query(to, workers=processors())[1]


def _notes(mesh: PlacedMesh, carrier: OnFaces, volume: float, spacing: float, off: float) -> list[str]:
    count, inside = len(mesh.vertices), len(carrier.points) - len(mesh.vertices)
    body = f" and {inside:,} points inside" if inside else ""
    found = [
        f"{count:,} vertices of its mesh{body}, {volume_told(volume)}, carry {len(carrier.corners):,} Gaussians on"
        f" {len(mesh.faces):,} faces"
    ]
    if not inside and mesh.open_edges:
        found[0] += f'; the mesh is open along {mesh.open_edges:,} edges: a sheet (points = "filled" fills it)'
    if inside and mesh.open_edges:
        found.append(f"{mesh.open_edges:,} edges of its mesh are open: its holes are closed as a soap film would")
    apart = mesh.longest_edge / spacing
    if not inside and apart > _APART:
        found.append(
            f"vertices of its mesh are up to {apart:.2g} cells apart, and engines with a grid tear what is: subdivide"
            " it, or take larger cells"
        )
    if off > FAR_OFF:
        found.append(f"half of its Gaussians are {100 * off:.2g} % of the mesh's diagonal outside of it: is it theirs?")
    return found
