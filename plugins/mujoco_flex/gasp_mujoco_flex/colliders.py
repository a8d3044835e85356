# pyright: reportAttributeAccessIssue=false
# MuJoCo makes its names when it is imported; no stub lists them.
"""Colliders as shapes that MuJoCo knows."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side, SignedDistanceField, SphereShape
from gasp_core.errors import SceneError
from gasp_core.stepping.convex_pieces import convex_pieces, convex_walls
from gasp_mujoco_flex.units import Units

__all__ = ["HOLLOW_DIRECTIONS", "geoms_of", "hull_geom"]

Array = NDArray[Any]

_PIECES = 256
"""Convex bodies that a collider without a formula is made of, at most."""


def _directions() -> Array:
    """Unit vectors (98, 3) spread over the sphere: middles and corners of a cube's faces cut in four by four."""
    grid = np.tan(np.linspace(-np.pi / 4, np.pi / 4, 5))
    cube = [np.insert([u, v], axis, w) for axis in range(3) for w in (-1.0, 1.0) for u in grid for v in grid]
    unit = np.array(cube) / np.linalg.norm(cube, axis=1, keepdims=True)
    return np.unique(np.round(unit, 12), axis=0)


HOLLOW_DIRECTIONS = _directions()
"""Outward normals of the tangent planes that stand for a ball seen from inside, which MuJoCo does not have.
They are pi / 8 apart along two great circles: the polyhedron reaches out 4 % further than the ball, at its corners."""


def geoms_of(spec: Any, collider: Collider, units: Units) -> Iterator[dict[str, Any]]:
    """Keywords of `mujoco.MjsBody.add_geom`: shape and place, in the backend's units; meshes go into `spec`."""
    shape, inside = collider.shape, collider.side is Side.INSIDE
    match shape:
        case HalfSpace():
            yield _plane(shape.point, np.asarray(shape.normal) * (-1.0 if inside else 1.0), units)
        case BoxShape() if inside:
            for axis, sign in itertools.product(range(3), (-1.0, 1.0)):
                outward = sign * np.eye(3)[axis]
                yield _plane(np.asarray(shape.center) + outward * shape.half_extents[axis], -outward, units)
        case BoxShape():
            yield {
                "type": mujoco.mjtGeom.mjGEOM_BOX,
                "pos": units.place(np.asarray(shape.center)),
                "size": np.asarray(shape.half_extents) / units.length,
            }
        case SphereShape() if inside:
            for outward in HOLLOW_DIRECTIONS:
                yield _plane(np.asarray(shape.center) + outward * shape.radius, -outward, units)
        case SphereShape():
            yield {
                "type": mujoco.mjtGeom.mjGEOM_SPHERE,
                "pos": units.place(np.asarray(shape.center)),
                "size": [shape.radius / units.length, 0.0, 0.0],
            }
        case SignedDistanceField():
            # A wall as thick as a body is left by the side it was entered from.
            pieces = convex_walls(shape, units.length, _PIECES) if inside else convex_pieces(shape, _PIECES)
            for piece in pieces:
                yield hull_geom(spec, units.place(piece))
        case _:
            raise SceneError(f"mujoco-flex knows no {shape.kind} as a collider: use a plane, a box or a sphere")


def hull_geom(spec: Any, vertices: Array) -> dict[str, Any]:
    """Keywords of `add_geom` for the hull of vertices (V, 3), in the backend's units."""
    mesh = spec.add_mesh(name=f"hull{len(spec.meshes)}")
    mesh.uservert = vertices.ravel()
    # It moves nothing, and a hull may be thin.
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": mesh.name}


def _plane(point: Any, normal: Array, units: Units) -> dict[str, Any]:
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, normal)
    return {
        "type": mujoco.mjtGeom.mjGEOM_PLANE,
        "pos": units.place(np.asarray(point)),
        "quat": quaternion,
        "size": [0.0, 0.0, 1.0],
    }
