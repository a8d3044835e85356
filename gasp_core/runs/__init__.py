"""Simulations, each in a process of its own, whatever becomes of it."""

from __future__ import annotations

from gasp_core.runs.outcome import Ending, Outcome, Run
from gasp_core.runs.together import carry_out, check_limits

__all__ = ["Ending", "Outcome", "Run", "carry_out", "check_limits"]
