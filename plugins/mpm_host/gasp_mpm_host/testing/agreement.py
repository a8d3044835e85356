"""An engine against the reference engine, which shares no line of code with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    ContactCondition,
    Driven,
    EngineAccuracy,
    Field,
    HalfSpace,
    Impulse,
    KeyframedMotion,
    Pinned,
    PointEngine,
    PointProblem,
    PointState,
    Precision,
    Rigid,
    Side,
    SignedDistanceField,
    SphereShape,
    Status,
    SteadyMotion,
    Trajectories,
    Wind,
)
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.errors import UnknownEngineError
from gasp_mpm_host.testing.kit import Kit

__all__ = ["COMPANIES", "AgreementTests"]

_SIDE = 0.4
_SPACING = 0.1
_STEP = 2e-4
_STEPS = 500
# float64: two orders of summation of 1e-16 relative rounding, 500 steps of at most about a hundred operations each,
# 1e-11 with every one of them in the same direction. float32: the bar; 500 half ulps of a velocity of a
# few m/s, in the same direction, over the 0.1 s simulated would be 6e-6 m = 1.5e-5 of the size.
_TOLERANCE = {"float64": 1e-10, "float32": 1e-5}


def _bump(x: float, y: float, z: float, radius: float) -> SignedDistanceField:
    """A ball on a grid that no other lines up with."""
    corners = [tuple(value + side * (radius + 0.013) for value in (x, y, z)) for side in (-1, 1)]
    return SignedDistanceField.sampled(SphereShape(center=(x, y, z), radius=radius), corners[0], corners[1], 0.037)


def _obstacles() -> tuple[Collider, ...]:
    return (
        Collider(shape=_bump(0.33, 0.07, 0.02, 0.11), friction=0.3),
        Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),
        Collider(shape=SphereShape(center=(0.2, 0.2, 0), radius=0.08), contact=ContactCondition.SLIP),
        Collider(shape=BoxShape(center=(0.5, 0.2, 0.3), half_extents=(0.05, 0.5, 0.5)), contact=ContactCondition.STICK),
        Collider(shape=BoxShape(center=(0.15, 0.2, 0.9), half_extents=(0.28, 0.29, 0.93)), side=Side.INSIDE),
        Collider(shape=SphereShape(center=(0.2, 0.2, 0.2), radius=0.61), side=Side.INSIDE, friction=0.2),
    )


def _forcing() -> dict[str, Any]:
    return {
        "drives": (
            Pinned(region=BoxShape(center=(0, 0, 0.3), half_extents=(0.06, 0.06, 0.06)), start=0.02, end=0.05),
            Driven(
                region=SphereShape(center=(0.4, 0.4, 0.3), radius=0.11),
                start=0.03,
                end=0.06,
                velocity=(0.0, 1.0, 0.0),
                angular_velocity=(0.0, 3.0, 5.0),
                center=(0.3, 0.3, 0.3),
            ),
            Pinned(region=_bump(0.4, 0.0, 0.4, 0.1), start=0.06, end=0.09),
            Impulse(region=HalfSpace(point=(0, 0, 0.31), normal=(0, 0, 1)), start=0.013, impulse=(1.0, 2.0, 0.0)),
        ),
        "force_fields": (
            Wind(velocity=(3.0, 0.0, 0.0), drag=2.0, start=0.01, end=0.08),
            Wind(region=HalfSpace(point=(0, 0, 0.21), normal=(0, 0, 1)), velocity=(0.0, -2.0, 1.0), drag=3.0),
        ),
    }


def _scene(kinds: tuple[str, ...]) -> PointProblem:
    """Blocks one above the other, falling askew at 2 m/s, their velocities disturbed."""
    blocks = [Kit.block(_SIDE, corner=(0, 0, 0.05 + 0.42 * index), seed=index) for index in range(len(kinds))]
    ids = np.repeat(np.arange(len(kinds)), len(blocks[0]))
    positions = np.concatenate(blocks)
    velocity = np.array([0.5, 0.0, -2.0]) + np.random.default_rng(1).normal(scale=0.05, size=positions.shape)
    volumes = np.full(len(positions), _SIDE**3 / len(blocks[0]))
    return Kit.problem(
        positions,
        tuple(Kit.materials[kind] for kind in kinds),
        ids=ids,
        volumes=volumes,
        velocity=velocity,
        colliders=_obstacles(),
        **_forcing(),
    )


def _meeting() -> PointProblem:
    """Three blocks that fall askew onto each other and a floor: all share nodes, each pair meets in its own way."""
    side, per_axis = 0.2, 4
    corners = ((0.0, 0.0, 0.01), (0.21, 0.0, 0.01), (0.09, 0.03, 0.22))
    blocks = [Kit.block(side, per_axis, corner, seed=seed) for seed, corner in enumerate(corners)]
    velocities = ((0.6, 0.2, -1.0), (-0.6, 0.0, -1.0), (0.3, -0.4, -2.5))
    ids = np.repeat(np.arange(3), per_axis**3)
    return Kit.problem(
        np.concatenate(blocks),
        (Kit.materials["elastic"], Kit.materials["neo-hookean"], Kit.materials["fluid"]),
        ids=ids,
        volumes=np.full(len(ids), (side / per_axis) ** 3),
        velocity=np.array(velocities)[ids],
        colliders=(
            _obstacles()[1],
            Collider(
                shape=SphereShape(center=(-0.12, 0.1, 0.1), radius=0.1),
                friction=0.3,
                motion=SteadyMotion(
                    velocity=(1.0, 0.2, 0.0), angular_velocity=(0.0, 4.0, 3.0), center=(-0.1, 0.1, 0.1), start=0.01
                ),
            ),
            Collider(
                shape=BoxShape(center=(0.2, -0.2, 0.2), half_extents=(0.3, 0.15, 0.05)),
                contact=ContactCondition.STICK,
                motion=KeyframedMotion(
                    times=(0.0, 0.04, 0.09),
                    places=((0.2, -0.2, 0.2), (0.2, -0.1, 0.2), (0.2, -0.1, 0.25)),
                    quaternions=((1, 0, 0, 0), (1, 0.1, 0, 0.2), (2, 0, 0.3, 0)),
                    center=(0.2, -0.2, 0.2),
                ),
            ),
        ),
        drives=(Pinned(region=BoxShape(center=(0, 0, 0.2), half_extents=(0.06, 0.06, 0.06)), start=0.02, end=0.05),),
        body_contact=BodyContact(friction=0.3),
        pair_contacts={
            (0, 1): BodyContact(contact=ContactCondition.SLIP),
            (1, 2): BodyContact(contact=ContactCondition.STICK),
        },
    )


def _rigid() -> PointProblem:
    """A rigid block that falls askew onto a soft one, water beside it and a floor, and another one that is driven."""
    side, per_axis = 0.2, 4
    corners = ((0.0, 0.0, 0.01), (0.21, 0.0, 0.01), (0.09, 0.03, 0.22), (-0.22, 0.02, 0.03))
    blocks = [Kit.block(side, per_axis, corner, seed=seed) for seed, corner in enumerate(corners)]
    velocities = ((0.6, 0.2, -1.0), (-0.6, 0.0, -1.0), (0.3, -0.4, -2.5), (0.0, 0.0, 0.0))
    ids = np.repeat(np.arange(4), per_axis**3)
    return Kit.problem(
        np.concatenate(blocks),
        (Kit.materials["elastic"], Kit.materials["fluid"], Rigid(density=700.0), Rigid(density=2000.0)),
        ids=ids,
        volumes=np.full(len(ids), (side / per_axis) ** 3),
        velocity=np.array(velocities)[ids],
        colliders=(_obstacles()[1],),
        drives=(
            Driven(
                region=SphereShape(center=(-0.12, 0.12, 0.13), radius=0.05),
                velocity=(0.8, 0.0, 0.0),
                angular_velocity=(0.0, 0.0, 2.0),
                center=(-0.12, 0.12, 0.13),
                end=0.06,
            ),
        ),
        body_contact=BodyContact(friction=0.3),
        pair_contacts={(0, 3): BodyContact(contact=ContactCondition.SLIP)},
    )


def _led() -> PointProblem:
    """A soft block whose lower half is swung, a soft one that falls onto it, a rigid one beside it, and a floor."""
    problem = _rigid()
    ids, places = problem.points.body_ids, problem.points.reference_positions
    rows = np.flatnonzero((ids == 0) & (places[:, 2] < 0.11))
    times = np.linspace(0.0, 0.12, 7)
    arms = places[rows] - [0.1, 0.1, 0.1]
    turned = [
        np.stack([np.cos(4 * t) * x - np.sin(4 * t) * y + 2 * t * t, np.sin(4 * t) * x + np.cos(4 * t) * y, z], axis=1)
        for t, (x, y, z) in ((t, arms.T) for t in times)
    ]
    trajectories = Trajectories(rows=rows, times=times, displacements=np.array(turned) - arms)
    return replace(problem, trajectories=trajectories)


_ALONE = (("neo-hookean",), ("sand",), ("snow",), ("rubber",), ("metal",), ("plasticine",), ("foam",), ("putty",))
_TOGETHER = (
    ("metal", "snow"),
    ("foam", "plasticine", "elastic"),
    ("sand", "elastic", "fluid"),
    ("gel", "rubber", "elastic"),
    ("cork", "sand", "putty"),
    ("lead", "gel", "neo-hookean"),
)
"""Every kind of matter is in one of them."""


def _compared() -> Iterator[Any]:
    """Kinds of matter and precisions. Together, and in double precision, they tell of every formula; alone, and in
    single precision, of which of them it is that is wrong."""
    for kinds in (("elastic",), ("fluid",), *_TOGETHER, *_ALONE):
        for precision in ("float64", "float32"):
            marks: tuple[Any, ...] = ()
            if kinds in _ALONE or (kinds in _TOGETHER and precision == "float32"):
                marks = (pytest.mark.slow,)
            elif kinds in _TOGETHER:
                marks = (pytest.mark.thorough,)
            yield pytest.param(kinds, precision, marks=marks, id=f"{'+'.join(kinds)}-{precision}")


def _welded() -> PointProblem:
    """The block that falls is a part of the soft one below it."""
    return replace(_rigid(), rigid_parts={2: 0})


COMPANIES = {
    "three that deform": _meeting,
    "rigid and soft": _rigid,
    "one that is led": _led,
    "a rigid part": _welded,
}


def _marked(name: str) -> PointProblem:
    """A company with tracers in the middle of its bodies.

    The nodes around these count fully for them (`gasp_core.stepping.mpm.presence`), whether by their own mass or by
    that of a led node; where matter ends, nodes of next to no mass magnify rounding.
    """
    problem = COMPANIES[name]()
    cloud, random = problem.points, np.random.default_rng(4)
    bodies = np.unique(cloud.body_ids)
    middles = [cloud.reference_positions[cloud.body_ids == body].mean(axis=0) for body in bodies]
    inside = np.repeat(middles, 20, axis=0) + random.uniform(-0.025, 0.025, (20 * len(middles), 3))
    return replace(problem, points=replace(cloud, tracer_positions=inside))


@cache
def _answer_of_company(name: str) -> PointState:
    return _answered(COMPANIES[name](), Kit.everything)


def _answered(problem: PointProblem, fields: frozenset[Field]) -> PointState:
    """What the reference engine says of several bodies."""
    session = _reference().open(
        problem,
        device="cpu",
        precision=Precision.FLOAT64,
        seed=0,
        accuracy=EngineAccuracy(spacing=_SPACING / 2, substep=_STEP),
        options=None,
    )
    with session:
        assert session.advance_to(_STEP * _STEPS).status is Status.OK
        return session.read(fields)


@cache
def _reference() -> PointEngine:
    return open_engine(discover().offer("reference-mpm"))


@cache
def _answer(kinds: tuple[str, ...]) -> PointState:
    """What the reference engine says, once for both precisions and every engine."""
    session = _reference().open(
        _scene(kinds),
        device="cpu",
        precision=Precision.FLOAT64,
        seed=0,
        accuracy=EngineAccuracy(spacing=_SPACING, substep=_STEP),
        options=None,
    )
    with session:
        assert session.advance_to(_STEP * _STEPS).status is Status.OK
        return session.read(Kit.everything)


class AgreementTests:
    """That an engine is where the reference is; a subclass finds the fixture `kit`, a `Kit`, beside it."""

    @pytest.fixture
    def reference(self):
        try:
            return _reference()
        except UnknownEngineError as error:
            pytest.skip(f"no engine to compare with: {error}")

    @pytest.mark.parametrize(("kinds", "precision"), list(_compared()))
    def test_500_steps_agree_with_the_reference(self, kit, reference, kinds, precision):
        expected = _answer(kinds)
        with kit.open(_scene(kinds), precision=precision, spacing=_SPACING, substep=_STEP) as session:
            report = session.advance_to(_STEP * _STEPS)
            found = session.read(kit.everything)
        assert report.status is Status.OK
        assert report.substep_count == _STEPS
        error = np.abs(found.positions - expected.positions).max() / _SIDE
        assert error <= _TOLERANCE[precision]
        moved = np.abs(found.positions - _scene(kinds).points.reference_positions).max()
        assert moved > 0.05 * _SIDE  # the comparison is of something that happened
        if precision == "float64":
            assert np.abs(found.deformation_gradients - expected.deformation_gradients).max() <= 1e-8

    @pytest.mark.thorough
    @pytest.mark.parametrize("precision", ["float64", "float32"])
    @pytest.mark.parametrize("company", COMPANIES)
    def test_500_steps_of_several_bodies_agree_with_the_reference(self, kit, reference, company, precision):
        expected, problem = _answer_of_company(company), COMPANIES[company]()
        with kit.open(problem, precision=precision, spacing=_SPACING / 2, substep=_STEP, threads=2) as session:
            assert session.advance_to(_STEP * _STEPS).status is Status.OK
            found = session.read(kit.everything)
        assert np.abs(found.positions - expected.positions).max() / _SIDE <= _TOLERANCE[precision]
        # Where each would be had it met nobody.
        free = problem.points.reference_positions + _STEP * _STEPS * problem.points.initial_velocities
        assert np.abs(found.positions - free)[:, :2].max() > 0.05 * _SIDE

    @pytest.mark.thorough
    @pytest.mark.parametrize("company", ["rigid and soft", "one that is led", "a rigid part"])
    def test_tracers_beside_what_is_rigid_or_led_agree_with_the_reference(self, kit, reference, company):
        problem, fields = _marked(company), frozenset(Field)
        expected = _answered(problem, fields).tracer_positions
        with kit.open(problem, precision="float64", spacing=_SPACING / 2, substep=_STEP) as session:
            assert session.advance_to(_STEP * _STEPS).status is Status.OK
            found = session.read(fields).tracer_positions
        assert np.abs(found - expected).max() / _SIDE <= _TOLERANCE["float64"]
        moved = np.abs(expected - problem.points.tracer_positions).max(axis=1)
        assert moved.min() > 0.03 * _SIDE

    @pytest.mark.parametrize(
        "company",
        [
            "rigid and soft",
            *(pytest.param(one, marks=pytest.mark.thorough) for one in ("one that is led", "a rigid part")),
        ],
    )
    def test_companies_go_on_from_a_checkpoint_as_if_they_had_not_stopped(self, kit, company):
        problem, half = COMPANIES[company](), _STEP * _STEPS / 2
        choices = {"precision": "float64", "spacing": _SPACING / 2, "substep": _STEP}
        with kit.open(problem, **choices) as session:
            assert session.advance_to(half).status is Status.OK
            kept = session.checkpoint()
            assert session.advance_to(2 * half).status is Status.OK
            whole = session.read(kit.everything)
        with kit.open(problem, restart=kept, threads=2, **choices) as session:
            assert session.advance_to(2 * half).status is Status.OK
            again = session.read(kit.everything)
        np.testing.assert_array_equal(whole.positions, again.positions)
        np.testing.assert_array_equal(whole.velocities, again.velocities)

    def test_chosen_substeps_agree_with_the_reference(self, kit, reference):
        """The two engines look at the same points and choose the same steps."""
        problem = _scene(("elastic",))
        session = reference.open(
            problem,
            device="cpu",
            precision=Precision.FLOAT64,
            seed=0,
            accuracy=EngineAccuracy(spacing=_SPACING),
            options=None,
        )
        with session, kit.open(problem, precision="float64", spacing=_SPACING) as ours:
            theirs, mine = session.advance_to(0.05), ours.advance_to(0.05)
            assert mine.substep_count == theirs.substep_count
            assert mine.smallest_substep == pytest.approx(theirs.smallest_substep, rel=1e-9)
            gap = ours.read(kit.everything).positions - session.read(kit.everything).positions
        assert np.abs(gap).max() / _SIDE <= _TOLERANCE["float64"]
