"""Wrong engines: the reference engine with one fault each, and the check of the suite that has to notice.

The package is a plugin like any other (`gasp_point_engines`), so that a mutant is found, opened, and run in a process
of its own as every engine is. Most faults are ones that were made: an engine written for axes with y up, a buffer
handed out instead of a copy, a backend that starts anew when it blows up.
"""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import EngineDescriptor
from gasp_core.discovery.hookspecs import hookimpl
from mutants import (
    advances,
    company,
    damping,
    declarations,
    flow,
    flows,
    knobs,
    mixed,
    problems,
    readings,
    rigid,
    snow,
    solvers,
)
from mutants.base import MUTANTS, Mutant

__all__ = ["MUTANTS", "Mutant", "gasp_point_engines"]

MODULES = (
    *(problems, solvers, knobs, readings, advances, company, damping),
    *(declarations, snow, flow, flows, rigid, mixed),
)
"""Importing them fills the catalogue."""


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """All of them."""
    return [
        EngineDescriptor(
            name=name,
            summary=(kind.__doc__ or "").splitlines()[0],
            contract_version=(1, 0),
            capabilities=kind.declares,
            factory=f"{kind.__module__}:{kind.__name__}",
        )
        for name, kind in MUTANTS.items()
    ]
