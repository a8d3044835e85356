"""Every real splat there is, against what is known of it and against other libraries."""

import json

import numpy as np
import plyfile
import pytest
from scipy.spatial import cKDTree

from gasp_core.gaussians import rotation_matrices
from gasp_core.io import read_splat, write_splat
from gasp_core.io.inspect import inspect_splat

# Counts and degrees of MANIFEST.md.
FILES = {
    "splats/plant.splat": (113_648, 0),
    "splats/playbot/0_0": (500_000, 2),
    "splats/playbot/1_0": (250_000, 2),
    "splats/playbot/2_0": (125_000, 2),
    "splats/playbot/3_0": (31_000, 2),
    "splats/playbot/4_0/meta.json": (8_406, 2),
    "splats/playbot/5_0": (3_000, 2),
    "splats/playbot/6_0": (1_873, 2),
    "splats/skull.sog": (94_936, 3),
    "splats/skull_inria_sh3.ply": (94_936, 3),
    "splats/playbot_lod3_inria_sh2.ply": (31_000, 2),
    "splats/guitar.compressed.ply": (90_854, 0),
    "splats/statue-st-peter.sog": (133_618, 0),
    "splats/statue-angel.sog": (71_359, 0),
    "splats/statue-angel.compressed.ply": (71_377, 0),
    "splats/statue-massa.sog": (58_649, 0),
    "splats/fruit_drops_minimal.ply": (4_721, 3),
    "splats/train-1000.ply": (1_000, 3),
    "meshlike/spot_10k.splat": (10_000, 0),
    "meshlike/spot_100k.splat": (100_000, 0),
    "dynamic/monkey_flipbook/monkey_0001.sog": (31_658, 0),
    "dynamic/monkey_flipbook/monkey_0050.sog": (31_658, 0),
}
INRIA = [name for name in FILES if name.endswith(".ply") and not name.endswith(".compressed.ply")]


@pytest.mark.parametrize("name", FILES)
def test_opens_with_the_count_and_degree_of_the_manifest(data_folder, name):
    gaussians = read_splat(data_folder / name)
    assert (len(gaussians), gaussians.sh_degree) == FILES[name]
    for array in (gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities, gaussians.harmonics):
        assert array.dtype == np.float32
        assert np.isfinite(array).all()
    assert gaussians.opacities.min() >= 0
    assert gaussians.opacities.max() <= 1
    assert np.linalg.norm(gaussians.quaternions, axis=1).min() > 0.5


def test_every_file_of_the_folders_is_in_the_list(data_folder):
    found = {
        path.relative_to(data_folder).as_posix()
        for folder in ("splats", "meshlike")
        for path in (data_folder / folder).iterdir()
        if path.is_file()
    }
    assert found == {name for name in FILES if name.count("/") == 1}


@pytest.mark.parametrize("name", INRIA)
def test_inria_is_bit_exact_against_plyfile(data_folder, name):
    gaussians = read_splat(data_folder / name)
    vertex = plyfile.PlyData.read(data_folder / name)["vertex"]

    def columns(*names):
        return np.stack([vertex[column] for column in names], axis=1)

    assert np.array_equal(gaussians.means, columns(*"xyz"))
    assert np.array_equal(gaussians.quaternions, columns(*(f"rot_{i}" for i in range(4))))
    assert np.array_equal(gaussians.harmonics[:, 0], columns(*(f"f_dc_{i}" for i in range(3))))
    bases = gaussians.harmonics.shape[1] - 1
    for channel in range(3):
        rest = columns(*(f"f_rest_{channel * bases + i}" for i in range(bases)))
        assert np.array_equal(gaussians.harmonics[:, 1:, channel], rest)
    # The documented way: exp and logistic in float64, rounded once.
    logs = columns(*(f"scale_{i}" for i in range(3))).astype(np.float64)
    assert np.array_equal(gaussians.scales, np.exp(logs).astype(np.float32))
    logits = vertex["opacity"].astype(np.float64)
    assert np.array_equal(gaussians.opacities, (1 / (1 + np.exp(-logits))).astype(np.float32))


@pytest.mark.parametrize("name", [*INRIA, "meshlike/spot_10k.splat", "splats/playbot/4_0", "splats/skull.sog"])
def test_real_splats_come_back_exactly_from_ply(data_folder, tmp_path, name):
    before = read_splat(data_folder / name)
    write_splat(tmp_path / "again.ply", before)
    after = read_splat(tmp_path / "again.ply")
    for field in ("means", "quaternions", "harmonics"):
        assert np.array_equal(getattr(before, field), getattr(after, field)), field
    # A logarithm or logit l is stored in float32, known to 2^-24 |l|; exp and logistic pass that on times their slope,
    # and round once more. Where the number came from such an l, it comes back to the bit.
    scales, opacities = before.scales.astype(np.float64), before.opacities.astype(np.float64)
    bound = (np.abs(np.log(scales)) + 1) * scales * 2.0**-24 * 1.01
    assert np.all(np.abs(after.scales - scales) <= bound)
    inside = (opacities > 0) & (opacities < 1)
    o = opacities[inside]
    bound = (np.abs(np.log(o / (1 - o))) * (1 - o) + 1) * o * 2.0**-24 * 1.01
    assert np.all(np.abs(after.opacities[inside] - o) <= bound)
    assert np.array_equal(after.opacities[~inside], before.opacities[~inside])
    if name in INRIA:
        assert np.array_equal(before.scales, after.scales)
        assert np.array_equal(before.opacities, after.opacities)


def test_sog_reads_as_the_ply_made_from_it(data_folder):
    for packed, ply in (("skull.sog", "skull_inria_sh3.ply"), ("playbot/3_0", "playbot_lod3_inria_sh2.ply")):
        a, b = read_splat(data_folder / "splats" / packed), read_splat(data_folder / "splats" / ply)
        extent = np.ptp(b.means)
        # Both decode the same integers; only the float32 of the .ply lies between.
        assert np.abs(a.means - b.means).max() <= 4e-7 * extent
        assert np.abs(a.harmonics - b.harmonics).max() <= 2e-7 * np.abs(b.harmonics).max()
        assert np.abs(a.opacities - b.opacities).max() <= 2e-6  # its logits were cut at +-13.8
        np.testing.assert_allclose(a.scales, b.scales, rtol=3e-6)  # logs to 20, in float32: 20 * 2^-24 twice
        np.testing.assert_allclose(a.quaternions, b.quaternions, atol=5e-7)


def test_the_two_statues_agree_after_their_up_axes_are_set(data_folder):
    sog = read_splat(data_folder / "splats/statue-angel.sog")
    name = data_folder / "splats/statue-angel.compressed.ply"
    ply = read_splat(name)
    # -y up against +y up: half a turn about z.
    turn = np.diag([-1.0, -1.0, 1.0])
    sog_means = sog.means.astype(np.float64) @ turn

    # Each centre is known to half a step of its chunk, 2047 or 1023 steps an axis, and to a step of the 16-bit SOG,
    # whose writer truncates. The .sog holds what was once packed in other chunks: half a step of the largest for those.
    chunks = plyfile.PlyData.read(name)["chunk"]
    sizes = np.stack([chunks[f"max_{axis}"] - chunks[f"min_{axis}"] for axis in "xyz"], axis=1).astype(np.float64)
    half_steps = np.linalg.norm(sizes / [2047, 1023, 2047], axis=1) / 2
    largest = np.abs(sog_means).max()
    sog_step = np.sqrt(3) * 2 * np.log1p(largest) / 65535 * (1 + largest)
    bound = half_steps[np.arange(len(ply)) // 256] + half_steps.max() + sog_step
    distance, partner = cKDTree(sog_means).query(ply.means)
    strangers = distance > bound
    assert strangers.sum() == len(ply) - len(sog) == 18
    back, _ = cKDTree(ply.means).query(sog_means)
    assert np.all(back <= bound.max())

    # Partners that are each other's nearest and much closer than any third are the same Gaussian.
    pairs, _ = cKDTree(sog_means).query(ply.means, k=2)
    sure = ~strangers & (pairs[:, 1] > 4 * bound)
    a, b = ply.select(sure), sog.select(partner[sure])
    assert len(a) > 10_000
    # Two roundings to 1/255 of one number differ by one step at most.
    assert np.quantile(np.abs(a.opacities - b.opacities), 0.99) <= 1 / 255 + 1e-6
    # A chunk spans logs of ~10 in 1023 steps, a codebook of 256 the same: a few per cent.
    assert np.median(np.abs(np.log(np.sort(a.scales) / np.sort(b.scales)))) < 0.03
    # Rotations to 1/1023 and 1/255 of sqrt 2 a component: covariances to some per cent.
    sigma = turn @ b.covariances() @ turn
    error = np.linalg.norm(a.covariances() - sigma, axis=(1, 2)) / np.linalg.norm(sigma, axis=(1, 2))
    assert np.median(error) < 0.06


def test_agrees_with_gsply_where_gsply_reads(data_folder, tmp_path):
    gsply = pytest.importorskip("gsply")
    ours = read_splat(data_folder / "splats/guitar.compressed.ply")
    theirs = gsply.plyread(data_folder / "splats/guitar.compressed.ply")
    _same(ours, theirs, np.asarray(theirs.sh0)[:, None])
    # gsply leaves .spz as stored, so what it reads of a file of ours is the turned splat.
    little = read_splat(data_folder / "splats/train-1000.ply")
    write_splat(tmp_path / "little.spz", little)
    from gasp_core.io.spz import turned

    theirs = gsply.read_spz(tmp_path / "little.spz")
    ours = turned(read_splat(tmp_path / "little.spz"))
    _same(ours, theirs, np.concatenate([np.asarray(theirs.sh0)[:, None], np.asarray(theirs.shN)], axis=1))


@pytest.mark.thorough
def test_agrees_with_gsply_on_sog(data_folder):
    pytest.importorskip("imagecodecs")
    gsply = pytest.importorskip("gsply")
    theirs = gsply.sogread(str(data_folder / "splats/skull.sog"))
    harmonics = np.concatenate([np.asarray(theirs.sh0)[:, None], np.asarray(theirs.shN)], axis=1)
    _same(read_splat(data_folder / "splats/skull.sog"), theirs, harmonics)


def test_gsply_reads_our_sog_as_we_do(data_folder, tmp_path):
    """The splat itself is a fixture of ordinary training with harmonics of degree 3; a reader that is not ours."""
    pytest.importorskip("imagecodecs")
    gsply = pytest.importorskip("gsply")
    write_splat(tmp_path / "little.sog", read_splat(data_folder / "splats/train-1000.ply"))
    theirs = gsply.sogread(str(tmp_path / "little.sog"))
    harmonics = np.concatenate([np.asarray(theirs.sh0)[:, None], np.asarray(theirs.shN)], axis=1)
    _same(read_splat(tmp_path / "little.sog"), theirs, harmonics)


def test_a_sog_is_written_as_it_was_read(data_folder, tmp_path):
    """What is in codebooks already stays what it is; 94,936 Gaussians share a palette of fewer than 65,536 rows."""
    skull = read_splat(data_folder / "splats/skull.sog")
    write_splat(tmp_path / "again.sog", skull)
    again = read_splat(tmp_path / "again.sog")
    for name in ("scales", "opacities", "harmonics"):
        np.testing.assert_allclose(getattr(again, name), getattr(skull, name), rtol=1e-6, atol=1e-6, err_msg=name)
    # Bounds are those of what is there, not those of the file it came from: half a step of 2^16 in ln(1 + |x|).
    largest = np.abs(skull.means).max()
    step = 2 * np.log1p(largest) / 65535 * (1 + largest)
    assert np.abs(again.means - skull.means).max() <= 0.5 * step
    assert (tmp_path / "again.sog").stat().st_size < 1.1 * (data_folder / "splats/skull.sog").stat().st_size


def _same(ours, theirs, harmonics):
    """float32 arithmetic on one side: some units of 2^-24 of the largest value."""
    few = 16 * 2.0**-24
    assert np.abs(ours.means - theirs.means).max() <= few * max(1, np.abs(ours.means).max())
    np.testing.assert_allclose(np.log(ours.scales), theirs.scales, rtol=0, atol=20 * few)
    # sqrt(1 - a^2 - b^2 - c^2) near zero magnifies; the largest component is never below a half but for noise.
    np.testing.assert_allclose(rotation_matrices(ours.quaternions), rotation_matrices(theirs.quats), atol=5e-6)
    # gsply cuts its logits at +-10 or +-13.8.
    np.testing.assert_allclose(ours.opacities, 1 / (1 + np.exp(-np.asarray(theirs.opacities))), atol=5e-5)
    np.testing.assert_allclose(ours.harmonics, harmonics, atol=few * 8)


def test_inspect_gives_the_flatness_of_the_manifest(data_folder):
    told = {
        "plant.splat": (0.06, 0.18, 0.36, 0.59, 0.90),
        "guitar.compressed.ply": (0.01, 0.06, 0.19, 0.45, 0.85),
        "statue-angel.sog": (0, 0.03, 0.13, 0.39, 0.82),
        "fruit_drops_minimal.ply": (0.05, 0.14, 0.32, 0.57, 0.89),
        "playbot/3_0": (0.02, 0.09, 0.18, 0.38, 0.74),
    }
    for name, flatness in told.items():
        summary = inspect_splat(data_folder / "splats" / name)
        # The manifest gives two decimals.
        np.testing.assert_allclose(summary.flatness, flatness, atol=0.0051)
        assert json.loads(json.dumps(summary.to_json(), allow_nan=False))["count"] == summary.count
