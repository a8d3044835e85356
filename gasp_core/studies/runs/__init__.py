"""Simulations, each in a process of its own, whatever becomes of it."""

from __future__ import annotations

from gasp_core.studies.runs.backends import BACKENDS, Backend, chosen_backend
from gasp_core.studies.runs.batch import carry_out, check_limits
from gasp_core.studies.runs.outcome import Limits, Outcome, Run, RunStatus

__all__ = [
    "BACKENDS", "Backend", "Limits", "Outcome", "Run", "RunStatus", "carry_out", "check_limits", "chosen_backend",
]  # fmt: skip
