"""Where runs are made: on this machine, or by the workers of a cluster."""

from __future__ import annotations

from gasp_core.studies.runs.backends.choosing import BACKENDS, chosen_backend
from gasp_core.studies.runs.backends.interface import Backend, Ended

__all__ = ["BACKENDS", "Backend", "Ended", "chosen_backend"]
