"""What a check gives to an engine, written as a script that does the same."""

from __future__ import annotations

import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from click.testing import CliRunner
from gasp_conformance.command import conformance
from gasp_conformance.random_scenes import random_scene
from gasp_conformance.scene_writing import WritingEngine
from gasp_conformance.subject import find_subject

from gasp_core.contract import EngineAccuracy, PointEngine, PointProblem

ENGINE = "reference-mpm"


class Still:
    """Opens whatever it is given, and moves nothing."""

    def open(self, problem: PointProblem, **_: Any) -> Any:
        return nullcontext()


def made(script: Path) -> tuple[PointProblem, EngineAccuracy, list[float]]:
    """What a script makes, without what it does with it."""
    told = script.read_text().partition("\nwith ")[0]
    names: dict[str, Any] = {"__file__": str(script)}
    exec(compile(told, str(script), "exec"), names)
    return names["PROBLEM"], names["ACCURACY"], names["TIMES"]


@pytest.mark.parametrize("number", range(0, 60, 3))
def test_a_script_makes_the_very_problem(tmp_path: Path, number: int) -> None:
    found = find_subject(ENGINE, None, None)
    scene = random_scene(number, found.descriptor.capabilities)
    engine = WritingEngine(cast("PointEngine", Still()), tmp_path, found.name, "a check")
    with replace(found, engine=cast("PointEngine", engine)).open(scene.problem, scene.accuracy):
        pass
    problem, accuracy, times = made(tmp_path / "scene-1.py")
    assert (accuracy, times) == (scene.accuracy, [])
    for name in ("reference_positions", "initial_velocities", "reference_volumes", "material_ids", "body_ids"):
        np.testing.assert_array_equal(getattr(problem.points, name), getattr(scene.problem.points, name))
    assert replace(problem, points=scene.problem.points) == scene.problem


class Falls:
    """Refuses to open, or falls over when it is first asked to advance."""

    def __init__(self, opens: bool) -> None:
        self.opens = opens

    def open(self, problem: PointProblem, **_: Any) -> Any:
        if not self.opens:
            raise RuntimeError
        return self

    def advance_to(self, time: float) -> None:
        raise RuntimeError


@pytest.mark.parametrize(("opens", "asked"), [(False, []), (True, [0.5])])
def test_what_an_engine_falls_over_is_written_before_it_does(tmp_path: Path, opens: bool, asked: list[float]) -> None:
    found = find_subject(ENGINE, None, None)
    scene = random_scene(0, found.descriptor.capabilities)
    engine = WritingEngine(cast("PointEngine", Falls(opens)), tmp_path, found.name, "a check")
    with pytest.raises(RuntimeError):
        replace(found, engine=cast("PointEngine", engine)).open(scene.problem, scene.accuracy).advance_to(0.5)
    assert made(tmp_path / "scene-1.py")[2] == asked


def test_the_script_does_what_the_check_did(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran = CliRunner().invoke(conformance, [ENGINE, "--precision", "float64", "--write-scene", "drift"])
    assert ran.exit_code == 3, ran.output
    _, _, times = made(tmp_path / "drift" / "scene-1.py")
    script = subprocess.run(
        [sys.executable, "scene-1.py"], cwd=tmp_path / "drift", capture_output=True, text=True, check=False, timeout=300
    )
    assert script.returncode == 0, script.stderr
    lines = [line for line in script.stdout.splitlines() if line and not line.startswith(" ")]
    assert len(lines) == len(times) > 0 and all(" ok " in line for line in lines)


def test_a_name_of_no_check_is_a_matter_of_usage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran = CliRunner().invoke(conformance, [ENGINE, "--write-scene", "V8"])
    assert ran.exit_code == 2 and not list(tmp_path.iterdir())


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drift").mkdir()
    ran = CliRunner().invoke(conformance, [ENGINE, "--write-scene", "drift"])
    assert ran.exit_code == 2 and "drift is there already: move it away" in ran.output
