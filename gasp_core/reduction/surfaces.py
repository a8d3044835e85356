"""What of a scene's splats others touch: colliders that stand still, and the surfaces of rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, Rigid, SignedDistanceField
from gasp_core.reduction.rigid_parts import part_shape
from gasp_core.scene.file_shapes import resolved
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import laws_of
from gasp_core.scene.placed_solid import FEW
from gasp_core.scene.selection import PlacedObject
from gasp_core.scene.solid_fields import field_of
from gasp_core.stepping.body_shape import BodyShape

__all__ = ["colliders_of", "rigid_surfaces"]

Array = NDArray[Any]


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


def rigid_surfaces(
    moving: Sequence[PlacedObject], parts: Mapping[int, int], points: Array, bodies: Array
) -> tuple[BodyShape, ...]:
    """The surfaces of bodies that keep their shape, as far as there is a solid that says them.

    Parameters
    ----------
    moving
        The objects that are bodies of the problem, in its order.
    parts
        See `PointProblem.rigid_parts`.
    points : (N, 3) [m]
    bodies : (N,)
        Whose each point is.
    """
    found: list[BodyShape] = []
    for body, placed in enumerate(moving):
        own = [part for part, host in parts.items() if host == body]
        rigid = all(isinstance(law, Rigid) for law in laws_of(placed.item))
        whole = _known_shape(placed) if own or rigid else None
        if whole is None:
            continue
        if rigid:
            found.append(BodyShape(body=body, shape=whole))
        of_object = np.isin(bodies, [body, *own])
        for part in own:
            shape = part_shape(whole, points[bodies == part], points[of_object & (bodies != part)])
            if shape is not None:
                found.append(BodyShape(body=part, shape=shape))
    return tuple(found)


def _known_shape(placed: PlacedObject) -> SignedDistanceField | None:
    """What of an object is simulated fills, where there is a solid that says it."""
    if placed.moving.sum() <= FEW or placed.solid().solid.is_empty:
        return None
    whole, region = field_of(placed.solid(), placed.item.name), placed.item.region
    if region is None:
        return whole
    # The solid is that of all of the splat: what is outside the region stays still, and touches nothing.
    places = whole.origin + whole.spacing * np.indices(whole.values.shape).reshape(3, -1).T
    values = np.maximum(whole.values, region.signed_distance(places).reshape(whole.values.shape))
    return replace(whole, values=values) if (values < 0).any() else None
