from __future__ import annotations

import numpy as np
import pytest
from gasp_genesis_mpm.stiffness_groups import CLASSES, MOST_PORTIONS, portions_of, volume_classes

from gasp_core.contract import Elastic, PointCloud, PointProblem, Sand
from gasp_core.errors import SceneError

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
GRAINS = Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.2)


def test_few_volumes_are_kept_apart_whatever_their_order() -> None:
    volumes = np.array([3.0, 1.0, 2.0, 1.0 + 1e-12, 3.0])
    assert volume_classes(volumes).tolist() == [2, 0, 1, 0, 2]


def test_as_many_volumes_as_there_are_classes_are_all_exact() -> None:
    volumes = np.repeat(np.arange(1.0, CLASSES + 1), 2)
    assert len(np.unique(volume_classes(volumes))) == CLASSES
    assert len(np.unique(volume_classes(np.append(volumes, CLASSES + 1.0)))) <= CLASSES


def test_volumes_of_a_class_are_no_further_apart_than_an_equal_part_of_their_range() -> None:
    volumes = np.exp(np.random.default_rng(0).uniform(0, np.log(300.0), 1000))
    classes = volume_classes(volumes)
    assert classes.max() < CLASSES
    ratios = [np.ptp(np.log(volumes[classes == one])) for one in np.unique(classes)]
    # Rounding of the edges.
    assert max(ratios) <= np.ptp(np.log(volumes)) / CLASSES + 1e-12


@pytest.mark.parametrize("spread", [1.0, 100.0])
def test_a_bodys_volume_and_rows_are_all_there(spread: float) -> None:
    generator = np.random.default_rng(1)
    volumes = np.exp(generator.uniform(0, np.log(spread), 200)) * 1e-6
    kinds = generator.integers(0, 2, 200)
    points = PointCloud(
        reference_positions=generator.random((200, 3)),
        initial_velocities=np.zeros((200, 3)),
        reference_volumes=volumes,
        material_ids=kinds,
        body_ids=np.zeros(200),
    )
    # The material in the middle is nobody's.
    portions = portions_of(PointProblem(points=points, materials=(SOFT, GRAINS, SOFT)))
    assert sorted(np.concatenate([portion.rows for portion in portions])) == list(range(200))
    for material, own in ((SOFT, kinds == 0), (GRAINS, kinds == 1)):
        held = sum(portion.volume * len(portion.rows) for portion in portions if portion.material is material)
        # Means of classes, summed: a rounding a point.
        assert held == pytest.approx(float(volumes[own].sum()), rel=200 * np.finfo(float).eps)


def test_a_material_that_varies_from_point_to_point_is_refused_before_it_is_compiled() -> None:
    count = MOST_PORTIONS + 1
    points = PointCloud(
        reference_positions=np.random.default_rng(0).random((count, 3)),
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.ones(count),
        material_ids=np.arange(count),
        body_ids=np.zeros(count),
    )
    materials = tuple(Elastic(density=1000.0, youngs_modulus=1e5 + row, poissons_ratio=0.3) for row in range(count))
    with pytest.raises(SceneError, match="128 with their volumes at most, and this scene has 129"):
        portions_of(PointProblem(points=points, materials=materials))
