"""Registers the engine; imports no backend, so that listing engines stays instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from gasp_core.contract import (
    BoxShape,
    ContactCondition,
    Determinism,
    DomainPolicy,
    Driven,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    Precision,
    Quantity,
    Rigid,
    SignedDistanceField,
    SphereShape,
    Wind,
)
from gasp_core.contract.validation import finite
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.errors import SceneError

__all__ = ["MujocoOptions", "gasp_point_engines"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MujocoOptions:
    """What only this engine has.

    Parameters
    ----------
    cells
        Cells of a cage along the longest side of the largest body. 0: as many as `EngineAccuracy` asks for, but no
        more than `node_limit` allows; its default resolution is one of particles, and far more than a cage needs.
    node_limit
        Nodes of all cages together. Six to ten cells along a body are usual, which is 300 to 1,000.
    elements
        "hexahedra": cells that bend, corotated. "tetrahedra": six stable neo-Hookean tetrahedra a cell, which bear
        being crushed, and bend a fifth to a half too little.
    filled
        Whether what a body encloses is matter as well: splats are hollow.
    self_collision
        Whether a soft body can touch itself.
    body_friction
        Coulomb's coefficient between bodies, >= 0, instead of the scene's; None: the scene's.
    damping
        Rayleigh's stiffness-proportional damping of all soft bodies [s], >= 0, beside that of their materials.
    """

    cells: int = 0
    node_limit: int = 1000
    elements: Literal["hexahedra", "tetrahedra"] = "hexahedra"
    filled: bool = True
    self_collision: bool = False
    body_friction: float | None = None
    damping: float = 0.0

    def __post_init__(self) -> None:
        if self.elements not in ("hexahedra", "tetrahedra"):
            raise SceneError(f'MujocoOptions.elements must be "hexahedra" or "tetrahedra", found {self.elements!r}')
        for name, low in (("cells", 0), ("node_limit", 8)):
            value = getattr(self, name)
            if type(value) is not int or value < low:
                raise SceneError(f"MujocoOptions.{name} must be a whole number >= {low}, found {value!r}")
        for name in ("filled", "self_collision"):
            if type(getattr(self, name)) is not bool:
                raise SceneError(f"MujocoOptions.{name} must be true or false, found {getattr(self, name)!r}")
        if self.body_friction is not None:
            finite(self, "body_friction", low=0.0)
        finite(self, "damping", low=0.0)


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The one engine of this distribution."""
    return [
        EngineDescriptor(
            name="mujoco-flex",
            summary="Finite elements and rigid bodies in MuJoCo: stiff matter and contact at large steps; CPU",
            contract_version=(1, 4),
            capabilities=EngineCapabilities(
                materials=frozenset({Elastic, Rigid}),
                collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
                region_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
                contact_conditions=frozenset({ContactCondition.SEPARATE, ContactCondition.STICK}),
                body_contacts=frozenset({ContactCondition.SEPARATE}),
                drives=frozenset({Pinned, Driven, Impulse}),
                force_fields=frozenset({Wind}),
                output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
                conserved=frozenset({Quantity.MASS, Quantity.LINEAR_MOMENTUM, Quantity.ANGULAR_MOMENTUM}),
                devices=("cpu",),
                precisions=(Precision.FLOAT64,),
                determinism=Determinism.BITWISE,
                domain_policies=frozenset({DomainPolicy.EXPAND, DomainPolicy.STOP}),
                temporal_order=1.0,
                iterates=True,
                checkpoints=True,
                unconditionally_stable=True,
                material_damping=True,
                trajectories=True,
            ),
            factory="gasp_mujoco_flex.engine:MujocoFlex",
            options=MujocoOptions,
        )
    ]
