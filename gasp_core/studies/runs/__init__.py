"""Simulations, each in a process of its own, whatever becomes of it."""

from __future__ import annotations

from gasp_core.studies.runs.batch import carry_out, check_limits
from gasp_core.studies.runs.outcome import Outcome, Run, RunStatus

__all__ = ["RunStatus", "Outcome", "Run", "carry_out", "check_limits"]
