"""The same scene through several engines: what each took, how far apart they end, and a page that shows it."""

from __future__ import annotations

from gasp_core.studies.comparison.comparing import compare
from gasp_core.studies.comparison.measures import Comparison, Likeness, Pair, Row

__all__ = ["Comparison", "Likeness", "Pair", "Row", "compare"]
