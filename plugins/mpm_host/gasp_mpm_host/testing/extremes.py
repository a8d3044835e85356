"""The extremes of matter: soft and stiff, fast, far away, large and small, next to nothing, crushed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from gasp_core.contract import Collider, Elastic, Fluid, HalfSpace, Material, NeoHookean, PointState, Status, StepReport
from gasp_core.stepping.flow import CROWDED_VOLUME_RATIO
from gasp_core.stepping.time_step import rest_bound
from gasp_mpm_host.testing.kit import FLOOR, Kit

__all__ = ["ExtremesTests"]

Array = NDArray[Any]


def _drop(
    kit: Kit,
    material: Material,
    *,
    speed: float = 1.0,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    scale: float = 1.0,
    duration: float = 0.02,
    gravity: float = -9.81,
    **accuracy: Any,
) -> tuple[StepReport, Array, PointState]:
    """A block thrown at the floor; positions relative to the offset, in units of the scale."""
    offset = np.asarray(offset, dtype=float)
    start = kit.block(0.4 * scale, corner=(0, 0, 0.01 * scale)) + offset
    floor = Collider(shape=HalfSpace(point=tuple(offset), normal=(0, 0, 1)), friction=0.4)
    problem = kit.problem(
        start,
        material,
        velocity=(0, 0, -speed),
        side=0.4 * scale,
        colliders=(floor,),
        gravity=(0, 0, gravity),
    )
    with kit.open(problem, spacing=0.1 * scale, **accuracy) as session:
        report = session.advance_to(duration)
        state = session.read(kit.everything)
    return report, (state.positions - offset) / scale, state


class ExtremesTests:
    """What any engine for explicit MPM survives; a subclass finds the fixture `kit`, a `Kit`, beside it."""

    @pytest.mark.parametrize("modulus", [1e2, 1e5, 1e9])
    @pytest.mark.parametrize("poissons_ratio", [0.3, 0.499])
    def test_soft_to_stiff(self, kit, modulus, poissons_ratio):
        material = Elastic(density=1000.0, youngs_modulus=modulus, poissons_ratio=poissons_ratio)
        # As long as sound takes through the block a few times, but no longer than it takes to fly through the floor.
        sound = np.sqrt(modulus / 1000)
        report, positions, state = _drop(kit, material, duration=min(0.05, 4 * 0.4 / sound))
        assert report.status is Status.OK
        assert np.isfinite(state.deformation_gradients).all()
        # Contact acts at nodes: no point passes more than one cell below the floor.
        assert positions[:, 2].min() >= -0.1
        # What the start brought and gravity released, by how far the block has really fallen.
        released = 0.5 * 1.0**2 + 9.81 * (kit.block(0.4, corner=(0, 0, 0.01)) - positions)[:, 2].mean()
        assert 0.5 * (state.velocities**2).sum(axis=1).mean() <= 1.02 * released

    @pytest.mark.parametrize("kind", [Elastic, NeoHookean])
    @pytest.mark.parametrize("stable_steps", [0.1, 1.0, 30.0])
    def test_damping_of_any_strength_is_stable(self, kit, kind, stable_steps):
        plain = {"density": 1000.0, "youngs_modulus": 1e4, "poissons_ratio": 0.45}
        damping = stable_steps * rest_bound(kind(**plain), 0.1)
        material = kind(**plain, stiffness_damping=damping, mass_damping=0.5 / damping)
        report, positions, state = _drop(kit, material, duration=0.03, gravity=0.0)
        assert report.status is Status.OK
        assert np.isfinite(positions).all()
        assert 0.5 * (state.velocities**2).sum(axis=1).mean() < 0.5 * 1.0**2
        assert np.abs(np.linalg.det(state.deformation_gradients) - 1).max() < 0.5

    def test_ten_times_the_speed_of_sound(self, kit):
        material = Elastic(density=1000.0, youngs_modulus=1e4, poissons_ratio=0.3)
        report, positions, state = _drop(kit, material, speed=10 * np.sqrt(10.0), duration=0.05)
        assert report.status is Status.OK
        assert np.isfinite(state.positions).all()
        assert positions[:, 2].min() >= -0.1

    def test_an_offset_changes_nothing(self, kit):
        """Positions of 1e4 m have an ulp of 1.8e-12 m, 4.5e-12 of the size; float32 engines may grow it to 1e-5."""
        material = kit.materials["elastic"]
        _, here, _ = _drop(kit, material, duration=0.05)
        _, there, _ = _drop(kit, material, duration=0.05, offset=(1e4, -1e4, 1e4))
        assert np.abs(here - there).max() / 0.4 <= 1e-5

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_a_scaled_scene_moves_alike(self, kit, scale):
        """L -> s L, E -> s E, t -> sqrt(s) t at the same density and gravity (Froude and Cauchy numbers unchanged)."""
        base = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
        scaled = Elastic(density=1000.0, youngs_modulus=1e5 * scale, poissons_ratio=0.3)
        _, one, _ = _drop(kit, base, duration=0.05)
        _, other, _ = _drop(kit, scaled, duration=0.05 * np.sqrt(scale), speed=np.sqrt(scale), scale=scale)
        assert np.abs(one - other).max() / 0.4 <= 1e-4

    @pytest.mark.thorough
    @pytest.mark.parametrize("count", [1, 2, 3])
    @pytest.mark.parametrize("kind", ["elastic", "sand", "fluid", "snow", "metal"])
    def test_a_few_coincident_points_fall_freely(self, kit, kind, count):
        problem = kit.problem(np.zeros((count, 3)), kit.materials[kind], velocity=(1, 0, 2))
        with kit.open(problem, precision="float64", spacing=0.1, substep=1e-3) as session:
            report = session.advance_to(0.5)
            state = session.read(kit.everything)
        assert report.status is Status.OK
        # Symplectic Euler adds g t dt / 2 to the parabola, exactly.
        expected = np.array([0.5, 0, 1.0]) + np.array([0, 0, -9.81]) * (0.5**2 + 0.5 * 1e-3) / 2
        assert np.abs(state.positions - expected).max() <= 1e-11
        assert np.ptp(state.positions, axis=0).max() <= 1e-15

    def test_a_duplicated_cloud_moves_as_the_original(self, kit):
        """Twice the points, each of half the volume, at the same places."""
        start = kit.block(corner=(0, 0, 0.01))
        results = []
        for copies in (1, 2):
            problem = kit.problem(
                np.tile(start, (copies, 1)), kit.materials["elastic"], velocity=(0, 0, -1), colliders=(FLOOR,)
            )
            with kit.open(problem, precision="float64", spacing=0.1) as session:
                session.advance_to(0.05)
                results.append(session.read(kit.everything).positions)
        assert np.abs(results[1].reshape(2, -1, 3) - results[0]).max() <= 1e-10

    def test_inverted_points_recover_or_are_reported(self, kit):
        """A block crushed by its own speed to a tenth: finite, and what was inverted is said."""
        material = Elastic(density=1000.0, youngs_modulus=1e3, poissons_ratio=0.1)
        report, _, state = _drop(kit, material, speed=20.0, duration=0.1)
        assert report.status is Status.OK
        assert np.isfinite(state.deformation_gradients).all()
        inverted = (np.linalg.det(state.deformation_gradients) <= 0).sum()
        assert (inverted == 0) or any("inverted" in warning for warning in report.warnings)

    @pytest.mark.thorough
    @pytest.mark.parametrize("kind", ["snow", "metal", "plasticine", "foam"])
    def test_what_flows_survives_a_crash(self, kit, kind):
        """At three times the speed of sound everything yields, and some of it is turned inside out."""
        material = kit.materials[kind]
        speed = 3 * np.sqrt(material.youngs_modulus / material.density)
        report, positions, state = _drop(kit, material, speed=speed, duration=0.02, substep_limit=100_000)
        assert report.status in (Status.OK, Status.SUBSTEP_LIMIT)
        assert report.status is Status.OK or kind == "snow"
        assert np.isfinite(state.deformation_gradients).all()
        assert positions[:, 2].min() >= -0.1
        # No more energy than was thrown: what flies apart does so with less.
        assert (state.velocities**2).sum(axis=1).mean() <= speed**2

    @pytest.mark.parametrize("precision", ["float32", pytest.param("float64", marks=pytest.mark.thorough)])
    def test_water_that_has_no_room_is_not_blown_apart(self, kit, precision):
        """Points that stand for 27 times their room: a pressure of at most K/7 (.95^-7 - 1) makes it, and its work is
        that times the volume that is wanted. Without a bound on the pressure it was 15 times as much."""
        water = Fluid(density=1000.0, bulk_modulus=1e5)
        problem = kit.problem(kit.block(0.4), water, velocity=(1, 0, 0), side=1.2)
        with kit.open(problem, precision=precision, spacing=0.1) as session:
            report = session.advance_to(0.1)
            state = session.read(kit.everything)
        assert report.status is Status.OK
        pressure = water.bulk_modulus / 7 * (CROWDED_VOLUME_RATIO**-7 - 1)
        assert 0.5 * 1000 * (state.velocities**2).sum(axis=1).mean() <= 0.5 * 1000 * 1.0**2 + pressure

    @pytest.mark.thorough
    @pytest.mark.parametrize("precision", ["float32", "float64"])
    def test_snow_that_hardens_beyond_all_steps_ends_with_a_reason(self, kit, precision):
        snow = replace(kit.materials["snow"], hardening=1e5)
        report, positions, _ = _drop(kit, snow, speed=20.0, duration=0.1, precision=precision)
        assert report.status is Status.SUBSTEP_LIMIT
        assert "substeps" in report.warnings[0]
        assert np.isfinite(positions).all()
