"""What of a scene is possible and probably not what was meant: told before it runs, and not refused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gasp_core.contract import Collider, Drive, ForceField, PointProblem, Side, SignedDistanceField
from gasp_core.reduction.assembly import Assembly
from gasp_core.scene.selection import PlacedObject

__all__ = ["oddities"]

_LIGHTEST, _HEAVIEST = 5.0, 25_000.0
"""[kg/m^3]: of the lightest foam, and beyond osmium."""
_SMALLEST, _LARGEST = 1e-3, 100.0
"""[m]: of what one captures."""


def oddities(objects: Sequence[PlacedObject], assembly: Assembly) -> Iterator[str]:
    """A sentence for each.

    Parameters
    ----------
    objects
        All of the scene, placed.
    assembly
        What an engine is given.
    """
    problem = assembly.problem
    for placed in objects:
        yield from (f'object "{placed.item.name}": {sentence}' for sentence in _of_object(placed))
    for name, collider in zip(assembly.colliders, problem.colliders):
        yield from _of_collider(name, collider, assembly.spacing)
    for kind, acting in (("drive", problem.drives), ("wind", problem.force_fields)):
        for number, each in enumerate(acting, start=1):
            yield from _of_region(f"{kind} {number}" + (f" ({each.kind})" if kind == "drive" else ""), each, problem)


def _of_collider(name: str, collider: Collider, spacing: float) -> Iterator[str]:
    """A sentence where a body that stands still is thinner than what an engine's grid sees."""
    shape = collider.shape
    if isinstance(shape, SignedDistanceField) and collider.side is Side.OUTSIDE:
        thickness = -2 * float(shape.values.min())
        if thickness < spacing:
            yield (
                f"{name}: is nowhere thicker than {thickness:.3g} m, less than a cell of {spacing:.3g} m:"
                " matter may pass through it, raise the resolution"
            )


def _of_object(placed: PlacedObject) -> Iterator[str]:
    if placed.item.static and placed.item.collider is None:
        yield "is drawn only, nothing collides with it (collider = true: everything that moves does)"
    material, means = placed.item.material, placed.gaussians.means[~placed.floating]
    if material is not None and not _LIGHTEST <= material.density <= _HEAVIEST:
        what = "less than any solid's or liquid's" if material.density < _LIGHTEST else "more than any metal's"
        yield f"its density of {material.density:g} kg/m^3 is {what}: water has 1000"
    size = float(np.ptp(means, axis=0).max()) if len(means) > 1 else 0.0
    if size > _LARGEST or 0 < size < _SMALLEST:
        said = placed.item.height is not None or placed.item.metres_per_unit is not None
        advice = "lengths are in metres" if said else "say its height; a unit of the file is a metre otherwise"
        yield f"it is {size:.3g} m long: {advice}"


def _of_region(name: str, acting: Drive | ForceField, problem: PointProblem) -> Iterator[str]:
    if acting.region is None or acting.start > 0:
        return
    distance = float(acting.region.signed_distance(problem.points.reference_positions).min())
    if distance > 0:
        yield (
            f"{name}: its region holds nothing at the start, the nearest matter is {distance:.3g} m off:"
            " gasp inspect FILE --height shows where things are (world coordinates, metres, +z up)"
        )
