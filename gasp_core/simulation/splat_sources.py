"""The splats of a scene, read, placed and made into points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gasp_core.dynamics.placed_scene import PlacedScene, place_scene
from gasp_core.reduction.assembly import Assembly, assemble
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.scene.model import Scene
from gasp_core.simulation.domain_fit import refuse_outside_domain

__all__ = ["Prepared", "prepare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared(PlacedScene):
    """A scene whose splats are read, placed and made into points.

    Parameters
    ----------
    assembly
        What the engine is given.
    """

    assembly: Assembly


def prepare(
    scene: Scene, known: Mapping[str, TransferOperator] | None = None, spacing: float | None = None
) -> Prepared:
    """Read, select and place the splats of a scene and make the engine's points of them.

    Parameters
    ----------
    scene
        Whose.
    known, spacing
        What carried its objects before, and on what grid [m], see `gasp_core.reduction.assembly.assemble`.

    Raises
    ------
    SceneError, SplatFormatError
        Where a splat cannot be read, nothing of it is left, or it begins outside of its domain.
    """
    placed = place_scene(scene)
    assembly = assemble(scene, placed.objects, placed.motions, known, spacing)
    refuse_outside_domain(assembly)
    return Prepared(objects=placed.objects, digests=placed.digests, motions=placed.motions, assembly=assembly)
