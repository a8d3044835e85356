"""What only this engine has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gasp_core.contract.validation import finite
from gasp_core.errors import SceneError

__all__ = ["BlenderOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BlenderOptions:
    """Options of the engine.

    Parameters
    ----------
    elastic
        What elastic bodies are: cages of springs, or, for thin sheets, cloth.
    voxels
        Most voxels (quads) in the cage of one body; where the resolution asks for more, the cage is coarser.
    turbulence
        Root mean square of what Blender's turbulence accelerates a node of mean mass by [m/s^2]: a field of gusts that
        stands still. Of cages alone.
    turbulence_size
        Length over which gusts change [m].
    """

    elastic: Literal["cage", "cloth"] = "cage"
    voxels: int = 1000
    turbulence: float = 0.0
    turbulence_size: float = 1.0

    def __post_init__(self) -> None:
        if self.elastic not in ("cage", "cloth"):
            raise SceneError(f"BlenderOptions.elastic must be cage or cloth, found {self.elastic!r}")
        finite(self, "turbulence", low=0.0)
        finite(self, "turbulence_size", low=0.0, open_low=True)
        if self.turbulence and self.elastic == "cloth":
            raise SceneError("BlenderOptions.turbulence moves cages alone: leave it out, or use elastic = cage")
        if type(self.voxels) is not int or self.voxels < 1:
            raise SceneError(f"BlenderOptions.voxels must be a whole number >= 1, found {self.voxels!r}")
