"""The one driver loop: a scene in, a recording out, whatever the engine."""

from __future__ import annotations

from gasp_core.simulation.driver import simulate
from gasp_core.simulation.splat_sources import Prepared, prepare

__all__ = ["Prepared", "prepare", "simulate"]
