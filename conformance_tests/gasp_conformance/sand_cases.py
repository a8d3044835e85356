"""Sand that runs out into a heap, and sand on a slope."""

from __future__ import annotations

import math

import numpy as np

from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import Subject
from gasp_conformance.wall_cases import floor_of
from gasp_core.contract import Collider, ContactCondition, EngineAccuracy, HalfSpace, PointProblem, Sand

__all__ = ["GRAVITY", "LAYER_DEPTH", "LAYER_LENGTH", "heap_stops", "layer_on_slope"]

GRAVITY = 9.81
LAYER_DEPTH = 0.2
LAYER_LENGTH = 1.6
"""[m], of the layer on a slope."""


def heap_stops(subject: Subject, material: Sand) -> tuple[float, float]:
    """A block of sand, let go on a floor with friction, twice as high as half its side, looked at after 0.8 s.

    Returns
    -------
    Mean speed over that of a fall from its height; and how far its farthest percent has run beyond where it stood, over
    half its side.
    """
    spacing, cells = 0.05, 6
    block = box_of_points((0.013, 0.021, 0.0), (cells, cells, cells), spacing)
    problem = PointProblem(
        points=cloud_of([block], [(0.0, 0.0, 0.0)], spacing),
        materials=(material,),
        colliders=(Collider(shape=floor_of(subject), friction=0.6),),
    )
    before, after = subject.states(problem, EngineAccuracy(spacing=spacing), [0.75, 0.8])
    height = half = cells * spacing
    speed = float(np.linalg.norm(after.positions - before.positions, axis=1).mean()) / 0.05
    away = np.abs(after.positions[:, :2] - block[:, :2].mean(axis=0)).max(axis=1)
    return speed / math.sqrt(2 * GRAVITY * height), float(np.quantile(away, 0.99)) / (half / 2) - 1


def layer_on_slope(subject: Subject, material: Sand, slope: float) -> float:
    """Way down a rough slope, `slope` in degrees, of the top of a layer of sand, over that of a block without friction.

    The layer is two cells thick between frictionless walls; its crumbling ends are left out.
    """
    spacing, width, time, tilt = LAYER_DEPTH / 2, 3, 0.5, math.radians(slope)
    length = round(LAYER_LENGTH / spacing)
    layer = box_of_points((0.0, 0.0, 0.0), (length, width, 2), spacing)
    walls = [((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)), ((0.0, width * spacing, 0.0), (0.0, -1.0, 0.0))]
    floor = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    problem = PointProblem(
        points=cloud_of([layer], [np.zeros(3)], spacing),
        materials=(material,),
        colliders=(
            Collider(shape=floor, contact=ContactCondition.STICK),
            *(
                Collider(shape=HalfSpace(point=point, normal=normal), contact=ContactCondition.SLIP)
                for point, normal in walls
            ),
        ),
        gravity=(GRAVITY * math.sin(tilt), 0.0, -GRAVITY * math.cos(tilt)),
    )
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [time])
    middle = np.abs(layer[:, 0] - LAYER_LENGTH / 2) < LAYER_LENGTH / 4
    top = layer[:, 2] > spacing
    way = float((state.positions - layer)[middle & top, 0].mean())
    return way / (GRAVITY * math.sin(tilt) * time**2 / 2)
