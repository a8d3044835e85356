"""What only this engine has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
    """

    elastic: Literal["cage", "cloth"] = "cage"
    voxels: int = 1000

    def __post_init__(self) -> None:
        if self.elastic not in ("cage", "cloth"):
            raise SceneError(f"BlenderOptions.elastic must be cage or cloth, found {self.elastic!r}")
        if type(self.voxels) is not int or self.voxels < 1:
            raise SceneError(f"BlenderOptions.voxels must be a whole number >= 1, found {self.voxels!r}")
