"""The engine of the tests under a name of its own, with options of odd kinds; and the same with an environment.

It claims to model everything, so that what does not fit elsewhere is asked of it.
"""

import dataclasses
from dataclasses import dataclass
from enum import Enum

import flying_points

from gasp_core.contract import (
    MATERIALS,
    BoxShape,
    ContactCondition,
    DomainPolicy,
    Elastic,
    EngineEnvironment,
    Field,
    HalfSpace,
    SphereShape,
)
from gasp_core.discovery.hookspecs import hookimpl


class Mood(Enum):
    CALM = "calm"
    WILD = "wild"


@dataclass(frozen=True, kw_only=True)
class FrailOptions(flying_points.Options):
    mood: Mood = Mood.CALM
    weights: tuple[float, ...] = ()


BALLISTIC = flying_points.descriptor(fields=frozenset(Field))
FRAIL = dataclasses.replace(
    BALLISTIC,
    name="frail",
    summary="Does what engines must not do",
    capabilities=dataclasses.replace(
        BALLISTIC.capabilities,
        materials=frozenset({Elastic, *MATERIALS.values()}),
        collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
        contact_conditions=frozenset(ContactCondition),
        domain_policies=frozenset(DomainPolicy),
        carries_tracers=True,
    ),
    options=FrailOptions,
)
AWAY = dataclasses.replace(
    FRAIL, name="away", environment=EngineEnvironment(python=">=3.11,<3.14", packages=("gasp-fake-backend==1.0",))
)


@hookimpl
def gasp_point_engines():
    return [FRAIL, AWAY]
