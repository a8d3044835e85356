"""The mesh of an object that moves by itself, where psi has brought it when physics begins."""

from __future__ import annotations

from dataclasses import replace

from gasp_core.dynamics.analytic import analytic_motion
from gasp_core.scene.placed_mesh import PlacedMesh, mesh_of
from gasp_core.scene.selection import PlacedObject

__all__ = ["mesh_at_start"]


def mesh_at_start(placed: PlacedObject) -> PlacedMesh:
    """The mesh of an object whose reduction names one, its vertices where a formula of its motion has them at s0.

    Of motions without one there is only what they do to Gaussians: `gasp_core.dynamics.composition.play` refuses those
    that have gone from where the file has them, so that the mesh lies with the others as it does in its own file.

    Raises
    ------
    SplatFormatError, SceneError
        Where the mesh cannot be read, or is to be filled and encloses nothing.
    """
    mesh, choice, origin = mesh_of(placed), placed.item.motion, placed.placement.translation
    motion = analytic_motion(choice, mesh.vertices - origin, origin) if choice is not None else None
    if choice is None or motion is None:
        return mesh
    return replace(mesh, vertices=motion.simplices(choice.scene_time(0.0)) + origin)
