"""What the tests of an engine for explicit MPM have in common: matter, clouds, scenes, and how a session is opened.

Small clouds on purpose: compiling dominates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
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
)
from gasp_core.stepping.threads import ThreadOptions
from gasp_mpm_host.rows import Rows
from gasp_mpm_host.session import MpmSession

__all__ = ["FLOOR", "Kit", "falling", "same"]

Array = NDArray[Any]

_MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "elastic": Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
        "neo-hookean": NeoHookean(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
        "sand": Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.3),
        "fluid": Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1.0),
        "snow": Snow(density=400.0, youngs_modulus=2e5, poissons_ratio=0.3),
        "metal": Metal(density=1000.0, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=2e3, hardening=5e3),
        "plasticine": Plasticine(density=1000.0, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=4e3),
        "foam": Foam(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=1e3, plastic_viscosity=200.0),
        # Nearly incompressible, of different weight and stiffness: the mean dilation is one of both where they meet.
        "rubber": Elastic(density=900.0, youngs_modulus=1e5, poissons_ratio=0.49),
        "gel": NeoHookean(density=1200.0, youngs_modulus=5e4, poissons_ratio=0.47),
        "putty": Elastic(
            density=1000.0, youngs_modulus=5e4, poissons_ratio=0.45, mass_damping=3.0, stiffness_damping=5e-4
        ),
        "cork": NeoHookean(
            density=400.0, youngs_modulus=5e4, poissons_ratio=0.2, mass_damping=2.0, stiffness_damping=2e-4
        ),
        "lead": Metal(density=1100.0, youngs_modulus=1e5, poissons_ratio=0.47, yield_stress=2e3),
    }
)

FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)

_EVERYTHING = frozenset(Field) - {Field.TRACER_POSITIONS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Kit:
    """An engine as its tests see it.

    Parameters
    ----------
    engine_open
        `open` of the engine (`gasp_core.contract.PointEngine`), with `ThreadOptions`.
    rows
        Of a session: its points as rows.
    nodes
        Of a session: number of nodes of its grid.
    device
        On which sessions run; not every test holds on another one than the CPU.
    """

    engine_open: Callable[..., MpmSession]
    rows: Callable[[MpmSession], Rows]
    nodes: Callable[[MpmSession], int]
    device: str = "cpu"
    materials: ClassVar[Mapping[str, Material]] = _MATERIALS
    """One of every kind, some that are nearly incompressible, some that are damped, by what they are called here."""
    everything: ClassVar[frozenset[Field]] = _EVERYTHING
    """Fields of the points."""

    def open(
        self,
        scene: PointProblem,
        *,
        precision: str = "float32",
        threads: int = 1,
        restart: Mapping[str, Array] | None = None,
        **accuracy: Any,
    ) -> MpmSession:
        """A session with as many substeps as it takes."""
        accuracy.setdefault("substep_limit", 1_000_000)
        return self.engine_open(
            scene,
            device=self.device,
            precision=Precision(precision),
            seed=0,
            accuracy=EngineAccuracy(**accuracy),
            options=ThreadOptions(threads=threads),
            restart=restart,
        )

    @staticmethod
    def block(
        side: float = 0.4, per_axis: int = 8, corner: ArrayLike = (0.0, 0.0, 0.0), *, jitter: float = 0.3, seed: int = 3
    ) -> Array:
        """Points of a cube, one in each of per_axis^3 equal cells, jittered inside them; (N, 3) [m]."""
        cells = np.stack(np.meshgrid(*[np.arange(per_axis)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        offset = np.random.default_rng(seed).uniform(-jitter, jitter, cells.shape)
        return (cells + 0.5 + offset) * (side / per_axis) + np.asarray(corner)

    @staticmethod
    def problem(
        positions: ArrayLike,
        material: Material | tuple[Material, ...],
        *,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        side: float = 0.4,
        ids: Array | None = None,
        volumes: Array | None = None,
        **scene: Any,
    ) -> PointProblem:
        """A problem of `positions` (N, 3) [m], together a cube of `side` [m]; `scene` goes into it as it is."""
        places = np.asarray(positions, dtype=float)
        count = len(places)
        rows = np.zeros(count, dtype=int) if ids is None else ids
        return PointProblem(
            points=PointCloud(
                reference_positions=places,
                initial_velocities=np.array(np.broadcast_to(np.asarray(velocity, dtype=float), places.shape)),
                reference_volumes=np.full(count, side**3 / count) if volumes is None else volumes,
                material_ids=rows,
                body_ids=rows,
            ),
            materials=material if isinstance(material, tuple) else (material,),
            **scene,
        )


def falling(kit: Kit, kind: str = "elastic", **scene: Any) -> PointProblem:
    """A block thrown at the floor, askew."""
    scene.setdefault("colliders", (FLOOR,))
    return kit.problem(kit.block(corner=(0, 0, 0.03)), kit.materials[kind], velocity=(0.3, 0, -2), **scene)


def same(a: PointState, b: PointState) -> bool:
    """Whether two states are equal bit for bit."""
    names = ("positions", "velocities", "deformation_gradients")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)
