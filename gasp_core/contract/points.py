"""The points an engine moves, the problem they are in, and what is read of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.forcing import DEFAULT_BODY_CONTACT, BodyContact, Collider, Domain, Drive, ForceField
from gasp_core.contract.materials import Material, Rigid
from gasp_core.contract.trajectories import Trajectories
from gasp_core.contract.validation import finite_vector, frozen_array
from gasp_core.errors import SceneError

__all__ = ["PointCloud", "PointProblem", "PointState"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointCloud:
    """The points an engine moves.

    Parameters
    ----------
    reference_positions : (N, 3) [m]
    initial_velocities : (N, 3) [m/s]
    reference_volumes : (N,) [m^3], > 0
    material_ids : (N,)
        Row of `PointProblem.materials`.
    body_ids : (N,)
        Which body a point belongs to, 0, 1, 2, ...
    tracer_positions : (M, 3) [m] or None
        Massless points carried along, for engines that declare `carries_tracers`.
    material_columns
        By name of a field of their materials, (N,) each: what a point has instead of its material's own number. For
        engines that declare the name; not finite where the material's own holds.

    Raises
    ------
    SceneError
        Where shapes disagree, a number is not finite (the first rows are named) or a volume is not > 0.
    """

    reference_positions: Array
    initial_velocities: Array
    reference_volumes: Array
    material_ids: Array
    body_ids: Array
    tracer_positions: Array | None = None
    material_columns: Mapping[str, Array] = field(default_factory=dict[str, Array])

    def __post_init__(self) -> None:
        count = len(frozen_array(self, "reference_positions", (None, 3), np.float64, what="point"))
        if count == 0:
            raise SceneError("PointCloud has no points: nothing is left to simulate")
        frozen_array(self, "initial_velocities", (count, 3), np.float64, what="point")
        volumes = frozen_array(self, "reference_volumes", (count,), np.float64, what="point")
        if not (volumes > 0).all():
            bad = np.flatnonzero(~(volumes > 0))
            raise SceneError(f"PointCloud.reference_volumes must be > 0, is not in {len(bad)} point(s), first {bad[0]}")
        frozen_array(self, "material_ids", (count,), np.int32, what="point")
        frozen_array(self, "body_ids", (count,), np.int32, what="point")
        if self.tracer_positions is not None:
            frozen_array(self, "tracer_positions", (None, 3), np.float64, what="tracer")
        object.__setattr__(
            self,
            "material_columns",
            {name: _column(name, values, count) for name, values in self.material_columns.items()},
        )

    def __len__(self) -> int:
        return int(self.reference_positions.shape[0])

    @property
    def size(self) -> float:
        """Longest side of the bounding box of the largest body [m]; 0 where every body is one place."""
        longest = 0.0
        for body in np.unique(self.body_ids):
            own = self.reference_positions[self.body_ids == body]
            longest = max(longest, float(np.ptp(own, axis=0).max()))
        return longest


@dataclass(frozen=True, slots=True, kw_only=True)
class PointProblem:
    """Everything an engine needs to know of a scene.

    Parameters
    ----------
    points
        What is moved.
    materials
        By their row, `PointCloud.material_ids`.
    colliders, drives, force_fields
        In the order in which they act.
    gravity
        [m/s^2].
    domain
        None: no edge, as with `DomainPolicy.EXPAND`.
    body_contact
        How bodies meet that have no contact of their own in `pair_contacts`. The default asks nothing of an engine: one
        that declares no `EngineCapabilities.body_contacts` lets them meet in its own way.
    pair_contacts
        How two bodies meet, by their numbers in `PointCloud.body_ids`, the lower one first.
    rigid_parts
        Rigid bodies that are parts of others that deform, numbers of both: what lies between them holds, however it is
        pulled. For engines that declare `EngineCapabilities.rigid_parts`.
    trajectories
        Of points that are led, for engines that declare `EngineCapabilities.trajectories`.
    hints
        What some engines can make use of and none has to: instances of classes that are no part of this contract, e.g.
        `gasp_core.stepping.grid.GridAnchor`. They decide nothing about the scene.

    Raises
    ------
    SceneError
        Where numbers of materials, bodies or points are none that there are.
    """

    points: PointCloud
    materials: tuple[Material, ...]
    colliders: tuple[Collider, ...] = ()
    drives: tuple[Drive, ...] = ()
    force_fields: tuple[ForceField, ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    domain: Domain | None = None
    body_contact: BodyContact = DEFAULT_BODY_CONTACT
    pair_contacts: Mapping[tuple[int, int], BodyContact] = field(default_factory=dict[tuple[int, int], BodyContact])
    rigid_parts: Mapping[int, int] = field(default_factory=dict[int, int])
    trajectories: Trajectories | None = None
    hints: tuple[object, ...] = ()

    def __post_init__(self) -> None:
        finite_vector(self, "gravity")
        ids = self.points.material_ids
        if ids.min() < 0 or ids.max() >= len(self.materials):
            raise SceneError(
                f"PointCloud.material_ids must be rows of the {len(self.materials)} materials,"
                f" found {int(ids.min())}..{int(ids.max())}"
            )
        bodies = int(self.points.body_ids.max()) + 1
        for low, high in self.pair_contacts:
            if not 0 <= low < high < bodies:
                raise SceneError(
                    f"PointProblem.pair_contacts: ({low}, {high}) must be two of the {bodies} bodies, the lower first"
                )
        for part, host in self.rigid_parts.items():
            self._check_part(part, host)
        if self.trajectories is not None and self.trajectories.rows[-1] >= len(ids):
            raise SceneError(
                f"Trajectories.rows must be rows of the {len(ids)} points, found {int(self.trajectories.rows[-1])}"
            )
        for name, column in self.points.material_columns.items():
            _check_column(name, column, ids, self.materials)

    def _check_part(self, part: int, host: int) -> None:
        is_rigid = np.array([isinstance(material, Rigid) for material in self.materials])[self.points.material_ids]
        own, others = (is_rigid[self.points.body_ids == body] for body in (part, host))
        if not (len(own) and own.all() and len(others) and not others.any()):
            raise SceneError(
                f"PointProblem.rigid_parts: body {part} of body {host} must be one that is rigid of one that deforms"
            )

    def contact_between(self, first: int, second: int) -> BodyContact:
        """How two bodies meet, by their numbers in either order."""
        return self.pair_contacts.get((min(first, second), max(first, second)), self.body_contact)

    @property
    def masses(self) -> Array:
        """Masses of the points, (N,) [kg]."""
        return self.material_values("density") * self.points.reference_volumes

    def material_values(self, name: str) -> Array:
        """A number of the points' materials, (N,): of each point's own column where it has one.

        Parameters
        ----------
        name
            A field that the materials of all points have, e.g. "density".
        """
        points = self.points
        used = np.unique(points.material_ids)
        table = np.zeros(len(self.materials))
        table[used] = [getattr(self.materials[row], name) for row in used]
        values = table[points.material_ids]
        own = points.material_columns.get(name)
        return values if own is None else np.where(np.isfinite(own), own, values)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointState:
    """What a session read out; fields that were not asked for are None, and arrays are read-only from then on.

    Parameters
    ----------
    time
        Of the state [s].
    positions : (N, 3) [m]
    velocities : (N, 3) [m/s] or None
    deformation_gradients : (N, 3, 3) or None
        Total or, for plastic materials, elastic.
    tracer_positions : (M, 3) [m] or None
    """

    time: float
    positions: Array
    velocities: Array | None = None
    deformation_gradients: Array | None = None
    tracer_positions: Array | None = None

    def __post_init__(self) -> None:
        for name in ("positions", "velocities", "deformation_gradients", "tracer_positions"):
            array = getattr(self, name)
            if array is not None:
                array.flags.writeable = False


def _column(name: str, values: Array, count: int) -> Array:
    """A column as owned, read-only float64 numbers."""
    column = np.array(values, dtype=np.float64)
    if column.shape != (count,):
        raise SceneError(f"PointCloud.material_columns: {name} must have shape ({count},), found {column.shape}")
    column.flags.writeable = False
    return column


def _check_column(name: str, column: Array, ids: Array, materials: tuple[Material, ...]) -> None:
    """Refuse numbers that no material could have, or of a field that it does not have."""
    own = np.isfinite(column)
    for row in np.unique(ids[own]):
        material = materials[row]
        if name not in [one.name for one in dataclasses.fields(material)]:
            raise SceneError(f"PointCloud.material_columns: {material.kind} has no {name}")
        rows = np.flatnonzero(own & (ids == row))
        # A material's bounds are intervals, so what its ends bear, all between them do.
        for at in (rows[np.argmin(column[rows])], rows[np.argmax(column[rows])]):
            try:
                dataclasses.replace(material, **{name: float(column[at])})
            except SceneError as error:
                raise SceneError(f"PointCloud.material_columns: {name} of point {at}: {error}") from None
