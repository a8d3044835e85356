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

_MARGIN = 3
"""Nodes around what is inside."""
_OFF = 0.4
"""Details by which 95 % of a solid's surface are nearer than: twice the root mean square of noisy shells with holes,
`benchmarks/solids.py`."""
_PIECE = 0.75
"""Radius of the balls that a sheet is made of, in spacings: its pieces are about one apart."""


def field_of(solid: PlacedSolid, name: str) -> SignedDistanceField:
    """The region that a solid fills, its sheets included, as thick as the solid says they are.

    Where the object is turned the distances are interpolated onto a grid along the world's axes.

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
    inside, sheets, spacing = solid.nodes_inside(), solid.sheet_positions(), solid.spacing
    if not len(inside) and not len(sheets):
        raise SceneError(f'object "{name}": its Gaussians enclose no body, so nothing can collide with it')
    radius = max(solid.solid.sheets.thickness * solid.scale / 2, _PIECE * spacing) if len(sheets) else 0.0
    lower = np.concatenate([inside, sheets - radius]).min(axis=0)
    upper = np.concatenate([inside, sheets + radius]).max(axis=0)
    # On the solid's own nodes where the object is not turned: nothing is interpolated then.
    anchor = solid.to_world(solid.solid.grid.origin)
    first = np.floor((lower - anchor) / spacing).astype(int) - _MARGIN
    counts = np.ceil((upper - anchor) / spacing).astype(int) + _MARGIN - first + 1
    origin = anchor + spacing * first
    nodes = origin + spacing * np.indices(counts).reshape(3, -1).T
    values = solid.distance_at(nodes)
    if len(sheets):
        values = np.minimum(values, _distance_to(sheets, nodes) - radius)
    return SignedDistanceField(
        origin=tuple(origin), spacing=spacing, values=values.reshape(counts), error=_OFF * solid.detail
    )


def _distance_to(places: Array, nodes: Array) -> Array:
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    tree: Any = KDTree(places)
    return tree.query(nodes, workers=processors())[0]
