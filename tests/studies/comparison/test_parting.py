"""When two runs part, beside falls whose times are known."""

import dataclasses
import math
from types import SimpleNamespace

import flying_points
import numpy as np
import pytest

import gasp_core as gasp
from gasp_core.errors import RecordingError
from gasp_core.simulation.splat_sources import prepare
from gasp_core.studies.comparison.parting import Parting, first_meeting, parting_of

G = 9.81


@pytest.fixture
def fall(tmp_path, toy):
    """Records a fall from heights [m] of the lowest points, through whatever is below: the engine knows no floor."""

    def make(*heights, colliders=(), velocities=None, duration=0.4):
        rubber = gasp.Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3)
        objects = tuple(
            gasp.SplatObject(
                name=f"toy {number}", splat=toy, material=rubber, position=(2.0 * number, 0, height), height=0.3,
                velocity=(0, 0, 0) if velocities is None else velocities[number], reduction=gasp.Reduction(mode="all"),
            )
            for number, height in enumerate(heights)
        )  # fmt: skip
        scene = gasp.Scene(duration=duration, frame_rate=50, objects=objects, colliders=tuple(colliders))
        able = dataclasses.replace(
            flying_points.descriptor().capabilities,
            collider_shapes=frozenset({gasp.HalfSpace, gasp.BoxShape}), moving_colliders=True,
        )  # fmt: skip
        engine = (dataclasses.replace(flying_points.descriptor(), capabilities=able), flying_points.Ballistic())
        run = gasp.simulate(scene, engine, tmp_path / f"{len(list(tmp_path.iterdir()))}.gasp", progress=False)
        return run, prepare(scene).assembly.problem

    return make


FLOOR = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))


def test_the_first_frame_within_reach_of_the_floor(fall):
    run, problem = fall(0.2, colliders=[FLOOR])
    lowest, reach = problem.points.reference_positions[:, 2].min(), 0.02
    time = math.sqrt(2 * (lowest - reach) / G)
    found = first_meeting(run, problem, reach)
    # In the next frame; the engine's steps of a millisecond add to the speed first.
    assert time - 1e-3 <= found <= time + 1 / 50


def test_what_stands_on_the_floor_has_met_nothing_yet(fall):
    """Held there from the start; a wall comes 1 m/s from .3 m away."""
    wall = gasp.Collider(
        shape=gasp.BoxShape(center=(-0.8, 0, 0), half_extents=(0.1, 3, 3)),
        motion=gasp.SteadyMotion(velocity=(1, 0, 0), center=(-0.8, 0, 0)),
    )
    run, problem = fall(0.0, colliders=[FLOOR, wall], duration=0.8)
    start = problem.points.reference_positions
    away = start[:, 0].min() + 0.7
    assert first_meeting(run, problem, 0.05) == pytest.approx(away - 0.05, abs=1 / 50)
    alone, problem = fall(0.0, colliders=[FLOOR])
    assert first_meeting(alone, problem, 0.05) is None


def test_a_hollow_box_is_met_from_inside(fall):
    box = gasp.Collider(shape=gasp.BoxShape(center=(0, 0, 0.5), half_extents=(1, 1, 0.5)), side=gasp.Side.INSIDE)
    run, problem = fall(0.2, colliders=[box])
    floor, same = fall(0.2, colliders=[FLOOR])
    assert first_meeting(run, problem, 0.02) == first_meeting(floor, same, 0.02)


def test_two_bodies_meet(fall):
    run, problem = fall(0.0, 0.0, velocities=[(2.5, 0, 0), (-2.5, 0, 0)])
    rows = problem.points.body_ids
    x = problem.points.reference_positions[:, 0]
    gap = x[rows == 1].min() - x[rows == 0].max()
    found = first_meeting(run, problem, 0.05)
    # Not before their boxes are within reach; by the time they overlap by .1 m at the latest.
    assert (gap - 0.05) / 5 - 1e-9 <= found <= (gap + 0.1) / 5 + 1 / 50
    with pytest.raises(RecordingError, match="points"):
        first_meeting(run, fall(0.0)[1], 0.05)


def apart(rms, rate=50.0):
    rms = np.asarray(rms, dtype=float)
    return SimpleNamespace(per_frame=SimpleNamespace(rms=rms), diagonal=2.0, times=np.arange(len(rms)) / rate)


@pytest.mark.parametrize(
    ("rms", "meetings", "expected", "said"),
    [
        ([0, 0.01, 0.02], (None, None), (None, None), "never 1 % apart"),
        ([0, 0.01, 0.021], (None, None), (0.04, None), "1 % apart at 0.04 s, and nothing meets anything"),
        ([0, 0.1], (0.02, None), (0.02, 0.02), "1 % apart at 0.02 s, in the frame of the first contact"),
        ([0, 0.1, 0.1, 0.1], (0.06, 0.04), (0.02, 0.04), "1 % apart at 0.02 s, before anything meets anything"),
        ([0, 0, 0, 0.1], (0.02, None), (0.06, 0.02), "1 % apart at 0.06 s, 0.04 s after the first contact"),
        ([0, 0.1], (0.5, 0.6), (0.02, None), "1 % apart at 0.02 s, and nothing meets anything"),
    ],
)
def test_parting_in_words(rms, meetings, expected, said):
    found = parting_of(apart(rms), meetings)
    assert found == Parting(apart_at=expected[0], met_at=expected[1])
    assert str(found) == said
