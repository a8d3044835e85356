"""The arithmetic of a trade: what is left, medians and fronts, settings and truths."""

from __future__ import annotations

import dataclasses
import math
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gasp_core import Elastic, EngineAccuracy, Reduction, Scene, SplatObject, read_splat
from gasp_core.contract import Precision
from gasp_core.errors import AccuracyError, SceneError
from gasp_core.studies.runs import RunStatus
from gasp_core.studies.tradeoff import default_resolutions, grid, load_truth
from gasp_core.studies.tradeoff.refining import expected_order, ladder
from gasp_core.studies.tradeoff.report import HEADER, Row, Tradeoff, cautions
from gasp_core.studies.tradeoff.richardson import remainder_of
from gasp_core.studies.tradeoff.settings import Setting, scene_with
from gasp_core.studies.tradeoff.statistics import dominated, summary
from gasp_core.toy import make_toy

EXAMPLES = Path(__file__).parents[3] / "examples"
SINGLE, DOUBLE = Precision.FLOAT32, Precision.FLOAT64


def scene(**others) -> Scene:
    toy = make_toy(64)
    items = (
        SplatObject(name="toy", splat=toy, material=Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3)),
        SplatObject(name="wall", splat=toy, static=True),
    )
    return Scene(duration=1.0, frame_rate=25, objects=items, **others)


@given(st.floats(1.51, 2.49), st.floats(1e-8, 1e8), st.tuples(*[st.integers(2, 300)] * 3))
def test_what_a_power_law_leaves_is_found(order, constant, cells):
    coarse, middle, fine = sorted(cells)
    assume(coarse < middle < fine)
    h1, h2, h3 = 1 / coarse, 1 / middle, 1 / fine
    differences = [constant * (h1**order - h2**order), constant * (h2**order - h3**order)]
    left = remainder_of((h1, h2, h3), *differences, 0.0, 2.0)
    # Where two spacings are nearly one their difference keeps a few digits fewer.
    assert left.order == pytest.approx(order, abs=1e-6)
    assert left.safety == 1.25
    true = constant * h3**order
    # By the smaller of seen and promised order: exact below it, on the safe side above.
    assert left.value == pytest.approx(1.25 * true, rel=1e-5) if order <= 2 else left.value >= 1.25 * true


@pytest.mark.parametrize(("order", "expected"), [(1.0, 2.0), (3.0, 2.0), (0.3, 1.0), (2.0, 1.0)])
def test_another_order_than_promised_is_trusted_less(order, expected):
    h = (1.5**2, 1.5, 1.0)
    left = remainder_of(h, h[0] ** order - h[1] ** order, h[1] ** order - h[2] ** order, 0.0, expected)
    assert left.safety == 3.0
    assert left.value == pytest.approx(3 * (1.5**order - 1) / 0.5)


def test_runs_that_do_not_draw_nearer_leave_the_larger_difference():
    left = remainder_of((4.0, 2.0, 1.0), 1.0, 2.0, 0.0, 2.0)
    assert (left.order, left.safety, left.value) == (0.0, 3.0, 6.0)
    left = remainder_of((4.0, 2.0, 1.0), 2.0, 1.9, 0.0, 2.0)
    assert left.order == pytest.approx(math.log2(2 / 1.9))
    assert left.value == pytest.approx(5.7)
    assert remainder_of((4.0, 2.0, 1.0), 0.0, 0.0, 0.0, 2.0).value == 0.0
    assert remainder_of((4.0, 2.0, 1.0), 1.0, 0.0, 0.0, 2.0).value == 0.0
    for wrong in ((1.0, 2.0, 3.0), (2.0, 2.0, 1.0), (2.0, 1.0, 0.0)):
        with pytest.raises(ValueError, match="must fall"):
            remainder_of(wrong, 1.0, 1.0, 0.0, 2.0)


def test_what_substeps_do_comes_on_top():
    spacings = (4.0, 2.0, 1.0)
    without = remainder_of(spacings, 12.0, 3.0, 0.0, 2.0)
    with_them = remainder_of(spacings, 12.0, 3.0, 0.4, 2.0)
    assert (without.value, without.substeps) == (pytest.approx(1.25), 0.0)
    assert (with_them.value, with_them.substeps) == (pytest.approx(1.75), pytest.approx(0.5))


def test_summary_of_few_and_of_many():
    one = summary([3.0])
    assert (one.median, one.deviation, one.low, one.high) == (3.0, 0.0, 3.0, 3.0)
    outlier = summary([1.0, 1.1, 1.2, 1.3, 100.0])
    assert (outlier.median, outlier.deviation) == (1.2, pytest.approx(0.1))
    drawn = np.random.default_rng(1).normal(10.0, 1.0, size=(200, 25))
    held = [own.low <= 10.0 <= own.high for own in map(summary, drawn)]
    # A 95 % interval; the percentile bootstrap of a median of 25 holds about that. Three deviations of 200 draws: 5 %.
    assert np.mean(held) > 0.9


def test_what_is_beaten_and_what_is_not():
    times = [[1.0, 1.1, 1.2], [2.0, 2.1, 2.2], [2.5, 2.6, 2.7], [4.0, 4.1, 4.2]]
    beaten = dominated(times, [[0.4], [0.2], [0.3], [0.1]])
    assert beaten.tolist() == [0.0, 0.0, 1.0, 0.0]
    # Of two alike in error and overlapping in time each is sometimes beaten: neither is sure to be on the front.
    alike = dominated([[1.0, 1.2, 1.4], [1.1, 1.2, 1.3]], [[0.1], [0.1]])
    assert (alike > 0.05).all() and (alike < 1).all()
    assert dominated([[1.0]], [[0.1]]).tolist() == [0.0]
    # The very same in both beats nothing.
    assert dominated([[1.0], [1.0]], [[0.1], [0.1]]).tolist() == [0.0, 0.0]


def test_the_grid_of_settings():
    settings = grid((8, 16, 8), (None, 0.1), (SINGLE,), (0.5, 0.9))
    assert len(settings) == len({setting.key for setting in settings}) == 8
    assert settings[0].key == "8-all-float32-0.5"
    with pytest.raises(AccuracyError, match="no fractions are named"):
        grid((8,), (), (SINGLE,), (0.5,))
    for wrong in ({"resolution": 0}, {"fraction": 0.0}, {"fraction": 2.0}, {"substep_fraction": 0.0}):
        with pytest.raises(SceneError, match="must be"):
            Setting(**({"resolution": 8, "precision": SINGLE, "substep_fraction": 0.5} | wrong))
    with pytest.raises(AccuracyError, match="whole number"):
        Setting(resolution=8.5, precision=SINGLE, substep_fraction=0.5)


def test_the_scene_of_a_setting():
    base = scene(accuracy=EngineAccuracy(spacing=0.01, substep=1e-4, solver_tolerance=1e-3))
    own = scene_with(base, Setting(resolution=12, fraction=0.2, precision=DOUBLE, substep_fraction=0.7))
    assert own.accuracy == EngineAccuracy(resolution=12, substep_fraction=0.7, solver_tolerance=1e-3)
    assert own.objects[0].reduction == Reduction(mode="cores", fraction=0.2)
    assert own.objects[1].reduction == Reduction()
    assert own.engine.precision is DOUBLE
    framed = Reduction(mode="cores", count=7, levels=2, transfer="frame")
    framed_scene = dataclasses.replace(base, objects=(dataclasses.replace(base.objects[0], reduction=framed),))
    again = scene_with(framed_scene, Setting(resolution=12, fraction=0.2, precision=DOUBLE, substep_fraction=0.7))
    assert again.objects[0].reduction == dataclasses.replace(framed, count=None, fraction=0.2)
    every = scene_with(framed_scene, Setting(resolution=12, precision=DOUBLE, substep_fraction=0.7))
    assert every.objects[0].reduction == Reduction(mode="all")


def test_default_resolutions():
    assert default_resolutions(scene(accuracy=EngineAccuracy(resolution=64))) == (32, 45, 64)
    assert default_resolutions(scene(accuracy=EngineAccuracy(resolution=2))) == (2,)


def test_the_ladder_is_finer_than_all_that_is_asked_for():
    steps = ladder(grid((8, 32), (0.1,), (SINGLE,), (0.7,)), (SINGLE, DOUBLE))
    assert [(step.resolution, step.substep_fraction) for step in steps] == [(21, 0.7), (32, 0.7), (48, 0.7), (48, 0.35)]
    assert {(step.fraction, step.precision) for step in steps} == {(None, DOUBLE)}
    assert ladder(grid((3,), (None,), (SINGLE,), (0.5,)), (SINGLE,))[-1].precision is SINGLE
    assert [step.resolution for step in ladder(grid((3,), (None,), (SINGLE,), (0.5,)), (SINGLE,))] == [2, 3, 4, 4]
    with pytest.raises(AccuracyError, match="ask for at least 3"):
        ladder(grid((2,), (None,), (SINGLE,), (0.5,)), (SINGLE,))


def test_contact_halves_the_order_that_is_expected():
    from gasp_core import Collider, HalfSpace

    alone = scene()
    assert expected_order(alone) == 2.0
    floor = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    assert expected_order(dataclasses.replace(alone, colliders=(floor,))) == 1.0
    two = (alone.objects[0], dataclasses.replace(alone.objects[0], name="other"))
    assert expected_order(dataclasses.replace(alone, objects=two)) == 1.0


def mass_at(splat, resolution) -> float:
    """Volume [m^3] of an object 0.3 m high whose every vertex is a point, as the engine has it."""
    from gasp_core.simulation.splat_sources import prepare

    item = SplatObject(
        name="a",
        splat=splat,
        height=0.3,
        material=Elastic(density=1, youngs_modulus=1, poissons_ratio=0),
        reduction=Reduction(mode="all"),
    )
    whole = Scene(duration=1, frame_rate=1, objects=(item,), accuracy=EngineAccuracy(resolution=resolution))
    return float(prepare(whole).assembly.problem.points.reference_volumes.sum())


@pytest.mark.thorough
def test_a_hollow_splat_weighs_less_with_every_finer_grid():
    """It fills the cells of its surface, so that no resolution is near a limit: the mass alone nearly halves."""
    masses = [mass_at(make_toy(20_000), resolution) for resolution in (12, 24, 48)]
    assert masses[1] < 0.7 * masses[0] and masses[2] < 0.7 * masses[1]


def test_a_filled_ball_weighs_too_much_by_half_a_cell_all_round(tmp_path):
    """At order 1: twice the resolution halves what is too much, but for the steps of cells that a ball is made of."""
    shutil.copy(EXAMPLES / "make_ball.py", tmp_path)
    runpy.run_path(str(tmp_path / "make_ball.py"), run_name="__main__")
    ball = read_splat(tmp_path / "ball.ply")
    true = np.pi / 6 * 0.3**3
    excess = [mass_at(ball, resolution) / true - 1 for resolution in (5, 10)]
    assert 0.3 * excess[0] < excess[1] < 0.65 * excess[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("nothing", 'written "FILE.py:FUNCTION"'),
        ("file.py:not a name", 'written "FILE.py:FUNCTION"'),
        ("absent.py:position", "there is no file absent.py"),
        ("no_such_module_here:position", "cannot be imported"),
        ("math:no_such_function", "no function"),
    ],
)
def test_no_truth(text, says):
    with pytest.raises(AccuracyError, match=says):
        load_truth(text)


def row_of(error, low, high, repeats=(1.0, 1.1, 0.9), beaten=0.0):
    setting = Setting(resolution=16, fraction=None, precision=SINGLE, substep_fraction=0.5)
    own = summary(repeats)
    return Row(
        setting=setting,
        ending=RunStatus.COMPLETE,
        error=error,
        error_low=low,
        error_high=high,
        start=own,
        run=own,
        cpu=own,
        repeats=tuple(repeats),
        beaten=beaten,
    )


def test_what_cannot_be_told_apart_is_said():
    """Of those on the front alone: what is beaten is nobody's choice."""
    close = [row_of(0.004, 0.0, 0.045), row_of(0.005, 0.0, 0.046)]
    (said,) = cautions(close)
    assert "errors of the 2 settings on the front cannot be told apart" in said and "between 0 and 4.5 %" in said
    apart = [row_of(0.004, 0.003, 0.005), row_of(0.01, 0.009, 0.011)]
    assert cautions(apart) == () == cautions([*apart[:1], row_of(0.0041, 0.003, 0.005, beaten=0.9)])


def test_of_one_repeat_no_interval_is_shown():
    rows = [row_of(0.004, 0.003, 0.005, repeats=(1.0,))]
    (said,) = cautions(rows)
    assert "timed once" in said
    table = Tradeoff(scene="a", engine={}, rows=tuple(rows), truth={}, machine={}, notes=()).table()
    assert table[0][HEADER.index("RUN s") + 1] == "-"
