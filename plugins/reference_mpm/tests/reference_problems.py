"""Problems of the reference engine's tests, and how they are run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from gasp_reference_mpm.engine import ReferenceMpm
from gasp_reference_mpm.session import ReferenceSession
from numpy.typing import ArrayLike, NDArray

from gasp_core.contract import (
    Collider,
    Elastic,
    EngineAccuracy,
    Field,
    Fluid,
    Foam,
    HalfSpace,
    Material,
    Metal,
    NeoHookean,
    Plasticine,
    PointCloud,
    PointProblem,
    PointState,
    Precision,
    Sand,
    Snow,
    SphereShape,
    Status,
)

Array = NDArray[Any]

ALL = frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS})

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)

FLOOR = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))

EVERYWHERE = SphereShape(center=(0.0, 0.0, 0.0), radius=1e6)

MATERIALS = [
    SOFT,
    NeoHookean(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
    Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2),
    Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1.0),
    Snow(density=400.0, youngs_modulus=1e5, poissons_ratio=0.2),
    Metal(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.45, yield_stress=1e3, hardening=5e3),
    Plasticine(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=2e3),
    Foam(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=1e3, plastic_viscosity=100.0),
]


def box(cells: tuple[int, int, int], spacing: float, corner: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    axes = [(np.arange(2 * count) + 0.5) * spacing / 2 for count in cells]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + np.asarray(corner)


def problem(
    positions: Array, spacing: float, material: Material = SOFT, velocity: ArrayLike = (0.0, 0.0, 0.0), **scene: Any
) -> PointProblem:
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.broadcast_to(np.asarray(velocity, dtype=float), positions.shape),
            reference_volumes=np.full(len(positions), (spacing / 2) ** 3),
            material_ids=np.zeros(len(positions)),
            body_ids=np.zeros(len(positions)),
        ),
        materials=(material,),
        **scene,
    )


def opened(scene: PointProblem, spacing: float, restart: Any = None, **accuracy: Any) -> ReferenceSession:
    return ReferenceMpm().open(
        scene,
        device="cpu",
        precision=Precision.FLOAT64,
        seed=0,
        accuracy=EngineAccuracy(spacing=spacing, **accuracy),
        options=None,
        restart=restart,
    )


def run(scene: PointProblem, spacing: float, times: Sequence[float], **accuracy: Any) -> PointState:
    with opened(scene, spacing, **accuracy) as session:
        for time in times:
            report = session.advance_to(time)
            assert report.status is Status.OK, report.warnings
        return session.read(ALL)


def thrown(material: Material, scale: float = 1.0, offset: float = 0.0) -> tuple[PointProblem, float]:
    """A block thrown onto a floor, `scale` times as large; stiffness and velocity follow so that motion is similar."""
    spacing = 0.25 * scale
    place = np.array([offset, -offset, offset])
    corner = np.array([0.1, 0.2, 0.1]) * scale + place
    velocity = np.array([1.0, 0.5, -2.0]) * math.sqrt(scale)
    changed = {one.name: getattr(material, one.name) for one in fields(material)}
    stresses = {"youngs_modulus", "bulk_modulus", "yield_stress"} | (
        {"hardening"} if isinstance(material, Metal) else set()
    )
    for stress in stresses & set(changed):
        changed[stress] *= scale
    for viscosity in {"viscosity", "plastic_viscosity"} & set(changed):
        changed[viscosity] *= scale**1.5
    floor = HalfSpace(point=tuple(place), normal=(0.0, 0.0, 1.0))
    scene = problem(
        box((2, 3, 2), spacing, corner),
        spacing,
        type(material)(**changed),
        velocity,
        colliders=(Collider(shape=floor, friction=0.4),),
    )
    return scene, spacing
