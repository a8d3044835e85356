"""The contract between GASP and an engine: plain data in, positions out, nothing shared.

SI units, right-handed axes, +z up. Arrays are owned by whoever receives them and read-only, rows stay in the order
in which they were given. A plugin registers `EngineDescriptor`s (see `gasp_core.engine.hookspecs`); the core opens
the `PointEngine` behind one when a scene needs it, and never before.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.checks import finite, finite_vector, frozen_array
from gasp_core.engine.forcing import Collider, ContactCondition, Domain, DomainPolicy, Drive, ForceField
from gasp_core.engine.materials import Material
from gasp_core.errors import SceneError

__all__ = [
    "CONTRACT_VERSION",
    "Determinism",
    "EngineAccuracy",
    "EngineCapabilities",
    "EngineDescriptor",
    "EngineEnvironment",
    "EngineSession",
    "Field",
    "PointCloud",
    "PointEngine",
    "PointProblem",
    "PointState",
    "Precision",
    "Quantity",
    "Status",
    "StepReport",
]

Array = NDArray[Any]

CONTRACT_VERSION = (1, 0)
"""Major, minor. A minor step adds what may be left out; a plugin of another major is refused at discovery."""


class Field(Enum):
    """What a session can be asked for. Positions are never optional."""

    POSITIONS = "positions"
    """(N, 3) [m]"""
    VELOCITIES = "velocities"
    """(N, 3) [m/s]"""
    DEFORMATION_GRADIENTS = "deformation_gradients"
    """(N, 3, 3), total or, for plastic materials, elastic"""
    TRACER_POSITIONS = "tracer_positions"
    """(M, 3) [m]"""


class Precision(Enum):
    """Floating-point format of the engine's state."""

    FLOAT32 = "float32"
    FLOAT64 = "float64"


class Quantity(Enum):
    """What an engine conserves in the absence of anything that would change it."""

    MASS = "mass"
    LINEAR_MOMENTUM = "linear_momentum"
    ANGULAR_MOMENTUM = "angular_momentum"


class Determinism(Enum):
    """How far a second run with the same input agrees."""

    BITWISE = "bitwise"
    """On the same machine with the same number of threads."""
    TOLERANCE = "tolerance"
    """Up to rounding."""


class Status(Enum):
    """Verdict on an advance. Anything but OK ends the run."""

    OK = "ok"
    NON_FINITE = "non_finite"
    ENERGY_GREW = "energy_grew"
    OUT_OF_DOMAIN = "out_of_domain"
    NOT_CONVERGED = "not_converged"
    SUBSTEP_LIMIT = "substep_limit"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReport:
    """What an advance did.

    Parameters
    ----------
    status
        Verdict.
    substep_count, smallest_substep, largest_substep
        Number and sizes [s] of the steps taken.
    warnings
        One sentence each, for the user; also the reason where `status` is not OK.
    """

    status: Status
    substep_count: int
    smallest_substep: float
    largest_substep: float
    warnings: tuple[str, ...] = ()


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
    """Everything an engine needs to know of a scene."""

    points: PointCloud
    materials: tuple[Material, ...]
    colliders: tuple[Collider, ...] = ()
    drives: tuple[Drive, ...] = ()
    force_fields: tuple[ForceField, ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    domain: Domain | None = None
    """None: no edge, as with `DomainPolicy.EXPAND`."""
    grid_anchor: tuple[float, float, float] | None = None
    """A place [m] that an engine lays its grid out from, `gasp_core.engine.lattice.grid_node`; None: the middle of the
    points. Few points that stand for much matter reach less far than it does: laid out from them, the grid would lie
    elsewhere for each choice of them."""

    def __post_init__(self) -> None:
        finite_vector(self, "gravity")
        if self.grid_anchor is not None:
            finite_vector(self, "grid_anchor")
        ids = self.points.material_ids
        if ids.min() < 0 or ids.max() >= len(self.materials):
            raise SceneError(
                f"PointCloud.material_ids must be rows of the {len(self.materials)} materials,"
                f" found {int(ids.min())}..{int(ids.max())}"
            )

    @property
    def masses(self) -> Array:
        """Masses of the points, (N,) [kg]."""
        densities = np.array([material.density for material in self.materials])
        return densities[self.points.material_ids] * self.points.reference_volumes


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineAccuracy:
    """The knobs every engine understands.

    Parameters
    ----------
    resolution
        Grid cells (or elements) along the longest side of the largest body.
    substep_fraction
        Of the stable bound the engine computes, in (0, 1].
    substep
        A fixed step [s] instead; refused by the engine if above its bound.
    solver_tolerance
        Relative, for engines that iterate.
    substep_limit
        Largest number of substeps for one frame: what would cost more ends with `Status.SUBSTEP_LIMIT`.
    spacing
        Grid spacing [m] instead of `resolution`: two runs compared at one spacing, a scene of one point.
    """

    resolution: int = 64
    substep_fraction: float = 0.5
    substep: float | None = None
    solver_tolerance: float = 1e-6
    substep_limit: int = 20_000
    spacing: float | None = None

    def __post_init__(self) -> None:
        finite(self, "resolution", low=2, high=4096)
        finite(self, "substep_fraction", low=0.0, high=1.0, open_low=True)
        finite(self, "solver_tolerance", low=0.0, high=1.0, open_low=True)
        finite(self, "substep_limit", low=1)
        for name in ("substep", "spacing"):
            if getattr(self, name) is not None:
                finite(self, name, low=0.0, open_low=True)

    def spacing_for(self, size: float | PointCloud) -> float:
        """Grid spacing [m] for matter of this size [m], `PointCloud.size`: `spacing`, or the size over `resolution`.

        A cloud instead of its size is deprecated.
        """
        if isinstance(size, PointCloud):
            warnings.warn(
                "EngineAccuracy.spacing_for wants a size: give it points.size", DeprecationWarning, stacklevel=2
            )
            size = size.size
        if self.spacing is not None:
            return self.spacing
        # One place has no size to resolve; any spacing serves a body that only flies.
        return size / self.resolution if size > 0 else 1.0 / self.resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class PointState:
    """What a session read out; fields that were not asked for are None."""

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


class EngineSession(Protocol):
    """A running simulation. A context manager; owns its memory."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s]; the substeps are the engine's business.

        Advancing to the present does nothing, in no substeps.

        Raises
        ------
        ValueError
            Where `time` is before the session's, or not finite. The session stays as it is and can go on.
        """
        ...

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields: owned, read-only, float64 host arrays, in the order given."""
        ...

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything `open(..., restart=...)` needs to go on as if nothing had happened, where declared."""
        ...

    def close(self) -> None:
        """Release everything; may be called twice. Whatever is asked of a closed session then raises ValueError."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...


class PointEngine(Protocol):
    """A black box that moves points."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any,
        restart: Mapping[str, Array] | None = None,
    ) -> EngineSession:
        """Set a problem up.

        Parameters
        ----------
        problem
            The scene as points; checked against the declared capabilities already.
        device
            One of `EngineCapabilities.devices`.
        precision
            One of `EngineCapabilities.precisions`.
        seed
            For whatever the engine draws at random.
        accuracy
            The common knobs.
        options
            An instance of the engine's own `EngineDescriptor.options`; None where it has none.
        restart
            A checkpoint of a session of the same problem.

        Raises
        ------
        SceneError
            Where the problem cannot be set up, e.g. a substep above the stable bound.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineCapabilities:
    """What an engine can do. What is not declared is refused by the core before the engine is opened.

    Parameters
    ----------
    determinism
        How far a second run agrees on the first of `devices`; on any other it is `Determinism.TOLERANCE`.
    temporal_order
        Order of convergence under joint refinement of grid and substep for smooth motion.
    iterates
        Whether steps are solved by iteration, to `EngineAccuracy.solver_tolerance`: two runs that are one on paper may
        then part by that much a step, and not by rounding alone.
    """

    materials: frozenset[type[Material]]
    collider_shapes: frozenset[type]
    contact_conditions: frozenset[ContactCondition]
    drives: frozenset[type[Drive]]
    force_fields: frozenset[type[ForceField]]
    output_fields: frozenset[Field]
    conserved: frozenset[Quantity]
    devices: tuple[str, ...]
    """In order of preference; the first is the default."""
    precisions: tuple[Precision, ...]
    """In order of preference; the first is the default."""
    determinism: Determinism
    domain_policies: frozenset[DomainPolicy] = frozenset({DomainPolicy.EXPAND})
    temporal_order: float = 1.0
    iterates: bool = False
    carries_tracers: bool = False
    checkpoints: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineEnvironment:
    """An environment of an engine's own: what to install, and under which Python.

    The plugin's own package and GASP's contract are lent to it and not installed there.

    Parameters
    ----------
    python
        A version, "3.11" for any 3.11, or a range, ">=3.11,<3.14"; 3.11 is the oldest the contract runs under.
    packages
        As pip takes them: "bpy==4.5.15", "numpy<2".
    """

    python: str
    packages: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineDescriptor:
    """An engine as its plugin registers it; building one imports no backend.

    Parameters
    ----------
    name
        As users write it, e.g. "taichi-mpm".
    summary
        One line for `gasp engines`.
    contract_version
        The plugin's own copy of the number it was written against, not `CONTRACT_VERSION` imported.
    capabilities
        What it can do.
    factory
        "package.module:Callable" that returns a `PointEngine`, imported when the engine is opened.
    options
        A dataclass of what only this engine has, with defaults that work; None for nothing.
    environment
        What the engine needs where its dependencies cannot live in this environment: it is then run in a process of
        that one.
    """

    name: str
    summary: str
    contract_version: tuple[int, int]
    capabilities: EngineCapabilities
    factory: str
    options: type[Any] | None = None
    environment: EngineEnvironment | None = None

    def option_names(self) -> Sequence[str]:
        """Names of the engine's own options."""
        return [] if self.options is None else [option.name for option in dataclasses.fields(self.options)]
