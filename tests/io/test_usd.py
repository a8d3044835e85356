"""Stages of USD, read back by USD itself."""

import resource
import sys

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io import write_splat
from gasp_core.io.usd import USD_SUFFIXES, splat_stage

pytest.importorskip("pxr", reason='no usd-core here: pip install "gasp-core[usd]"')


def opened(path):
    """The stage, and its fields by their names."""
    from pxr import Usd, UsdVol

    stage = Usd.Stage.Open(str(path))
    prims = [prim for prim in stage.Traverse() if prim.GetTypeName() == "ParticleField3DGaussianSplat"]
    return stage, {prim.GetName(): UsdVol.ParticleField3DGaussianSplat(prim) for prim in prims}


def told(field, time=None):
    """What a field says of its Gaussians: means, quaternions w x y z, scales, opacities, harmonics."""
    from pxr import Usd

    code = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
    turns = [(q.GetReal(), *q.GetImaginary()) for q in field.GetOrientationsAttr().Get(code)]
    return {
        "means": np.array(field.GetPositionsAttr().Get(code)).reshape(-1, 3),
        "quaternions": np.array(turns).reshape(-1, 4),
        "scales": np.array(field.GetScalesAttr().Get(code)).reshape(-1, 3),
        "opacities": np.array(field.GetOpacitiesAttr().Get(code)),
        "harmonics": np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get(code)).reshape(-1, 3),
    }


@pytest.mark.parametrize("suffix", USD_SUFFIXES)
@pytest.mark.parametrize("degree", [0, 3])
def test_a_still_stands_on_y(some, tmp_path, suffix, degree):
    from pxr import UsdGeom

    g = some(40, degree)
    path = tmp_path / f"a toy{suffix}"
    write_splat(path, g)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    stage, fields = opened(path)
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetName() == "splats"
    (field,) = fields.values()
    assert field.GetPrim().GetDisplayName() == "a toy"
    assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == degree
    found, turn = told(field), np.diag([1.0, -1.0, -1.0])
    np.testing.assert_array_equal(found["means"], g.means * np.float32([1, -1, -1]))
    np.testing.assert_array_equal(found["scales"], g.scales)
    np.testing.assert_array_equal(found["opacities"], g.opacities)
    assert len(found["harmonics"]) == 40 * (degree + 1) ** 2
    np.testing.assert_array_equal(found["harmonics"][:: (degree + 1) ** 2], g.harmonics[:, 0])
    expected = np.einsum("ij,njk,lk->nil", turn, g.covariances(), turn)
    # Rotations rounded to float32, in each of the components of two factors.
    bound = 16 * 2.0**-24 * (g.scales.max(axis=1) ** 2)[:, None, None]
    assert np.all(np.abs(g.with_(quaternions=found["quaternions"]).covariances() - expected) <= bound)
    lower, upper = np.array(field.GetExtentAttr().Get())
    assert np.all(lower < found["means"].min(axis=0))
    assert np.all(upper > found["means"].max(axis=0))


def test_frames_are_samples_and_what_stands_still_is_none(some, tmp_path):
    """Rests in frames 1 to 3 and 6: values between samples must not drift there."""
    moving, still = some(30, 1, 1), some(20, 0, 2)
    heights = [0.0, 1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 4.0]
    with splat_stage(tmp_path / "a.usdc", up_axis="Z", frame_rate=12.0) as stage:
        for frame, height in enumerate(heights):
            raised = moving.with_(means=moving.means + np.float32([0, 0, height]))
            stage.add(frame, {"moving": raised, "still": still})
    stage, fields = opened(tmp_path / "a.usdc")
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (12.0, 0.0, 7.0)
    for frame, height in enumerate(heights):
        found = told(fields["moving"], frame)["means"]
        np.testing.assert_array_equal(found, moving.means + np.float32([0, 0, height]))
        lower = np.array(fields["moving"].GetExtentAttr().Get(frame))[0, 2]
        assert height - 20 < lower < found[:, 2].min()
    assert fields["still"].GetPositionsAttr().GetNumTimeSamples() == 0
    assert fields["moving"].GetScalesAttr().GetNumTimeSamples() == 0
    np.testing.assert_array_equal(told(fields["still"])["means"], still.means)


def test_what_comes_and_goes_is_not_there_before_and_after(some, tmp_path):
    with splat_stage(tmp_path / "a.usdc", up_axis="Z", frame_rate=10.0) as stage:
        for frame, count in enumerate([0, 0, 5, 9, 0, 0]):
            grains = {"grains": some(count, 0, frame)} if count else {}
            stage.add(frame, {"sand": some(7, 0), **grains})
    _, fields = opened(tmp_path / "a.usdc")
    assert [len(told(fields["grains"], frame)["means"]) for frame in range(6)] == [0, 0, 5, 9, 0, 0]
    np.testing.assert_array_equal(told(fields["grains"], 3)["scales"], some(9, 0, 3).scales)


def test_names_that_usd_does_not_take(some, tmp_path):
    names = ["a b", "a/b", "a_b", "3"]
    with splat_stage(tmp_path / "a.usda", up_axis="Z") as stage:
        stage.add(0, {name: some(3, 0, seed) for seed, name in enumerate(names)})
    _, fields = opened(tmp_path / "a.usda")
    assert len(fields) == 4
    means = [told(field)["means"] for field in fields.values()]
    for seed in range(4):
        np.testing.assert_array_equal(means[seed], some(3, 0, seed).means)


def test_long_runs_are_saved_as_they_go(some, tmp_path, monkeypatch):
    monkeypatch.setattr("gasp_core.io.usd._SAVED_EVERY", 2)
    g = some(10, 0)
    with splat_stage(tmp_path / "a.usdc", up_axis="Z", frame_rate=1.0) as stage:
        for frame in range(7):
            stage.add(frame, {"toy": g.with_(means=g.means + np.float32(frame))})
            (beside,) = tmp_path.iterdir()
            assert beside.name != "a.usdc"
    _, fields = opened(tmp_path / "a.usdc")
    for frame in range(7):
        np.testing.assert_array_equal(told(fields["toy"], frame)["means"], g.means + np.float32(frame))


def test_a_stage_that_fails_leaves_the_old_one(some, tmp_path):
    path = tmp_path / "a.usdc"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError), splat_stage(path, up_axis="Z", frame_rate=1.0) as stage:
        stage.add(0, {"toy": some()})
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_where_nothing_can_be_written(some, tmp_path):
    (tmp_path / "folder.usdc").mkdir()
    for name in ("folder.usdc", "missing/a.usdc"):
        with pytest.raises(SplatFormatError, match="cannot be written") as refused:
            write_splat(tmp_path / name, some())
        assert "\n" not in str(refused.value)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.usdc"]


def test_a_full_disk_leaves_the_old_file(some, tmp_path, monkeypatch):
    """A limit on file sizes stands in for the disk."""
    path = tmp_path / "a.usdc"
    path.write_bytes(b"old")
    # Nor is what is imported meanwhile to be left cut off in the cache of bytecode.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(SplatFormatError, match="cannot be written") as refused:
            write_splat(path, some(5000, 0))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "\n" not in str(refused.value)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_without_usd_core(some, tmp_path, monkeypatch):
    for name in ("pxr", "pxr.Tf"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SplatFormatError, match=r"pip install \"gasp-core\[usd\]\""):
        write_splat(tmp_path / "a.usdc", some())
    assert not list(tmp_path.iterdir())
