"""What engines for explicit MPM declare alike, here since plugins may import nothing but the core to be listed."""

from __future__ import annotations

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
from gasp_core.stepping.threads import ThreadOptions
from gasp_core.stepping.time_step import rest_bound

__all__ = ["mpm_descriptor"]


def mpm_descriptor(
    *,
    name: str,
    summary: str,
    factory: str,
    contract_version: tuple[int, int],
    device_indices: bool,
) -> EngineDescriptor:
    """The descriptor of an engine whose kernels do all that `MpmSession` asks for, with `ThreadOptions`.

    Parameters
    ----------
    name, summary, factory, contract_version
        See `gasp_core.contract.EngineDescriptor`.
    device_indices
        See `gasp_core.contract.EngineCapabilities`.
    """
    return EngineDescriptor(
        name=name,
        summary=summary,
        contract_version=contract_version,
        capabilities=EngineCapabilities(
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
            devices=("cpu", "cuda"),
            precisions=(Precision.FLOAT32, Precision.FLOAT64),
            determinism=Determinism.BITWISE,
            domain_policies=frozenset(DomainPolicy),
            temporal_order=2.0,
            carries_tracers=True,
            checkpoints=True,
            device_indices=device_indices,
            stable_step=rest_bound,
        ),
        factory=factory,
        options=ThreadOptions,
    )
