"""Blender's cloth: a net of quads and triangles, stepped implicitly.

Springs along the edges of a square net, of stiffness k [N/m], and across its squares, of k/2, are isotropic in their
plane: Poisson's ratio 1/3, and Young's modulus times thickness 4 k / 3. So are those along the edges of triangles that
lie in all directions alike: Young's modulus times thickness is k / 3 times the sum of their squared lengths over the
area. That takes vertices to go with the stretch; irregular ones find an easier way, and their net is softer, by a sixth
where they are shifted by 0.3 of an edge. There is no bending stiffness.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from gasp_blender.bpy_runtime import new_scene, quiet
from gasp_blender.meshes import mesh_object
from gasp_blender.point_cache import CLOTH
from gasp_blender.softbody import GRAVITY
from gasp_blender.stepping import Stepper

__all__ = ["TENSION", "cloth"]

Array = NDArray[Any]

TENSION = 1.0
"""Stiffness of an edge, in Blender's units."""


def cloth(places: Array, faces: Array, mass: float, gravity: Array) -> Stepper:
    """Cloth without damping, drag or collisions.

    Parameters are those of `soft_body`, but that an edge bears `TENSION` at a strain of one, and all vertices have one
    mass: Blender knows no other. `faces` are those of `gasp_blender.meshes.mesh_object`.
    """
    with quiet():
        scene = new_scene()
        scene.gravity = (GRAVITY * gravity).tolist()
        net = mesh_object(scene, places, faces=faces)
        modifier = net.modifiers.new("gasp", "CLOTH")
        settings = modifier.settings
        # One step a frame. With more, Blender's loop in float32 takes one too many for some lengths of a frame.
        settings.quality = 1
        settings.mass = mass
        settings.tension_stiffness = settings.compression_stiffness = TENSION
        settings.shear_stiffness = TENSION / 2
        settings.bending_stiffness = 0.0
        settings.air_damping = 0.0
        settings.tension_damping = settings.compression_damping = 0.0
        settings.shear_damping = settings.bending_damping = 0.0
        modifier.collision_settings.use_collision = False
        return Stepper(scene, modifier, "time_scale", CLOTH)
