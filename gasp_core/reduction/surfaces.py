"""What of a scene's splats others touch: colliders that stand still, and the surfaces of rigid bodies."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import Collider, Rigid
from gasp_core.scene.file_shapes import resolved
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import laws_of
from gasp_core.scene.placed_solid import FEW
from gasp_core.scene.selection import PlacedObject
from gasp_core.scene.solid_fields import field_of
from gasp_core.stepping.body_shape import BodyShape

__all__ = ["colliders_of", "rigid_surfaces"]


def colliders_of(scene: Scene, objects: Sequence[PlacedObject]) -> dict[str, Collider]:
    """Everything that matter of a scene collides with, as engines understand it, by what a user would call it.

    Parameters
    ----------
    scene
        Its colliders come first.
    objects
        All of them, placed; those that stand still and say `collider` are colliders.

    Raises
    ------
    SceneError, SplatFormatError
        Where a file cannot be read, or there is no body in it.
    """
    found = {f"collider {number}": resolved(one) for number, one in enumerate(scene.colliders, start=1)}
    for placed in objects:
        if placed.item.collider is not None:
            name = placed.item.name
            touch = placed.item.collider
            shape = field_of(placed.solid(), name)
            found[f'object "{name}"'] = Collider(shape=shape, contact=touch.contact, friction=touch.friction)
    return found


def rigid_surfaces(moving: Sequence[PlacedObject]) -> tuple[BodyShape, ...]:
    """The surfaces of bodies that keep their shape, as far as there is a solid that says them.

    Parameters
    ----------
    moving
        The objects that are bodies of the problem, in its order.
    """
    found: list[BodyShape] = []
    for body, placed in enumerate(moving):
        if all(isinstance(law, Rigid) for law in laws_of(placed.item)) and placed.moving.sum() > FEW:
            solid = placed.solid()
            if not solid.solid.is_empty:
                found.append(BodyShape(body=body, shape=field_of(solid, placed.item.name)))
    return tuple(found)
