"""Checkpoints: what goes on from one is the run that never stopped, and what no run has written is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gasp_core.contract import Field
from gasp_core.errors import SceneError
from gasp_mpm_host import layout as at
from gasp_mpm_host.testing.kit import FLOOR, falling, same

__all__ = ["CheckpointTests"]


class CheckpointTests:
    """What an engine's checkpoints have to hold."""

    @pytest.mark.parametrize(
        "material", ["sand", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("rubber", "snow", "metal"))]
    )
    @pytest.mark.parametrize("precision", ["float32", pytest.param("float64", marks=pytest.mark.thorough)])
    def test_restart_is_bitwise(self, kit, precision, material):
        problem = falling(kit, material)
        with kit.open(problem, precision=precision, spacing=0.1) as whole:
            whole.advance_to(0.03)
            kept = {name: np.array(array) for name, array in whole.checkpoint().items()}
            whole.advance_to(0.06)
            expected = whole.read(kit.everything)
        with kit.open(problem, precision=precision, spacing=0.1, restart=kept) as resumed:
            assert resumed.time == 0.03
            resumed.advance_to(0.06)
            assert same(resumed.read(kit.everything), expected)

    @pytest.mark.parametrize("marked", [False, True], ids=["alone", "with tracers"])
    @pytest.mark.parametrize("precision", ["float32", pytest.param("float64", marks=pytest.mark.thorough)])
    def test_restart_of_two_bodies_far_apart_is_bitwise(self, kit, precision, marked):
        """They stand side by side on the grid, where a place has more digits than in the scene."""
        corners = ((0.0, 0.0, 0.03), (60.0, -90.0, 0.04))
        ids = np.repeat([0, 1], 8**3)
        problem = kit.problem(
            np.concatenate([kit.block(corner=corner, seed=seed) for seed, corner in enumerate(corners)]),
            (kit.materials["elastic"], kit.materials["neo-hookean"]),
            ids=ids,
            volumes=np.full(len(ids), 0.05**3),
            velocity=(0.3, 0, -2),
            colliders=(FLOOR,),
        )
        if marked:
            places = problem.points.reference_positions[::5] + 0.02
            problem = replace(problem, points=replace(problem.points, tracer_positions=places))
        everything = frozenset(Field) if marked else kit.everything
        with kit.open(problem, precision=precision, spacing=0.1) as whole:
            whole.advance_to(0.03)
            kept = {name: np.array(array) for name, array in whole.checkpoint().items()}
            assert np.abs(kept["stands"]).max() > 500, "they do not stand side by side"
            whole.advance_to(0.06)
            expected, end = whole.read(everything), whole.checkpoint()
        with kit.open(problem, precision=precision, spacing=0.1, restart=kept) as resumed:
            # All of it, because what is lost of a place shows in float32 only after a long time.
            assert all(np.array_equal(array, kept[name]) for name, array in resumed.checkpoint().items())
            resumed.advance_to(0.06)
            found = resumed.read(everything)
            assert all(np.array_equal(array, end[name]) for name, array in resumed.checkpoint().items())
        assert same(found, expected)
        if marked:
            assert np.array_equal(found.tracer_positions, expected.tracer_positions)

    def test_a_checkpoint_of_something_else_is_refused(self, kit):
        with kit.open(falling(kit), spacing=0.1) as session:
            kept = session.checkpoint()
        with pytest.raises(SceneError, match="spacing"):
            kit.open(falling(kit), spacing=0.05, restart=kept)
        with pytest.raises(SceneError, match="precision"):
            kit.open(falling(kit), spacing=0.1, precision="float64", restart=kept)
        with pytest.raises(SceneError, match=f"layout {at.LAYOUT - 1}, this version reads {at.LAYOUT}"):
            kit.open(falling(kit), spacing=0.1, restart={**kept, "layout": np.array(at.LAYOUT - 1)})
        for lost in ("cells", "rows", "labels", "ids", "time"):
            with pytest.raises(SceneError, match=lost if lost != "time" else "another scene"):
                kit.open(falling(kit), spacing=0.1, restart={name: kept[name] for name in kept if name != lost})

    @pytest.mark.parametrize(
        ("array", "damage", "says"),
        [
            ("ids", lambda ids: np.where(ids == 0, 10**9, ids), "every point once"),
            ("ids", lambda ids: np.zeros_like(ids), "every point once"),
            (
                "labels",
                lambda labels: labels + np.eye(1, labels.shape[1], at.MATERIAL, dtype=np.int32) * 10**6,
                "materials",
            ),
            (
                "labels",
                lambda labels: labels + np.eye(1, labels.shape[1], at.HOME, dtype=np.int32) * 9,
                "where its cells",
            ),
            ("cells", lambda cells: cells * 1e300, "where its cells"),
            ("cells", lambda cells: cells * np.nan, "not finite for cells"),
        ],
        ids=["unknown points", "one point", "unknown material", "home elsewhere", "cells far away", "cells nowhere"],
    )
    def test_a_checkpoint_that_no_run_has_written_is_refused(self, kit, array, damage, says):
        """Kernels would read and write out of their memory by it."""
        with kit.open(falling(kit), spacing=0.1) as session:
            session.advance_to(0.01)
            kept = session.checkpoint()
        with pytest.raises(SceneError, match=f"{says}.*: it is damaged"):
            kit.open(falling(kit), spacing=0.1, restart={**kept, array: damage(np.array(kept[array]))})

    def test_points_in_another_order_than_their_cells_are_refused(self, kit):
        with kit.open(falling(kit), spacing=0.1) as session:
            kept = session.checkpoint()
        turned = {name: np.array(kept[name])[::-1] for name in ("cells", "rows", "labels", "ids")}
        with pytest.raises(SceneError, match="in the order of their cells: it is damaged"):
            kit.open(falling(kit), spacing=0.1, restart={**kept, **turned})
