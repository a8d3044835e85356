"""Registers the engine; imports no backend, so that listing engines stays instant."""

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
    Sand,
    Snow,
    SphereShape,
    Wind,
)
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.stepping.threads import ThreadOptions

__all__ = ["gasp_point_engines"]


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The one engine of this distribution."""
    return [
        EngineDescriptor(
            name="warp-mpm",
            summary="Explicit MLS-MPM in NVIDIA Warp: sorted points, coloured scatter; CPU and CUDA",
            contract_version=(1, 1),
            capabilities=EngineCapabilities(
                materials=frozenset({Elastic, NeoHookean, Sand, Fluid, Snow, Metal, Plasticine, Foam}),
                collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
                contact_conditions=frozenset(ContactCondition),
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
                device_indices=True,
            ),
            factory="gasp_warp_mpm.engine:WarpMpm",
            options=ThreadOptions,
        )
    ]
