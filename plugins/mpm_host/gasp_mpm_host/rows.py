"""Between the scene's points and the rows the kernels work on: what a session starts from, goes on from and gives back.

Host memory and NumPy alone: whatever compiles the kernels, the rows are the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_mpm_host import layout as at
from gasp_mpm_host.scaling import Units

__all__ = ["DAMAGED", "Rows", "Survey"]

Array = NDArray[Any]

DAMAGED = "it is damaged; start without it"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Points as rows, in the engine's units and its own order.

    Parameters
    ----------
    cells : (N, 3) float64
        Positions; of a cloud, those on its grid, where bodies have their stands (`gasp_mpm_host.bodies`).
    points : (N, `layout.POINT_WIDTH`) float32 or float64
    labels : (N, `layout.LABEL_WIDTH`) int32
    ids : (N,) int32
        Which of the scene's points each row is.
    """

    cells: Array
    points: Array
    labels: Array
    ids: Array

    @classmethod
    def at_rest(cls, problem: PointProblem, units: Units, real: Any) -> Self:
        """Undeformed points in the order given, their homes not yet known, the affine velocities zero."""
        cloud = problem.points
        points = np.zeros((len(cloud), at.POINT_WIDTH), dtype=real)
        points[:, at.VELOCITY : at.VELOCITY + 3] = cloud.initial_velocities / units.speed
        points[:, at.MASS] = problem.masses / units.mass
        points[:, at.HALF_SIDE] = 0.5 * np.cbrt(cloud.reference_volumes) / units.spacing
        labels = np.zeros((len(cloud), at.LABEL_WIDTH), dtype=np.int32)
        labels[:, at.MATERIAL] = cloud.material_ids
        ids = np.arange(len(cloud), dtype=np.int32)
        return cls(cells=units.cells(cloud.reference_positions), points=points, labels=labels, ids=ids)

    @classmethod
    def restored(cls, checkpoint: Mapping[str, Array], materials: Array, real: Any, engine: str) -> Self:
        """Rows as `checkpoint` kept them, of points that are made of `materials` (N,).

        Raises
        ------
        SceneError
            Where the checkpoint is of another number of points, another layout or another precision; and where it says
            what no run has written: kernels trust its numbers of points, materials and cells.
        """
        count = len(materials)
        shapes: dict[str, tuple[int, ...]] = {
            "cells": (count, 3),
            "rows": (count, at.POINT_WIDTH),
            "labels": (count, at.LABEL_WIDTH),
            "ids": (count,),
            "layout": (),
        }
        arrays = checkpoint_arrays(checkpoint, shapes, engine)
        layout, kept = int(arrays["layout"]), arrays["rows"].dtype
        if layout != at.LAYOUT:
            raise SceneError(
                f"{engine}: the checkpoint has layout {layout}, this version reads {at.LAYOUT}: go on with the"
                " version that wrote it, or start without it"
            )
        if kept != real:
            raise SceneError(
                f"{engine}: the checkpoint holds {kept}, the session was opened in {np.dtype(real)}: resume with the"
                " precision the run was started with"
            )
        rows = cls(
            cells=arrays["cells"].astype(np.float64),
            points=arrays["rows"],
            labels=arrays["labels"].astype(np.int32),
            ids=arrays["ids"].astype(np.int32),
        )
        drift = rows.cells - 0.5 - rows.labels[:, at.HOME : at.HOME + 3]
        if not np.array_equal(np.sort(rows.ids), np.arange(count)):
            raise SceneError(f"{engine}: the checkpoint does not name every point once: {DAMAGED}")
        if not np.array_equal(rows.labels[:, at.MATERIAL], materials[rows.ids]):
            raise SceneError(
                f"{engine}: the checkpoint's points are made of other materials than the scene's: {DAMAGED}"
            )
        if not ((drift >= -1) & (drift < 2)).all():
            raise SceneError(f"{engine}: the checkpoint's points are not where its cells are: {DAMAGED}")
        return rows

    def checkpoint(self) -> dict[str, Array]:
        """Copies of everything, so that a run that goes on from them is equal bit for bit."""
        return {
            "cells": self.cells.copy(),
            "rows": self.points.copy(),
            "labels": self.labels.copy(),
            "ids": self.ids.copy(),
            "layout": np.array(at.LAYOUT),
        }

    def _given(self, values: Array) -> Array:
        """Values of rows in the order in which the points were given, owned, float64."""
        given = np.empty(values.shape, dtype=np.float64)
        given[self.ids] = values
        return given

    def velocities(self, units: Units) -> Array:
        """(N, 3) [m/s], in the given order."""
        return self._given(self.points[:, at.VELOCITY : at.VELOCITY + 3].astype(np.float64) * units.speed)

    def deformation_gradients(self, fluids: Array) -> Array:
        """(N, 3, 3), in the given order; J^(1/3) I where `fluids`, by material, says that it is one."""
        first = at.DISPLACEMENT_GRADIENT
        found = self.points[:, first : first + 9].astype(np.float64).reshape(-1, 3, 3) + np.eye(3)
        fluid = fluids[self.labels[:, at.MATERIAL]]
        gains = self.points[fluid, at.HISTORY].astype(np.float64)
        found[fluid] = np.cbrt(1 + gains)[:, None, None] * np.eye(3)
        return self._given(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What the next step depends on, in SI units.

    Parameters
    ----------
    finite
        Whether every velocity, position and deformation gradient is.
    stress
        Smallest stable step at the points' present stretch [s].
    speed, velocity_gradient
        Largest |v| [m/s] and |C| [1/s].
    inverted
        Points whose deformation gradient has a determinant <= 0.
    crushed
        Elastic points at `gasp_core.stepping.session.CRUSHED_VOLUME` or below.
    low, high : (3,) [m]
        The points' bounding box.
    drift
        How far a point is outside its home, along one axis [cells].
    """

    finite: bool
    stress: float
    speed: float
    velocity_gradient: float
    inverted: int
    crushed: int
    low: Array
    high: Array
    drift: float

    @classmethod
    def of(cls, chart: Array, units: Units) -> Self:
        """The survey of all points from those of their chunks, (K, `layout.SURVEY_WIDTH`)."""
        stiffness, speed, gradient = (
            float(chart[:, column].max()) for column in (at.SURVEY_STIFFNESS, at.SURVEY_SPEED, at.SURVEY_GRADIENT)
        )
        return cls(
            # Chunks report maxima of finite points alone; an overflow of the maxima themselves is not finite either.
            finite=not chart[:, at.SURVEY_BAD].any() and bool(np.isfinite(chart).all()),
            stress=stiffness**-0.5 if stiffness > 0 else math.inf,
            speed=math.sqrt(speed) * units.speed,
            velocity_gradient=math.sqrt(gradient) / units.time,
            inverted=int(chart[:, at.SURVEY_INVERTED].sum()),
            crushed=int(chart[:, at.SURVEY_CRUSHED].sum()),
            low=units.world(chart[:, at.SURVEY_LOW : at.SURVEY_LOW + 3].min(axis=0)),
            high=units.world(chart[:, at.SURVEY_HIGH : at.SURVEY_HIGH + 3].max(axis=0)),
            drift=float(chart[:, at.SURVEY_DRIFT].max()),
        )
