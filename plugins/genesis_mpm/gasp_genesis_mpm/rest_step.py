"""How large a substep matter at rest bears."""

from __future__ import annotations

from gasp_core.contract import Material
from gasp_core.stepping.time_step import rest_bound

__all__ = ["rest_step"]


def rest_step(material: Material, spacing: float) -> float:
    """Largest stable substep [s] of an isolated point at rest; no stress of Genesis acts by the splines' gradient."""
    return rest_bound(material, spacing, gradient_share=0.0)
