"""Meshes from arrays, checked before Blender sees them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.bpy_runtime import new_name, studio
from gasp_core.errors import SceneError

__all__ = ["mesh_object", "weigh"]

Array = NDArray[Any]


def mesh_object(scene: Any, vertices: Array, edges: Array | None = None, faces: Array | None = None) -> Any:
    """An object of a mesh, in the scene; of `faces` (F, 4), those whose last two corners are the same are triangles.

    `Mesh.validate` is not called: it turns what is not finite into numbers without a word.

    Raises
    ------
    SceneError
        Where a vertex is not finite or an index is of no vertex.
    """
    vertices = np.ascontiguousarray(vertices, np.float32)
    if not np.isfinite(vertices).all():
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        raise SceneError(f"a mesh for Blender has {len(bad)} vertices that are not finite, first {bad[0]}")
    for what, rows in (("edge", edges), ("face", faces)):
        if rows is not None and rows.size and (rows.min() < 0 or rows.max() >= len(vertices)):
            raise SceneError(f"a mesh for Blender has an {what} of a vertex that is not among its {len(vertices)}")
    bpy, _ = studio()
    mesh = bpy.data.meshes.new(new_name("gasp-mesh"))
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    if edges is not None and len(edges):
        mesh.edges.add(len(edges))
        mesh.edges.foreach_set("vertices", np.ascontiguousarray(edges, np.int32).ravel())
    if faces is not None and len(faces):
        corners = np.ones(faces.shape, dtype=bool)
        corners[:, 3] = faces[:, 3] != faces[:, 2]
        mesh.loops.add(int(corners.sum()))
        mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces[corners], np.int32))
        mesh.polygons.add(len(faces))
        sides = corners.sum(axis=1)
        mesh.polygons.foreach_set("loop_start", (np.cumsum(sides) - sides).astype(np.int32))
        mesh.update(calc_edges=True)
    one = bpy.data.objects.new(new_name("gasp-object"), mesh)
    scene.collection.objects.link(one)
    return one


def weigh(one: Any, name: str, weights: Array) -> str:
    """Name of a new vertex group with these weights (V,), each in [0, 1]."""
    group = one.vertex_groups.new(name=name)
    # Vertices of a regular cage share few different weights.
    for weight in np.unique(weights):
        group.add(np.flatnonzero(weights == weight).tolist(), float(weight), "REPLACE")
    return str(group.name)
