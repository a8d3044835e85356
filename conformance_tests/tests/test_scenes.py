"""The shared scenes: that every file says what it means to, and that the points made from it fill what they should."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gasp_conformance import metamorphic, scenes
from gasp_conformance.clouds import ball_of_points, box_of_points, jittered, point_volume
from gasp_conformance.scenes import MATERIALS, shared_scene, thrown_block

from gasp_core.errors import SceneError
from gasp_core.stepping.time_step import rest_bound

FILES = sorted(
    file.name.removesuffix(".toml")
    for file in (resources.files("gasp_conformance") / "scene_files").iterdir()
    if file.name.endswith(".toml")
)


def scene_names() -> list[str]:
    return [name for name in FILES if name != "materials"]


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_fills_its_bodies_at_each_of_its_resolutions(name: str) -> None:
    scene = shared_scene(name)
    assert scene.title and (scene.cells or scene.finer_cells)
    for cells in (*scene.cells, *scene.finer_cells):
        problem, spacing = scene.problem(cells), scene.spacing(cells)
        assert problem.points.body_ids.max() == len(scene.bodies) - 1
        for number, body in enumerate(scene.bodies):
            own = problem.points.body_ids == number
            sides = [max(side * body.length, spacing) for side in body.proportions]
            sides[0] += body.embedded * spacing
            volume = math.prod(sides)
            # A ball is cut from cubes: those on its surface belong to it or do not.
            share = math.pi / 6 if body.form == "ball" else 1.0
            rough = 6 * spacing / body.length if body.form == "ball" else 1e-9
            assert problem.points.reference_volumes[own].sum() == pytest.approx(share * volume, rel=rough)
            low = problem.points.reference_positions[own].min(axis=0)
            assert (low[1:] > np.array(body.corner)[1:]).all()


def test_every_scene_is_used_by_a_case() -> None:
    package = Path(scenes.__file__).parent
    sources = "".join(file.read_text(encoding="utf-8") for file in package.glob("*.py"))
    assert [name for name in FILES if f'"{name}"' not in sources] == []


def test_materials_are_of_the_kind_they_are_filed_under() -> None:
    assert {name: material.kind for name, material in MATERIALS.items()} == {name: name for name in MATERIALS}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('title = "x"\nspeed = 1', "speed: unknown key"),
        ('title = "x"\ncells = [1.5]', "cells: must be an array of whole numbers > 0"),
        (
            'title = "x"\n[[body]]\nlength = 1\ncorner = [0, 0, 0]\nmaterial = { model = "jelly" }',
            "model: must be one of",
        ),
        ('title = "x"\n[numbers]\nduration = "long"', "duration: must be a number"),
    ],
)
def test_a_scene_file_that_is_wrong_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str, complaint: str
) -> None:
    (tmp_path / "scene_files").mkdir()
    (tmp_path / "scene_files" / "wrong.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(scenes.resources, "files", lambda _: tmp_path)
    with pytest.raises(SceneError, match=rf"^wrong\.toml: .*{complaint}"):
        scenes.shared_scene.__wrapped__("wrong")


def test_points_stand_for_equal_parts() -> None:
    box = box_of_points((1, 2, 3), (2, 1, 1), 0.5)
    assert len(box) == 2 * 8
    np.testing.assert_allclose(box.mean(axis=0), [1.5, 2.25, 3.25], rtol=1e-14)
    ball = ball_of_points((0, 0, 0), 16, 1 / 16)
    assert np.linalg.norm(ball - 0.5, axis=1).max() <= 0.5
    # Lattice points in a ball of radius R cells of a half: the surface's roughness is O(1/R) at most.
    assert len(ball) * point_volume(1 / 16) == pytest.approx(math.pi / 6, rel=1 / 16)
    moved = jittered(box, 0.5, 0.3, seed=1)
    np.testing.assert_array_equal(moved, jittered(box, 0.5, 0.3, seed=1))
    assert 0 < np.abs(moved - box).max() <= 0.3 * 0.25


def test_a_throw_ends_after_its_substeps_well_inside_the_bound() -> None:
    throw = thrown_block(MATERIALS["fluid"], cells=4, substeps=100)
    substep = throw.accuracy.substep
    assert substep is not None and throw.accuracy.spacing is not None
    assert throw.end == pytest.approx(100 * substep, rel=1e-12)
    assert substep < rest_bound(MATERIALS["fluid"], throw.accuracy.spacing)
    assert throw.problem.points.reference_positions[:, 2].min() > 0


@pytest.mark.parametrize("change", metamorphic.SMOOTH, ids=lambda change: change.name)
def test_the_way_back_undoes_a_change(change: Any) -> None:
    throw = thrown_block(MATERIALS["elastic"], cells=3)
    trial = metamorphic.Trial(problem=throw.problem, accuracy=throw.accuracy, end=throw.end)
    changed, back = change.apply(trial)
    before, after = trial.problem.points, changed.problem.points
    # A few roundings of numbers of the order of one.
    np.testing.assert_allclose(back(after.reference_positions), before.reference_positions, atol=1e-14)
    assert trial.accuracy.spacing is not None and changed.accuracy.spacing is not None
    scale, bodies = changed.accuracy.spacing / trial.accuracy.spacing, len(np.unique(after.body_ids))
    # Larger units keep Froude's number v^2 / g L.
    wanted = bodies * before.reference_volumes.sum() * scale**3
    assert after.reference_volumes.sum() == pytest.approx(wanted, rel=1e-12)
    speeds = [np.linalg.norm(points.initial_velocities, axis=1) for points in (before, after)]
    assert speeds[1].max() == pytest.approx(speeds[0].max() * math.sqrt(scale), rel=1e-12)
    assert changed.end == pytest.approx(trial.end * math.sqrt(scale), rel=1e-12)
