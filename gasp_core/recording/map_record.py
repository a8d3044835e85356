"""What a recording keeps of `MapChoice`: all it takes to make Gaussians of a frame, as JSON values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gasp_core.scene.settings import MapChoice

__all__ = ["map_record", "recorded_maps"]


def map_record(maps: MapChoice) -> dict[str, Any]:
    """Of a scene's maps; JSON has no infinity."""
    alpha = maps.alpha if math.isfinite(maps.alpha) else None
    return {"covariance": maps.covariance, "alpha": alpha, "control": maps.control}


def recorded_maps(record: Mapping[str, Any]) -> MapChoice:
    """The maps that frames are read with; recordings of before 0.2.0 name no rule of control.

    An alpha below 1, which shrank what was at rest, scenes could say once: it is taken for 1.
    """
    alpha = record["alpha"]
    return MapChoice(
        covariance=record["covariance"],
        alpha=math.inf if alpha is None else max(alpha, 1.0),
        control=record.get("control", "bounded"),
    )
