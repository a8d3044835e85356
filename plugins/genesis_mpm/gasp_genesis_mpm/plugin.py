"""What the core sees before anybody asks for a simulation: the engine's name, what it can do, and what it needs.

Nothing here imports Genesis or torch.
"""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import (
    BoxShape,
    ContactCondition,
    Determinism,
    DomainPolicy,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    EngineEnvironment,
    Field,
    Fluid,
    HalfSpace,
    Impulse,
    Metal,
    NeoHookean,
    Precision,
    Quantity,
    Sand,
    Snow,
)
from gasp_core.discovery.hookspecs import hookimpl
from gasp_genesis_mpm.rest_step import rest_step

__all__ = ["CAPABILITIES", "ENVIRONMENT", "gasp_point_engines"]

CAPABILITIES = EngineCapabilities(
    materials=frozenset({Elastic, NeoHookean, Sand, Fluid, Snow, Metal}),
    collider_shapes=frozenset({HalfSpace, BoxShape}),
    contact_conditions=frozenset({ContactCondition.SEPARATE}),
    drives=frozenset({Impulse}),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}),
    conserved=frozenset({Quantity.MASS, Quantity.LINEAR_MOMENTUM, Quantity.ANGULAR_MOMENTUM}),
    devices=("cpu",),
    # Genesis computes in float64 too, but not to its last digits; see the README.
    precisions=(Precision.FLOAT32,),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset({DomainPolicy.EXPAND, DomainPolicy.STOP}),
    temporal_order=2.0,
    checkpoints=True,
    stable_step=rest_step,
)

ENVIRONMENT = EngineEnvironment(python="3.11", packages=("genesis-world==1.4.5", "torch==2.13.0"))


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The engines of this distribution."""
    return [
        EngineDescriptor(
            name="genesis-mpm",
            summary="Genesis 1.4.5, its material point method, in an environment of its own",
            contract_version=(1, 1),
            capabilities=CAPABILITIES,
            factory="gasp_genesis_mpm.engine:GenesisMpm",
            environment=ENVIRONMENT,
        )
    ]
