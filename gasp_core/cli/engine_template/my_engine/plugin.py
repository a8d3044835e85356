"""What GASP sees before anybody asks for a simulation: the engine's name and what it can do.

Imported whenever engines are listed, so nothing here imports the engine or what it stands on; `factory` names it.
"""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import (
    Determinism,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    Impulse,
    Precision,
    Quantity,
    Rigid,
)
from gasp_core.discovery.hookspecs import hookimpl

__all__ = ["CAPABILITIES", "gasp_point_engines"]

CAPABILITIES = EngineCapabilities(
    # What is left out here is refused before the engine is asked; what is named, `gasp-conformance` wants to see.
    materials=frozenset({Rigid}),
    collider_shapes=frozenset(),
    contact_conditions=frozenset(),
    drives=frozenset({Impulse}),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    bodies_meet=False,
    conserved=frozenset({Quantity.MASS, Quantity.ANGULAR_MOMENTUM}),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
    temporal_order=2.0,
    checkpoints=True,
)


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The engines of this distribution."""
    return [
        EngineDescriptor(
            name="my-engine",
            summary="Rigid bodies in free flight",
            contract_version=(1, 6),
            capabilities=CAPABILITIES,
            factory="my_engine.engine:Engine",
        )
    ]
