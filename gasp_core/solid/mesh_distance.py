"""Triangles -> signed distances on a grid.

What is inside, the winding number says, which takes holes, overlaps and loose triangles (Jacobson, Kavan,
Sorkine-Hornung 2013; fast by Barill et al. 2018, in libigl); how far, the nearest triangle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.io.memory_limit import available_memory
from gasp_core.solid.morphology import dilated, nearest_in

__all__ = ["field_of_mesh"]

Array = NDArray[Any]

_BAND = 3
"""Nodes from the triangles within which distances are exact; farther off they are those to the same triangles."""
_INSIDE = 0.5
"""Winding number above which a place is inside: between those on both sides of a hole's middle."""
_OFF = 0.2
"""Cells by which 95 % of the interpolated surface are nearer than: edges and corners are cut off,
`benchmarks/collider_fields.py`."""
_AT_ONCE = 2**20
_BYTES_A_NODE = 140
"""Of memory while distances are found, measured."""
_LEAST = 1e-3
"""Of the volume of the box around the triangles: what encloses less is a sheet."""


def field_of_mesh(
    vertices: Array, faces: Array, cells: int, *, thickness: float | None = None, name: str = "mesh"
) -> SignedDistanceField:
    """The region that triangles enclose, or are.

    Parameters
    ----------
    vertices : (V, 3) [m]
        In the world.
    faces : (F, 3)
        Facing out or in; with holes, they are closed as a soap film would.
    cells
        Of the grid, along the longest side.
    thickness
        [m]: everything within half of it from the triangles, whatever they enclose. None: what they enclose.
    name
        Of the file, for messages.

    Raises
    ------
    SceneError
        Where they enclose nothing, the thickness is less than a cell, the grid takes more memory than there is, or
        libigl is not installed.
    """
    try:
        import igl
    except ImportError:
        raise SceneError(f"{name}: distances to meshes are found by libigl: pip install 'gasp-core[meshes]'") from None
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    finding: Any = igl
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    spacing = float((upper - lower).max()) / cells
    if thickness is not None and thickness < spacing:
        raise SceneError(
            f"{name}: a thickness of {thickness:.3g} m is less than a cell of {spacing:.3g} m: raise it, or cells"
        )
    reach = _BAND + (0 if thickness is None else int(np.ceil(thickness / 2 / spacing)))
    counts = np.ceil((upper - lower) / spacing).astype(int) + 2 * reach + 2
    need, there = _BYTES_A_NODE * int(np.prod(counts)), available_memory()
    if need > there:
        raise SceneError(
            f"{name}: a grid of {cells} cells along its longest side takes {need / 2**30:.1f} GiB of memory while"
            f" distances are found, and the machine has {there / 2**30:.1f} GiB free: lower cells"
        )
    origin = (lower + upper - spacing * (counts - 1)) / 2
    beside = dilated(_touched((vertices - origin) / spacing, faces, counts), reach)
    nodes = origin + spacing * np.indices(counts).reshape(3, -1).T
    near = np.flatnonzero(beside)
    feet = np.zeros((len(nodes), 3))
    feet[near] = finding.point_mesh_squared_distance(nodes[near], vertices, faces)[2]
    nearest = np.ravel_multi_index(nearest_in(beside), tuple(counts)).reshape(-1)
    distances = np.linalg.norm(nodes - feet[nearest], axis=1)
    if thickness is not None:
        values = distances - thickness / 2
    else:
        winding = finding.fast_winding_number(vertices, faces, nodes)
        # A mesh that faces in winds the other way.
        inside = np.sign(winding.sum()) * winding > _INSIDE
        if inside.sum() * spacing**3 < _LEAST * float(np.prod(upper - lower + spacing)):
            raise SceneError(
                f"{name}: its triangles enclose next to nothing: say thickness = {2 * spacing:.2g}, the thickness of"
                " the sheet that they are, or close the mesh"
            )
        film = _film(winding.reshape(counts), inside.reshape(counts), distances.reshape(counts) > spacing)
        if len(film):
            tree: Any = KDTree(film)
            distances = np.minimum(distances, spacing * tree.query((nodes - origin) / spacing, workers=processors())[0])
        values = np.where(inside, -distances, distances)
    return SignedDistanceField(
        origin=tuple(origin), spacing=spacing, values=values.reshape(counts), error=_OFF * spacing
    )


def _film(winding: Array, inside: Array, away: Array) -> Array:
    """Where the surface of what is inside cuts the edges of the grid away from all triangles, (N, 3) in spacings."""
    level = _INSIDE * (1 if winding[inside].mean() > 0 else -1)
    found: list[Array] = []
    for axis in range(3):
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        here, there = tuple(low), tuple(high)
        cut = np.argwhere((inside[here] != inside[there]) & away[here] & away[there])
        below, above = winding[here][tuple(cut.T)], winding[there][tuple(cut.T)]
        places = cut.astype(np.float64)
        places[:, axis] += (level - below) / (above - below)
        found.append(places)
    return np.concatenate(found)


def _touched(places: Array, faces: Array, counts: Array) -> Array:
    """The nodes (X, Y, Z) nearest to some place of a triangle whose vertices are at `places` (V, 3) in spacings."""
    found = np.zeros(counts, dtype=bool)
    corners = places[faces]
    edges = corners - np.roll(corners, 1, axis=1)
    parts = np.ceil(np.linalg.norm(edges, axis=2).max(axis=1)).astype(int)
    for count in np.unique(parts):
        own = corners[parts == count]
        a, b = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        shares = np.stack([a, b, count - a - b], axis=-1)[a + b <= count] / max(count, 1)
        # A triangle at a time where it is large: a plane of two covers as many nodes as it has.
        step = max(1, _AT_ONCE // len(shares))
        for begin in range(0, len(own), step):
            samples = np.rint(np.einsum("sk,fkd->fsd", shares, own[begin : begin + step])).astype(int).reshape(-1, 3)
            found[tuple(np.clip(samples, 0, counts - 1).T)] = True
    return found
