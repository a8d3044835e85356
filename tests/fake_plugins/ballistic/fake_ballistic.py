"""Points that fly as if nothing else were there: the smallest engine that works."""

from dataclasses import dataclass

from gasp_core.contract import Determinism, Elastic, EngineCapabilities, EngineDescriptor, Field, Precision
from gasp_core.discovery.hookspecs import Command, hookimpl

CAPABILITIES = EngineCapabilities(
    materials=frozenset({Elastic}),
    collider_shapes=frozenset(),
    contact_conditions=frozenset(),
    drives=frozenset(),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    conserved=frozenset(),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
    checkpoints=True,
)


@dataclass(frozen=True, kw_only=True)
class BallisticOptions:
    time_scale: float = 1.0


@hookimpl
def gasp_point_engines():
    return [
        EngineDescriptor(
            name="ballistic",
            summary="Points that fly as if nothing else were there",
            contract_version=(1, 7),
            capabilities=CAPABILITIES,
            factory="fake_ballistic_engine:Ballistic",
            options=BallisticOptions,
        )
    ]


@hookimpl
def gasp_commands():
    return [Command(name="greet", summary="Say hello.", factory="fake_ballistic_command:greet")]
