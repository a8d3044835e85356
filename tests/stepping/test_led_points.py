"""Points along trajectories, and the nodes that they take along."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gasp_core.contract import Elastic, PointCloud, PointProblem, Trajectories
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices
from gasp_core.stepping.led_cage import LedCage
from gasp_core.stepping.led_nodes import LedGrid
from gasp_core.stepping.led_points import LedPoints

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
RNG = np.random.default_rng(0)


def problem_of(points, trajectories, bodies=None):
    count = len(points)
    cloud = PointCloud(
        reference_positions=points,
        initial_velocities=np.zeros_like(points),
        reference_volumes=np.full(count, 1e-3),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count) if bodies is None else bodies,
    )
    return PointProblem(points=cloud, materials=(SOFT,), trajectories=trajectories)


def led_along(path, times, points=None):
    """Points that all go along path(t) (3,)."""
    points = RNG.uniform(-1, 1, (5, 3)) if points is None else points
    moves = np.array([np.tile(path(t), (len(points), 1)) for t in times])
    trajectories = Trajectories(rows=np.arange(len(points)), times=times, displacements=moves)
    led = LedPoints.of(problem_of(points, trajectories))
    assert led is not None
    return led


UNEVEN = np.array([0.0, 0.1, 0.25, 0.3, 0.55, 0.7])


def parabola(t):
    return np.array([2 * t, -3 * t * t, 0.5 * t + t * t])


def parabola_velocity(t):
    return np.array([2.0, -6 * t, 0.5 + 2 * t])


@pytest.mark.parametrize("time", [0.0, 0.05, 0.1, 0.2, 0.3, 0.41, 0.69, 0.7])
def test_a_parabola_is_exact_everywhere(time):
    """Tables are float32: 6e-8 of 3 m, and a slope over a step of 0.05 s is a difference of two of them."""
    led = led_along(parabola, UNEVEN)
    np.testing.assert_allclose(led.positions(time), led.start + parabola(time), atol=1e-6)
    np.testing.assert_allclose(led.velocities(time), np.tile(parabola_velocity(time), (5, 1)), atol=5e-5)


def test_between_moments_the_error_falls_with_the_third_power():
    def swing(t):
        return np.array([np.sin(3 * t), 1 - np.cos(3 * t), 0])

    errors = []
    for count in (9, 17):
        led = led_along(swing, np.linspace(0, 1, count))
        some = np.linspace(0, 1, 101)
        errors.append(max(np.abs(led.positions(t) - led.start - swing(t)).max() for t in some))
    assert errors[0] / errors[1] > 2**2.7, errors


def test_after_the_last_moment_they_rest():
    led = led_along(parabola, UNEVEN)
    np.testing.assert_allclose(led.positions(5.0), led.start + parabola(0.7), atol=1e-6)
    assert not led.velocities(5.0).any()
    assert led.fastest(0.7) == 0
    assert not led.mean_velocities(0.7, 0.75).any()
    single = led_along(lambda t: np.zeros(3), np.zeros(1))
    np.testing.assert_array_equal(single.positions(1.0), single.start)
    assert not single.velocities(0.0).any()


def test_a_mean_velocity_is_the_way_over_the_time_however_short():
    led = led_along(lambda t: np.array([np.sin(3 * t), t**3, 0]), UNEVEN)
    for begin, end in ((0.12, 0.24), (0.3, 0.55), (0.6, 0.6 + 1e-3)):
        way = led.positions(end) - led.positions(begin)
        np.testing.assert_allclose(led.mean_velocities(begin, end) * (end - begin), way, atol=1e-12)
    instant = led.mean_velocities(0.4, np.nextafter(0.4, 1))
    np.testing.assert_allclose(instant, led.velocities(0.4), atol=1e-12)


def test_nothing_is_faster_than_the_bound():
    times = np.linspace(0, 1, 6)
    moves = np.concatenate([np.zeros((1, 20, 3)), RNG.normal(size=(5, 20, 3))])
    points = RNG.uniform(-1, 1, (20, 3))
    led = LedPoints.of(problem_of(points, Trajectories(rows=np.arange(20), times=times, displacements=moves)))
    assert led is not None
    for begin, end in itertools.pairwise(times):
        speeds = [np.linalg.norm(led.velocities(t), axis=1).max() for t in np.linspace(begin, end, 21)[:-1]]
        assert max(speeds) <= led.fastest(begin) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"rows": [0, 0]}, "rising"),
        ({"rows": [1, 0]}, "rising"),
        ({"rows": [-1, 0]}, "rising"),
        ({"times": [0, 0, 1]}, "rise from 0"),
        ({"times": [0.1, 0.2, 0.3]}, "rise from 0"),
        ({"times": [0, np.nan, 1]}, "not finite"),
        ({"displacements": np.ones((3, 2, 3))}, "begin where they are"),
        ({"displacements": np.zeros((3, 3, 3))}, "shape"),
        ({"displacements": np.full((3, 2, 3), np.inf)}, "not finite"),
    ],
)
def test_what_leads_nowhere_is_refused(change, says):
    given = {"rows": [0, 1], "times": [0, 0.5, 1], "displacements": np.zeros((3, 2, 3))}
    with pytest.raises(SceneError, match=says):
        Trajectories(**(given | change))


def test_points_that_there_are_not_are_refused():
    trajectories = Trajectories(rows=[7], times=[0.0], displacements=np.zeros((1, 1, 3)))
    with pytest.raises(SceneError, match="5 points"):
        problem_of(RNG.uniform(size=(5, 3)), trajectories)


# Nodes.

SPACING = 0.1
ORIGIN = np.array([0.013, -0.02, 0.041])


def lattice(nx, ny, nz, spacing=SPACING / 2):
    axes = [(np.arange(n) + 0.5) * spacing for n in (nx, ny, nz)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def around(points, rows, moved, velocities, bodies=None):
    trajectories = Trajectories(rows=rows, times=[0.0], displacements=np.zeros((1, len(rows), 3)))
    problem = problem_of(points, trajectories, bodies)
    led = LedPoints.of(problem)
    assert led is not None
    return LedGrid.of(problem, led, SPACING, ORIGIN).around(moved, velocities)


@pytest.mark.parametrize("shape", ["block", "jittered", "plate"])
def test_an_affine_field_is_exact_at_every_node(shape):
    """Far outside the points as well; of a flat plate where the field turns it rigidly, as nothing else tells."""
    points = lattice(8, 6, 6) if shape != "plate" else lattice(12, 12, 1)
    if shape == "jittered":
        points = points + RNG.uniform(-0.01, 0.01, points.shape)
    spin = np.array([0.3, -1.0, 2.0])
    field = np.cross(np.eye(3), -spin) if shape == "plate" else RNG.normal(size=(3, 3))
    velocities = points @ field.T + [1.0, 2.0, 3.0]
    found = around(points, np.arange(len(points)), points, velocities)
    places = ORIGIN + SPACING * found.nodes
    assert places[:, 2].max() > points[:, 2].max() + SPACING / 2
    np.testing.assert_allclose(found.velocities(velocities), places @ field.T + [1.0, 2.0, 3.0], atol=1e-10)


def test_a_single_led_point_gives_all_its_nodes_its_velocity():
    found = around(np.zeros((1, 3)), [0], np.zeros((1, 3)), np.array([[1.0, 2, 3]]))
    assert len(found.nodes) == 27
    np.testing.assert_allclose(found.velocities(np.array([[1.0, 2, 3]])), np.tile([1.0, 2, 3], (27, 1)))


@pytest.mark.parametrize("degrees", [0, 25, 90, 170])
def test_nodes_are_led_where_they_were_nearer_to_what_is_led(degrees):
    """A bar, one half led and turned as a whole by any angle: the plane between the halves turns along."""
    points = lattice(12, 4, 4)
    middle = points[:, 0].mean()
    rows = np.flatnonzero(points[:, 0] < middle)
    half = np.radians(degrees) / 2
    turn = rotation_matrices([[np.cos(half), 0, np.sin(half), 0]])[0]
    moved = points[rows] @ turn.T + [0.2, 0, 0.3]
    found = around(points, rows, moved, np.zeros_like(moved))
    before = (ORIGIN + SPACING * found.nodes - [0.2, 0, 0.3]) @ turn
    assert before[:, 0].max() <= middle + 3e-3 * SPACING
    # Every node that the led points reach, on their side of it, is there.
    cells = (moved - ORIGIN) / SPACING
    base = np.floor(cells - 0.5).astype(int)
    reached = {tuple(node) for b in base for node in b + np.indices((3, 3, 3)).reshape(3, -1).T}
    places = np.array(sorted(reached))
    inside = ((ORIGIN + SPACING * places - [0.2, 0, 0.3]) @ turn)[:, 0] < middle - 3e-3 * SPACING
    assert {tuple(node) for node in places[inside]} <= {tuple(node) for node in found.nodes}


def test_bodies_do_not_lead_each_other():
    points = np.concatenate([lattice(4, 4, 4), lattice(4, 4, 4) + [0.2, 0, 0]])
    bodies = np.repeat([0, 1], 64)
    velocities = np.repeat([[1.0, 0, 0], [-1.0, 0, 0]], 64, axis=0)
    found = around(points, np.arange(128), points, velocities, bodies)
    speeds = found.velocities(velocities)
    assert set(found.bodies) == {0, 1}
    np.testing.assert_allclose(speeds[:, 0], np.where(found.bodies == 0, 1.0, -1.0))


# Nodes of cages.


def caged(points, rows, path, nodes, bodies=None, bodies_of_nodes=None):
    """`path` takes the led points (K, 3) to where they are after a second."""
    moves = np.stack([np.zeros((len(rows), 3)), path(points[rows]) - points[rows]])
    problem = problem_of(points, Trajectories(rows=rows, times=[0.0, 1.0], displacements=moves), bodies)
    of_nodes = np.zeros(len(nodes)) if bodies_of_nodes is None else bodies_of_nodes
    found = LedCage.of(problem, nodes, of_nodes, SPACING)
    assert found is not None
    return found


@pytest.mark.parametrize("shape", ["block", "jittered", "plate"])
def test_what_moves_led_points_affinely_moves_nodes_of_a_cage_so(shape):
    """By any angle; of a flat plate, rigidly. The table is float32, of ways of a metre, and arms are 10 spacings."""
    points = lattice(8, 6, 6) if shape != "plate" else lattice(12, 12, 1)
    if shape == "jittered":
        points = points + RNG.uniform(-0.01, 0.01, points.shape)
    turn = rotation_matrices([[0.3, 0.5, -0.2, 0.8]])[0]
    field = turn if shape == "plate" else turn @ (np.eye(3) + 0.3 * RNG.normal(size=(3, 3)))
    nodes = RNG.uniform(-0.1, 0.5, (50, 3))
    found = caged(points, np.arange(len(points)), lambda x: x @ field.T + [1.0, 2.0, 3.0], nodes)
    np.testing.assert_array_equal(found.nodes, np.arange(50))
    np.testing.assert_allclose(found.positions(0.0), nodes, atol=1e-15)
    np.testing.assert_allclose(found.positions(1.0), nodes @ field.T + [1.0, 2.0, 3.0], atol=1e-5)


def test_nodes_of_a_cage_are_led_where_they_are_nearer_to_what_is_led():
    points = np.concatenate([lattice(12, 4, 4), lattice(12, 4, 4) + [0, 1.0, 0]])
    bodies = np.repeat([0, 1], 192)
    rows = np.flatnonzero(points[:192, 0] < 0.3)
    nodes = np.stack(np.meshgrid(*[np.arange(n) * 0.1 for n in (7, 3, 3)], indexing="ij"), axis=-1).reshape(-1, 3)
    both = np.concatenate([nodes, nodes + [0, 1.0, 0]])
    found = caged(points, rows, lambda x: x + [0.2, 0, 0], both, bodies, np.repeat([0, 1], len(nodes)))
    np.testing.assert_array_equal(found.nodes, np.flatnonzero(nodes[:, 0] < 0.3 + 1e-9))
    np.testing.assert_allclose(found.positions(1.0), found.rest + [0.2, 0, 0], atol=1e-7)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_led_points_take_nodes_of_a_cage_along(count):
    points = np.linspace(0, 0.1, count)[:, None] * [1.0, 0, 0]
    found = caged(points, np.arange(count), lambda x: x + [0.0, 1.0, 0], np.array([[0, 0, 0], [0.1, 0.1, 0.1]]))
    np.testing.assert_allclose(found.positions(1.0) - found.rest, [[0, 1, 0]] * 2, atol=1e-7)
    assert LedCage.of(problem_of(points, None), points, np.zeros(count), SPACING) is None
