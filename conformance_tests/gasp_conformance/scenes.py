"""The shared scenes: one TOML file each in `scene_files`, read into what the contract wants at any resolution.

A file holds everything that has a number: bodies, materials, colliders, drives, the resolutions it is run at, and under
[numbers] what its case alone reads (durations, amplitudes, seeds). Lengths are in metres and stay what they are when
the resolution changes; only where a body is one cell thick, or goes on for some cells behind its face, do cells count.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_conformance.clouds import ball_of_points, box_of_points, cloud_of, jittered
from gasp_core.contract import MATERIALS as KINDS
from gasp_core.contract import (
    SHAPES,
    BoxShape,
    Collider,
    ContactCondition,
    Drive,
    Driven,
    EngineAccuracy,
    ForceField,
    HalfSpace,
    Impulse,
    Material,
    Pinned,
    PointProblem,
    SphereShape,
    Vector,
    Wind,
)
from gasp_core.scene.tables import Table
from gasp_core.stepping.time_step import rest_bound

__all__ = ["MATERIALS", "SUBSTEPS", "Body", "SharedScene", "Throw", "shared_scene", "thrown_block"]

Array = NDArray[Any]

_DRIVES: Mapping[str, type[Drive]] = {drive.kind: drive for drive in (Pinned, Driven, Impulse)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A body of points.

    Parameters
    ----------
    material
        What it is made of.
    form
        A box, or the ball that fits into a cube.
    length
        Longest side, or diameter [m]; the grid's cells are counted along it.
    proportions
        Sides of the box in lengths. A side of 0 is one cell thick, whatever the resolution.
    corner
        Lowest corner of the box around it [m].
    embedded
        Cells by which a box goes on along x below its corner, to be held there.
    jitter, seed
        Share of their distance by which points are moved at random.
    velocity, angular_velocity
        At the start, about the mean of its points [m/s], [rad/s].
    """

    material: Material
    form: Literal["box", "ball"] = "box"
    length: float
    proportions: Vector = (1.0, 1.0, 1.0)
    corner: Vector
    embedded: int = 0
    jitter: float = 0.0
    seed: int = 0
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)

    def points(self, spacing: float) -> Array:
        """Places, (N, 3) [m], for a grid of `spacing` [m]."""
        along, across, up = (max(1, round(side * self.length / spacing)) for side in self.proportions)
        if self.form == "ball":
            places = ball_of_points(self.corner, along, spacing)
        else:
            corner = np.array(self.corner) - [self.embedded * spacing, 0.0, 0.0]
            places = box_of_points(corner, (along + self.embedded, across, up), spacing)
        return jittered(places, spacing, self.jitter, self.seed) if self.jitter else places

    def velocities(self, places: Array) -> Array:
        """Of rigid motion, (N, 3) [m/s], at its own places (N, 3) [m]."""
        return np.asarray(self.velocity) + np.cross(self.angular_velocity, places - places.mean(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedScene:
    """A scene file.

    Parameters
    ----------
    name
        Of the file.
    title
        What happens, in a line.
    cells, finer_cells
        Resolutions to run it at: grid cells along the first body's length. The finer ones are for a full run.
    numbers
        What only its case reads; texts and lists cannot be here.
    """

    name: str
    title: str
    bodies: tuple[Body, ...]
    gravity: Vector
    colliders: tuple[Collider, ...]
    drives: tuple[Drive, ...]
    force_fields: tuple[ForceField, ...]
    base_accuracy: EngineAccuracy
    cells: tuple[int, ...]
    finer_cells: tuple[int, ...]
    numbers: Mapping[str, float]

    @property
    def material(self) -> Material:
        """Of the first body."""
        return self.bodies[0].material

    @property
    def length(self) -> float:
        """Of the first body [m]."""
        return self.bodies[0].length

    def spacing(self, cells: int) -> float:
        """Of the grid [m]."""
        return self.length / cells

    def accuracy(self, cells: int) -> EngineAccuracy:
        """The file's own, at the spacing of that many cells."""
        return replace(self.base_accuracy, spacing=self.spacing(cells))

    def fixed_substep(self, cells: int) -> float:
        """`substep_fraction` of the numbers, of the bound of explicit engines for the first body at rest [s]."""
        return self.numbers["substep_fraction"] * rest_bound(self.material, self.spacing(cells))

    def places(self, cells: int) -> list[Array]:
        """Points of each body, (N, 3) [m]."""
        return [body.points(self.spacing(cells)) for body in self.bodies]

    def side_walls(self, cells: int, axes: str) -> tuple[Collider, ...]:
        """Slip walls on both sides of a body that is one cell thin along `axes`, so that it stays plane."""
        walls: list[Collider] = []
        for axis in ("xyz".index(name) for name in axes):
            low = np.array(self.bodies[0].corner)
            inwards = np.eye(3)[axis]
            for point, normal in ((low, inwards), (low + self.spacing(cells) * inwards, -inwards)):
                plane = HalfSpace(point=tuple(point), normal=tuple(normal))
                walls.append(Collider(shape=plane, contact=ContactCondition.SLIP))
        return tuple(walls)

    def problem(self, cells: int, velocities: Sequence[ArrayLike] | None = None) -> PointProblem:
        """The scene as an engine gets it.

        `velocities`, (N, 3) [m/s] a body, replace rigid motion by a field that only the case knows.
        """
        places = self.places(cells)
        if velocities is None:
            velocities = [body.velocities(own) for body, own in zip(self.bodies, places)]
        kinds = tuple(dict.fromkeys(body.material for body in self.bodies))
        rows = [kinds.index(body.material) for body in self.bodies]
        return PointProblem(
            points=cloud_of(places, velocities, self.spacing(cells), rows),
            materials=kinds,
            colliders=self.colliders,
            drives=self.drives,
            force_fields=self.force_fields,
            gravity=self.gravity,
        )


@cache
def shared_scene(name: str) -> SharedScene:
    """The scene in `scene_files/NAME.toml`.

    Raises
    ------
    SceneError
        Where the file has an unknown key, a wrong type or an impossible number.
    """
    top = _table(name)
    top.only("title", "gravity", "body", "collider", "drive", "wind", "accuracy", "cells", "finer_cells", "numbers")
    numbers = top.table("numbers")
    return SharedScene(
        name=name,
        title=top.text("title"),
        bodies=tuple(table.build(Body, material=_material(table.table("material"))) for table in top.tables("body")),
        gravity=top.vector("gravity", (0.0, 0.0, 0.0)),
        colliders=tuple(_placed(table, Collider, "shape") for table in top.tables("collider")),
        drives=tuple(
            _placed(table, table.choice("kind", _DRIVES), "region", tag="kind") for table in top.tables("drive")
        ),
        force_fields=tuple(_placed(table, Wind, "region") for table in top.tables("wind")),
        base_accuracy=top.table("accuracy").build(EngineAccuracy),
        cells=_counts(top, "cells"),
        finer_cells=_counts(top, "finer_cells"),
        numbers=MappingProxyType({key: numbers.number(key) for key in numbers.values}),
    )


def _table(name: str) -> Table:
    file = resources.files("gasp_conformance") / "scene_files" / f"{name}.toml"
    return Table(file.name, "", tomllib.loads(file.read_text(encoding="utf-8")))


def _material(table: Table) -> Material:
    return table.build(table.choice("model", KINDS), tag="model")


def _shape(table: Table) -> HalfSpace | BoxShape | SphereShape:
    return table.build(table.choice("shape", SHAPES), tag="shape")


def _placed(table: Table, kind: type[Any], key: str, tag: str | None = None) -> Any:
    """What has a shape under `key`; a wind without one blows everywhere."""
    given = {key: _shape(table.table(key))} if table.has(key) else {}
    return table.build(kind, tag=tag, **given)


def _counts(table: Table, key: str) -> tuple[int, ...]:
    values = table.values.get(key, [])
    if not (isinstance(values, list) and all(isinstance(value, int) and value > 0 for value in values)):
        table.fail(key, f"must be an array of whole numbers > 0, found {values!r}")
    return tuple(values)


def _materials(name: str) -> Mapping[str, Material]:
    top = _table(name)
    return MappingProxyType({kind: top.table(kind).build(KINDS[kind]) for kind in top.values})


MATERIALS = _materials("materials")
"""One of each kind of material, by kind."""

SUBSTEPS = 500
"""Of a thrown block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Throw:
    """A problem, the accuracy it is to be run with, when it ends [s], and the size of what was thrown [m]."""

    problem: PointProblem
    accuracy: EngineAccuracy
    end: float
    size: float


def thrown_block(material: Material, cells: int | None = None, substeps: int = SUBSTEPS) -> Throw:
    """A spinning cube that hits the floor obliquely after a few substeps and goes on from there, at a fixed substep."""
    scene = shared_scene("thrown_block")
    cells = scene.cells[0] if cells is None else cells
    # Well inside the bound: the block is squeezed on impact, and an engine must bear the same step all the way.
    substep = scene.numbers["substep_fraction"] * rest_bound(material, scene.spacing(cells))
    return Throw(
        problem=replace(scene.problem(cells), materials=(material,)),
        accuracy=replace(scene.accuracy(cells), substep=substep),
        end=substeps * substep,
        size=scene.length,
    )
