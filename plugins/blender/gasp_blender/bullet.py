"""Rigid bodies in Blender's Bullet world: hulls that are thrown, and colliders that stand."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.bpy_runtime import evaluated, new_name, new_scene, quiet, remove_scene, studio
from gasp_blender.initial_overlap import Pieces
from gasp_blender.meshes import mesh_object

__all__ = ["RigidWorld", "turned"]

Array = NDArray[Any]

_LAST_FRAME = 1_000_000
_RATE = 24
_ITERATIONS = 50


def turned(vector: Array) -> Array:
    """Rotation matrix (3, 3) of a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross


def _moved(pose: Array, shift: Array, turn: Array) -> Array:
    moved = pose.copy()
    moved[:3, :3] = turned(turn) @ pose[:3, :3]
    moved[:3, 3] += shift
    return moved


class RigidWorld:
    """A scene with a Bullet world. Lengths and times are scaled by the caller.

    Bullet has no property for a velocity: bodies are led along a straight line for one frame, turning, and let go at
    its end. That is the second frame, as the world is only made on the first. What changes a velocity on the way throws
    all of them again. Blender's damping, deactivation, margins and restitution are off.

    Parameters
    ----------
    gravity : (3,)
    """

    def __init__(self, gravity: Array) -> None:
        with quiet():
            bpy, _ = studio()
            self._scene = scene = new_scene()
            scene.gravity = gravity.tolist()
            scene.render.fps = _RATE
            evaluated(scene, 0)
            with bpy.context.temp_override(scene=scene):
                bpy.ops.rigidbody.world_add()
            world = scene.rigidbody_world
            self._collection = bpy.data.collections.new(new_name("gasp-rigid"))
            world.collection = self._collection
            world.substeps_per_frame = 1
            world.solver_iterations = _ITERATIONS
            # What is pushed apart does not get a velocity by it.
            world.use_split_impulse = True
            world.point_cache.frame_start, world.point_cache.frame_end = 0, _LAST_FRAME
        self._bodies: list[Any] = []
        self._frame = 0

    def add_wall(self, pieces: Pieces, friction: float, layers: Array) -> None:
        """A body that stands, of convex pieces; Bullet multiplies frictions, those of bodies are 1."""
        with quiet():
            vertices = np.concatenate(pieces)
            center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            wall = self._thing([piece - center for piece in pieces], center, "PASSIVE", friction)
            wall.rigid_body.collision_collections = layers.tolist()

    def add_body(self, pieces: Pieces, center: Array, mass: float, layers: Array) -> None:
        """A body whose centre of mass is at `center` (3,), of convex pieces (H, 3) about it.

        Things that have one of their `layers` (LAYERS,) in common touch each other.
        """
        with quiet():
            body = self._thing(pieces, center, "ACTIVE", 1.0)
            body.rotation_mode = "QUATERNION"
            settings = body.rigid_body
            settings.mass = mass
            settings.linear_damping = settings.angular_damping = 0.0
            settings.use_deactivation = False
            settings.collision_collections = layers.tolist()
            self._bodies.append(body)

    def _thing(self, pieces: Pieces, center: Array, kind: str, friction: float) -> Any:
        """An object of the world, of convex pieces about its centre: several are its children."""
        thing = mesh_object(self._scene, np.concatenate(pieces))
        thing.location = center.tolist()
        self._collection.objects.link(thing)
        self._set(thing.rigid_body, kind, friction)
        if len(pieces) > 1:
            thing.rigid_body.collision_shape = "COMPOUND"
            for piece in pieces:
                part = mesh_object(self._scene, piece)
                part.parent = thing
                self._collection.objects.link(part)
                self._set(part.rigid_body, kind, friction)
        return thing

    def throw(self, poses: Array, velocities: Array, spins: Array, held: Array, lead: float) -> Array:
        """Start all bodies anew at `poses` (B, 4, 4), with velocities and angular velocities (B, 3); their poses then.

        They are led for a time `lead`; those that are `held` (B,) are led until they are thrown again.
        """
        with quiet():
            for body, pose, velocity, spin, stays in zip(self._bodies, poses, velocities, spins, held):
                self._led(body, 1, _moved(pose, -lead * velocity, -lead * spin))
                self._led(body, 2, pose)
                settings = body.rigid_body
                for frame, led in ((0, True), (3, bool(stays))):
                    settings.kinematic = led
                    settings.keyframe_insert("kinematic", frame=frame)
            self._frame = 0
            evaluated(self._scene, 0)
        self.step(lead)
        return self.step(lead)

    def lead(self, number: int, pose: Array) -> None:
        """Where a body that is held is to be after the next step."""
        with quiet():
            self._led(self._bodies[number], self._frame + 1, pose)

    def step(self, duration: float) -> Array:
        """Poses (B, 4, 4) after one frame of `duration`, which Bullet takes in one step."""
        with quiet():
            self._scene.render.fps_base = duration * _RATE
            self._frame += 1
            graph = evaluated(self._scene, self._frame)
            return np.array([np.array(body.evaluated_get(graph).matrix_world) for body in self._bodies])

    @staticmethod
    def _led(body: Any, frame: int, pose: Array) -> None:
        mathutils = importlib.import_module("mathutils")
        body.location = pose[:3, 3].tolist()
        body.rotation_quaternion = mathutils.Matrix(pose[:3, :3].tolist()).to_quaternion()
        body.keyframe_insert("location", frame=frame)
        body.keyframe_insert("rotation_quaternion", frame=frame)

    def close(self) -> None:
        """Remove the scene."""
        with quiet():
            bpy, _ = studio()
            remove_scene(self._scene)
            bpy.data.collections.remove(self._collection)

    def _set(self, settings: Any, kind: str, friction: float) -> None:
        settings.type = kind
        settings.collision_shape = "CONVEX_HULL"
        settings.friction = friction
        settings.restitution = 0.0
        # The default leaves a gap of 4 cm.
        settings.use_margin = True
        settings.collision_margin = 0.0
