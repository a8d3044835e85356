"""An engine that does what engines must not do, when it is told to; and the same with an environment of its own."""

import dataclasses
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from gasp_core.contract import (
    MATERIALS,
    BoxShape,
    ContactCondition,
    Determinism,
    DomainPolicy,
    Driven,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    EngineEnvironment,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    Precision,
    SphereShape,
    Wind,
)
from gasp_core.discovery.hookspecs import hookimpl


class Mood(Enum):
    CALM = "calm"
    WILD = "wild"


@dataclass(frozen=True, kw_only=True)
class FrailOptions:
    fault: str = ""
    fault_time: float = 0.1
    note: Path | None = None
    mood: Mood = Mood.CALM
    weights: tuple[float, ...] = ()
    spin: float = 0.0


CAPABILITIES = EngineCapabilities(
    materials=frozenset({Elastic, *MATERIALS.values()}),
    collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
    contact_conditions=frozenset(ContactCondition),
    drives=frozenset({Pinned, Driven, Impulse}),
    force_fields=frozenset({Wind}),
    output_fields=frozenset(Field),
    conserved=frozenset(),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset(DomainPolicy),
    carries_tracers=True,
    checkpoints=True,
)

FRAIL = EngineDescriptor(
    name="frail",
    summary="Does what engines must not do",
    contract_version=(1, 0),
    capabilities=CAPABILITIES,
    factory="fake_frail_engine:Frail",
    options=FrailOptions,
)
AWAY = dataclasses.replace(
    FRAIL, name="away", environment=EngineEnvironment(python=">=3.11,<3.14", packages=("gasp-fake-backend==1.0",))
)


@hookimpl
def gasp_point_engines():
    return [FRAIL, AWAY]
