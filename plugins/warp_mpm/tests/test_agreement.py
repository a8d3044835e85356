"""The Warp engine against the reference engine, which shares no line of code with it."""

import numpy as np
import pytest

from gasp_core.engine.contract import EngineAccuracy, Precision, Status
from gasp_core.engine.forcing import Collider, ContactCondition, Driven, Impulse, Pinned, Side, Wind
from gasp_core.engine.registry import discover
from gasp_core.engine.shapes import BoxShape, HalfSpace, SphereShape
from gasp_core.errors import UnknownEngineError

SIDE = 0.4
SPACING = 0.1
STEP = 2e-4
STEPS = 500
# float64: two orders of summation of 1e-16 relative rounding, 500 steps of at most about a hundred operations each,
# 1e-11 with every one of them in the same direction. float32: the bar; 500 half ulps of a velocity of a
# few m/s, in the same direction, over the 0.1 s simulated would be 6e-6 m = 1.5e-5 of the size.
TOLERANCE = {"float64": 1e-10, "float32": 1e-5}


@pytest.fixture(scope="module")
def reference():
    try:
        return discover().load("reference-mpm")
    except UnknownEngineError as error:
        pytest.skip(f"no engine to compare with: {error}")


def obstacles():
    return (
        Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),
        Collider(shape=SphereShape(center=(0.2, 0.2, 0), radius=0.08), contact=ContactCondition.SLIP),
        Collider(shape=BoxShape(center=(0.5, 0.2, 0.3), half_extents=(0.05, 0.5, 0.5)), contact=ContactCondition.STICK),
        Collider(shape=BoxShape(center=(0.15, 0.2, 0.9), half_extents=(0.28, 0.29, 0.93)), side=Side.INSIDE),
        Collider(shape=SphereShape(center=(0.2, 0.2, 0.2), radius=0.61), side=Side.INSIDE, friction=0.2),
    )


def forcing():
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
            Impulse(region=HalfSpace(point=(0, 0, 0.31), normal=(0, 0, 1)), start=0.013, impulse=(1.0, 2.0, 0.0)),
        ),
        "force_fields": (
            Wind(velocity=(3.0, 0.0, 0.0), drag=2.0, start=0.01, end=0.08),
            Wind(region=HalfSpace(point=(0, 0, 0.21), normal=(0, 0, 1)), velocity=(0.0, -2.0, 1.0), drag=3.0),
        ),
    }


def scene(kit, kinds):
    """Blocks one above the other, falling askew at 2 m/s, their velocities disturbed."""
    blocks = [kit.block(SIDE, corner=(0, 0, 0.05 + 0.42 * index), seed=index) for index in range(len(kinds))]
    ids = np.repeat(np.arange(len(kinds)), len(blocks[0]))
    positions = np.concatenate(blocks)
    velocity = np.array([0.5, 0.0, -2.0]) + np.random.default_rng(1).normal(scale=0.05, size=positions.shape)
    volumes = np.full(len(positions), SIDE**3 / len(blocks[0]))
    return kit.problem(
        positions,
        tuple(kit.materials[kind] for kind in kinds),
        ids=ids,
        volumes=volumes,
        velocity=velocity,
        colliders=obstacles(),
        **forcing(),
    )


_answers = {}


def answer(reference, kit, kinds):
    """What the reference engine says, once for both precisions."""
    if kinds not in _answers:
        session = reference.open(
            scene(kit, kinds),
            device="cpu",
            precision=Precision.FLOAT64,
            seed=0,
            accuracy=EngineAccuracy(spacing=SPACING, substep=STEP),
            options=None,
        )
        with session:
            assert session.advance_to(STEP * STEPS).status is Status.OK
            _answers[kinds] = session.read(kit.everything)
    return _answers[kinds]


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize(
    "kinds",
    [
        ("elastic",),
        ("neo-hookean",),
        ("sand",),
        ("fluid",),
        ("snow",),
        ("metal",),
        ("plasticine",),
        ("foam",),
        ("metal", "snow"),
        ("foam", "plasticine", "elastic"),
        ("sand", "elastic", "fluid"),
        ("rubber",),
        ("gel", "rubber", "elastic"),
        ("lead", "gel"),
    ],
    ids=lambda kinds: "+".join(kinds),
)
def test_500_steps_agree_with_the_reference(kit, reference, kinds, precision):
    expected = answer(reference, kit, kinds)
    with kit.open(scene(kit, kinds), precision=precision, spacing=SPACING, substep=STEP) as session:
        report = session.advance_to(STEP * STEPS)
        found = session.read(kit.everything)
    assert report.status is Status.OK
    assert report.substep_count == STEPS
    error = np.abs(found.positions - expected.positions).max() / SIDE
    assert error <= TOLERANCE[precision]
    moved = np.abs(found.positions - scene(kit, kinds).points.reference_positions).max()
    assert moved > 0.05 * SIDE  # the comparison is of something that happened
    if precision == "float64":
        assert np.abs(found.deformation_gradients - expected.deformation_gradients).max() <= 1e-8


def test_chosen_substeps_agree_with_the_reference(kit, reference):
    """The two engines look at the same points and choose the same steps."""
    problem = scene(kit, ("elastic",))
    session = reference.open(
        problem,
        device="cpu",
        precision=Precision.FLOAT64,
        seed=0,
        accuracy=EngineAccuracy(spacing=SPACING),
        options=None,
    )
    with session, kit.open(problem, precision="float64", spacing=SPACING) as ours:
        theirs, mine = session.advance_to(0.05), ours.advance_to(0.05)
        assert mine.substep_count == theirs.substep_count
        assert mine.smallest_substep == pytest.approx(theirs.smallest_substep, rel=1e-9)
        gap = ours.read(kit.everything).positions - session.read(kit.everything).positions
    assert np.abs(gap).max() / SIDE <= TOLERANCE["float64"]
