"""Plugins as distributions on the import path: good ones work, whatever the bad ones do."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from gasp_core.contract import Elastic, EngineAccuracy, Field, PointCloud, PointProblem, Precision, Status
from gasp_core.discovery.registry import FoundPlugin, Registry, discover
from gasp_core.engines.opening import open_engine
from gasp_core.errors import DuplicateEngineError, PluginLoadError, UnknownEngineError

BROKEN = ["unimportable", "exits", "misspelt", "unmarked", "twin_one", "twin_two", "other_major", "no_factory"]


def one_point():
    return PointProblem(
        points=PointCloud(
            reference_positions=np.array([[0.0, 0.0, 1.0]]),
            initial_velocities=np.array([[2.0, 0.0, 0.0]]),
            reference_volumes=np.ones(1),
            material_ids=np.zeros(1),
            body_ids=np.zeros(1),
        ),
        materials=(Elastic(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0),),
        gravity=(0.0, 0.0, -10.0),
    )


def test_engine_of_a_distribution_runs(installed):
    registry = installed("ballistic")
    descriptor = registry.descriptor("ballistic")
    assert registry.engines["ballistic"] is descriptor
    engine = open_engine(registry.offer("ballistic"))
    with engine.open(
        one_point(), device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=EngineAccuracy(), options=None
    ) as session:
        assert session.advance_to(0.5).status is Status.OK
        state = session.read(frozenset({Field.VELOCITIES}))
    # x0 + v0 t + g t^2 / 2 at t = 1/2: every number is a sum of powers of two times small integers, so exact.
    np.testing.assert_array_equal(state.positions, [[1.0, 0.0, -0.25]])
    np.testing.assert_array_equal(state.velocities, [[2.0, 0.0, -5.0]])


def test_a_good_engine_is_untouched_by_every_broken_one(installed):
    registry = installed("ballistic", *BROKEN)
    assert open_engine(registry.offer("ballistic")) is not None
    assert "twin" not in registry.engines
    assert {failure.distribution for failure in registry.failures} >= {
        "gasp-fake-unimportable",
        "gasp-fake-exits",
        "gasp-fake-misspelt",
        "gasp-fake-unmarked",
        "gasp-fake-other-major",
    }
    for failure in registry.failures:
        assert "\n" not in failure.error


def test_plugin_that_fails_to_import_is_kept_with_its_error(installed):
    registry = installed("unimportable")
    (failure,) = [failure for failure in registry.failures if failure.name == "unimportable"]
    assert failure.distribution == "gasp-fake-unimportable"
    assert "RuntimeError: the flux capacitor is missing" in failure.error
    assert "pip install --upgrade --force-reinstall gasp-fake-unimportable" in failure.error
    with pytest.raises(PluginLoadError, match=r"gasp-fake-unimportable.*flux capacitor"):
        registry.descriptor("unimportable")


def test_plugin_that_exits_is_a_failure_and_its_print_stays_out_of_stdout(installed, capsys):
    registry = installed("exits")
    (failure,) = [failure for failure in registry.failures if failure.name == "exits"]
    assert "tried to exit" in failure.error
    assert capsys.readouterr().out == ""


def test_ctrl_c_during_discovery_is_not_swallowed():
    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Registry.of([FoundPlugin(name="slow", distribution="gasp-slow", load=interrupted)])


def test_misspelt_hook_names_the_function_and_the_hooks(installed):
    registry = installed("misspelt")
    (failure,) = [failure for failure in registry.failures if failure.name == "misspelt"]
    assert "unknown hook gasp_point_engine;" in failure.error
    for hook in ("gasp_point_engines", "gasp_splat_renderers", "gasp_commands"):
        assert hook in failure.error
    assert "misspelt" not in registry.offers


def test_hook_without_its_mark_is_told(installed):
    (failure,) = [failure for failure in installed("unmarked").failures if failure.name == "unmarked"]
    assert "@hookimpl" in failure.error


def test_two_engines_of_one_name_are_an_error_that_names_both(installed):
    registry = installed("twin_one", "twin_two", "ballistic")
    for ask in (registry.descriptor, registry.offer):
        with pytest.raises(DuplicateEngineError, match=r"gasp-fake-twin-one and gasp-fake-twin-two"):
            ask("twin")
    assert "ballistic" in registry.engines


def test_one_of_the_two_alone_is_no_error(installed):
    assert installed("twin_two").descriptor("twin").name == "twin"


def test_another_contract_is_refused_with_both_versions(installed):
    registry = installed("other_major")
    assert "other-major" not in registry.engines
    with pytest.raises(PluginLoadError, match=r"contract 2\.0.*speaks 1\.\d+: update gasp-core"):
        open_engine(registry.offer("other-major"))


def test_missing_factory_is_known_only_when_asked_for(installed):
    registry = installed("no_factory")
    assert "no-factory" in registry.engines
    with pytest.raises(PluginLoadError, match=r"no-factory.*fake_no_factory_engine.*pip install"):
        open_engine(registry.offer("no-factory"))


def test_missing_backend_says_what_to_install(installed):
    with pytest.raises(PluginLoadError, match=r'No module named .fake_backend.; pip install "fake-backend>=3"$'):
        open_engine(installed("no_backend").offer("no-backend"))


def test_unknown_engine_lists_the_known_and_suggests(installed):
    registry = installed("ballistic")
    with pytest.raises(UnknownEngineError, match=r'"balistic".*ballistic.*did you mean "ballistic"\?'):
        registry.descriptor("balistic")
    with pytest.raises(UnknownEngineError, match=r"ballistic.*install the plugin that offers it"):
        registry.descriptor("xyz")


def test_discovery_is_made_once(installed):
    assert installed("ballistic") is discover()


def test_the_same_distribution_twice_on_the_path_counts_once(installed, tmp_path, monkeypatch):
    shutil.copytree(Path(__file__).parents[1] / "fake_plugins" / "ballistic", tmp_path / "again")
    monkeypatch.syspath_prepend(tmp_path / "again")
    assert "ballistic" in installed("ballistic").engines


def test_unreadable_metadata_of_a_stranger_is_passed_over(installed, tmp_path, monkeypatch):
    info = tmp_path / "stranger-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (info / "entry_points.txt").write_bytes(b"[gasp]\n\xff\xfe = x\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert "ballistic" in installed("ballistic").engines


def test_an_engine_is_imported_with_the_stdout_of_the_program(installed):
    """A library that finds another stdout at its import may take it for a notebook's and behave differently."""
    registry = installed("ballistic")
    assert sys.modules.get("fake_ballistic_engine") is None
    open_engine(registry.offer("ballistic"))
    assert sys.modules["fake_ballistic_engine"].STDOUT_AT_IMPORT is sys.stdout
