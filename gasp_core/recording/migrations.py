"""Headers of recordings of earlier versions, brought to today's: what was written once can be read for good."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from typing import Any

__all__ = ["VERSION", "migrated"]

Attributes = dict[str, Any]

VERSION = 7
"""Of recordings as they are written today."""


def migrated(attributes: Attributes) -> Attributes:
    """The header of a recording of any version so far, as one of today's.

    Raises
    ------
    KeyError, TypeError, ValueError
        Where it is damaged.
    """
    for step in _STEPS[attributes["version"] - 1 :]:
        attributes = step(attributes)
    return attributes


def _with_carriers(attributes: Attributes) -> Attributes:
    """1: every vertex was a point of the engine."""
    return {**attributes, "bodies": [{**body, "carrier": "all"} for body in attributes["bodies"]]}


def _with_drifts(attributes: Attributes) -> Attributes:
    """2: nothing moved by itself."""
    return {**attributes, "bodies": [{**body, "drifts": False} for body in attributes["bodies"]]}


def _unchanged(attributes: Attributes) -> Attributes:
    """3: a fit to cores had no `order`, which is that of the rows then; `LeastSquares.of` knows."""
    return attributes


def _without_need_of_the_scene(attributes: Attributes) -> Attributes:
    """4: what it takes to read a frame stood in the text of the scene alone, and options were kept as Python's repr."""
    scene = tomllib.loads(attributes["scene"])
    maps = scene.get("maps", {})
    alpha = float(maps.get("alpha", 2.0))
    motions = {item["name"]: item.get("motion") for item in scene["object"]}
    names = [item["name"] for item in attributes["objects"]]
    return {
        **attributes,
        "maps": {"covariance": maps.get("covariance", "exact"), "alpha": alpha if math.isfinite(alpha) else None},
        "bodies": [
            {**body, "motion": motions[names[body["item"]]] if body["drifts"] else None}
            for body in attributes["bodies"]
        ],
        "engine": {**attributes["engine"], "options": scene.get("engine", {}).get("options", {})},
    }


def _without_checksums(attributes: Attributes) -> Attributes:
    """5: nothing said what its files were."""
    return {**attributes, "files": {}}


def _without_driven_parts(attributes: Attributes) -> Attributes:
    """6: of a body that moved by itself all Gaussians did."""
    return attributes


_STEPS: tuple[Callable[[Attributes], Attributes], ...] = (
    _with_carriers,
    _with_drifts,
    _unchanged,
    _without_need_of_the_scene,
    _without_checksums,
    _without_driven_parts,
)
