"""What acts on points besides their own stress: colliders, drives, force fields, the domain's edge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from gasp_core.contract.rigid_motion import KeyframedMotion, RigidMotion, SteadyMotion
from gasp_core.contract.shapes import HalfSpace, Shape, Vector
from gasp_core.contract.validation import finite, finite_vector, instance, member
from gasp_core.errors import SceneError

__all__ = [
    "DEFAULT_BODY_CONTACT",
    "BodyContact",
    "Collider",
    "ContactCondition",
    "Domain",
    "DomainPolicy",
    "Drive",
    "Driven",
    "ForceField",
    "Impulse",
    "Pinned",
    "Side",
    "Wind",
    "check_friction",
]


class ContactCondition(Enum):
    """What a collider does to the velocity of matter that touches it.

    Attributes
    ----------
    STICK
        The matter takes the collider's velocity.
    SLIP
        No velocity through the surface, either way; free along it.
    SEPARATE
        No velocity into the surface, free to leave, Coulomb friction along it.
    """

    STICK = "stick"
    SLIP = "slip"
    SEPARATE = "separate"


class Side(Enum):
    """On which side of its surface a collider lets matter be.

    Attributes
    ----------
    OUTSIDE
        An obstacle: matter stays out of the shape.
    INSIDE
        A container: matter stays within the shape.
    """

    OUTSIDE = "outside"
    INSIDE = "inside"


@dataclass(frozen=True, slots=True, kw_only=True)
class Collider:
    """A body that matter cannot enter (or leave, with `Side.INSIDE`), and that nothing moves but what is prescribed.

    Parameters
    ----------
    shape
        `HalfSpace`, `BoxShape`, `SphereShape` or `SignedDistanceField`.
    contact
        What happens on touching.
    friction
        Coulomb's coefficient, >= 0; only `ContactCondition.SEPARATE` may have one > 0.
    side
        Where matter may be.
    motion
        How it moves, for engines that declare `moving_colliders`; None: it stands.
    """

    shape: Shape
    contact: ContactCondition = ContactCondition.SEPARATE
    friction: float = 0.0
    side: Side = Side.OUTSIDE
    motion: RigidMotion | None = None

    def __post_init__(self) -> None:
        if not hasattr(self.shape, "signed_distance") and not hasattr(self.shape, "resolve"):
            raise SceneError(f"Collider.shape must be a shape, found {type(self.shape).__name__}")
        member(self, "side", Side)
        instance(self, "motion", SteadyMotion, KeyframedMotion, type(None))
        check_friction(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyContact:
    """What happens where two bodies touch; a body does not touch itself: its parts hold together where they meet.

    Parameters
    ----------
    contact
        `ContactCondition.STICK`: they have one velocity. `SLIP`: one along the normal, each its own across it.
        `SEPARATE`: neither moves into the other, both are free to leave, Coulomb friction across the normal.
    friction
        Coulomb's coefficient, >= 0; only `ContactCondition.SEPARATE` may have one > 0.
    """

    contact: ContactCondition = ContactCondition.SEPARATE
    friction: float = 0.0

    def __post_init__(self) -> None:
        check_friction(self)


def check_friction(owner: Any) -> None:
    """Refuse a friction below zero, or one that means nothing with the owner's contact."""
    member(owner, "contact", ContactCondition)
    finite(owner, "friction", low=0.0)
    if owner.friction > 0 and owner.contact is not ContactCondition.SEPARATE:
        raise SceneError(
            f'{type(owner).__name__}.friction {owner.friction:g} has no meaning with contact "{owner.contact.value}":'
            ' use contact "separate", or friction 0'
        )


DEFAULT_BODY_CONTACT = BodyContact(friction=0.3)
"""What holds where nothing else is said: bodies part and slide on each other, as dry wood on wood does."""


def _check_window(owner: Drive | ForceField) -> None:
    finite(owner, "start", low=0.0)
    if owner.end != math.inf:
        finite(owner, "end", low=0.0)
    if not owner.end > owner.start:
        raise SceneError(f"{type(owner).__name__}.end must be > start ({owner.start!r}), found {owner.end!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Something that moves the matter in a region of space for a time.

    Parameters
    ----------
    region
        Where; of a shape that engines declare as `region_shapes`.
    start, end
        During [start, end) [s].
    """

    kind: ClassVar[str] = ""
    region: Shape
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_window(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinned(Drive):
    """Matter in the region stands still."""

    kind: ClassVar[str] = "pinned"


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven(Drive):
    """Matter in the region moves as a rigid body, and the region moves with it.

    Parameters
    ----------
    velocity
        Of `center` [m/s].
    angular_velocity
        About `center` [rad/s].
    center
        Point the rotation is about, at `start` [m].
    """

    kind: ClassVar[str] = "driven"
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    center: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        Drive.__post_init__(self)
        for name in ("velocity", "angular_velocity", "center"):
            finite_vector(self, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Impulse(Drive):
    """A blow at time `start` on the points then in the region, shared in proportion to their mass.

    `end` has no meaning for an impulse and must be left alone.

    Parameters
    ----------
    impulse
        On all of them together [N s].
    """

    kind: ClassVar[str] = "impulse"
    impulse: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        Drive.__post_init__(self)
        finite_vector(self, "impulse")
        if self.end != math.inf:
            raise SceneError("Impulse.end has no meaning: an impulse acts at its start alone")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceField:
    """A force that acts on the matter in a region of space for a time.

    Parameters
    ----------
    region
        Where; None: everywhere.
    start, end
        During [start, end) [s].
    """

    kind: ClassVar[str] = ""
    region: Shape | None = None
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_window(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind(ForceField):
    """Moving air that drags matter along: dv/dt = drag (velocity - v).

    Parameters
    ----------
    velocity
        Of the air [m/s].
    drag
        Rate at which matter takes on the air's velocity [1/s], >= 0.
    """

    kind: ClassVar[str] = "wind"
    velocity: Vector = (0.0, 0.0, 0.0)
    drag: float = 1.0

    def __post_init__(self) -> None:
        ForceField.__post_init__(self)
        finite_vector(self, "velocity")
        finite(self, "drag", low=0.0)


class DomainPolicy(Enum):
    """What becomes of points that reach the domain's edge.

    Attributes
    ----------
    EXPAND
        The domain follows the points; it ends only where memory does.
    STOP
        The run ends with `Status.OUT_OF_DOMAIN`.
    CLAMP
        The edge is a slip wall, and what it held back is reported.
    """

    EXPAND = "expand"
    STOP = "stop"
    CLAMP = "clamp"


@dataclass(frozen=True, slots=True, kw_only=True)
class Domain:
    """The box the points live in; with `EXPAND` a first guess only.

    Parameters
    ----------
    lower, upper
        Its corners [m].
    policy
        What becomes of points that reach its edge.
    """

    lower: Vector
    upper: Vector
    policy: DomainPolicy = DomainPolicy.EXPAND

    def __post_init__(self) -> None:
        finite_vector(self, "lower")
        finite_vector(self, "upper")
        if any(low >= high for low, high in zip(self.lower, self.upper)):
            raise SceneError(f"Domain.upper {self.upper!r} must be above Domain.lower {self.lower!r} on every axis")


# A shape in a collider, drive or region is one of three classes; the protocol is what code over them relies on.
_: type[Shape] = HalfSpace
