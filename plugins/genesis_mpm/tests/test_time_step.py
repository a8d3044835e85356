from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gasp_genesis_mpm.particle_state import Motion
from gasp_genesis_mpm.rest_step import rest_step
from gasp_genesis_mpm.stiffness_groups import CLASSES, Portion, portions_of
from gasp_genesis_mpm.time_step import stable_step

from gasp_core.contract import Elastic, Material, PointCloud, PointProblem, Snow

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
SNOW = Snow(density=400.0, youngs_modulus=1e5, poissons_ratio=0.2)
SPACING = 0.1


def problem(volumes, material: Material = SOFT) -> PointProblem:
    count = len(volumes)
    points = PointCloud(
        reference_positions=np.random.default_rng(0).random((count, 3)),
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=volumes,
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=points, materials=(material,))


def at_rest(count: int, history: float = 1.0) -> Motion:
    return Motion(
        cells=np.zeros((count, 3)),
        velocities=np.zeros((count, 3)),
        affine_velocities=np.zeros((count, 3, 3)),
        deformations=np.tile(np.eye(3), (count, 1, 1)),
        history=np.full(count, history),
    )


def test_volumes_with_classes_of_their_own_cost_no_substeps() -> None:
    case = problem(np.repeat(np.arange(1.0, CLASSES + 1), 3))
    step = stable_step(case, portions_of(case), at_rest(len(case.points)), SPACING)
    # At rest nothing is stiffer than at rest; a few roundings.
    assert step == pytest.approx(rest_step(SOFT, SPACING), rel=1e-6)


def test_a_point_lighter_than_its_class_bears_less() -> None:
    case = problem([1.0, 1.0, 0.25])
    (both,) = (Portion(material=SOFT, volume=1.0, rows=np.arange(3)),)
    step = stable_step(case, (both,), at_rest(3), SPACING)
    assert step == pytest.approx(rest_step(SOFT, SPACING) / 2, rel=1e-6)


def test_what_is_stretched_or_hardened_bears_less() -> None:
    case = problem([1.0, 1.0])
    motion = at_rest(2)
    motion = replace(motion, deformations=motion.deformations * np.array([1.0, 1.5])[:, None, None])
    stretched = stable_step(case, portions_of(case), motion, SPACING)
    # 2 J^2 - J at J = 1.5^3.
    stiffer = 2 * 1.5**6 - 1.5**3
    assert stretched == pytest.approx(rest_step(SOFT, SPACING) / np.sqrt(stiffer), rel=1e-6)
    packed = problem([1.0, 1.0], SNOW)
    pressed = stable_step(packed, portions_of(packed), at_rest(2, 0.9), SPACING)
    # exp(10 (1 - J_P)), and the step goes with its root.
    assert pressed == pytest.approx(rest_step(SNOW, SPACING) * np.exp(-0.5), rel=1e-6)
