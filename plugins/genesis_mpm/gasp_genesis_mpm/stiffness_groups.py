"""Which points share a stiffness.

Genesis knows one volume of a particle, and a stiffness a material; a point's mass can be its own. The force of a point
is its volume times its stress, so points of other volumes need a material of their own: its stiffness is multiplied by
their volume. Only so many materials can be compiled, so that volumes are gathered into classes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Material, PointProblem
from gasp_core.errors import SceneError

__all__ = ["CLASSES", "MOST_PORTIONS", "Portion", "portions_of", "volume_classes"]

Array = NDArray[Any]

CLASSES = 8
"""Of volumes, per material. Each is one more branch in Genesis' largest kernel."""
MOST_PORTIONS = 128
"""Beyond, compiling takes longer than a run: a material that varies from point to point would be thousands."""
_SAME = 1e-9
"""Volumes closer than this, relative, are one: a sum of thirds is a whole."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Portion:
    """Points of one material that share one volume in their stress.

    Parameters
    ----------
    material
        Of all of them.
    volume
        By which their stress acts [m^3]: the mean of their own.
    rows : (n,)
        Which points, ascending.
    """

    material: Material
    volume: float
    rows: Array


def volume_classes(volumes: Array, limit: int = CLASSES) -> Array:
    """Class, 0, 1, ..., of each volume (N,) [m^3], at most `limit` of them, ascending.

    As many different volumes as there may be classes are kept apart. More are cut where the logarithm of the range has
    equal parts, which bounds the ratio of two volumes of one class, and with it how much too stiff or too soft a point
    may be, by (largest / smallest)^(1 / limit).
    """
    logarithms = np.log(volumes)
    ordered = np.sort(logarithms)
    steps = np.flatnonzero(np.diff(ordered) > _SAME)
    if len(steps) < limit:
        edges = (ordered[steps] + ordered[steps + 1]) / 2
    else:
        edges = np.linspace(ordered[0], ordered[-1], limit + 1)[1:-1]
    _, classes = np.unique(np.searchsorted(edges, logarithms), return_inverse=True)
    return classes


def portions_of(problem: PointProblem) -> tuple[Portion, ...]:
    """The portions of a problem's points, by material, then by volume.

    Raises
    ------
    SceneError
        Where they are more than can be compiled.
    """
    points = problem.points
    portions: list[Portion] = []
    for index in np.unique(points.material_ids):
        rows = np.flatnonzero(points.material_ids == index)
        classes = volume_classes(points.reference_volumes[rows])
        for one in range(int(classes.max()) + 1):
            own = rows[classes == one]
            volume = float(points.reference_volumes[own].mean())
            portions.append(Portion(material=problem.materials[index], volume=volume, rows=own))
    if len(portions) > MOST_PORTIONS:
        raise SceneError(
            f"genesis-mpm: compiles each material apart, {MOST_PORTIONS} with their volumes at most, and this scene has"
            f" {len(portions):,}: let less of it vary, or choose warp-mpm"
        )
    return tuple(portions)
