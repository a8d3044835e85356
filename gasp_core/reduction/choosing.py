"""What `auto` stands for: which points an object gets, and how many cells its scene.

Both follow from the body that was captured: as few points and cells as what it is made of needs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Fluid, Material, Sand, Snow
from gasp_core.dynamics.mesh_at_start import mesh_at_start
from gasp_core.games import magnify
from gasp_core.quantities import volume_told
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.cores import CORNERS_A_CELL
from gasp_core.reduction.occupancy import occupied_cells
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.reduction.volume import POINTS_A_CELL
from gasp_core.scene.objects import Reduction, laws_of
from gasp_core.scene.placed_solid import FEW
from gasp_core.scene.selection import PlacedObject

__all__ = ["Choice", "chosen_mode", "chosen_resolution", "reduction_of"]

Array = NDArray[Any]

_THIN = 0.2
"""Of all matter: with less than this inside, a body is thin. Statues and pots have .75 at least, a flat robot on its
slab has .3, a heap of sheets none."""
_COARSEST, _FINEST = 24, 64
"""Cells along an object."""
_LAYERS = 48
"""The least for what flows and lies in thin layers then, or is thin to begin with."""
_LADDER = 8
"""Numbers of cells are multiples of it: roundings of another processor choose no other grid."""
_MOST_POINTS = 500_000
"""That fill the bodies of a scene: a small thing beside a large one would have the large one cost hours."""
_FEWEST, _STEPS = 8, (64, 48, 32, 24, 16, 12, 8)
"""Where points are as many as they are: the first with enough of them in each cell that they occupy."""
_GAUSSIANS_A_CELL = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """How an object is reduced, and why.

    Parameters
    ----------
    mode
        One of `Reduction`, not "auto".
    why
        For the user; empty where the scene names the mode.
    """

    mode: str
    why: str = ""


def chosen_mode(placed: PlacedObject, known: TransferOperator | None) -> Choice:
    """The mode of an object that moves.

    Parameters
    ----------
    placed
        The object.
    known
        What carried it in the recording that is gone on with: what was chosen once stays chosen.
    """
    reduction = placed.item.reduction
    if reduction.mode != "auto":
        return Choice(mode=reduction.mode)
    moving = int(placed.moving.sum())
    if known is not None:
        return Choice(mode=known.kind, why="the recording has it")
    if moving <= FEW:
        return Choice(mode="all", why=f"{moving:,} Gaussians are few")
    solid = placed.solid()
    # A hollow body encloses what it would if it were filled.
    inside, thin = solid.filled.volume, float(solid.solid.sheets.volumes.sum()) * solid.scale**3
    if inside + thin == 0:
        return Choice(mode="all", why="its Gaussians are too faint or too few to be the surface of a body")
    if inside < _THIN * (inside + thin):
        return Choice(mode="cores", why="its Gaussians are thin matter and enclose next to nothing")
    return Choice(mode="volume", why=f"its Gaussians are the surface of {volume_told(solid.volume)}")


def reduction_of(placed: PlacedObject, choice: Choice, block: Block, floor: float, spacing: float) -> Reduction:
    """The reduction of a mode: cores, as many as it takes to fill the cells of this spacing [m]; "all" if not fewer.

    `floor`: shortest edge [m] of the simplices that fill them.
    """
    reduction = placed.item.reduction
    if reduction.mode != "auto":
        return reduction
    if choice.mode != "cores":
        return Reduction(mode=choice.mode)
    corners = magnify(block.rest, floor)[0].reshape(-1, 3)
    cells = int(occupied_cells(corners + block.centre, spacing).max()) + 1
    count = math.ceil(CORNERS_A_CELL * cells / 4)
    if 4 * count >= len(corners):
        return Reduction(mode="all")
    return Reduction(mode="cores", count=count)


def chosen_resolution(objects: Sequence[PlacedObject], modes: Mapping[str, str]) -> tuple[int, str]:
    """Cells along the largest of the objects that move, and why so many.

    Parameters
    ----------
    objects
        That move.
    modes
        Of each, by name.
    """
    sizes = [size_of(placed) for placed in objects]
    wanted = [_cells_along(placed, modes[placed.item.name], size) for placed, size in zip(objects, sizes)]
    cells = [max(sizes) / size * count if size > 0 else _FEWEST for size, (count, _) in zip(sizes, wanted)]
    leading = int(np.argmax(cells))
    largest = int(np.argmax(sizes))
    whose = "" if leading == largest else f' of "{objects[leading].item.name}"'
    why = f"for the {wanted[leading][1]}{whose}"
    resolution = max(_FEWEST, _LADDER * math.ceil(cells[leading] / _LADDER - 0.25))
    filled = sum(_filled(placed, modes[placed.item.name]) for placed in objects)
    most = max(sizes) * (_MOST_POINTS / (POINTS_A_CELL * filled)) ** (1 / 3) if filled else math.inf
    if resolution > most:
        resolution = max(_FEWEST, _LADDER * math.floor(most / _LADDER))
        why += f", as far as some {_MOST_POINTS:,} points go"
    return resolution, f'{resolution} cells along "{objects[largest].item.name}", {why}'


def size_of(placed: PlacedObject) -> float:
    """Longest side [m] of what moves of an object and does not float.

    One far floater, or one huge faint Gaussian of a capture, would otherwise set the resolution of all the rest.
    """
    own = placed.gaussians.means[placed.moving & ~placed.floating]
    return float(np.ptp(own, axis=0).max()) if len(own) > 1 else 0.0


def _cells_along(placed: PlacedObject, mode: str, size: float) -> tuple[float, str]:
    """How many cells along it an object wants, and for what of it."""
    reduction = placed.item.reduction
    means = placed.gaussians.means[placed.moving & ~placed.floating]
    if mode in ("all", "centres"):
        return _filled_by(len(means) // _GAUSSIANS_A_CELL, means, size), "number of its Gaussians"
    if mode == "mesh":
        mesh = mesh_at_start(placed)
        if not mesh.filled:
            return _filled_by(len(mesh.vertices) // _GAUSSIANS_A_CELL, mesh.vertices, size), "vertices of its mesh"
        # The mean depth in a slab is a quarter of its thickness, which is twice its volume to its area.
        return _layered(placed, size, mesh.volume / mesh.area / 2)
    if reduction.mode == "cores":
        corners = 4 * reduction.cores_of(int(placed.moving.sum()))
        return _filled_by(corners // CORNERS_A_CELL, means, size), "number of its cores"
    if mode == "cores":
        return float(_LAYERS), "thinness"
    solid = placed.solid()
    return _layered(placed, size, solid.solid.mean_depth * solid.scale or solid.detail)


def _layered(placed: PlacedObject, size: float, depth: float) -> tuple[float, str]:
    """Cells along an object of this size whose matter is `depth` [m] deep in the mean."""
    least = _LAYERS if any(map(_flows, laws_of(placed.item))) else _COARSEST
    cells = min(max(size / depth, least), _FINEST)
    if cells == least and least == _LAYERS:
        return cells, "layers that it flows into"
    return cells, f"thickness of its matter, some {4e3 * depth:.2g} mm"


def _filled(placed: PlacedObject, mode: str) -> float:
    """Volume [m^3] of an object that is filled with points, by the spacing."""
    if mode == "volume":
        return placed.solid().volume
    mesh = mesh_at_start(placed) if mode == "mesh" else None
    return mesh.volume if mesh is not None and mesh.filled else 0.0


def _flows(material: Material) -> bool:
    return isinstance(material, (Fluid, Sand, Snow))


def _filled_by(count: int, means: Array, size: float) -> float:
    """Most cells along a body of which no more than so many are occupied."""
    for cells in _STEPS:
        if size > 0 and int(occupied_cells(means, size / cells).max()) < count:
            return float(cells)
    return float(_FEWEST)
