"""A real plant at the extremes: the right result, or the clear error of what cannot be had.

The plant is thinned to every 24th Gaussian, so that each case takes seconds; `benchmarks/plant_drop.py` runs it whole.
"""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

import gasp_core as gasp
from gasp_core.contract import PointCloud
from gasp_core.errors import EngineDivergedError, SceneError, UnsupportedSceneError

DATA = Path(os.environ.get("GASP_DATA", Path(__file__).parents[3] / "shared" / "data"))
PLANT = DATA / "splats" / "plant.splat"
GRAVITY = 9.81

pytestmark = pytest.mark.skipif(not PLANT.exists(), reason=f"no {PLANT}; set GASP_DATA")


@pytest.fixture(scope="module")
def plant():
    return gasp.read_splat(PLANT).select(np.arange(0, 113_648, 24))


def dropped(splat, *, drop=0.02, offset=0.0, frames=6, resolution=16, velocity=(0, 0, 0), **material):
    """The plant, 0.4 m tall, `drop` [m] above a floor with friction; everything moved by `offset` [m]."""
    elastic = {"density": 400, "youngs_modulus": 5e4, "poissons_ratio": 0.3} | material
    item = gasp.SplatObject(
        name="plant",
        splat=splat,
        up="-y",
        height=0.4,
        position=(offset, offset, offset + drop),
        material=gasp.Elastic(**elastic),
        floaters=gasp.Floaters.DROP,
        velocity=velocity,
        vertices=3,
    )
    floor = gasp.HalfSpace(point=(offset, offset, offset), normal=(0, 0, 1))
    return gasp.Scene(
        duration=(frames - 1) / 25,
        frame_rate=25,
        objects=(item,),
        colliders=(gasp.Collider(shape=floor, friction=0.4),),
        accuracy=gasp.EngineAccuracy(resolution=resolution),
    )


def every_vertex(scene):
    objects = (dataclasses.replace(item, reduction=gasp.Reduction(mode="all")) for item in scene.objects)
    return dataclasses.replace(scene, objects=tuple(objects))


def sound(run):
    """Complete, finite, on the floor's right side, with no energy but gravity's and the start's."""
    assert run.status == "complete"
    frames = run.diagnostics()
    for frame in range(run.frame_count):
        assert np.isfinite(run.points(frame)).all()
        assert np.isfinite(run.gaussians(frame).covariances()).all()
    # Nodes half a cell below the floor are those that stop; on impact matter comes that close to them.
    assert np.percentile(run.points(run.frame_count - 1)[:, 2], 1) >= -0.5 * run.header.spacing
    start = frames[0]["kinetic_energy"]
    for frame in frames[1:]:
        assert frame["kinetic_energy"] <= 1.05 * (start - frame["potential_energy"]) + 1e-6
    return run


@pytest.mark.thorough
def test_it_comes_to_rest_on_the_floor_not_above_it(plant):
    run = sound(gasp.simulate(dropped(plant, youngs_modulus=2e5, frames=15)))
    rest = run.points(run.frame_count - 1)
    # The nodes that stop matter are half a cell below the floor, and are felt from a cell and a half away.
    assert -0.5 <= np.percentile(rest[:, 2], 1) / run.header.spacing <= 1.0


def test_what_triangles_leave_out_is_said(plant):
    run = gasp.simulate(dropped(plant), frames=1)
    assert any("not flat" in note and "vertices = 4" in note for note in run.notes)
    whole = dropped(plant)
    whole = dataclasses.replace(whole, objects=(dataclasses.replace(whole.objects[0], vertices=4),))
    assert not any("not flat" in note for note in gasp.simulate(whole, frames=1).notes)


def test_softer_than_its_own_weight_stops_and_says_so(plant, tmp_path):
    # rho g L / E = 16: it collapses to nothing, and no elastic law holds there.
    with pytest.raises(EngineDivergedError, match="too soft for its load"):
        gasp.simulate(dropped(plant, youngs_modulus=1e2, frames=8), out=tmp_path / "soft.gasp")
    run = gasp.Recording.open(tmp_path / "soft.gasp")
    assert run.status == "incomplete"
    assert run.frame_count >= 2
    assert all(np.isfinite(run.points(frame)).all() for frame in range(run.frame_count))


def test_soft_and_weightless_runs(plant):
    scene = dropped(plant, youngs_modulus=1e2, frames=8, velocity=(0, 0, -0.3))
    sound(gasp.simulate(dataclasses.replace(scene, gravity=(0, 0, 0))))


def test_stiff_as_bone_names_what_it_would_cost(plant, tmp_path):
    with pytest.raises(UnsupportedSceneError, match=r"would need [\d,]+ substeps .* substep_limit .* Either "):
        gasp.simulate(dropped(plant, youngs_modulus=1e9, resolution=64), out=tmp_path / "stiff.gasp")
    assert not (tmp_path / "stiff.gasp").exists()


def test_stiff_as_bone_runs_where_it_is_paid_for(plant):
    scene = dropped(plant.select(np.arange(0, len(plant), 20)), youngs_modulus=1e9, resolution=8, frames=2)
    scene = dataclasses.replace(scene, frame_rate=100, duration=0.01)
    sound(gasp.simulate(scene))


def test_nearly_incompressible(plant):
    sound(
        gasp.simulate(dropped(plant.select(np.arange(0, len(plant), 4)), poissons_ratio=0.499, frames=4, resolution=12))
    )


@pytest.mark.thorough
def test_ten_metres_a_second_into_the_floor(plant):
    # rho v^2 = 4e4 Pa is E of the other tests: nothing elastic survives that, and the run would stop and say so.
    sound(gasp.simulate(dropped(plant, velocity=(0, 0, -10), drop=0.1, youngs_modulus=1e6)))


@pytest.mark.thorough
def test_ten_kilometres_away(plant):
    """Every vertex is a point: of cores and sheets, roundings decide how the tetrahedra are turned."""
    near, far = (gasp.simulate(every_vertex(dropped(plant, offset=offset))) for offset in (0, 1e4))
    size = near.start_points.max(axis=0) - near.start_points.min(axis=0)
    for frame in range(near.frame_count):
        away = far.points(frame) - 1e4 - near.points(frame)
        # A place at 1e4 m is known to 2e-12 m before anything moves; float32 rounding of the run does the rest.
        assert np.abs(away).max() <= 1e-5 * size.max()


def test_a_gaussian_that_is_not_finite_is_left_out_and_named(plant):
    means = np.array(plant.means)
    means[7] = np.nan
    run = sound(gasp.simulate(dropped(plant.with_(means=means), frames=2)))
    assert len(run.gaussians(1)) < len(plant)
    assert any("not finite" in note and "7" in note for note in run.notes)


def test_a_point_that_is_not_finite_is_refused_by_its_number():
    positions = np.zeros((9, 3))
    positions[4, 1] = np.inf
    with pytest.raises(SceneError, match=r"first 4"):
        PointCloud(
            reference_positions=positions,
            initial_velocities=np.zeros((9, 3)),
            reference_volumes=np.ones(9),
            material_ids=np.zeros(9),
            body_ids=np.zeros(9),
        )


@pytest.mark.parametrize("covariance", ["exact", "gram_schmidt"])
def test_a_triangle_without_area(plant, covariance):
    scales = np.array(plant.scales)
    scales[3] = [0.0, 0.01, 0.0]
    scene = dropped(plant.with_(scales=scales), frames=3)
    scene = dataclasses.replace(scene, maps=gasp.MapChoice(covariance=covariance))
    run = sound(gasp.simulate(scene))
    assert [frame["degenerate"] for frame in run.diagnostics()][1:] == [0 if covariance == "exact" else 1] * 2


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_gaussians_fall_as_they_should(plant, count):
    scene = dropped(plant.select(np.arange(count)), drop=10, frames=6, resolution=4)
    scene = dataclasses.replace(
        scene, objects=(dataclasses.replace(scene.objects[0], height=None, metres_per_unit=0.1),)
    )
    run = gasp.simulate(scene)
    assert run.status == "complete"
    fallen = (run.points(5) - run.points(0)).mean(axis=0)
    time = run.times[5]
    substep = max(frame["largest_substep"] for frame in run.diagnostics()[1:])
    # Symplectic Euler falls g t dt/2 too far, exactly.
    assert abs(fallen[2] + GRAVITY * time**2 / 2) <= 1.05 * GRAVITY * time * substep / 2 + 1e-5
    assert np.abs(fallen[:2]).max() <= 1e-6
