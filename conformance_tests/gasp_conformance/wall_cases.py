"""What colliders do to matter: each case throws small blocks at or along something and returns what it measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_conformance import oracles
from gasp_conformance.bounds import place_rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.specimens import NO_GRAVITY, plain_material
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    EngineAccuracy,
    HalfSpace,
    KeyframedMotion,
    Material,
    PointProblem,
    Shape,
    Side,
    SignedDistanceField,
    SphereShape,
    SteadyMotion,
)

__all__ = ["Carried", "Impact", "Slope", "carried", "floor_of", "impacts", "on_slope", "stiff_material"]

Array = NDArray[Any]
AnyShape = HalfSpace | BoxShape | SphereShape

GRAVITY = 9.81
_SPACING = 0.1
_CELLS = 2
_SPEED = 1.0
_TILTED = (1 / 3, 2 / 3, 2 / 3)
_FAR = 6.0
"""From where anything goes [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """What became of blocks thrown at a collider.

    Parameters
    ----------
    depth
        How deep the deepest point was in it, in grid cells; negative where none was.
    gap
        How far from it, in grid cells, the block was stopped that came least near; negative where all went in.
    reach
        How deep it would have been without the collider, in grid cells.
    free_error
        Distance from uniform motion of matter that is nowhere near it, over what rounding leaves; at most 1 where
        nothing else acts on it.
    """

    depth: float
    gap: float
    reach: float
    free_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """A block on a slope.

    Parameters
    ----------
    way
        Along it, of the block's centre, less what its own start gives it [m].
    rise
        Off it [m].
    free_way, free_rise
        Of a block that nothing holds [m].
    stepping
        Euler's error of a free fall along the slope [m].
    settling
        Half height of the block over its speed of sound [s]: after that its weight has arrived at the foot.
    """

    way: float
    rise: float
    free_way: float
    free_rise: float
    stepping: float
    settling: float


def stiff_material(subject: Subject, factor: float = 100.0) -> Material:
    """The plainest declared material, `factor` times as stiff: by its defaults, sound goes at 30 m/s."""
    material = plain_material(subject.descriptor.capabilities)
    stiffer = {
        name: factor * getattr(material, name) for name in ("youngs_modulus", "bulk_modulus") if hasattr(material, name)
    }
    return replace(material, **stiffer)


def _contact(subject: Subject) -> ContactCondition:
    """The declared condition that interferes least."""
    order = (ContactCondition.SEPARATE, ContactCondition.SLIP, ContactCondition.STICK)
    declared = subject.descriptor.capabilities.contact_conditions
    return next((contact for contact in order if contact in declared), ContactCondition.SEPARATE)


def _throws(shape: AnyShape, side: Side) -> list[tuple[Array, Array, bool]]:
    """Blocks to throw, by centre [m] and direction, and whether the collider is in their way.

    Those that it is in the way of come from opposite sides, where a shape has any.
    """
    sign = 1.0 if side is Side.OUTSIDE else -1.0
    throws: list[tuple[Array, Array, bool]] = []
    if isinstance(shape, HalfSpace):
        normal = sign * np.asarray(shape.normal)
        along = np.cross(normal, [0.0, 0.0, 1.0])
        along /= np.linalg.norm(along)
        throws.append((np.asarray(shape.point) + 0.5 * normal, -normal, True))
        throws.append((np.asarray(shape.point) + 0.8 * normal + 1.2 * along, along, False))
        return throws
    center = np.asarray(shape.center)
    half = shape.radius if isinstance(shape, SphereShape) else shape.half_extents[0]
    for axis, way in ((0, 1.0), (0, -1.0), (2, -1.0)):
        direction = way * np.eye(3)[axis]
        aside = np.roll(direction, 1) * (0.1 if axis == 0 else 0.0)
        start = center - (half + 0.5) * direction if side is Side.OUTSIDE else center + aside * way
        throws.append((start, direction, True))
    if isinstance(shape, SphereShape):
        # Where a ball is farthest from the box around it.
        direction = np.ones(3) / math.sqrt(3)
        throws.append((center - (half + 0.5) * direction if side is Side.OUTSIDE else center, direction, True))
    if side is Side.OUTSIDE:
        throws.append((center + [-1.0, half + 0.6, 0.0], np.array([1.0, 0.0, 0.0]), False))
    return throws


def impacts(subject: Subject, kind: type[Any], side: Side) -> list[Impact]:
    """Blocks thrown at a collider of this shape from the side on which matter may be, and one thrown past it."""
    return [_impact(subject, given, known, side) for given, known in _colliders(kind, side)]


def _colliders(kind: type[Any], side: Side) -> Sequence[tuple[Shape, AnyShape]]:
    """Colliders of one kind, and the formula that each obeys; a field has it of another kind."""
    if kind is SignedDistanceField:
        known = [shape for one in (HalfSpace, BoxShape, SphereShape) for shape in _shapes(one, side)]
        return [(sampled(shape), shape) for shape in known]
    return [(shape, shape) for shape in _shapes(kind, side)]


def sampled(shape: Shape) -> SignedDistanceField:
    """A field of what of a shape is near where blocks are thrown, or slide; its nodes are at no round numbers."""
    return SignedDistanceField.sampled(shape, (-3.13, -3.07, -3.01), (3.33, 3.37, 3.21), 0.77 * _SPACING)


def _shapes(kind: type[Any], side: Side) -> Sequence[AnyShape]:
    """Colliders of one kind; containers are wider, so that there is something to fly through."""
    half = 0.5 if side is Side.OUTSIDE else 0.7
    if kind is HalfSpace:
        # Both ways round: which half is solid is what the normal says.
        return [
            HalfSpace(point=(0.2, 0.1, 0.3), normal=_TILTED),
            HalfSpace(point=(0.2, 0.1, 0.3), normal=(-_TILTED[0], -_TILTED[1], -_TILTED[2])),
        ]
    if kind is BoxShape:
        return [BoxShape(center=(0.2, 0.1, 0.3), half_extents=(half, half, half))]
    assert kind is SphereShape, f"the suite has no check for {kind.__name__} yet"
    return [SphereShape(center=(0.2, 0.1, 0.3), radius=half)]


def _impact(subject: Subject, given: Shape, shape: AnyShape, side: Side) -> Impact:
    """One block at a time, so that they cannot run into each other."""
    sign = 1.0 if side is Side.OUTSIDE else -1.0
    contact = _contact(subject)
    collider = Collider(shape=given, contact=contact, side=side)
    # Neither the first of all colliders nor the last: the others are where nothing goes.
    before, after = (Collider(shape=_far_away(given, way), contact=contact) for way in (-1.0, 1.0))
    # An impact at 1 m/s, a tenth of the speed of sound, squeezes it by about a tenth.
    material = stiff_material(subject, 10.0)
    depth, gap, reach, free_error = -math.inf, -math.inf, math.inf, 0.0
    for center, direction, blocked in _throws(shape, side):
        extent = _CELLS * _SPACING
        block = box_of_points(center - extent / 2, (_CELLS, _CELLS, _CELLS), _SPACING)
        velocity = _SPEED * direction
        problem = PointProblem(
            points=cloud_of([block], [velocity], _SPACING),
            materials=(material,),
            colliders=(before, collider, after),
            gravity=NO_GRAVITY,
        )
        journal = Journal()
        times = np.linspace(0, 1.1, 23)[1:]
        lowest = math.inf
        for state in subject.states(problem, EngineAccuracy(spacing=_SPACING), times, (), journal):
            free = block + velocity * state.time
            # A quadratic spline reaches one and a half cells along each axis, 2.6 across.
            if float((sign * shape.signed_distance(free)).min()) > 3 * _SPACING:
                error = float(np.linalg.norm(state.positions - free, axis=1).max())
                # An engine may count places from where a collider is, the farthest as well as the nearest.
                farthest, travel = max(_FAR, float(np.abs(free).max())), _SPEED * state.time
                bound = place_rounding(subject, journal.substep_count, farthest, travel)
                free_error = max(free_error, error / bound)
            else:
                assert blocked, "the way past the collider is not clear"
            lowest = min(lowest, float((sign * shape.signed_distance(state.positions)).min()))
        depth = max(depth, -lowest / _SPACING)
        if blocked:
            gap = max(gap, lowest / _SPACING)
            unheld = block + velocity * times[-1]
            reach = min(reach, -float((sign * shape.signed_distance(unheld)).mean()) / _SPACING)
    return Impact(depth=depth, gap=gap, reach=reach, free_error=free_error)


def _far_away(shape: Shape, way: float) -> Shape:
    """A shape of the same kind that nothing comes near, along x to one side or the other."""
    if isinstance(shape, HalfSpace):
        return HalfSpace(point=(_FAR * way, 0.0, 0.0), normal=(-way, 0.0, 0.0))
    if isinstance(shape, SignedDistanceField):
        x, y, z = shape.origin
        ball = SphereShape(center=(x + _FAR * way, y, z), radius=0.3)
        low, high = (tuple(np.asarray(ball.center) + side * 0.5) for side in (-1, 1))
        return SignedDistanceField.sampled(ball, low, high, _SPACING)
    assert isinstance(shape, BoxShape | SphereShape)
    x, y, z = shape.center
    return replace(shape, center=(x + _FAR * way, y, z))


def on_slope(
    subject: Subject,
    contact: ContactCondition,
    friction: float,
    slope: float,
    speed: float,
    *,
    ceiling: bool = False,
    field: bool = False,
) -> Slope:
    """A block on a slope of `slope` degrees, started downhill at `speed` [m/s], for 0.4 s; `ceiling` turns gravity's
    pull towards the surface into one away from it, `field` the plane into a signed distance field."""
    tilt, time = math.radians(slope), 0.4
    block = box_of_points((0.37, 0.21, 0.0), (_CELLS, _CELLS, _CELLS), _SPACING)
    across = GRAVITY * math.cos(tilt) * (1 if ceiling else -1)
    material = stiff_material(subject)
    floor = sampled(HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))) if field else floor_of(subject)
    problem = PointProblem(
        points=cloud_of([block], [[speed, 0.0, 0.0]], _SPACING),
        materials=(material,),
        colliders=_among_others(subject, Collider(shape=floor, contact=contact, friction=friction)),
        gravity=(GRAVITY * math.sin(tilt), 0.0, across),
    )
    journal = Journal()
    (state,) = subject.states(problem, EngineAccuracy(spacing=_SPACING), [time], (), journal)
    moved = (state.positions - block).mean(axis=0)
    stiffness = getattr(material, "youngs_modulus", None) or getattr(material, "bulk_modulus", math.inf)
    return Slope(
        way=float(moved[0]) - speed * time,
        rise=float(moved[2]),
        free_way=GRAVITY * math.sin(tilt) * time**2 / 2,
        free_rise=across * time**2 / 2,
        stepping=oracles.euler_fall_error(GRAVITY, time, journal.largest_substep),
        settling=_CELLS * _SPACING / math.sqrt(stiffness / material.density),
    )


def _among_others(subject: Subject, collider: Collider) -> tuple[Collider, ...]:
    """A collider amid others of every declared contact, far away: before it those that rub more, behind it none."""
    # Another floor would be as wide.
    here = BoxShape(center=(0.0, 0.0, _FAR), half_extents=(0.5, 0.5, 0.5))
    shape = here if isinstance(collider.shape, BoxShape) else collider.shape
    declared = [one for one in ContactCondition if one in subject.descriptor.capabilities.contact_conditions]
    before, after = (
        [
            Collider(
                shape=_far_away(shape, way),
                contact=one,
                friction=friction if one is ContactCondition.SEPARATE else 0.0,
            )
            for one in declared
        ]
        for way, friction in ((-1.0, 1.5), (1.0, 0.0))
    )
    return (*reversed(before), collider, *after)


def floor_of(subject: Subject) -> AnyShape:
    """Something flat whose upper face is z = 0."""
    if HalfSpace in subject.descriptor.capabilities.collider_shapes:
        return HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    return BoxShape(center=(0.0, 0.0, -1.0), half_extents=(9.0, 9.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """Blocks that a collider takes along.

    Parameters
    ----------
    way
        On a floor that glides away under it at 0.5 m/s: of the block's centre [m].
    closed_form
        Of a rigid block [m].
    late
        What may be missing of it because the weight has to arrive first [m].
    depth
        How deep a wall that moves at 0.5 m/s is in a block that it pushes, in grid cells.
    pushed
        Way of that block's centre, over that of the wall since it arrived.
    turn
        Angle that a block on a turntable has gone round with it, over that of the turntable.
    """

    way: float
    closed_form: float
    late: float
    depth: float
    pushed: float
    turn: float


def carried(subject: Subject) -> Carried:
    """A block on a gliding floor, one before a moving wall, one on a turntable."""
    material, cells = stiff_material(subject), (_CELLS, _CELLS, _CELLS)
    speed, friction, time = 0.5, 0.4, 0.3
    block = box_of_points((0.37, 0.21, 0.0), cells, _SPACING)

    def after(
        points: Array, collider: Collider, gravity: tuple[float, float, float], velocities: ArrayLike = (0.0, 0.0, 0.0)
    ) -> Array:
        problem = PointProblem(
            points=cloud_of([points], [velocities], _SPACING),
            materials=(material,),
            colliders=(collider,),
            gravity=gravity,
        )
        (state,) = subject.states(problem, EngineAccuracy(spacing=_SPACING), [time])
        return state.positions

    down = (0.0, 0.0, -GRAVITY)
    gliding = Collider(
        shape=floor_of(subject),
        friction=friction,
        motion=KeyframedMotion(
            times=(0.0, 1.0), places=((0.0, 0.0, 0.0), (speed, 0.0, 0.0)), quaternions=((1.0, 0.0, 0.0, 0.0),) * 2
        ),
    )
    on_floor = after(block, gliding, down) - block
    # It is pulled along at mu g until it goes as fast as the floor.
    pulled = speed / (friction * GRAVITY)
    stiffness = getattr(material, "youngs_modulus", None) or getattr(material, "bulk_modulus", math.inf)
    settling = _CELLS * _SPACING / math.sqrt(stiffness / material.density)

    # The side of a box or, turned up, of a floor.
    wall = Collider(
        shape=floor_of(subject),
        contact=_contact(subject),
        motion=SteadyMotion(velocity=(0.0, 0.0, speed), start=0.0),
    )
    raised = box_of_points((0.37, 0.21, _SPACING / 2), cells, _SPACING)
    ahead = after(raised, wall, NO_GRAVITY)
    arrived = _SPACING / 2 / speed

    spin = 2.0
    table = Collider(shape=floor_of(subject), friction=3.0, motion=SteadyMotion(angular_velocity=(0.0, 0.0, spin)))
    round_block = box_of_points((0.3, -_SPACING, 0.0), cells, _SPACING)
    x, y, _ = after(round_block, table, down, np.cross([0.0, 0.0, spin], round_block)).mean(axis=0)
    return Carried(
        way=float(on_floor[:, 0].mean()),
        closed_form=speed * (time - pulled / 2),
        late=friction * GRAVITY * settling * time,
        depth=float(speed * time - ahead[:, 2].min() + _SPACING / 4) / _SPACING,
        pushed=float((ahead - raised)[:, 2].mean()) / (speed * (time - arrived)),
        turn=math.atan2(float(y), float(x)) / (spin * time),
    )
