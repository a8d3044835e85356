"""What the core sees before anybody asks for a simulation: the engine's name and what it can do.

Nothing here imports the engine itself; `factory` names it, and the core imports it when a scene is opened.
"""

from __future__ import annotations

from collections.abc import Sequence

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
    Fluid,
    Foam,
    HalfSpace,
    Impulse,
    Metal,
    NeoHookean,
    Pinned,
    Plasticine,
    Precision,
    Quantity,
    Rigid,
    Sand,
    SignedDistanceField,
    Snow,
    SphereShape,
    Wind,
)
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.stepping.time_step import rest_bound

__all__ = ["CAPABILITIES", "gasp_point_engines"]

CAPABILITIES = EngineCapabilities(
    materials=frozenset({Elastic, NeoHookean, Sand, Fluid, Snow, Metal, Plasticine, Foam, Rigid}),
    collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
    region_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
    contact_conditions=frozenset(ContactCondition),
    body_contacts=frozenset(ContactCondition),
    pair_contacts=True,
    moving_colliders=True,
    restitution=True,
    rigid_parts=True,
    material_damping=True,
    cohesion=True,
    trajectories=True,
    drives=frozenset({Pinned, Driven, Impulse}),
    force_fields=frozenset({Wind}),
    output_fields=frozenset(Field),
    conserved=frozenset({Quantity.MASS, Quantity.LINEAR_MOMENTUM, Quantity.ANGULAR_MOMENTUM}),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset({DomainPolicy.EXPAND, DomainPolicy.STOP, DomainPolicy.CLAMP}),
    temporal_order=2.0,
    carries_tracers=True,
    checkpoints=True,
    views=frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}),
    stable_step=rest_bound,
)


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The engines of this distribution."""
    return [
        EngineDescriptor(
            name="reference-mpm",
            summary="MLS-MPM in plain NumPy, double precision: slow, obvious, the measure for the others",
            contract_version=(1, 5),
            capabilities=CAPABILITIES,
            factory="gasp_reference_mpm.engine:ReferenceMpm",
        )
    ]
