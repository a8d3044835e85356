"""What a plugin says of its engine before anybody opens it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from gasp_core.contract.fields import Determinism, Field, Precision, Quantity, device_class, device_index
from gasp_core.contract.forcing import ContactCondition, DomainPolicy, Drive, ForceField
from gasp_core.contract.materials import Material
from gasp_core.contract.shapes import BoxShape, HalfSpace, Shape, SphereShape

__all__ = ["CONTRACT_VERSION", "EngineCapabilities", "EngineDescriptor", "EngineEnvironment"]

Array = NDArray[Any]


CONTRACT_VERSION = (1, 6)
"""Of engines, major and minor; renderers and commands have numbers of their own in `gasp_core.discovery.hookspecs`.

A minor step adds what may be left out; a plugin of another major is refused at discovery. docs/compatibility.md says
what each has brought.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineCapabilities:
    """What an engine can do. What is not declared is refused by the core before the engine is opened.

    Parameters
    ----------
    materials
        Classes of materials that it models.
    collider_shapes, contact_conditions
        Shapes that colliders may have, and what may happen where matter touches one.
    drives, force_fields
        Classes of drives and of force fields that it applies.
    output_fields
        What a session can be asked for; positions always, named or not.
    conserved
        What it keeps in the absence of anything that would change it: the suite measures it.
    devices, precisions
        In order of preference; the first is the default.
    domain_policies
        What may become of points that reach the edge of a domain; `DomainPolicy.EXPAND` asks nothing of an engine.
    carries_tracers
        Whether `PointCloud.tracer_positions` may be given, and `Field.TRACER_POSITIONS` be asked for.
    checkpoints
        Whether sessions write checkpoints, and begin from one: a run that was stopped goes on then.
    body_contacts
        What may happen where two bodies touch, with friction where they separate; one for all pairs.
    bodies_meet
        Whether bodies meet at all, in whatever way; False: they pass through each other, and users are told so.
    pair_contacts
        Whether every pair of bodies may have a contact of its own.
    moving_colliders
        Whether colliders may move, as their `Collider.motion` says.
    restitution
        Whether rigid bodies bounce as their `Rigid.restitution` says.
    rigid_parts
        Whether rigid bodies may be parts of others that deform, as `PointProblem.rigid_parts` says.
    material_damping
        Whether elastic matter is damped as its `mass_damping` and `stiffness_damping` say.
    cohesion
        Whether sand coheres as its `Sand.cohesion` says.
    trajectories
        Whether some points may be led, as `PointProblem.trajectories` says.
    region_shapes
        Of regions in which a drive or a force field acts.
    device_indices
        Whether one of several devices of a class can be named, "cuda:1".
    material_columns
        Names of material fields that may vary from point to point, see `PointCloud.material_columns`. No scene of GASP
        asks for any: what varies there is given as so many materials.
    views
        Fields that a session also hands out on the device, see `ViewingSession`.
    determinism
        How far a second run agrees on the first of `devices`; on any other it is `Determinism.TOLERANCE`.
    temporal_order
        Order of convergence under joint refinement of grid and substep for smooth motion.
    iterates
        Whether steps are solved by iteration, to `EngineAccuracy.solver_tolerance`: two runs that are one on paper may
        then part by that much a step, and not by rounding alone.
    unconditionally_stable
        Whether no substep is too long for stability, so that a fixed one is never refused; its error is another matter.
    stable_step
        Largest stable step [s] of matter at rest and undeformed, of its material and the grid spacing [m], where the
        engine steps explicitly and takes `EngineAccuracy.substep_fraction` of it: a scene of which a frame would need
        more than `substep_limit` is then refused before the engine is opened. None: it is not told.
    damping
        Rate [1/s] at which the engine lets vibrations decay, at most, that nothing in the scene damps; 0: it does not
        mean to. What materials say is no part of it.
    """

    materials: frozenset[type[Material]]
    collider_shapes: frozenset[type[Shape]]
    contact_conditions: frozenset[ContactCondition]
    drives: frozenset[type[Drive]]
    force_fields: frozenset[type[ForceField]]
    output_fields: frozenset[Field]
    conserved: frozenset[Quantity]
    devices: tuple[str, ...]
    precisions: tuple[Precision, ...]
    determinism: Determinism
    domain_policies: frozenset[DomainPolicy] = frozenset({DomainPolicy.EXPAND})
    temporal_order: float = 1.0
    iterates: bool = False
    carries_tracers: bool = False
    checkpoints: bool = False
    body_contacts: frozenset[ContactCondition] = frozenset()
    bodies_meet: bool = True
    pair_contacts: bool = False
    moving_colliders: bool = False
    restitution: bool = False
    rigid_parts: bool = False
    material_damping: bool = False
    cohesion: bool = False
    trajectories: bool = False
    region_shapes: frozenset[type[Shape]] = frozenset({HalfSpace, BoxShape, SphereShape})
    device_indices: bool = False
    material_columns: frozenset[str] = frozenset()
    views: frozenset[Field] = frozenset()
    unconditionally_stable: bool = False
    stable_step: Callable[[Material, float], float] | None = None
    damping: float = 0.0

    def runs_on(self, device: str) -> bool:
        """Whether this is one of `devices`, or one of a class of them, "cuda:1", where that can be told apart."""
        return device in self.devices or (
            self.device_indices and device_class(device) in self.devices and device_index(device) is not None
        )


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
