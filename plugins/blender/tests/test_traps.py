"""What Blender does in silence, each of which was met."""

from __future__ import annotations

import numpy as np
import pytest
from gasp_blender.meshes import mesh_object

from gasp_core.contract import (
    Collider,
    ContactCondition,
    Elastic,
    Field,
    HalfSpace,
    PointCloud,
    PointProblem,
    Rigid,
    Side,
    SphereShape,
    Status,
    Wind,
)
from gasp_core.errors import SceneError

ROUNDING = 2.0**-24

FLOOR = HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))

EVERYTHING = frozenset({Field.POSITIONS, Field.VELOCITIES})

G = 9.81


def sheet(kit):
    return kit.block((4, 4, 1), 0.1)


def fallen(kit, problem, times, **options):
    """Mean fall [m] at each time, and how many substeps it took."""
    start = problem.points.reference_positions
    falls, count = [], 0
    with kit.open(problem, **options) as session:
        for time in times:
            count += session.advance_to(time).substep_count
            falls.append(float((start - session.read(EVERYTHING).positions)[:, 2].mean()))
    return np.array(falls), count


@pytest.mark.parametrize("elastic", ["cage", "cloth"])
@pytest.mark.parametrize("step", [1e-3, 2e-3, 3.3e-3])
def test_falls_at_one_g_whatever_the_frame_rate(kit, elastic, step):
    """Frame rate, and cloth's quality: Blender's clocks know no seconds, and its loops take a step too many."""
    times = np.array([100, 150]) * step
    falls, count = fallen(kit, kit.problem(sheet(kit), 0.1), times, elastic=elastic, substep=step)
    assert count == 150
    # Symplectic Euler, to the last digit: g t (t + dt) / 2. Each step adds one rounding of a speed and one of a place.
    np.testing.assert_allclose(falls, G * times * (times + step) / 2, rtol=2 * 150 * ROUNDING, atol=150 * ROUNDING)


@pytest.mark.parametrize("cells", [(1, 1, 1), (5, 4, 3)])
@pytest.mark.parametrize("voxels", [1000, 1])
def test_light_nodes_fall_as_fast_as_heavy_ones(kit, cells, voxels):
    """Blender moves a vertex lighter than 0.01 as one of 0.01: a corner of a coarse cage hung in the air."""
    step = 1e-3
    problem = kit.problem(kit.block(cells, 0.1), 0.1)
    with kit.open(problem, substep=step, voxels=voxels) as session:
        session.advance_to(20 * step)
        speeds = session.read(EVERYTHING).velocities
    # A place rounded by 2^-24 of half a metre is pulled back by w^2 times that, with w < 200 / s: 1.2e-4 of g.
    expected = np.array([0.0, 0.0, -G * 20 * step])
    np.testing.assert_allclose(speeds, np.broadcast_to(expected, speeds.shape), atol=1.2e-4 * G * 20 * step)


def test_falls_within_a_hundredth_by_itself(kit):
    falls, _ = fallen(kit, kit.problem(sheet(kit), 0.1), [1.0])
    assert falls[0] == pytest.approx(G / 2, rel=0.01)


def test_rigid_bodies_fall_at_one_g(kit):
    problem = kit.problem(kit.block((2, 2, 2), 0.1), 0.1, material=Rigid(density=700.0))
    falls, _ = fallen(kit, problem, [0.5], substep=5e-3)
    assert falls[0] == pytest.approx(G * 0.5 * 0.505 / 2, rel=1e-5)


@pytest.mark.parametrize("elastic", ["cage", "cloth"])
def test_wind_blows_the_way_it_says(kit, elastic):
    """Blender's own field turns round where a soft body has no friction."""
    wind = Wind(velocity=(2.0, -1.0, 0.5), drag=3.0)
    problem = kit.problem(sheet(kit), 0.1, gravity=(0, 0, 0), force_fields=(wind,))
    with kit.open(problem, elastic=elastic) as session:
        session.advance_to(0.4)
        state = session.read(EVERYTHING)
    expected = np.array(wind.velocity) * -np.expm1(-1.2)
    # Exact in each substep; rounded in float32 in each of some hundred.
    np.testing.assert_allclose(state.velocities, np.broadcast_to(expected, (len(problem.points), 3)), atol=1e-4)


def test_goes_on_beyond_frame_250(kit):
    """The end of a cache, which is shown for ever after; the one made here ends at 1000."""
    step, steps = 1e-3, 1300
    problem = kit.problem(kit.block((1, 1, 1), 0.1), 0.1, gravity=(0, 0, 0))
    points = problem.points.reference_positions
    # One that turns: what flies straight is no work for Blender.
    problem = kit.problem(points, 0.1, np.cross([0, 0, 1.0], points - points.mean(axis=0)), gravity=(0, 0, 0))
    with kit.open(problem, substep=step) as session:
        assert session.advance_to(steps * step).substep_count == steps
        arms = session.read(EVERYTHING).positions - points.mean(axis=0)
    turned = np.arctan2(*arms.T[1::-1]) - np.arctan2(*(points - points.mean(axis=0)).T[1::-1])
    # Drawn out by w^2 rho L^2 / E it turns slower by some thousandths.
    np.testing.assert_allclose(np.angle(np.exp(1j * turned)), steps * step, rtol=0.01)


def test_a_new_length_of_step_does_not_begin_anew(kit):
    """Another setting resets Blender's simulation to its first frame."""
    problem = kit.problem(kit.block((2, 1, 1), 0.1), 0.1, (1.0, 0, 0), gravity=(0, 0, 0))
    with kit.open(problem) as session:
        for time in (0.01, 0.0101, 0.0101 + 1e-9, 0.02, 0.0331):
            assert session.advance_to(time).status is Status.OK
            moved = session.read(EVERYTHING).positions - problem.points.reference_positions
            np.testing.assert_allclose(moved[:, 0], time, rtol=1e-5, atol=1e-8)


def test_sessions_take_turns(kit):
    """Blender simulates the scene in its window alone: in any other, frames go by and nothing moves."""
    problems = (
        kit.problem(kit.block((2, 1, 1), 0.1), 0.1, (0.0, 0.0, 1.0)),
        kit.problem(kit.block((1, 2, 1), 0.1), 0.1, material=Rigid(density=700.0)),
    )
    times = (0.02, 0.04, 0.06)
    alone = []
    for problem in problems:
        with kit.open(problem, substep=0.002) as session:
            for time in times:
                session.advance_to(time)
            alone.append(session.read(EVERYTHING).positions)
    with kit.open(problems[0], substep=0.002) as first, kit.open(problems[1], substep=0.002) as second:
        for time in times:
            first.advance_to(time)
            second.advance_to(time)
        assert np.array_equal(first.read(EVERYTHING).positions, alone[0])
        assert np.array_equal(second.read(EVERYTHING).positions, alone[1])


@pytest.mark.parametrize("what", ["cage", "cloth", "rigid"])
def test_what_drifts_slowly_is_neither_braked_nor_stopped(kit, what):
    """Blender damps all of them by default, and Bullet puts what is slower than 0.4 to sleep after two seconds."""
    material, elastic = (Rigid(density=700.0), "cage") if what == "rigid" else (kit.rubber, what)
    speed = 0.02
    problem = kit.problem(sheet(kit), 0.1, (speed, 0, 0), material, gravity=(0, 0, 0))
    step, time = 0.004, 4.0
    with kit.open(problem, substep=step, elastic=elastic) as session:
        session.advance_to(time)
        moved = session.read(EVERYTHING).positions - problem.points.reference_positions
    # Each of a thousand steps rounds a place that ends within two sizes of the body.
    np.testing.assert_allclose(moved[:, 0].mean(), speed * time, atol=time / step * ROUNDING * 0.8)


def test_one_advance_ends_where_many_do(kit):
    problem = kit.problem(kit.block((2, 2, 2), 0.1), 0.1, colliders=(Collider(shape=FLOOR),))
    ends = []
    for times in ([0.064], np.arange(1, 33) * 0.002):
        with kit.open(problem, substep=0.002) as session:
            for time in times:
                session.advance_to(float(time))
            ends.append(session.read(EVERYTHING).positions)
    # Steps that are differences of times differ in their last digit, which may turn the rounding to float32 over.
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=32 * ROUNDING * 0.2)


def test_rests_on_the_floor_without_a_gap(kit):
    """Blender's margins leave 4 cm; what starts on the floor is not thrown up either."""
    problem = kit.problem(kit.block((2, 2, 2), 0.1), 0.1, colliders=(Collider(shape=FLOOR),))
    with kit.open(problem) as session:
        lowest = []
        for time in np.linspace(0, 1, 11)[1:]:
            session.advance_to(float(time))
            lowest.append(session.read(EVERYTHING).positions[:, 2].min())
    # It sinks by rho g H^2 / 2E = 4 cm of its 20 at its head, and by much less at its foot, a quarter voxel up.
    assert min(lowest) > 0.0 and max(lowest) < 0.025 + 0.02


def test_rigid_bodies_rest_on_the_floor_without_a_gap(kit):
    problem = kit.problem(
        kit.block((2, 2, 2), 0.1, corner=(0, 0, 0.1)),
        0.1,
        material=Rigid(density=700.0),
        colliders=(Collider(shape=FLOOR, friction=0.5),),
    )
    with kit.open(problem) as session:
        session.advance_to(1.0)
        lowest = session.read(EVERYTHING).positions[:, 2].min()
    # Points lie a quarter voxel within what they stand for; Bullet lets a hull sink by a thousandth of its size.
    assert lowest == pytest.approx(0.025, abs=1e-3)


def test_a_rigid_body_that_starts_in_the_floor_is_not_thrown_out(kit):
    """Bullet throws it out."""
    points = kit.block((2, 2, 2), 0.1, corner=(0, 0, -0.3))
    problem = kit.problem(points, 0.1, material=Rigid(density=700.0), colliders=(Collider(shape=FLOOR),))
    with kit.open(problem) as session:
        session.advance_to(0.5)
        moved = session.read(EVERYTHING).positions - points
    # Bullet lets a hull sink by a thousandth of its size.
    assert np.abs(moved).max() < 1e-3


def test_what_starts_in_the_floor_is_neither_thrown_out_nor_crushed(kit):
    """Blender's own collisions eject it."""
    points = kit.block((2, 2, 4), 0.1, corner=(0, 0, -0.3))
    with kit.open(kit.problem(points, 0.1, colliders=(Collider(shape=FLOOR),))) as session:
        first, second = session.advance_to(0.01), session.advance_to(0.3)
        found = session.read(EVERYTHING)
    assert first.status is second.status is Status.OK and first.warnings == second.warnings == ()
    # What is in the floor stays where it is; what is above sinks by rho g H^2 / 2E of a tenth of a metre, and swings.
    moved = found.positions - points
    assert np.abs(moved).max() < 4 * 1000 * G * 0.1**2 / 2e4
    assert np.abs(moved[points[:, 2] < -0.1]).max() < 1e-3
    # Thrown up faster than it would come back, it leaves.
    with kit.open(kit.problem(points, 0.1, (0, 0, 4.0), colliders=(Collider(shape=FLOOR),))) as session:
        session.advance_to(0.2)
        risen = session.read(EVERYTHING).positions - points
    np.testing.assert_allclose(risen[:, 2], 4.0 * 0.2 - G * 0.2**2 / 2, rtol=0.01)


def test_a_body_is_not_pressed_through_itself(kit):
    """Springs are as long in a block turned inside out."""
    points = kit.block((3, 3, 3), 0.1)
    sound = np.sqrt(kit.rubber.youngs_modulus / kit.rubber.density)
    problem = kit.problem(points, 0.1, -20 * sound / 0.3 * (points - points.mean(axis=0)), gravity=(0, 0, 0))
    with kit.open(problem) as session:
        ratios = []
        for time in np.linspace(0, 0.3 / sound, 31)[1:]:
            session.advance_to(float(time))
            places = session.read(EVERYTHING).positions
            # Of the affine map nearest to what has become of it.
            gradient = np.linalg.lstsq(points - points.mean(axis=0), places - places.mean(axis=0), rcond=None)[0]
            ratios.append(np.linalg.det(gradient))
    # A fifth, less what it is pressed by within a step before that is seen; and it springs back.
    assert 0.0 < min(ratios) < 0.5 and ratios[-1] > 0.5
    np.testing.assert_allclose(places.mean(axis=0), points.mean(axis=0), atol=1e-6)


def test_a_coarser_cage_than_asked_for_is_told(kit):
    with kit.open(kit.problem(kit.block((4, 4, 4), 0.1), 0.1), voxels=8) as session:
        reports = [session.advance_to(time) for time in (0.001, 0.002)]
    assert reports[0].warnings[0].startswith("a cage has voxels of 0.2 m instead of the 0.1 m")
    assert reports[1].warnings == ()


def test_meshes_that_are_not_finite_are_refused():
    """`Mesh.validate` makes numbers of them."""
    with pytest.raises(SceneError, match="1 vertices that are not finite, first 2"):
        mesh_object(None, np.array([[0, 0, 0], [1, 0, 0], [np.nan, 0, 0]]))
    with pytest.raises(SceneError, match="edge of a vertex"):
        mesh_object(None, np.zeros((3, 3)), np.array([[0, 3]]))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_size_does_not_matter(kit, scale):
    """A cage of a millimetre explodes where lengths are not scaled. L -> s L, E -> s E, t -> sqrt(s) t."""
    spacing = 0.1 * scale
    material = Elastic(density=1000.0, youngs_modulus=1e4 * scale, poissons_ratio=0.25)
    floor = (Collider(shape=FLOOR),)
    problem = kit.problem(kit.block((2, 2, 2), spacing, (0, 0, 0.2 * spacing)), spacing, 0.0, material, colliders=floor)
    with kit.open(problem, spacing) as session:
        assert session.advance_to(0.3 * np.sqrt(scale)).status is Status.OK
        height = session.read(EVERYTHING).positions[:, 2].mean() / scale
    assert height == pytest.approx(reference_height(kit), abs=1e-4)


def reference_height(kit):
    floor = (Collider(shape=FLOOR),)
    with kit.open(kit.problem(kit.block((2, 2, 2), 0.1, (0, 0, 0.02)), 0.1, colliders=floor)) as session:
        session.advance_to(0.3)
        return float(session.read(EVERYTHING).positions[:, 2].mean())


@pytest.mark.parametrize("modulus", [1e2, 1e4, 1e7, 1e9])
def test_any_stiffness_stays_finite_and_elastic(kit, modulus):
    """A spring that is too stiff for its step gives silent NaNs."""
    material = Elastic(density=1000.0, youngs_modulus=modulus, poissons_ratio=0.3)
    rate = 0.05 * np.sqrt(modulus / 1000.0) / 0.2
    points = kit.block((2, 2, 2), 0.1)
    stretch = rate * (points - points.mean(axis=0))
    with kit.open(kit.problem(points, 0.1, stretch, material, gravity=(0, 0, 0))) as session:
        for _ in range(20):
            assert session.advance_to(session.time + 0.02 / rate).status is Status.OK
            size = np.ptp(session.read(EVERYTHING).positions, axis=0)
            # Thrown apart with a strain of some hundredths, it swings.
            assert (size > 0.1).all() and (size < 0.2).all()


def test_softer_and_stiffer_bodies_go_together_until_blender_has_no_numbers_for_them(kit):
    points = kit.block((1, 1, 1), 0.1)

    def two(modulus):
        cloud = PointCloud(
            reference_positions=np.concatenate([points, points + [1.0, 0, 0]]),
            initial_velocities=np.zeros((16, 3)),
            reference_volumes=np.full(16, 1.25e-4),
            material_ids=np.repeat([0, 1], 8),
            body_ids=np.repeat([0, 1], 8),
        )
        stiff = Elastic(density=1000.0, youngs_modulus=modulus, poissons_ratio=0.25)
        return PointProblem(points=cloud, materials=(kit.rubber, stiff))

    with kit.open(two(1e7)) as session:
        assert session.advance_to(1e-3).status is Status.OK
    with pytest.raises(SceneError, match="simulate them apart"):
        kit.open(two(1e12))


def test_what_bullet_does_not_do_is_refused(kit):
    rigid, points = Rigid(density=700.0), kit.block((1, 1, 1), 0.1, corner=(0, 0, 0.5))
    ball = SphereShape(center=(0, 0, 0), radius=9.0)
    for scene, reason in (
        ({"colliders": (Collider(shape=FLOOR, contact=ContactCondition.SLIP),)}, 'no contact "slip"'),
        ({"colliders": (Collider(shape=ball, side=Side.INSIDE),)}, "within a ball"),
    ):
        with pytest.raises(SceneError, match=reason):
            kit.open(kit.problem(points, 0.1, material=rigid, **scene))


def test_rigid_and_elastic_bodies_go_on_from_a_checkpoint(kit):
    for material, options in ((Rigid(density=700.0), {}), (kit.rubber, {}), (kit.rubber, {"elastic": "cloth"})):
        problem = kit.problem(
            kit.block((4, 4, 1), 0.1, (0, 0, 0.01)), 0.1, (1.0, 0, -1.0), material, colliders=(Collider(shape=FLOOR),)
        )
        with kit.open(problem, **options) as whole:
            whole.advance_to(0.05)
            kept = whole.checkpoint()
            whole.advance_to(0.1)
            expected = whole.read(EVERYTHING)
        with kit.open(problem, restart=kept, **options) as resumed:
            assert resumed.time == 0.05
            resumed.advance_to(0.1)
            found = resumed.read(EVERYTHING)
        assert np.array_equal(found.positions, expected.positions), material
        assert np.array_equal(found.velocities, expected.velocities), material


def test_turbulence_is_as_strong_as_it_says_whatever_the_step(kit):
    """Blender's fields go with the frame rate, and turn round where a soft body has friction."""
    problem = kit.problem(kit.block((8, 8, 8), 0.1), 0.1, gravity=(0, 0, 0))
    found = []
    for step in (1e-3, 2e-3):
        with kit.open(problem, substep=step, turbulence=5.0, turbulence_size=0.13) as session:
            session.advance_to(step)
            found.append(session.read(EVERYTHING).velocities / step)
    # The same field; springs have pushed back by a share (w dt)^2 / 4 of it in a step, w dt < 0.4.
    np.testing.assert_allclose(found[0], found[1], atol=0.04 * np.abs(found[0]).max())
    # Some hundred cells of noise, and points lie between nodes, which averages: by a third or so.
    strength = float(np.sqrt((found[0] ** 2).sum(axis=1).mean()))
    assert 2.0 < strength < 7.0
