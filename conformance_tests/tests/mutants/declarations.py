"""What they declare, and have not."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gasp_reference_mpm.plugin import CAPABILITIES

from gasp_core.engine.materials import Elastic
from mutants.base import Mutant, mutant


@mutant("order-overstated", {"temporal-order": "measured, 3 declared"})
class OrderOverstated(Mutant):
    """Third order is declared."""

    declares = replace(CAPABILITIES, temporal_order=3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Jelly(Elastic):
    """No check can know it."""

    kind = "jelly"


@mutant("jelly-declared", {"material:jelly": "the suite has no check for material:jelly yet"})
class JellyDeclared(Mutant):
    """A material of its own is declared, which nothing shows."""

    right_can = False
    declares = replace(CAPABILITIES, materials=CAPABILITIES.materials | {Jelly})
