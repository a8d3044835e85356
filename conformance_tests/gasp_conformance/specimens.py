"""Plain things to try an engine on: one of each material, and clouds that every engine has to be able to move."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import Subject
from gasp_core.contract import MATERIALS, EngineCapabilities, Material, PointCloud, PointProblem

__all__ = ["NO_GRAVITY", "block_problem", "lone_points", "plain_material", "resting_block", "specimen"]

Array = NDArray[Any]

NO_GRAVITY = (0.0, 0.0, 0.0)

_PLAIN = {
    "density": 1000.0,
    "youngs_modulus": 1e4,
    "poissons_ratio": 0.3,
    "bulk_modulus": 1e4,
    "yield_stress": 1e3,
}
"""Soft, so that a second is some hundred substeps."""

_ORDER = {kind: number for number, kind in enumerate(MATERIALS.values())}


def specimen(kind: type[Material]) -> Material:
    """A plain instance of any class of material: usual numbers by name, its own defaults, and 1 for what is left."""
    values: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        if field.name in _PLAIN:
            values[field.name] = _PLAIN[field.name]
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            values[field.name] = 1.0
    return kind(**values)


def plain_material(capabilities: EngineCapabilities) -> Material:
    """A specimen of the simplest material that is declared, elastic before all others."""
    kinds = sorted(capabilities.materials, key=lambda kind: (_ORDER.get(kind, len(_ORDER)), kind.kind))
    assert kinds, "the engine declares no material: it can move nothing"
    return specimen(kinds[0])


def block_problem(
    subject: Subject, corner: ArrayLike, cells: int, spacing: float, velocity: ArrayLike, **scene: Any
) -> PointProblem:
    """One cube of `cells` grid cells a side, of the subject's plainest material; `scene` goes into the problem."""
    block = box_of_points(corner, (cells, cells, cells), spacing)
    return PointProblem(
        points=cloud_of([block], [velocity], spacing),
        materials=(plain_material(subject.descriptor.capabilities),),
        **scene,
    )


def resting_block(subject: Subject, corner: ArrayLike, cells: int, spacing: float, **scene: Any) -> PointProblem:
    """`block_problem` at rest."""
    return block_problem(subject, corner, cells, spacing, (0.0, 0.0, 0.0), **scene)


def lone_points(
    materials: Sequence[Material], pitch: float, per_axis: int, speed: float, spacing: float, seed: int
) -> PointProblem:
    """Points far from each other, each a body of its own, each with its own velocity below `speed` [m/s], weightless.

    Rows are in no order of space, and materials take turns.
    """
    generator = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(*[np.arange(per_axis)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(cells)
    places = cells[generator.permutation(count)] * pitch + np.array([0.3, -0.7, 0.2])
    directions = generator.normal(size=(count, 3))
    speeds = generator.uniform(0.3, 1.0, count) * speed / np.linalg.norm(directions, axis=1)
    cloud = PointCloud(
        reference_positions=places,
        initial_velocities=directions * speeds[:, None],
        reference_volumes=generator.uniform(0.5, 2.0, count) * (spacing / 2) ** 3,
        material_ids=np.arange(count) % len(materials),
        body_ids=np.arange(count),
    )
    return PointProblem(points=cloud, materials=tuple(materials), gravity=NO_GRAVITY)
