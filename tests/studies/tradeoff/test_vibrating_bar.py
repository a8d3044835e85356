"""Whether reported errors are true: a bar whose motion is known, measured as if it were not."""

import dataclasses
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

from gasp_core import EngineChoice, Recording, load_scene, simulate
from gasp_core.contract import Precision
from gasp_core.studies.tradeoff import ClosedForm, grid, tradeoff

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """The scene, and its truth."""
    folder = tmp_path_factory.mktemp("bar")
    for name in ("vibrating_bar.py", "vibrating_bar.toml"):
        shutil.copy(EXAMPLES / name, folder)
    made = runpy.run_path(str(folder / "vibrating_bar.py"), run_name="__main__")
    return load_scene(folder / "vibrating_bar.toml"), ClosedForm(function=made["position"], name="position")


def error_of(bar, out, resolution, substep_fraction=0.5, engine="warp-mpm"):
    scene, truth = bar
    accuracy = dataclasses.replace(scene.accuracy, resolution=resolution, substep_fraction=substep_fraction)
    scene = dataclasses.replace(scene, accuracy=accuracy, engine=EngineChoice(name=engine))
    return truth.error_of(
        simulate(scene, out=out / "a.gasp", overwrite=True, trust_code=True, progress=False)
    ).rms_share


def test_the_bar_is_even_and_as_long_as_it_is_however_it_is_divided(bar):
    """Its error falls by four where the spacing is halved: a cell too many at an end would make that two."""
    from gasp_core.simulation.splat_sources import prepare

    scene, _ = bar
    for resolution in (8, 16, 24, 32, 48):
        accuracy = dataclasses.replace(scene.accuracy, resolution=resolution)
        assembly = prepare(dataclasses.replace(scene, accuracy=accuracy)).assembly
        points = assembly.problem.points
        layers = np.minimum(points.reference_positions[:, 0] / assembly.spacing + 1e-9, resolution - 1).astype(int)
        volumes = np.bincount(layers, points.reference_volumes)
        # Each cell's share is one of a sum of at most a few thousand doubles.
        np.testing.assert_allclose(volumes, volumes[0], rtol=1e-11)
        assert len(volumes) == resolution
        assert assembly.spacing == pytest.approx(1 / resolution, rel=1e-6)


@pytest.mark.thorough
def test_the_example_is_as_accurate_as_its_method(bar, tmp_path):
    """V3 of 2D and 3D MLS-MPM in float64: frequencies are off by 1.0 (dx / L)^2 [measured at 8 to 64 cells].

    A phase that is off by e = 2 pi f t (df / f), rms e / sqrt 3 over a period of 0.64 s, is rms A e / (2 sqrt 3) in
    place: 1.8e-2 (dx / L)^2 of the length. Half as much again for what amplitude and substeps do.
    """
    for resolution in (8, 16, 24):
        assert error_of(bar, tmp_path, resolution) < 1.5 * 1.8e-2 / resolution**2
    assert error_of(bar, tmp_path, 8) > 3 * error_of(bar, tmp_path, 16)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("resolutions", "fractions", "substep"),
    [((12, 16, 24, 32), (None, 0.3, 0.1), 0.5), ((10, 16, 24), (None, 0.2), 0.9)],
)
def test_the_true_error_is_within_the_interval_that_is_reported(bar, tmp_path, resolutions, fractions, substep):
    scene, truth = bar
    scene = dataclasses.replace(scene, engine=EngineChoice(name="warp-mpm"))
    settings = grid(resolutions, fractions, (Precision.FLOAT32,), (substep,))
    measured = tradeoff(scene, settings, tmp_path / "bar", repeats=1, keep=True, trust_code=True, progress=False)
    print(measured.truth["sentence"])
    within = []
    for row in measured.rows:
        assert row.error is not None, row.reason
        run = Recording.open(tmp_path / "bar" / "recordings" / f"{row.setting.key}.gasp")
        true = truth.error_of(run).rms_share
        within.append(row.error_low <= true <= row.error_high)
        print(f"{row.setting.key}: true {true:.3g}, {row.error:.3g} in {row.error_low:.3g} .. {row.error_high:.3g}")
    assert sum(within) >= 0.9 * len(within)
    # An interval that holds anything says nothing: these tell the coarsest setting of all vertices from the finest.
    whole = [row for row in measured.rows if row.setting.fraction is None]
    assert whole[0].error_low > whole[-1].error_high


@pytest.mark.slow
def test_substeps_inside_their_bound_are_no_knob_of_accuracy(bar, tmp_path):
    """As measured for MLS-MPM: refine the grid, not the time."""
    errors = {
        (resolution, substep): error_of(bar, tmp_path, resolution, substep)
        for resolution in (8, 16, 32)
        for substep in (0.25, 0.5, 0.9)
    }
    by_substep = max(
        max(own) - min(own)
        for own in (
            [error for (cells, _), error in errors.items() if cells == resolution] for resolution in (8, 16, 32)
        )
    )
    assert by_substep < 0.1 * (errors[8, 0.5] - errors[32, 0.5])
