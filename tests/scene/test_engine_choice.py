"""One rule says what becomes of a scene's device, precision and options with another engine."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import pytest

from gasp_core import EngineChoice, Precision, Reduction, Scene
from gasp_core.discovery.registry import discover
from gasp_core.errors import UnsupportedSceneError
from gasp_core.scene.model import engine_notes
from gasp_core.simulation.engine_choice import choose_engine
from gasp_core.studies.comparison.running import notes_of, runs_of
from gasp_core.studies.tradeoff.settings import Setting, scene_with

FAKES = Path(__file__).parents[1] / "fake_plugins"
SINGLE, DOUBLE = Precision.FLOAT32, Precision.FLOAT64
OWN = EngineChoice(name="warp-mpm", device="cuda", precision=SINGLE, options={"threads": 1}, seed=3)


def of_engine(scene: Scene, **changes) -> Scene:
    return dataclasses.replace(scene, engine=dataclasses.replace(OWN, **changes))


@pytest.fixture
def installed(monkeypatch):
    """The engines of the tests, beside those that are installed."""
    for name in ("ballistic", "frail"):
        monkeypatch.syspath_prepend(FAKES / name)
    discover.cache_clear()
    yield
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("device", [None, "cpu", "cuda"])
@pytest.mark.parametrize("precision", [None, SINGLE, DOUBLE])
@pytest.mark.parametrize("name", sorted({*discover().engines, "ballistic", "frail"}))
def test_every_command_gives_every_engine_the_same_scene(scene_of, tmp_path, name, precision, device):
    scene = of_engine(scene_of(), device=device, precision=precision)
    can = discover().descriptor(name).capabilities
    run = choose_engine(scene, name, None, None, None)[0].engine
    compared = runs_of(scene, [name], tmp_path)[0].scene.engine
    assert run == compared == scene.with_engine(discover().descriptor(name)).engine
    # A trade names the precision of each of its settings itself.
    setting = Setting(resolution=8, precision=DOUBLE, substep_fraction=0.5)
    traded = scene_with(scene.with_engine(discover().descriptor(name)), setting).engine
    assert traded == dataclasses.replace(run, precision=DOUBLE)
    if name == "warp-mpm":
        assert run == scene.engine
    else:
        assert run.device == (device if device in can.devices else None)
        assert run.precision == (precision if precision in can.precisions else None)
        assert (run.options, run.seed) == ({}, 3)


@pytest.mark.parametrize("name", ["unimportable", "nobody"])
def test_of_an_engine_that_nobody_knows_the_name_alone_is_set(scene_of, tmp_path, name):
    scene = of_engine(scene_of())
    runs = runs_of(scene, [name], tmp_path)
    assert runs[0].scene == dataclasses.replace(scene, engine=dataclasses.replace(scene.engine, name=name))
    assert notes_of(scene, runs) == ()


def test_what_is_asked_for_by_name_is_kept_even_where_it_will_be_refused(scene_of):
    reference = discover().descriptor("reference-mpm")
    chosen = of_engine(scene_of()).with_engine(reference, device="cuda", precision=SINGLE).engine
    assert (chosen.device, chosen.precision) == ("cuda", SINGLE)


def test_what_another_engine_cannot_keep_is_told(scene_of):
    scene = of_engine(scene_of())
    reference, taichi = (discover().descriptor(name) for name in ("reference-mpm", "taichi-mpm"))
    told = engine_notes(scene, scene.with_engine(reference), reference)
    assert told == (
        "reference-mpm does not run on cuda, which the scene names for warp-mpm: it runs on cpu",
        "reference-mpm does not compute in float32, which the scene names for warp-mpm: it computes in float64",
    )
    assert engine_notes(scene, scene.with_engine(taichi), taichi) == ()
    warp = discover().descriptor("warp-mpm")
    assert engine_notes(scene, scene.with_engine(warp), warp) == ()


def test_a_single_precision_scene_runs_with_an_engine_that_has_double_alone(scene_of, run, tmp_path):
    recording = run(of_engine(scene_of(duration=0.1), device=None), tmp_path / "a.gasp")
    assert (recording.engine.name, recording.engine.precision) == ("ballistic", "float64")
    assert recording.notes[0].startswith("ballistic does not compute in float32, which the scene names for warp-mpm")
    with pytest.raises(UnsupportedSceneError, match="float32"):
        run(of_engine(scene_of()), tmp_path / "b.gasp", precision=SINGLE)


def test_resolution_and_cores_of_a_scene_are_set_in_one_place(scene_of):
    scene = scene_of(reduction=Reduction(mode="cores", count=9, levels=2))
    assert scene.with_resolution(12).accuracy.resolution == 12
    assert scene.with_resolution(12).accuracy.spacing is None
    assert scene.with_cores(fraction=0.5).objects[0].reduction == Reduction(mode="cores", fraction=0.5, levels=2)
    assert scene.with_cores(count=4).objects[0].reduction == Reduction(mode="cores", count=4, levels=2)
    assert scene.with_cores().objects[0].reduction == Reduction(mode="all")
