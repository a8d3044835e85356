from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gasp_core import Elastic, Part, Reduction
from gasp_core.errors import RecordingError
from gasp_core.games import to_simplices
from gasp_core.reduction import cores

CORES = Reduction(mode="cores", count=5)


def test_a_run_by_cores_keeps_their_corners_and_the_way_back(scene_of, cloud, run, tmp_path):
    splat = cloud()
    recording = run(scene_of(splat, reduction=CORES, vertices=4), tmp_path / "a.gasp")
    assert recording.status == "complete"
    assert recording.start_points.shape == (20, 3)
    assert 'object "thing": 5 cores carry 40 Gaussians' in recording.notes
    first = recording.gaussians(0)
    # About a centre of their own and back: an ulp of the means.
    np.testing.assert_allclose(recording.simplices(0)["thing"], to_simplices(splat, 4), atol=1e-15)
    np.testing.assert_allclose(first.covariances(), splat.covariances(), atol=1e-14)
    # All fly alike: the mean displacement is kept in double precision, the rest is zero but for its rounding.
    fall = recording.points(10) - recording.start_points
    moved = recording.gaussians(10).means - splat.means
    np.testing.assert_allclose(moved, np.broadcast_to(fall.mean(axis=0), moved.shape), atol=1e-12)


@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
def test_a_run_by_cores_goes_on_bit_for_bit(scene_of, run, tmp_path, transfer):
    reduction = Reduction(mode="cores", fraction=0.25, levels=2, transfer=transfer)
    scene = scene_of(reduction=reduction, options={"spin": 3.0})
    whole = run(scene, tmp_path / "whole.gasp")
    run(scene, tmp_path / "a.gasp", frames=5)
    resumed = run(scene, tmp_path / "a.gasp", resume=True)
    assert resumed.status == "complete"
    for frame in (4, 10):
        assert np.array_equal(resumed.gaussians(frame).means, whole.gaussians(frame).means)
        assert np.array_equal(resumed.gaussians(frame).quaternions, whole.gaussians(frame).quaternions)


@pytest.mark.parametrize("parted", [False, True])
@pytest.mark.parametrize("transfer", ["least-squares", "frame"])
def test_a_run_goes_on_with_its_own_cores_where_another_machine_makes_others(
    scene_of, run, tmp_path, monkeypatch, transfer, parted
):
    """Where clusters are equally near, roundings decide: of 20,000 corners of a skull 520 differ by the processor."""
    other = Elastic(density=500, youngs_modulus=1e6, poissons_ratio=0.2)
    scene = scene_of(
        reduction=Reduction(mode="cores", count=10, levels=2, transfer=transfer),
        parts=(Part(labels=np.arange(40) % 2, label=1, material=other),) if parted else (),
        options={"spin": 3.0},
    )
    whole = run(scene, tmp_path / "whole.gasp")
    run(scene, tmp_path / "a.gasp", frames=5)
    made = cores.cluster_apart
    elsewhere = (1.0, 3.0, 0.5)
    monkeypatch.setattr(cores, "cluster_apart", lambda places, kinds, n: made(places * elsewhere, kinds, n))
    assert run(scene, tmp_path / "elsewhere.gasp", frames=1).header.points_digest != whole.header.points_digest
    resumed = run(scene, tmp_path / "a.gasp", resume=True)
    assert resumed.status == "complete"
    for frame in (4, 10):
        assert np.array_equal(resumed.gaussians(frame).means, whole.gaussians(frame).means)
        assert np.array_equal(resumed.gaussians(frame).quaternions, whole.gaussians(frame).quaternions)


def test_another_reduction_is_another_scene(scene_of, run, tmp_path):
    run(scene_of(reduction=CORES), tmp_path / "a.gasp", frames=2)
    with pytest.raises(RecordingError, match="the scene, or a file that it names, has changed"):
        run(scene_of(), tmp_path / "a.gasp", resume=True)


def test_objects_may_differ_in_their_reduction(scene_of, cloud, run, tmp_path):
    scene = scene_of(cloud(40, 1), reduction=CORES)
    other = dataclasses.replace(scene.objects[0], name="other", splat=cloud(30, 2), reduction=Reduction())
    both = run(dataclasses.replace(scene, objects=(*scene.objects, other)), tmp_path / "a.gasp")
    assert [body.carrier.kind for body in both.bodies] == ["cores", "all"]
    assert len(both.start_points) == 20 + 30 * 4
    assert np.isfinite(both.gaussians(10).means).all()
