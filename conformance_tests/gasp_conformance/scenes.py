"""Scenes on which two engines of the same method have to agree, one a material: a small block, spinning, thrown
obliquely onto a floor with friction, at a fixed substep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_core.engine.contract import EngineAccuracy, PointProblem
from gasp_core.engine.forcing import Collider, ContactCondition
from gasp_core.engine.materials import Elastic, Fluid, Material, NeoHookean, Sand
from gasp_core.engine.shapes import HalfSpace
from gasp_core.engine.stability import rest_bound

__all__ = ["MATERIALS", "SUBSTEPS", "Throw", "thrown_block"]

SUBSTEPS = 500

MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "elastic": Elastic(density=1000.0, youngs_modulus=1e6, poissons_ratio=0.3),
        "neo-hookean": NeoHookean(density=1000.0, youngs_modulus=1e6, poissons_ratio=0.3),
        "sand": Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2, friction_angle=35.0),
        "fluid": Fluid(density=1000.0, bulk_modulus=1e6, viscosity=5.0),
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Throw:
    """A problem, the accuracy it is to be run with, when it ends [s], and the size of what was thrown [m]."""

    problem: PointProblem
    accuracy: EngineAccuracy
    end: float
    size: float


def thrown_block(material: Material, cells: int = 5, substeps: int = SUBSTEPS) -> Throw:
    """A cube of `cells` grid cells a side, 1 m, that hits the floor after a few substeps and goes on from there."""
    size = 1.0
    spacing = size / cells
    block = box_of_points((0.13, -0.42, 0.3 * spacing), (cells, cells, cells), spacing)
    spin = np.cross([0.3, 0.5, -0.4], block - block.mean(axis=0))
    problem = PointProblem(
        points=cloud_of([block], [np.array([1.2, 0.5, -1.5]) + spin], spacing),
        materials=(material,),
        colliders=(
            Collider(
                shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)),
                contact=ContactCondition.SEPARATE,
                friction=0.3,
            ),
        ),
    )
    # Well inside the bound: the block is squeezed on impact, and an engine must bear the same step all the way.
    substep = 0.3 * rest_bound(material, spacing)
    return Throw(
        problem=problem,
        accuracy=EngineAccuracy(spacing=spacing, substep=substep),
        end=substeps * substep,
        size=size,
    )
