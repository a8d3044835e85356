"""What of a scene's splats others touch: colliders that stand still, and the surfaces of rigid bodies."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import Rigid
from gasp_core.scene.placed_solid import FEW
from gasp_core.scene.selection import PlacedObject
from gasp_core.scene.solid_fields import field_of
from gasp_core.stepping.body_shape import BodyShape

__all__ = ["rigid_surfaces"]


def rigid_surfaces(moving: Sequence[PlacedObject]) -> tuple[BodyShape, ...]:
    """The surfaces of bodies that keep their shape, as far as there is a solid that says them.

    Parameters
    ----------
    moving
        The objects that are bodies of the problem, in its order.
    """
    found: list[BodyShape] = []
    for body, placed in enumerate(moving):
        if isinstance(placed.item.material, Rigid) and placed.moving.sum() > FEW:
            solid = placed.solid()
            if not solid.solid.is_empty:
                found.append(BodyShape(body=body, shape=field_of(solid, placed.item.name)))
    return tuple(found)
