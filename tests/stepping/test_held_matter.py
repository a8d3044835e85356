"""What counts many times because a drive holds it."""

import numpy as np

from gasp_core.contract import (
    Driven,
    Elastic,
    Fluid,
    HalfSpace,
    Pinned,
    PointCloud,
    PointProblem,
    SphereShape,
    Trajectories,
)
from gasp_core.stepping.held_matter import HELD_FIRMNESS, firmness

JELLY = Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3)
WATER = Fluid(density=1e3, bulk_modulus=1e5)
SPACING = 0.1


def counted(positions, drives=(), time=0.0, bodies=None, holding=None, materials=(JELLY,), material_ids=None, led=()):
    count = len(positions)
    own = np.zeros(count, dtype=int) if bodies is None else np.array(bodies)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, 1e-3),
        material_ids=np.zeros(count, dtype=int) if material_ids is None else np.array(material_ids),
        body_ids=own,
    )
    still = Trajectories(rows=led, times=[0.0, 1.0], displacements=np.zeros((2, len(led), 3))) if led else None
    problem = PointProblem(points=points, materials=materials, drives=tuple(drives), trajectories=still)
    held = np.ones((len(drives), own.max() + 1)) if holding is None else np.array(holding)
    return (firmness(problem, drives, time, np.array(positions), held, SPACING) / HELD_FIRMNESS == 1).tolist()


def test_what_lies_in_a_region_counts_and_what_lies_on_its_face():
    pin = Pinned(region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    heights = [-0.3, -1e-12, 0.0, 1e-12, 1e-3, 0.3]
    found = counted([(0, 0, height) for height in heights], [pin])
    assert found == [True, True, True, True, False, False]
    assert counted([(0, 0, height) for height in heights], []) == [False] * 6


def test_a_region_that_moves_holds_where_it_is():
    led = Driven(region=SphereShape(center=(0, 0, 0), radius=1), velocity=(1, 0, 0))
    positions = [(0.0, 0, 0), (2.5, 0, 0)]
    assert counted(positions, [led], time=0.0) == [True, False]
    assert counted(positions, [led], time=2.0) == [False, True]


def test_what_is_led_counts():
    assert counted([(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0)], led=[0, 2]) == [True, False, True]


def test_bodies_that_are_not_held_and_what_flows_count_once():
    pin = Pinned(region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    low = [(0.0, 0, -1), (1.0, 0, -1)]
    assert counted(low, [pin], bodies=[0, 1], holding=[[1, 0]]) == [True, False]
    assert counted(low, [pin], materials=(JELLY, WATER), material_ids=[0, 1]) == [True, False]
