"""Many settings of one scene: `sweep` runs each, and makes a table of them."""

from __future__ import annotations

from gasp_core.studies.sweep.measures import Measures, Observable, load_observable
from gasp_core.studies.sweep.planning import Planned, planned
from gasp_core.studies.sweep.settings import Setting, settings_from_table, settings_of
from gasp_core.studies.sweep.sweeping import Sweep, sweep
from gasp_core.studies.sweep.table import Row

__all__ = [
    "Measures", "Observable", "Planned", "Row", "Setting", "Sweep", "load_observable", "planned", "settings_from_table",
    "settings_of", "sweep",
]  # fmt: skip
