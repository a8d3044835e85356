"""What an engine's author sees: plain data in, positions out, nothing shared.

SI units, right-handed axes, +z up. Arrays are owned by whoever receives them and read-only, rows stay in the order in
which they were given. A plugin registers `EngineDescriptor`s (see `gasp_core.discovery.hookspecs`); the core opens the
`PointEngine` behind one when a scene needs it, and never before.

These names are the public interface. Nothing here imports more than NumPy.
"""

from __future__ import annotations

from gasp_core.contract.accuracy import EngineAccuracy
from gasp_core.contract.descriptor import CONTRACT_VERSION, EngineCapabilities, EngineDescriptor, EngineEnvironment
from gasp_core.contract.distance_field import SignedDistanceField
from gasp_core.contract.fields import Determinism, Field, Precision, Quantity, device_class, device_index
from gasp_core.contract.forcing import (
    DEFAULT_BODY_CONTACT,
    BodyContact,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Drive,
    Driven,
    ForceField,
    Impulse,
    Pinned,
    Side,
    Wind,
)
from gasp_core.contract.friction_cone import FrictionCone
from gasp_core.contract.materials import (
    MATERIALS,
    Elastic,
    Fluid,
    Foam,
    Material,
    Metal,
    NeoHookean,
    Plasticine,
    Rigid,
    Sand,
    Snow,
)
from gasp_core.contract.points import PointCloud, PointProblem, PointState
from gasp_core.contract.protocols import EngineSession, PointEngine, ViewingSession
from gasp_core.contract.report import Status, StepReport
from gasp_core.contract.rigid_motion import KeyframedMotion, RigidMotion, SteadyMotion
from gasp_core.contract.shapes import SHAPES, BoxShape, HalfSpace, Shape, SphereShape, Vector
from gasp_core.contract.trajectories import Trajectories

__all__ = [
    "BodyContact",
    "BoxShape",
    "CONTRACT_VERSION",
    "Collider",
    "DEFAULT_BODY_CONTACT",
    "ContactCondition",
    "Determinism",
    "Domain",
    "DomainPolicy",
    "Drive",
    "Driven",
    "Elastic",
    "EngineAccuracy",
    "EngineCapabilities",
    "EngineDescriptor",
    "EngineEnvironment",
    "EngineSession",
    "Field",
    "Fluid",
    "Foam",
    "FrictionCone",
    "ForceField",
    "HalfSpace",
    "Impulse",
    "MATERIALS",
    "KeyframedMotion",
    "Material",
    "Metal",
    "NeoHookean",
    "Pinned",
    "Plasticine",
    "PointCloud",
    "PointEngine",
    "PointProblem",
    "PointState",
    "Precision",
    "Quantity",
    "Rigid",
    "RigidMotion",
    "SHAPES",
    "Sand",
    "Shape",
    "Side",
    "SignedDistanceField",
    "Snow",
    "SphereShape",
    "Status",
    "SteadyMotion",
    "StepReport",
    "Trajectories",
    "Vector",
    "ViewingSession",
    "Wind",
    "device_class",
    "device_index",
]
