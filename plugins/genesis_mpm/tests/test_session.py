"""Genesis at work, beyond what the conformance suite looks at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gasp_core.contract import (
    BoxShape,
    Collider,
    Domain,
    DomainPolicy,
    Elastic,
    EngineAccuracy,
    Field,
    Fluid,
    HalfSpace,
    Material,
    PointCloud,
    PointProblem,
    Precision,
    Sand,
    Status,
)
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.errors import SceneError

# Each needs Genesis in a process of its own, which comes up in eight seconds.
pytestmark = pytest.mark.thorough

SPACING = 0.1
SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
STILL = (0.0, 0.0, 0.0)
ROUNDING = 30 * float(np.finfo(np.float32).eps)
"""Of a velocity in a substep, relative: it is a sum over 27 nodes."""
ALL = frozenset({Field.VELOCITIES, Field.DEFORMATION_GRADIENTS})


def block(cells: int = 3, corner=(0.37, -0.21, 0.11)) -> np.ndarray:
    axis = (np.arange(2 * cells) + 0.5) * SPACING / 2
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) + corner


def thrown(positions, velocity=STILL, volumes=None, material: Material = SOFT, **scene) -> PointProblem:
    count = len(positions)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.broadcast_to(velocity, (count, 3)),
        reference_volumes=np.full(count, (SPACING / 2) ** 3) if volumes is None else volumes,
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=points, materials=(material,), **scene)


def opened(engine, problem, restart=None, **accuracy):
    return engine.open(
        problem,
        device="cpu",
        precision=Precision.FLOAT32,
        seed=0,
        accuracy=EngineAccuracy(spacing=SPACING, **accuracy),
        restart=restart,
    )


def test_the_grid_follows_a_flight_that_its_first_place_does_not_reach(engine) -> None:
    """Genesis alone would hold the points at the end of its grid and say nothing."""
    start, velocity = block(), np.array([7.0, -5.0, 3.0])
    with opened(engine, thrown(start, velocity, gravity=STILL)) as session:
        first = session.checkpoint()["window"]
        steps = sum(session.advance_to(time).substep_count for time in (0.5, 1.0))
        end = session.read(ALL)
        last = session.checkpoint()["window"]
    # 70 cells away: far beyond the first grid, which was moved and not made larger.
    assert not np.array_equal(first[0], last[0]) and np.array_equal(first[1], last[1])
    assert np.abs(end.positions - start - velocity).max() <= ROUNDING * steps * np.linalg.norm(velocity)


def test_a_cloud_that_spreads_is_given_a_larger_grid_and_flies_on(engine) -> None:
    """Eight points with nothing near them."""
    start = 6 * block(1)
    velocities = 4.0 * (start - start.mean(axis=0))
    points = replace(thrown(start).points, initial_velocities=velocities, body_ids=np.arange(len(start)))
    with opened(engine, PointProblem(points=points, materials=(SOFT,), gravity=STILL)) as session:
        first = session.checkpoint()["window"]
        steps = sum(session.advance_to(time).substep_count for time in (0.75, 1.5, 2.0))
        end, last = session.read(ALL), session.checkpoint()["window"]
    assert (last[1] > first[1]).all()
    ways = 2.0 * velocities
    assert np.abs(end.positions - start - ways).max() <= ROUNDING * steps * np.abs(ways).max()


def test_honey_that_spreads_evenly_is_neither_pulled_back_nor_driven_apart(engine) -> None:
    """In frames of any length: viscosity resists a change of shape alone, however much of it there is."""
    honey = Fluid(density=1000.0, bulk_modulus=1e4, viscosity=200.0)
    start = block()
    arms = start - start.mean(axis=0)
    points = replace(thrown(start).points, initial_velocities=2.0 * arms)
    with opened(engine, PointProblem(points=points, materials=(honey,), gravity=STILL)) as session:
        for time in (0.01, 0.023, 0.05, 0.1):
            assert session.advance_to(time).status is Status.OK
        end = session.read(ALL)
    # Affine transfers take the strain of 0.2 times a cell over the side at free surfaces; see the suite's own check
    # that fluids bear no tension.
    off = np.linalg.norm(end.positions - start - 0.2 * arms, axis=1).max()
    assert off <= 0.2 / 3 * 0.2 * np.linalg.norm(arms, axis=1).max()


def test_what_starts_in_a_wall_is_held_there(engine) -> None:
    """A point three cells down in the floor, and a body deep in a box: as with contact at nodes anywhere."""
    upper, lower = block(corner=(0.37, -0.21, 0.005)), block(corner=(3.0, -0.15, -0.15))
    upper[100, 2] = -0.3
    start = np.concatenate([upper, lower])
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=0.5)
    slab = Collider(shape=BoxShape(center=(3.15, 0.0, -0.5), half_extents=(0.6, 0.6, 0.5)), friction=0.5)
    with opened(engine, thrown(start, colliders=(floor, slab))) as session:
        first, second = session.advance_to(0.2), session.advance_to(0.4)
        end = session.read(ALL).positions
    assert first.status is second.status is Status.OK
    # Nodes in the floor let nothing go further down; rounding is that of a cell's coordinate.
    assert abs(end[100, 2] + 0.3) < 1e-4 * SPACING
    assert np.delete(end[: len(upper)], 100, axis=0)[:, 2].min() > -SPACING
    assert end[len(upper) :, 2].min() > lower[:, 2].min() - SPACING


def test_a_run_that_blew_up_leaves_nothing_to_the_next(engine) -> None:
    """The same scene of Genesis would serve both."""
    sand = thrown(block(1), material=Sand(density=1600.0, youngs_modulus=1e5, poissons_ratio=0.2))
    with opened(engine, sand) as session:
        session.advance_to(0.01)
        before, state = session.read(ALL).positions, session.checkpoint()
    ill = {**state, "deformations": np.zeros_like(state["deformations"])}
    with opened(engine, sand, restart=ill) as session:
        report = session.advance_to(0.02)
        assert report.status is Status.NON_FINITE and "\n" not in report.warnings[0]
    with opened(engine, sand) as session:
        session.advance_to(0.01)
        assert np.array_equal(session.read(ALL).positions, before)


def test_who_leaves_a_domain_is_named_and_the_run_stops(engine) -> None:
    domain = Domain(lower=(-1.0, -1.0, -1.0), upper=(2.0, 2.0, 2.0), policy=DomainPolicy.STOP)
    with opened(engine, thrown(block(1), (4.0, 0.0, 0.0), gravity=STILL, domain=domain)) as session:
        report = session.advance_to(2.0)
    assert report.status is Status.OUT_OF_DOMAIN
    assert "point" in report.warnings[0] and "left the domain" in report.warnings[0]


def test_points_too_far_apart_for_any_grid_are_refused(engine) -> None:
    with pytest.raises(SceneError, match="farthest is point 1 at"):
        opened(engine, thrown(np.array([[0.0, 0.0, 0.0], [90.0, -80.0, 100.0], [0.1, 0.0, 0.0]])))


def test_every_point_has_its_own_mass_and_its_classes_stiffness(engine) -> None:
    """A block of volumes that differ a hundredfold: its centre of mass goes straight, and it rings."""
    start = block()
    volumes = (SPACING / 2) ** 3 * np.exp(np.random.default_rng(0).uniform(-2.3, 2.3, len(start)))
    problem = thrown(start, volumes=volumes, gravity=STILL)
    arms = start - start.mean(axis=0)
    points = replace(problem.points, initial_velocities=np.array([1.0, 0.5, -0.2]) + 2 * arms * [1.0, -1.0, 0.5])
    problem = replace(problem, points=points)
    masses = problem.masses / problem.masses.sum()
    with opened(engine, problem) as session:
        report = session.advance_to(0.1)
        end = session.read(ALL)
    assert report.status is Status.OK
    uniform = masses @ points.reference_positions + 0.1 * (masses @ points.initial_velocities)
    # All places and ways are within a metre.
    assert np.abs(masses @ end.positions - uniform).max() <= ROUNDING * (report.substep_count + 1)
    # It would have flown apart by a fifth otherwise.
    apart = np.linalg.norm(end.positions - start - 0.1 * points.initial_velocities, axis=1)
    assert apart.max() > 0.01 * SPACING


def test_a_box_holds_a_falling_block_on_its_face(engine) -> None:
    """On a slab of 20 x 20 x 2 cells, whose distance Genesis reads from a table."""
    slab = Collider(shape=BoxShape(center=(0.5, 0.0, -0.1), half_extents=(1.0, 1.0, 0.1)), friction=0.5)
    with opened(engine, thrown(block(corner=(0.35, -0.15, 0.05)), colliders=(slab,))) as session:
        for time in np.linspace(0, 1, 11)[1:]:
            assert session.advance_to(float(time)).status is Status.OK
        low = session.read(ALL).positions[:, 2].min()
    # Walls act at nodes: felt a cell away at most, and sunk into by less than one.
    assert -SPACING < low < SPACING


def test_nothing_is_written_where_it_runs(engine, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    # Another worker, which starts here.
    anew = open_engine(discover().offer("genesis-mpm"))
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    with opened(anew, thrown(block(1), colliders=(floor,))) as session:
        session.advance_to(0.01)
    assert not list(tmp_path.iterdir())
