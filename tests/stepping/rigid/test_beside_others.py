"""Rigid bodies in the scenes of engines that step other matter: what holds, meets and hurries one holds for all."""

from __future__ import annotations

import numpy as np
import pytest
from gasp_conformance.subject import find_subject
from installed_engines import ready
from rigid_clouds import block, problem_of

from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    Elastic,
    EngineAccuracy,
    Field,
    Pinned,
    Precision,
    Rigid,
    Status,
    SteadyMotion,
    Trajectories,
    Wind,
)

SIDE, SPACING = 0.05, 0.1
RIGID = Rigid(density=1000.0)


def elastic(modulus):
    return Elastic(density=1000.0, youngs_modulus=modulus, poissons_ratio=0.3)


@pytest.fixture(params=["reference-mpm", "warp-mpm"])
def advanced(request):
    """The state of a problem at a time, and what that took, by an engine of each kind."""
    ready(request.param)

    def go(problem, time):
        subject = find_subject(request.param, Precision.FLOAT64, "cpu")
        with subject.open(problem, EngineAccuracy(spacing=SPACING)) as session:
            report = session.advance_to(time)
            return session.read(frozenset({Field.POSITIONS, Field.VELOCITIES})), report

    return go


@pytest.mark.parametrize("slab", [elastic(1e6), RIGID], ids=["soft", "rigid"])
def test_what_glides_on_a_slab_that_is_pinned_is_not_held(advanced, slab):
    under = block((16, 10, 4), SIDE, (0.0, 0.0, -2 * SIDE))
    glider = block((6, 6, 6), SIDE, (-0.1, 0.0, 3 * SIDE))
    problem = problem_of(
        [under, glider],
        SIDE,
        [np.zeros(3), np.array([1.0, 0.0, 0.0])],
        [slab, elastic(1e5)],
        body_contact=BodyContact(friction=0.0),
        drives=(Pinned(region=BoxShape(center=(0.0, 0.0, -0.1), half_extents=(0.9, 0.4, 0.1))),),
    )
    state, report = advanced(problem, 0.1)
    assert report.status is Status.OK
    own = slice(len(under), None)
    # Two soft bodies lose .5 % here; one that is held, nearly all.
    assert state.velocities[own, 0].mean() > 0.98
    np.testing.assert_allclose((state.positions[own] - glider)[:, 0].mean(), 0.1, rtol=0.02)


def test_what_lies_on_matter_that_is_led_goes_with_it(advanced):
    platform = block((12, 12, 4), SIDE, (0.0, 0.0, -2 * SIDE))
    load = block((6, 6, 8), SIDE, (0.0, 0.0, 4 * SIDE))
    times = np.linspace(0.0, 0.3, 4)
    lifted = np.zeros((4, len(platform), 3))
    lifted[:, :, 2] = 0.2 * times[:, None]
    problem = problem_of(
        [platform, load],
        SIDE,
        materials=[elastic(1e5), RIGID],
        trajectories=Trajectories(rows=np.arange(len(platform)), times=times, displacements=lifted),
    )
    state, report = advanced(problem, 0.3)
    assert report.status is Status.OK
    np.testing.assert_allclose(state.positions[: len(platform)] - platform, lifted[-1], atol=1e-9)
    np.testing.assert_allclose(state.velocities[len(platform) :].mean(axis=0), [0, 0, 0.2], atol=2e-3)
    # Half a cell is what lies at nodes may sink until it is met.
    np.testing.assert_allclose((state.positions[len(platform) :] - load)[:, 2].mean(), 0.06, atol=SPACING / 2)


@pytest.mark.parametrize("apart", [5e-17, *(pytest.param(time, marks=pytest.mark.thorough) for time in (1e-10, 1e-6))])
def test_a_seam_bears_a_step_however_short(advanced, apart):
    """Two winds that do nothing end one after the other: between them is a step as short as that."""
    hanging = block((6, 6, 8), SIDE, (0.0, 0.0, 4 * SIDE))
    foot = block((6, 6, 4), SIDE, (0.0, 0.0, -2 * SIDE))

    def swung(*ends):
        problem = problem_of(
            [hanging, foot],
            SIDE,
            materials=[elastic(2e4), RIGID],
            rigid_parts={1: 0},
            gravity=(3.0, 0.0, -9.81),
            drives=(Pinned(region=BoxShape(center=(0.0, 0.0, -0.15), half_extents=(0.3, 0.3, 0.1))),),
            force_fields=tuple(Wind(velocity=(0.0, 0.0, 0.0), drag=1e-9, start=0.05, end=end) for end in ends),
        )
        return advanced(problem, 0.16)

    alone, _ = swung(0.15)
    state, report = swung(0.15, 0.15 + apart)
    assert report.status is Status.OK
    assert report.smallest_substep <= 2 * apart
    # One step more moves the others by a step of what they do at most.
    assert np.abs(state.velocities - alone.velocities).max() < 0.02


def test_what_comes_fast_meets_a_rigid_body_however_slow_others_are(advanced):
    soft, struck = block((4, 4, 4), SIDE, (-4.9, 0.0, 0.1)), block((4, 4, 4), SIDE, (0.1, 0.0, 0.1))
    bat = Collider(
        shape=BoxShape(center=(-1.0, 0.0, 0.1), half_extents=(0.15, 0.5, 0.5)),
        motion=SteadyMotion(velocity=(20.0, 0.0, 0.0), center=(-1.0, 0.0, 0.1), end=0.1),
    )
    problem = problem_of(
        [soft, struck], SIDE, materials=[elastic(2e3), RIGID], colliders=(bat,), gravity=(0.0, 0.0, 0.0)
    )
    state, report = advanced(problem, 0.1)
    assert report.status is Status.OK
    own = state.positions[len(soft) :]
    # The bat's face is at 1.15 m then.
    assert own[:, 0].min() > 1.15
    np.testing.assert_allclose(state.velocities[len(soft) :, 0], 20.0, rtol=0.01)
    np.testing.assert_allclose(state.positions[: len(soft)], soft, atol=1e-12)
