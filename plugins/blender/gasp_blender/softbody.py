"""Blender's soft body: springs, stepped explicitly.

A step is one frame, and one step of Blender's own integrator within it. That integrator is Heun's in name. What it
does, measured, is x1 = x + dt v1 and then x + dt (v1 + v2) / 2 with the mean of both forces in v2: symplectic Euler in
a uniform field, to the last digit, and for an oscillator a determinant of 1 - (w dt)^2 / 2, which damps and is stable
up to w dt = 2.

All is scaled: lengths by the voxels' size, times by the longest step ever taken. Blender's soft bodies ignore the
frame rate; `speed` is the only clock they have.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.bpy_runtime import evaluated, new_name, new_scene, quiet, studio
from gasp_blender.meshes import mesh_object, weigh
from gasp_blender.point_cache import SOFT_BODY
from gasp_blender.stepping import Stepper

__all__ = ["GRAVITY", "HEAVIEST", "LIGHTEST", "SPRING", "Gusts", "soft_body"]

Array = NDArray[Any]

GRAVITY = 1000.0
"""Blender's gravity of one accelerates soft bodies and cloth by a thousandth."""
_TURBULENCE = 1.25e-4
"""Root mean square force of a turbulence of strength one on a vertex of a soft body without friction, over its cells;
with friction it has the other sign."""
_PULL = 2.0**-7
SPRING = 4 * float(np.float32(1) / (np.float32(1) - np.float32(_PULL)) - np.float32(1))
"""Force of a spring at a strain of one, which is four of Blender's: each p / (1 - p) of pull and push, with Blender's
own rounding. Small, because masses are bounded above, and no smaller, because they are bounded below: see `Elastic`."""
LIGHTEST = 0.01
"""Of vertices. Blender moves a lighter one as if it had this mass, but weighs it by its own: it falls too slowly."""
HEAVIEST = 4e4
"""Blender takes masses up to 5e4."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gusts:
    """Blender's turbulence: root mean square force on a vertex, length over which it changes, and seed."""

    force: float
    size: float
    seed: int


def soft_body(
    places: Array, edges: Array, weights: Array, masses: Array, gravity: Array, gusts: Gusts | None = None
) -> Stepper:
    """A soft body without goal, drag or damping.

    Parameters
    ----------
    places : (V, 3)
        At rest, in voxels.
    edges : (E, 2)
        Quarters of springs, as often as there are any between two vertices; four of them bear a force of `SPRING` at a
        strain of one, times their weight.
    weights : (V,)
        In (0, 1]; a spring's is the fourth power of its ends' mean.
    masses : (V,)
        Times the square of the unit of time, so that force over mass is in voxels per squared unit.
    gravity : (3,)
        In voxels per squared unit of time.
    gusts
        None for still air.
    """
    with quiet():
        scene = new_scene()
        scene.gravity = (GRAVITY * gravity).tolist()
        body = mesh_object(scene, places, edges)
        modifier = body.modifiers.new("gasp", "SOFT_BODY")
        settings = modifier.settings
        settings.use_goal = False
        settings.use_edges = True
        settings.pull = settings.push = _PULL
        settings.mass = float(masses.max())
        settings.vertex_group_mass = weigh(body, "mass", masses / masses.max())
        settings.vertex_group_spring = weigh(body, "springs", weights)
        # Left at their defaults these brake a free fall.
        settings.friction = settings.damping = 0.0
        # One step a frame, whatever Blender thinks of its error: a step that it repeats or adds shifts the clock.
        settings.step_min = settings.step_max = 1
        settings.error_threshold = 10.0
        if gusts is not None:
            _add_turbulence(scene, gusts)
        return Stepper(scene, modifier, "speed", SOFT_BODY)


def _add_turbulence(scene: Any, gusts: Gusts) -> None:
    bpy, _ = studio()
    source = bpy.data.objects.new(new_name("gasp-gusts"), None)
    scene.collection.objects.link(source)
    evaluated(scene, 0)
    with bpy.context.temp_override(object=source, active_object=source, scene=scene):
        bpy.ops.object.forcefield_toggle()
    field = source.field
    field.type = "TURBULENCE"
    field.strength = gusts.force / _TURBULENCE
    field.size = gusts.size
    # Flow would brake what moves, and noise would differ from run to run.
    field.flow = field.noise = 0.0
    field.seed = 1 + gusts.seed % 128
