"""The knobs that every engine understands."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

from gasp_core.contract.points import PointCloud
from gasp_core.contract.validation import finite, whole_number

__all__ = ["EngineAccuracy"]

Array = NDArray[Any]

_CELLS = 64
"""Where nobody has chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineAccuracy:
    """The knobs every engine understands.

    Parameters
    ----------
    resolution
        Grid cells (or elements) along the longest side of the largest body. "auto": what a scene chooses by its
        objects and materials; engines are given the number.
    substep_fraction
        Of the stable bound the engine computes, in (0, 1].
    substep
        A fixed step [s] instead; refused by the engine if above its bound.
    solver_tolerance
        Relative, for engines that iterate.
    iteration_limit
        Of one solve, for engines that iterate; one that cannot go on with what it has by then ends with
        `Status.NOT_CONVERGED`. None: the engine's own.
    substep_limit
        Largest number of substeps for one frame: what would cost more ends with `Status.SUBSTEP_LIMIT`.
    spacing
        Grid spacing [m] instead of `resolution`: two runs compared at one spacing, a scene of one point.
    """

    resolution: int | Literal["auto"] = "auto"
    substep_fraction: float = 0.8
    substep: float | None = None
    solver_tolerance: float = 1e-6
    iteration_limit: int | None = None
    substep_limit: int = 20_000
    spacing: float | None = None

    def __post_init__(self) -> None:
        if self.resolution != "auto":
            whole_number(self, "resolution", low=2, high=4096)
        finite(self, "substep_fraction", low=0.0, high=1.0, open_low=True)
        finite(self, "solver_tolerance", low=0.0, high=1.0, open_low=True)
        whole_number(self, "substep_limit", low=1)
        if self.iteration_limit is not None:
            whole_number(self, "iteration_limit", low=1)
        for name in ("substep", "spacing"):
            if getattr(self, name) is not None:
                finite(self, name, low=0.0, open_low=True)

    def spacing_for(self, size: float | PointCloud) -> float:
        """Grid spacing [m] for matter of this size [m], `PointCloud.size`: `spacing`, or the size over `resolution`,
        64 where that is "auto".

        A cloud instead of its size is deprecated.
        """
        if isinstance(size, PointCloud):
            warnings.warn(
                "EngineAccuracy.spacing_for wants a size: give it points.size", DeprecationWarning, stacklevel=2
            )
            size = size.size
        if self.spacing is not None:
            return self.spacing
        cells = _CELLS if self.resolution == "auto" else self.resolution
        # One place has no size to resolve; any spacing serves a body that only flies.
        return size / cells if size > 0 else 1.0 / cells
