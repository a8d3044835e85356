"""Sessions: times, threads, neighbours, guards, refusals."""

from __future__ import annotations

import copy
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gasp_core.contract import (
    BoxShape,
    Collider,
    Domain,
    DomainPolicy,
    Elastic,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    Side,
    Status,
)
from gasp_core.errors import SceneError
from gasp_core.stepping import threads as core_threads
from gasp_core.stepping.threads import ThreadOptions
from gasp_mpm_host import layout as at
from gasp_mpm_host.forcing_tables import Forcing
from gasp_mpm_host.testing.kit import falling, same

__all__ = ["SessionTests"]


class SessionTests:
    """What a session of any engine for explicit MPM owes; a subclass finds the fixture `kit`, a `Kit`, beside it."""

    @pytest.fixture
    def pool_of_four(self, monkeypatch):
        """Let up to four threads be asked for, whatever the machine has."""
        monkeypatch.setattr(core_threads, "processors", lambda: 4)

    @pytest.mark.thorough
    def test_specialisations_in_one_process_do_not_disturb_each_other(self, kit):
        """Their functions have the same names; each has to be compiled with its own."""
        kinds = ["rubber", "elastic", "sand", "rubber", "elastic", "gel", "sand"]
        found = {}
        for kind in kinds:
            with kit.open(falling(kit, kind), spacing=0.1) as session:
                assert session.advance_to(0.02).status is Status.OK
                state = session.read(kit.everything)
            assert kind not in found or same(found[kind], state)
            found[kind] = state

    @pytest.mark.parametrize("threads", [-1, 1.5, True])
    def test_bad_options_are_refused(self, threads):
        with pytest.raises(SceneError, match="threads"):
            ThreadOptions(threads=threads)

    @pytest.mark.parametrize("material", ["elastic", pytest.param("rubber", marks=pytest.mark.thorough)])
    def test_any_number_of_threads_gives_the_same_bits(self, kit, pool_of_four, material):
        problem = falling(kit, material)
        results = []
        for threads in (1, 2, 4):
            with kit.open(problem, spacing=0.05, threads=threads) as session:
                session.advance_to(0.05)
                results.append(session.read(kit.everything))
        assert same(results[0], results[1])
        assert same(results[0], results[2])

    def test_sessions_side_by_side_do_not_disturb_each_other(self, kit):
        problem = falling(kit)
        alone = {}
        for precision in ("float32", "float64"):
            with kit.open(problem, precision=precision, spacing=0.1) as session:
                session.advance_to(0.02)
                session.advance_to(0.04)
                alone[precision] = session.read(kit.everything)
        with (
            kit.open(problem, precision="float32", spacing=0.1) as one,
            kit.open(problem, precision="float64", spacing=0.1) as two,
        ):
            for time in (0.02, 0.04):
                one.advance_to(time)
                two.advance_to(time)
            assert same(one.read(kit.everything), alone["float32"])
            assert same(two.read(kit.everything), alone["float64"])

    def test_calls_may_come_from_different_threads(self, kit):
        """One after the other. A context of CUDA is current in a thread, so memory of a GPU may be out of reach."""

        def elsewhere(call, *arguments):
            with ThreadPoolExecutor(1) as other:
                return other.submit(call, *arguments).result()

        def opened():
            return kit.open(falling(kit), precision="float64", spacing=0.1)

        with opened() as session:
            session.advance_to(0.01)
            session.advance_to(0.02)
            expected = session.read(kit.everything)
        session = elsewhere(opened)
        elsewhere(session.advance_to, 0.01)
        session.read(kit.everything)
        assert elsewhere(session.checkpoint)
        elsewhere(session.advance_to, 0.02)
        found = elsewhere(session.read, kit.everything)
        elsewhere(session.close)
        # In what order a GPU adds is its own affair.
        assert np.allclose(found.positions, expected.positions, rtol=0, atol=1e-12)

    def test_times(self, kit):
        with kit.open(falling(kit), spacing=0.1) as session:
            report = session.advance_to(0.0)
            assert (report.status, report.substep_count) == (Status.OK, 0)
            report = session.advance_to(0.0123)
            assert session.time == 0.0123
            assert report.substep_count > 0
            assert 0 < report.smallest_substep <= report.largest_substep
            with pytest.raises(ValueError, match="advance"):
                session.advance_to(0.01)
            with pytest.raises(ValueError, match="advance"):
                session.advance_to(float("nan"))

    def test_what_is_read_is_owned_and_read_only(self, kit):
        with kit.open(falling(kit), spacing=0.1) as session:
            before = session.read(frozenset({Field.POSITIONS}))
            copy = before.positions.copy()
            session.advance_to(0.02)
            assert np.array_equal(before.positions, copy)
            assert before.velocities is None
            assert before.positions.dtype == np.float64
            with pytest.raises(ValueError, match="read-only"):
                before.positions[0, 0] = 1
        session.close()
        with pytest.raises(ValueError, match="closed"):
            session.advance_to(1.0)

    def test_a_point_far_from_home_is_sorted_before_it_is_scattered(self, kit):
        """Made to take steps too long for its speed, a point leaves home within one: the guard alone can know."""
        problem = falling(kit, colliders=(), gravity=(0, 0, 0))
        with kit.open(problem, spacing=0.02) as session:
            cloud = session._held
            step = 1.5 * 0.02 / 2.0  # one and a half cells
            cloud.begin_batch(step, np.zeros(3), Forcing.none(20))
            done, drifted, _ = cloud.steps(0, 20)
            assert drifted
            assert done == 1
            cloud.sort()
            rows = kit.rows(session)
            assert np.array_equal(rows.labels[:, at.HOME : at.HOME + 3], np.floor(rows.cells - 0.5).astype(int))

    def test_nan_is_found_and_named(self, kit):
        with kit.open(falling(kit), spacing=0.1) as session:
            session.advance_to(0.01)
            row = 7
            rows = kit.rows(session)
            rows.points[np.flatnonzero(rows.ids == row)[0], at.VELOCITY] = np.nan
            session._held._load(rows)
            report = session.advance_to(0.02)
            assert report.status is Status.NON_FINITE
            assert f"first {row}" in report.warnings[0]

    @pytest.mark.parametrize("precision", ["float32", "float64"])
    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_whatever_is_not_finite_is_seen(self, kit, value, precision):
        """Each number of a point that the next step reads, alone."""
        watched = [
            *range(at.VELOCITY, at.VELOCITY + 3),
            *range(at.AFFINE, at.AFFINE + 9),
            *range(at.DISPLACEMENT_GRADIENT, at.DISPLACEMENT_GRADIENT + 9),
            at.HISTORY,
        ]
        with kit.open(falling(kit), spacing=0.1, precision=precision) as session:
            cloud = session._held
            for place in [*watched, "x", "y", "z"]:
                rows = copy.deepcopy(kit.rows(session))
                if isinstance(place, int):
                    rows.points[100, place] = value
                else:
                    rows.cells[100, "xyz".index(place)] = value
                sound = copy.deepcopy(kit.rows(session))
                cloud._load(rows)
                assert not cloud.survey().finite, place
                cloud._load(sound)
                assert cloud.survey().finite

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_a_point_that_is_nowhere_is_not_scattered(self, kit, value):
        """It would write beyond the grid."""
        with kit.open(falling(kit), spacing=0.1) as session:
            session.advance_to(0.01)
            rows = kit.rows(session)
            rows.points[100, at.VELOCITY] = value
            session._held._load(rows)
            session._held.begin_batch(1e-4, np.zeros(3), Forcing.none(20))
            done, drifted, _ = session._held.steps(0, 20)
            assert drifted
            assert done == 1

    def test_nan_in_mid_batch_neither_crashes_nor_passes(self, kit):
        """What is not finite in a stress reaches the grid with it, and every point near it within a step."""
        with kit.open(falling(kit), spacing=0.1) as session:
            session.advance_to(0.01)
            rows = kit.rows(session)
            rows.points[100, at.STRESS + 1] = np.inf
            session._held._load(rows)
            problem_step = 1e-4
            session._held.begin_batch(problem_step, np.zeros(3), Forcing.none(20))
            done, drifted, _ = session._held.steps(0, 20)
            assert drifted
            assert done <= 2
            assert not session._held.survey().finite

    def test_substep_limit_is_known_before_time_is_spent(self, kit):
        with kit.open(falling(kit), spacing=0.1, substep_limit=3) as session:
            report = session.advance_to(1.0)
        assert report.status is Status.SUBSTEP_LIMIT
        assert report.substep_count == 0
        assert "substep_limit" in report.warnings[0]

    def test_a_substep_above_the_bound_is_refused(self, kit):
        with pytest.raises(SceneError, match="stable bound"):
            kit.open(falling(kit), spacing=0.1, substep=1.0)

    def test_points_too_far_apart_for_a_grid_are_refused(self, kit):
        positions = np.array([[0.0, 0, 0], [0, 0, 0.1], [1e3, 1e3, 1e3]])
        with pytest.raises(SceneError, match="point 2 at"):
            kit.open(kit.problem(positions, kit.materials["elastic"]), spacing=0.1)
        positions[2] = 1e300
        with pytest.raises(SceneError, match="point 2 at"):
            kit.open(kit.problem(positions, kit.materials["elastic"]), spacing=0.1)

    def test_domain_stop_names_the_point(self, kit):
        domain = Domain(lower=(-1, -1, -0.1), upper=(1, 1, 1), policy=DomainPolicy.STOP)
        problem = falling(kit, colliders=(), domain=domain)
        with kit.open(problem, spacing=0.1) as session:
            report = session.advance_to(1.0)
        assert report.status is Status.OUT_OF_DOMAIN
        assert "left the domain" in report.warnings[0]
        assert report.substep_count > 0

    def test_domain_clamp_keeps_points_inside(self, kit):
        lower, upper = np.array([-0.05, -0.05, 0.0]), np.array([0.5, 0.5, 1.0])
        domain = Domain(lower=tuple(lower), upper=tuple(upper), policy=DomainPolicy.CLAMP)
        with kit.open(falling(kit, "fluid", colliders=(), domain=domain), spacing=0.05) as session:
            report = session.advance_to(0.5)
            positions = session.read(kit.everything).positions
        assert report.status is Status.OK
        slack = 1e-12  # cells and back
        assert (positions >= lower - slack).all()
        assert (positions <= upper + slack).all()

    @pytest.mark.parametrize(("velocity", "told"), [((0, 0, -1), True), ((1, 0, 0), False)])
    def test_what_the_edge_stops_is_told_and_what_glides_along_it_is_not(self, kit, velocity, told):
        domain = Domain(lower=(-9, -9, 0), upper=(9, 9, 9), policy=DomainPolicy.CLAMP)
        scene = kit.problem(
            [[0.0, 0.0, 0.2]], kit.materials["elastic"], velocity=velocity, side=0.05, gravity=(0, 0, 0), domain=domain
        )
        with kit.open(scene, spacing=0.1) as session:
            report = session.advance_to(1.0)
            height = session.read(kit.everything).positions[0, 2]
        # The wall's nodes reach a cell and a half, and stop it before it gets there.
        assert height > 0
        assert report.warnings == (("matter was held back at the domain's edge",) if told else ())

    def test_a_point_brought_back_to_the_edge_goes_no_further_and_glides_on(self, kit):
        # The wall's nodes take an eighth of its speed in this one substep, which is four times as long as the way is.
        domain = Domain(lower=(-9, -9, -1e-3), upper=(9, 9, 9), policy=DomainPolicy.CLAMP)
        scene = kit.problem(
            [[0.0, 0.0, 0.0]],
            kit.materials["elastic"],
            velocity=(1, 0, -5),
            side=0.05,
            gravity=(0, 0, 0),
            domain=domain,
        )
        with kit.open(scene, spacing=0.1) as session:
            session.advance_to(1e-3)
            state = session.read(kit.everything)
        assert state.positions[0, 2] == pytest.approx(-1e-3, abs=1e-12)
        assert state.velocities[0, 2] == 0
        assert state.velocities[0, 0] == pytest.approx(1, rel=1e-5)

    def test_soft_matter_falls_many_cells_without_a_leap(self, kit):
        # At rest nothing but its own weight bounds the step: g dt^2 would be 20 cells at half of what its stiffness
        # bears.
        soft = Elastic(density=1e4, youngs_modulus=1.0, poissons_ratio=0.0)
        with kit.open(kit.problem(np.zeros((1, 3)), soft, side=0.1), spacing=0.1) as session:
            report = session.advance_to(1.0)
            fallen = -session.read(kit.everything).positions[0, 2]
        assert report.status is Status.OK
        # Symplectic Euler is ahead by g t dt/2; float32 rounds the speed to 1e-6 of it.
        assert 9.81 / 2 < fallen <= (9.81 / 2 + 9.81 * report.largest_substep / 2) * (1 + 1e-5)
        assert report.largest_substep <= np.sqrt(0.05 / 9.81)

    def test_domain_expand_follows_a_cloud_in_flight(self, kit):
        """2.5 m at 100 m/s on a grid of 5 mm cells: each two steps a new sort, and the shape stays."""
        start = kit.block(0.02)
        problem = kit.problem(start, kit.materials["elastic"], velocity=(100, 0, 0), side=0.02, gravity=(0, 0, 0))
        with kit.open(problem, spacing=0.005) as session:
            report = session.advance_to(0.025)
            moved = session.read(kit.everything).positions - start
            assert kit.nodes(session) < 20**3
        assert report.status is Status.OK
        # float32 velocities: 6e-8 relative in every step, in the same direction at worst.
        assert np.abs(moved - [2.5, 0, 0]).max() <= 2.5 * report.substep_count * 6e-8

    def test_impulse_is_given_once_at_its_time(self, kit):
        push = Impulse(region=HalfSpace(point=(0, 0, 10), normal=(0, 0, 1)), start=0.01, impulse=(8.0, 0.0, 0.0))
        problem = kit.problem(kit.block(), kit.materials["elastic"], drives=(push,), gravity=(0, 0, 0))
        with kit.open(problem, precision="float64", spacing=0.1) as session:
            speeds = []
            for time in (0.005, 0.01, 0.015, 0.02):
                session.advance_to(time)
                speeds.append(float(problem.masses @ session.read(kit.everything).velocities[:, 0]))
        assert speeds == pytest.approx([0, 0, 8, 8], abs=1e-9)

    def test_pinned_matter_stands_still_while_pinned(self, kit):
        hold = Pinned(region=HalfSpace(point=(0, 0, 10), normal=(0, 0, 1)), start=0.0, end=0.02)
        problem = kit.problem(kit.block(), kit.materials["elastic"], drives=(hold,))
        with kit.open(problem, spacing=0.1) as session:
            session.advance_to(0.02)
            assert np.array_equal(session.read(kit.everything).velocities, np.zeros((512, 3)))
            session.advance_to(0.03)
            falling_speed = session.read(kit.everything).velocities[:, 2]
        assert np.allclose(falling_speed, -9.81 * 0.01, rtol=1e-4)

    def test_points_keep_their_order(self, kit):
        start = kit.block()[::-1].copy()
        with kit.open(kit.problem(start, kit.materials["elastic"], gravity=(0, 0, 0)), spacing=0.05) as session:
            assert np.abs(session.read(kit.everything).positions - start).max() <= 1e-15
            session.advance_to(0.1)
            # float32 stress of rounded weights moves nothing by more than rounding.
            assert np.abs(session.read(kit.everything).positions - start).max() <= 1e-5

    def test_closed_regions_of_a_box_collider(self, kit):
        """A box from inside and a pinned corner compile and hold: nothing leaves the container."""
        container = BoxShape(center=(0.2, 0.2, 0.3), half_extents=(0.25, 0.25, 0.3))
        problem = falling(kit, "fluid", colliders=(Collider(shape=container, side=Side.INSIDE),))
        with kit.open(problem, spacing=0.05) as session:
            session.advance_to(0.5)
            depth = container.signed_distance(session.read(kit.everything).positions)
        # Contact acts at nodes: matter may come as far as the first node outside the wall, one cell.
        assert depth.max() <= 0.05

    def test_material_that_is_not_used_is_not_compiled(self, kit):
        unused = Elastic(density=1.0, youngs_modulus=1e9, poissons_ratio=0.3)
        problem = kit.problem(kit.block(), (kit.materials["fluid"], unused))
        with kit.open(problem, spacing=0.1) as session:
            # The unused material's stiffness bounds no step either: 1e9 Pa would need more than a thousand.
            assert session.advance_to(0.01).substep_count < 50

    @pytest.mark.thorough
    @pytest.mark.parametrize("kind", ["metal", "foam", "snow"])
    def test_flow_does_not_drift_in_single_precision(self, kit, kind):
        """A block that is thrown apart, or together, so that it flows and then swings for the rest of 2000 steps.

        Half an ulp of F a step, always in the same direction, would make it larger or smaller by 2000 * 3e-8 / 3 = 2e-5
        of its size. What rounds either way adds up to 2000^(1/2) * 3e-8 = 1e-6 a point, and to much less of all of
        them.
        """
        start = kit.block()
        arms = start - start.mean(axis=0)
        gradient = np.array([[1.0, 0.5, 0.0], [-2.0, -0.4, 1.0], [0.3, 2.0, -0.6]]) * (-1 if kind == "snow" else 2)
        scene = kit.problem(start, kit.materials[kind], velocity=arms @ gradient.T, gravity=(0, 0, 0))
        ends = []
        for precision in ("float32", "float64"):
            with kit.open(scene, precision=precision, spacing=0.1, substep=5e-4) as session:
                assert session.advance_to(1.0).substep_count == 2000
                ends.append(session.read(kit.everything).positions)
        single, double = ends
        assert np.abs(double - start).max() > 0.1
        swollen = np.sum((single - double) * (double - double.mean(axis=0))) / np.sum(
            (double - double.mean(axis=0)) ** 2
        )
        assert abs(swollen) <= 2e-6
