"""Which settings a scene is run with, and the scene of each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gasp_core.contract import EngineAccuracy, Precision
from gasp_core.errors import AccuracyError
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import Reduction
from gasp_core.simulation.splat_sources import prepare

__all__ = ["Setting", "default_resolutions", "grid", "scene_with"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What of a scene is traded for time.

    Parameters
    ----------
    resolution
        Cells along the longest side of the largest body.
    fraction
        Cores for each Gaussian; None: all vertices.
    precision
        Of the engine's numbers.
    substep_fraction
        Of the stable bound.

    Raises
    ------
    SceneError
        Where a value is impossible.
    """

    resolution: int
    fraction: float | None = None
    precision: Precision
    substep_fraction: float

    def __post_init__(self) -> None:
        self.accuracy(EngineAccuracy())
        self.reduction(Reduction())

    def accuracy(self, base: EngineAccuracy) -> EngineAccuracy:
        """The engine's knobs; a spacing or a substep that `base` names would leave nothing to set."""
        if type(self.resolution) is not int:
            raise AccuracyError(f"a resolution must be a whole number, found {self.resolution!r}")
        return replace(
            base, resolution=self.resolution, spacing=None, substep=None, substep_fraction=self.substep_fraction
        )

    def reduction(self, base: Reduction) -> Reduction:
        """All vertices, or this fraction of cores; levels and transfer are those of `base` where it says any."""
        return base.with_cores(fraction=self.fraction)

    @property
    def cores(self) -> str:
        """The fraction as people write it."""
        return "all" if self.fraction is None else f"{self.fraction:g}"

    @property
    def key(self) -> str:
        """A name, also for a folder."""
        return f"{self.resolution}-{self.cores}-{self.precision.value}-{self.substep_fraction:g}"


def grid(
    resolutions: Sequence[int],
    fractions: Sequence[float | None],
    precisions: Sequence[Precision],
    substep_fractions: Sequence[float],
) -> tuple[Setting, ...]:
    """Every combination, each once.

    Raises
    ------
    AccuracyError
        Where one of the lists is empty.
    SceneError
        Where a value is impossible.
    """
    lists = {
        "resolutions": resolutions,
        "fractions": fractions,
        "precisions": precisions,
        "substep fractions": substep_fractions,
    }
    for name, values in lists.items():
        if not values:
            raise AccuracyError(f"no {name} are named: name at least one")
    combined = itertools.product(resolutions, fractions, precisions, substep_fractions)
    return tuple(
        dict.fromkeys(
            Setting(resolution=resolution, fraction=fraction, precision=precision, substep_fraction=substep)
            for resolution, fraction, precision, substep in combined
        )
    )


def default_resolutions(scene: Scene) -> tuple[int, ...]:
    """A half and 1/sqrt 2 of the scene's own resolution, and that; where it is "auto", its splats are read for it."""
    own = scene.accuracy.resolution
    own = int(prepare(scene).assembly.accuracy.resolution) if own == "auto" else own
    return tuple(sorted({max(2, round(own / math.sqrt(2) ** step)) for step in range(3)}))


def scene_with(scene: Scene, setting: Setting) -> Scene:
    """The scene as a setting has it."""
    return replace(
        scene.with_cores(fraction=setting.fraction),
        accuracy=setting.accuracy(scene.accuracy),
        engine=replace(scene.engine, precision=setting.precision),
    )
