"""Colliders, winds and drives as rows of numbers, in the engine's units, and the distance fields that rows name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Drive,
    Driven,
    HalfSpace,
    PointProblem,
    Shape,
    Side,
    SignedDistanceField,
    SphereShape,
    Wind,
)
from gasp_core.stepping.forcing import pose_of_drive, walls_of
from gasp_core.stepping.rigid_motion import Pose, pose_of
from gasp_mpm_host import layout as at
from gasp_mpm_host.scaling import Units

__all__ = ["FieldTable", "Forcing", "collider_rows", "drive_rows", "wind_rows"]

Array = NDArray[Any]

_CONTACT = {
    ContactCondition.STICK: at.STICK,
    ContactCondition.SLIP: at.SLIP,
    ContactCondition.SEPARATE: at.SEPARATE,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldTable:
    """Distance fields one after the other.

    Parameters
    ----------
    numbers : (M,)
        Never empty: some kernels' arguments must not be.
    fields
        Those that are in it.
    begins
        Where each begins.
    """

    numbers: Array
    fields: tuple[SignedDistanceField, ...]
    begins: tuple[int, ...]

    @classmethod
    def of(cls, problem: PointProblem, units: Units) -> Self:
        """All that colliders, drives and winds of a problem name, each once."""
        regions = [one.region for one in (*problem.drives, *problem.force_fields)]
        fields: list[SignedDistanceField] = []
        for shape in [*(one.shape for one in problem.colliders), *regions]:
            if isinstance(shape, SignedDistanceField) and not any(shape is known for known in fields):
                fields.append(shape)
        parts = [
            np.concatenate([field.values.shape, field.values.reshape(-1).astype(np.float64) / units.spacing])
            for field in fields
        ]
        begins = np.cumsum([0, *(len(part) for part in parts)])[: len(fields)]
        return cls(
            numbers=np.concatenate([*parts, np.zeros(1)]),
            fields=tuple(fields),
            begins=tuple(int(begin) for begin in begins),
        )

    def begin_of(self, field: SignedDistanceField) -> int:
        """Where a field begins."""
        return next(begin for known, begin in zip(self.fields, self.begins) if known is field)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forcing:
    """What acts during a batch of steps.

    Parameters
    ----------
    colliders : (sets, K, `layout.COLLIDER_WIDTH`)
        A set for every step, or one for all of them.
    winds : (K, `layout.WIND_WIDTH`)
    drives : (steps, K, `layout.DRIVE_WIDTH`)
    holding : (K, B)
        1 where a drive holds a body, else 0.
    """

    colliders: Array
    winds: Array
    drives: Array
    holding: Array

    @classmethod
    def none(cls, steps: int) -> Self:
        """Where nothing acts."""
        return cls(
            colliders=np.zeros((1, 0, at.COLLIDER_WIDTH)),
            winds=np.zeros((0, at.WIND_WIDTH)),
            drives=np.zeros((steps, 0, at.DRIVE_WIDTH)),
            holding=np.zeros((0, 1)),
        )

    @property
    def holding_begin(self) -> int:
        """Where `holding` begins in `numbers`."""
        return self.colliders.size + self.winds.size + self.drives.size

    @property
    def numbers(self) -> Array:
        """All of it in this order, and one number more: arguments of kernels must not be empty."""
        parts = (self.colliders, self.winds, self.drives, self.holding)
        return np.concatenate([*(part.reshape(-1) for part in parts), np.zeros(1)])


def _fill_shape(row: Array, shape: Shape | None, units: Units, table: FieldTable) -> None:
    if shape is None:
        row[0] = at.EVERYWHERE
    elif isinstance(shape, HalfSpace):
        row[0] = at.PLANE
        row[1:4] = units.cells(shape.point)
        row[4:7] = shape.normal
    elif isinstance(shape, BoxShape):
        row[0] = at.BOX
        row[1:4] = units.cells(shape.center)
        row[4:7] = np.asarray(shape.half_extents) / units.spacing
    elif isinstance(shape, SignedDistanceField):
        row[0] = at.FIELD
        row[1:4] = units.cells(shape.origin)
        row[4] = shape.spacing / units.spacing
        row[5] = table.begin_of(shape)
    else:
        assert isinstance(shape, SphereShape), shape  # no other kind is declared
        row[0] = at.SPHERE
        row[1:4] = units.cells(shape.center)
        row[4] = shape.radius / units.spacing


def collider_rows(colliders: tuple[Collider, ...], time: float, step: float, units: Units, table: FieldTable) -> Array:
    """Rows (K, `layout.COLLIDER_WIDTH`) for a step [s] from `time` [s] on; a container with flat sides is as many as it
    has sides."""
    walls = [wall for collider in colliders for wall in walls_of(collider)]
    rows = np.zeros((len(walls), at.COLLIDER_WIDTH))
    for row, wall in zip(rows, walls):
        _fill_shape(row, wall.shape, units, table)
        row[8] = _CONTACT[wall.contact]
        row[9] = wall.friction
        row[10] = 1.0 if wall.side is Side.OUTSIDE else -1.0
        if wall.motion is not None:
            row[11] = 1.0
            _fill_pose(row[12:34], pose_of(wall.motion, time).during(step), units)
    return rows


def wind_rows(winds: Sequence[Wind], step: float, units: Units, table: FieldTable) -> Array:
    """Rows (K, `layout.WIND_WIDTH`) for steps of `step` [s]."""
    rows = np.zeros((len(winds), at.WIND_WIDTH))
    for row, wind in zip(rows, winds):
        _fill_shape(row, wind.region, units, table)
        row[8:11] = np.asarray(wind.velocity) / units.speed
        row[11] = wind.drag * step
    return rows


def drive_rows(drives: Sequence[Drive], time: float, step: float, units: Units, table: FieldTable) -> Array:
    """Rows (K, `layout.DRIVE_WIDTH`) of where the drives' regions are at `time` [s] and how they move in a step [s]."""
    rows = np.zeros((len(drives), at.DRIVE_WIDTH))
    for row, drive in zip(rows, drives):
        _fill_shape(row, drive.region, units, table)
        row[14:23] = np.eye(3).reshape(-1)
        if isinstance(drive, Driven):
            _fill_pose(row[8:30], pose_of_drive(drive, time).during(step), units)
    return rows


def _fill_pose(row: Array, pose: Pose, units: Units) -> None:
    """Centre, where it is now, transposed rotation (9), velocity, angular velocity, how much goes inward."""
    row[:3] = units.cells(pose.center)
    row[3:6] = units.cells(pose.place)
    row[6:15] = pose.rotation.T.reshape(-1)
    row[15:18] = pose.velocity / units.speed
    row[18:21] = pose.angular_velocity * units.time
    row[21] = pose.inward / units.time
