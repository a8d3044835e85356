"""What `auto` stands for, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from splat_shells import SHAPES, discs, shell

from gasp_core import Elastic, EngineAccuracy, Fluid, Reduction, Scene, SplatObject
from gasp_core.reduction.assembly import assemble
from gasp_core.scene.selection import place_object

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
WATER = Fluid(density=1000, bulk_modulus=1e5)


def assembled(*items, known=None, spacing_before=None, **accuracy):
    scene = Scene(duration=1, frame_rate=1, objects=items, accuracy=EngineAccuracy(**accuracy))
    return assemble(scene, [place_object(item, item.splat) for item in items], known=known, spacing=spacing_before)


_MADE = {}


def alone(splat, **options):
    """The assembly of a thing of it, made once, to look at; of splats that are there all the time."""
    key = (id(splat), repr(options))
    if key not in _MADE:
        _MADE[key] = assembled(thing(splat, **options))
    return _MADE[key]


def thing(splat, name="thing", **options):
    return SplatObject(**{"name": name, "splat": splat, "material": JELLY, **options})


def cloud(count, opacity=0.9):
    """Discs anywhere in a cube: they are the surface of nothing."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(count, 3))
    normals = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return discs(rng.uniform(size=(count, 3)), normals, np.full((count, 2), 0.005), np.full(count, opacity), rng)


def sheet(count=6_000):
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (count, 3)) * [1, 1, 0]
    return discs(points, np.tile([0.0, 0, 1], (count, 1)), np.full((count, 2), 0.02), np.full(count, 0.9), rng)


BALL, SHEET = shell(SHAPES["sphere"], count=5_000), sheet()


@pytest.mark.parametrize(
    ("splat", "mode", "because"),
    [
        (BALL, "volume", "its Gaussians are the surface of"),
        (shell(SHAPES["sphere"], count=2_000), "all", "2,000 Gaussians are few"),
        (SHEET, "cores", "thin matter"),
        (cloud(3_000, opacity=0.02), "all", "too faint"),
    ],
    ids=["a ball", "few", "a sheet", "haze"],
)
def test_the_mode_follows_from_the_body_and_the_user_is_told(splat, mode, because):
    (body,) = alone(splat).bodies
    assert body.carrier.kind == mode
    assert body.notes[0].startswith(f'reduction "{mode}", because ')
    assert because in body.notes[0]


def test_what_the_scene_names_is_neither_chosen_nor_explained():
    splat = shell(SHAPES["sphere"], count=5_000)
    for reduction in (Reduction(mode="all"), Reduction(mode="volume"), Reduction(mode="cores", count=20)):
        assembly = assembled(thing(splat, reduction=reduction), resolution=24)
        assert assembly.bodies[0].carrier.kind == reduction.mode
        assert not any("because" in note for note in assembly.bodies[0].notes)
        assert assembly.accuracy.resolution == 24
        assert assembly.notes == ()


def test_a_run_that_is_gone_on_with_keeps_what_was_chosen():
    splat = shell(SHAPES["sphere"], count=5_000)
    (before,) = assembled(thing(splat, reduction=Reduction(mode="all")), resolution=24).bodies
    (after,) = assembled(thing(splat), known={"thing": before.carrier}, resolution=24).bodies
    assert after.carrier.kind == "all"
    assert 'reduction "all", because the recording has it: ' in after.notes[0]


def test_a_run_that_is_gone_on_with_keeps_its_grid_whatever_its_points_have_become():
    """Sheets for which as many cores as cells would be more points than vertices: "cores" for the grid, then "all"."""
    across = np.stack(np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 54)]), axis=-1).reshape(-1, 2)
    points = np.append(across, 0.15 * np.sin(6 * across[:, :1]), axis=1)
    slopes = np.stack([-0.9 * np.cos(6 * points[:, 0]), 0 * points[:, 0], np.ones(len(points))], axis=1)
    normals = slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
    sizes, opacities = np.full((len(points), 2), 0.8 / 54), np.full(len(points), 0.99)
    item = thing(discs(points, normals, sizes, opacities, np.random.default_rng(0)))
    before = assembled(item)
    assert before.bodies[0].carrier.kind == "all" and before.accuracy.resolution == 48
    after = assembled(item, known={"thing": before.bodies[0].carrier}, spacing_before=before.spacing)
    assert after.spacing == before.spacing and after.accuracy.resolution == 48
    assert "as it was recorded" in after.notes[0]


def test_there_are_enough_cores_for_the_cells_of_a_sheet():
    (body,) = alone(SHEET).bodies
    assert "are few" not in " ".join(body.notes)
    (body,) = assembled(thing(SHEET), resolution=400).bodies
    assert body.carrier.kind == "all", "as many cores would be more points than there are vertices"


@pytest.mark.parametrize(
    ("splat", "options", "cells"),
    [
        # 20 cells in a diameter are ten in a radius: the mean depth of a ball is a quarter of its radius.
        (BALL, {}, 24),
        pytest.param(BALL, {"material": WATER}, 48, marks=pytest.mark.thorough),
        (shell(SHAPES["thin box"], count=20_000), {}, 40),
        (SHEET, {}, 48),
        (sheet(count=1_500), {}, 24),
        (cloud(30), {}, 8),
        (SHEET, {"reduction": Reduction(mode="cores", count=300)}, 16),
    ],
    ids=["a ball", "of water", "a thin box", "a sheet", "of few discs", "a cloud", "300 cores"],
)
def test_there_are_as_many_cells_as_its_matter_needs(splat, options, cells):
    assembly = alone(splat, **options)
    assert assembly.accuracy.resolution == cells
    assert assembly.notes[0].startswith(f'resolution {cells} cells along "thing", for the ')
    size = np.ptp(splat.means, axis=0).max()
    assert assembly.spacing == assembly.accuracy.spacing == pytest.approx(size / cells, rel=0.02)


@pytest.mark.thorough
def test_the_smallest_object_decides_up_to_a_bound():
    large, small = shell(SHAPES["sphere"], count=5_000), shell(SHAPES["sphere"], count=5_000, seed=1)
    both = assembled(thing(large, "large", height=1.0), thing(small, "small", height=0.6))
    assert both.accuracy.resolution == 40
    assert both.notes[0].startswith('resolution 40 cells along "large"')
    assert both.notes[0].endswith('of "small"')
    tiny = assembled(thing(large, "large", height=1.0), thing(small, "small", height=0.01))
    assert tiny.notes[0].endswith('of "small", as far as some 500,000 points go')
    assert 0.5 * 500_000 < len(tiny.problem.points) <= 500_000


def test_a_spacing_of_the_scene_is_the_spacing_and_engines_get_a_number_of_cells_all_the_same():
    assembly = assembled(thing(shell(SHAPES["cube"], count=3_000)), spacing=0.05)
    assert assembly.spacing == 0.05
    assert assembly.accuracy.resolution == 20
    assert assembly.notes == ()


def test_a_single_gaussian_has_a_grid():
    assembly = assembled(thing(cloud(1)))
    assert np.isfinite(assembly.spacing)
    assert assembly.spacing > 0
