"""The solid behind a placed splat as a shape that engines understand."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.scene.placed_solid import PlacedSolid

__all__ = ["field_of"]

Array = NDArray[Any]

_WALL = 2 * np.sqrt(3.0)
"""Spacings that a wall is thick at least, inwards: each side of it then cuts cells of which no corner is nearer to the
other side, and what comes from without meets the surface of a body that is filled. A thinner one would have holes."""
_MARGIN = 3
"""Nodes around what is inside."""
_OFF = 0.65
"""Details by which more than 95 % of a capture's surface are nearer than to that of a grid twice as fine,
`benchmarks/collider_fields.py`: 98.9 to 99.8 %."""
_APART = 1.0
"""Details off the body from which on a piece of a sheet is one."""
_AROUND, _WHOLE = 2.0, 0.5
"""Of a disc of so many details around a piece, the share that there is of the sheet."""
_PIECE = 0.75
"""Radius of the balls that a sheet is made of, in details: its pieces are about one apart."""


def field_of(solid: PlacedSolid, name: str) -> SignedDistanceField:
    """The region that a solid fills, its sheets included, as thick as the solid says they are.

    Where the object is turned the distances are interpolated onto a grid along the world's axes. A wall is no thinner
    than that grid can carry.

    Parameters
    ----------
    solid
        In the world.
    name
        Of the object, for messages.

    Raises
    ------
    SceneError
        Where nothing is inside, and there is no sheet.
    """
    inside, sheets, spacing = solid.nodes_inside(), _sheets(solid), solid.spacing
    if not len(inside) and not len(sheets):
        raise SceneError(f'object "{name}": its Gaussians enclose no body, so nothing can collide with it')
    radius = _PIECE * max(solid.detail, spacing) if len(sheets) else 0.0
    lower = np.concatenate([inside, sheets - radius]).min(axis=0)
    upper = np.concatenate([inside, sheets + radius]).max(axis=0)
    # On the solid's own nodes where the object is not turned: nothing is interpolated then.
    anchor = solid.to_world(solid.solid.grid.origin)
    first = np.floor((lower - anchor) / spacing).astype(int) - _MARGIN
    counts = np.ceil((upper - anchor) / spacing).astype(int) + _MARGIN - first + 1
    origin = anchor + spacing * first
    nodes = origin + spacing * np.indices(counts).reshape(3, -1).T
    values = solid.thickened(_WALL * spacing).distance_at(nodes)
    if len(sheets):
        values = np.minimum(values, _distance_to(sheets, nodes) - radius)
    return SignedDistanceField(
        origin=tuple(origin), spacing=spacing, values=values.reshape(counts), error=_OFF * solid.detail
    )


def _sheets(solid: PlacedSolid) -> Array:
    """Places (S, 3) [m] of thin matter that is no fuzz on the body and no lone speck."""
    from scipy.spatial import KDTree

    places, areas = solid.sheet_positions(), solid.solid.sheets.areas * solid.scale**2
    apart = solid.distance_at(places) > _APART * solid.detail
    places, areas = places[apart], areas[apart]
    if not len(places):
        return places
    tree: Any = KDTree(places)
    reach = _AROUND * solid.detail
    beside = tree.query_ball_point(places, reach)
    around = np.array([areas[rows].sum() for rows in beside])
    return places[around > _WHOLE * np.pi * reach**2]


def _distance_to(places: Array, nodes: Array) -> Array:
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    tree: Any = KDTree(places)
    return tree.query(nodes, workers=processors())[0]
