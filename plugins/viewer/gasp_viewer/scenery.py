"""Colliders as shapes on the stage: obstacles are solid, containers are drawn by their edges."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, HalfSpace, RigidMotion, Side, SignedDistanceField, SphereShape
from gasp_core.errors import RenderingError
from gasp_core.gaussians import rotation_quaternions
from gasp_core.stepping.rigid_motion import Pose, pose_of
from gasp_viewer.colouring import round_up
from gasp_viewer.display_units import SIZE, Stage

__all__ = ["Mover", "add_scenery", "box_edges", "grid_cell", "plane_pose", "pose_on_stage", "surface_of"]

Array = NDArray[Any]

_SOLID = (150, 158, 170)
_EDGE = (110, 118, 128)
_PLANE = (232, 234, 237)
_AMBIENT = 1.5
"""With viser's own lights: faces have about the colours of the legend, and solids still have a shape."""
_PLANE_SIZE = 6 * SIZE
_MOST_CELLS = 128
"""Along a surface that a field describes: a page gets some 100,000 triangles of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A collider that moves: the frame on the page that it hangs in."""

    handle: viser.FrameHandle
    motion: RigidMotion
    stage: Stage

    def show(self, time: float) -> None:
        """Put it where it is at a time [s]."""
        self.handle.position, self.handle.wxyz = pose_on_stage(pose_of(self.motion, time), self.stage)


def pose_on_stage(pose: Pose, stage: Stage) -> tuple[Array, Array]:
    """Where on the stage is what was at its origin, (3,), and the turn about it, a quaternion w x y z."""
    now = pose.place + pose.rotation @ (stage.origin - pose.center)
    return stage.place(now), rotation_quaternions(pose.rotation[None])[0]


def add_scenery(scene: viser.SceneApi, colliders: Sequence[Collider], stage: Stage) -> list[Mover]:
    """Put colliders and lights on the stage; those that move are given back, to be shown where they are."""
    scene.configure_default_lights(cast_shadow=False)
    scene.add_light_ambient("/light", intensity=_AMBIENT)
    movers: list[Mover] = []
    for index, collider in enumerate(colliders):
        name, contains = f"/colliders/{index}", collider.side is Side.INSIDE
        if collider.motion is not None:
            movers.append(Mover(handle=scene.add_frame(name, show_axes=False), motion=collider.motion, stage=stage))
            movers[-1].show(0.0)
            name += "/shape"
        match collider.shape:
            case HalfSpace():
                _add_plane(scene, name, collider.shape, stage, contains)
            case BoxShape() as box:
                if contains:
                    edges = stage.place(box_edges(box)).astype(np.float32)
                    scene.add_line_segments(name, points=edges, colors=_EDGE, thickness=2, thickness_units="screen")
                else:
                    scene.add_box(
                        name,
                        color=_SOLID,
                        dimensions=2 * np.asarray(box.half_extents) * stage.unit,
                        position=stage.place(np.asarray(box.center)),
                        cast_shadow=False,
                        receive_shadow=False,
                    )
            case SphereShape() as sphere:
                scene.add_icosphere(
                    name,
                    radius=sphere.radius * stage.unit,
                    color=_EDGE if contains else _SOLID,
                    subdivisions=2 if contains else 4,
                    wireframe=contains,
                    position=stage.place(np.asarray(sphere.center)),
                    cast_shadow=False,
                    receive_shadow=False,
                )
            case SignedDistanceField() as field:
                vertices, faces = surface_of(field)
                scene.add_mesh_simple(
                    name,
                    vertices=stage.place(vertices).astype(np.float32),
                    faces=faces,
                    color=_EDGE if contains else _SOLID,
                    wireframe=contains,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            case _:
                raise RenderingError(f"a collider of kind {collider.shape.kind} cannot be shown")
    return movers


def grid_cell(stage: Stage) -> float:
    """Side of a plane's grid cells [m]: a round length, about a tenth of what is shown."""
    return round_up(SIZE / stage.unit / 12)


def plane_pose(plane: HalfSpace, middle: Array) -> tuple[Array, Array]:
    """Foot of a plane below a point `middle` (3,) [m], and the quaternion w x y z that turns +z to its normal."""
    normal = np.asarray(plane.normal, dtype=np.float64)
    foot = middle - ((middle - np.asarray(plane.point)) @ normal) * normal
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    if abs(normal[2]) == 1.0:
        # Level ground keeps its grid along the axes.
        first = np.array([1.0, 0.0, 0.0])
    turn = np.stack([first, np.cross(normal, first), normal], axis=1)
    return foot, rotation_quaternions(turn[None])[0]


def box_edges(box: BoxShape) -> Array:
    """The twelve edges of a box, (12, 2, 3) [m]."""
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    pairs = [(a, b) for a, b in itertools.combinations(range(8), 2) if np.abs(corners[a] - corners[b]).sum() == 2]
    return np.asarray(box.center) + corners[np.array(pairs)] * np.asarray(box.half_extents)


def surface_of(field: SignedDistanceField) -> tuple[Array, Array]:
    """Vertices (V, 3) [m] and triangles (F, 3), facing out, of where a field is zero."""
    # It takes half a second to import, and few scenes need it.
    measure: Any = importlib.import_module("skimage.measure")
    step = -(-max(field.values.shape) // _MOST_CELLS)
    vertices, faces, _, _ = measure.marching_cubes(
        field.values.copy(), 0.0, spacing=(field.spacing,) * 3, step_size=step
    )
    return vertices + np.asarray(field.origin), faces.astype(np.uint32)


def _add_plane(scene: viser.SceneApi, name: str, plane: HalfSpace, stage: Stage, contains: bool) -> None:
    foot, quaternion = plane_pose(plane, stage.origin)
    scene.add_grid(
        name,
        width=_PLANE_SIZE,
        height=_PLANE_SIZE,
        plane="xy",
        cell_size=grid_cell(stage) * stage.unit,
        section_size=5 * grid_cell(stage) * stage.unit,
        fade_distance=2 * _PLANE_SIZE,
        shadow_opacity=0.0,
        plane_color=_PLANE,
        plane_opacity=0.0 if contains else 0.7,
        wxyz=quaternion,
        position=stage.place(foot),
    )
