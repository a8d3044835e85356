import struct

import numpy as np
import pytest
from gasp_viewer.display_units import SIZE, Stage
from gasp_viewer.packing import FINENESS, HALF_MAX, HALF_ROUNDING, HALF_STEP, covariances, pack_splats
from gasp_viewer.server import free_port, serving

from gasp_core.render_input import RenderInput

STAGE = Stage(origin=np.array([1.0, -2.0, 3.0]), unit=2.0)
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def unpacked(buffer):
    """Centres, covariances (xx xy xz yy yz zz) and bytes r g b a, read word by word as the page's shader does."""
    raw = np.ascontiguousarray(buffer, dtype="<u4").tobytes()
    rows = [struct.unpack_from("<3fI6e4B", raw, 32 * row) for row in range(len(buffer))]
    table = np.array(rows, dtype=np.float64)
    return table[:, :3], table[:, 4:10], table[:, 10:]


def floor_of(six):
    trace = six[:, 0] + six[:, 3] + six[:, 5]
    return (HALF_ROUNDING * trace + 3 * HALF_STEP) / (1 - 3**0.5 * HALF_ROUNDING)


def matrices(six):
    full = np.empty((len(six), 3, 3))
    for column, (i, j) in enumerate(UPPER):
        full[:, i, j] = full[:, j, i] = six[:, column]
    return full


def test_centres_are_the_means_on_the_stage_to_a_float32(cloud):
    gaussians = cloud(500)
    centres, _, _ = unpacked(pack_splats(RenderInput.of(gaussians), np.ones((500, 3)), STAGE).buffer)
    expected = FINENESS * 2.0 * (gaussians.means - [1.0, -2.0, 3.0])
    # One rounding to float32, 2^-24 of the number, and a few of float64 before it.
    assert (np.abs(centres - expected) <= 2.0**-23.99 * np.abs(expected)).all()


@pytest.mark.parametrize("shape", ["axes", "covariances"])
def test_covariances_are_those_of_the_gaussians_to_a_float16(cloud, shape):
    gaussians = cloud(500)
    truth = gaussians.covariances()
    splats = RenderInput.of(gaussians)
    if shape == "covariances":
        six = np.stack([truth[:, i, j] for i, j in UPPER], axis=1)
        opacities, harmonics = splats.opacities, splats.harmonics
        splats = RenderInput(means=splats.means, opacities=opacities, harmonics=harmonics, covariances=six)
    _, found, _ = unpacked(pack_splats(splats, np.ones((500, 3)), STAGE).buffer)
    expected = np.stack([truth[:, i, j] for i, j in UPPER], axis=1) * (FINENESS * 2.0) ** 2
    floored = expected + floor_of(expected)[:, None] * [1, 0, 0, 1, 0, 1]
    # Rounded once; a hundredth more for the arithmetic in float64 before that.
    bound = 1.01 * (HALF_ROUNDING * np.abs(floored) + HALF_STEP)
    assert (np.abs(found - floored) <= bound).all()


def test_no_covariance_is_negative_after_rounding():
    # Needles, discs and balls from a millionth of what is shown to all of it, thinner by up to 1e-6 on each axis.
    rng = np.random.default_rng(3)
    count = 20_000
    scales = SIZE / STAGE.unit * 10 ** rng.uniform(-6, 0, (count, 1)) * 10 ** rng.uniform(-6, 0, (count, 3))
    splats = RenderInput(
        means=np.zeros((count, 3)),
        opacities=np.ones(count),
        harmonics=np.zeros((count, 1, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
    )
    _, six, _ = unpacked(pack_splats(splats, np.ones((count, 3)), STAGE).buffer)
    smallest = np.linalg.eigvalsh(matrices(six))
    # Eigenvalues of a symmetric matrix come out to a few roundings of the largest.
    assert (smallest[:, 0] >= -16 * np.finfo(float).eps * smallest[:, 2]).all()
    # Without the floor many are: the check is one that can fail.
    plain = (covariances(splats) * (FINENESS * STAGE.unit) ** 2).astype(np.float16).astype(np.float64)
    assert (np.linalg.eigvalsh(matrices(plain))[:, 0] < -16 * np.finfo(float).eps * smallest[:, 2]).any()


def test_what_is_too_large_for_float16_keeps_its_shape():
    scales = np.array([[1e3, 5e2, 2.5e2]])
    splats = RenderInput(
        means=np.zeros((1, 3)),
        opacities=np.ones(1),
        harmonics=np.zeros((1, 1, 3)),
        quaternions=np.array([[1.0, 0, 0, 0]]),
        scales=scales,
    )
    _, six, _ = unpacked(pack_splats(splats, np.ones((1, 3)), STAGE).buffer)
    diagonal = six[0, [0, 3, 5]]
    assert np.isfinite(six).all()
    assert diagonal[0] <= HALF_MAX
    # Relative to the largest entry: three floors of u tr S <= 3 u, and a rounding each.
    np.testing.assert_allclose(diagonal / diagonal[0], [1, 1 / 4, 1 / 16], atol=12 * HALF_ROUNDING)


def test_thin_gaussians_do_not_vanish():
    # 2e-4 of a unit of the stage is where float16 would begin to lose them unscaled: 4e-8 is under its smallest step.
    deviation = 2e-4 / STAGE.unit
    splats = RenderInput(
        means=np.zeros((1, 3)),
        opacities=np.ones(1),
        harmonics=np.zeros((1, 1, 3)),
        quaternions=np.array([[1.0, 0, 0, 0]]),
        scales=np.full((1, 3), deviation),
    )
    _, six, _ = unpacked(pack_splats(splats, np.ones((1, 3)), STAGE).buffer)
    expected = (FINENESS * STAGE.unit * deviation) ** 2
    # The floor is u tr S = 3 u S and a little, the rounding u S.
    np.testing.assert_allclose(six[0, [0, 3, 5]], expected, rtol=5 * HALF_ROUNDING)
    assert np.float16((STAGE.unit * deviation) ** 2) < np.finfo(np.float16).smallest_normal


def test_colours_and_opacities_are_bytes_cut_off_at_the_ends(cloud):
    gaussians = cloud(3).with_(opacities=np.array([0.0, 0.5, 1.0]))
    colours = np.array([[-1.0, 0.0, 0.2], [0.4, 0.6, 0.8], [1.0, 1.5, 0.1]])
    _, _, rgba = unpacked(pack_splats(RenderInput.of(gaussians), colours, STAGE).buffer)
    expected = [[0, 0, 51, 0], [102, 153, 204, 128], [255, 255, 26, 255]]
    np.testing.assert_array_equal(rgba, expected)


def test_viser_reads_the_buffer_as_we_do(cloud):
    gaussians = cloud(50)
    rng = np.random.default_rng(0)
    buffer = pack_splats(RenderInput.of(gaussians), rng.uniform(size=(50, 3)), STAGE).buffer
    centres, six, rgba = unpacked(buffer)
    with serving("127.0.0.1", free_port("127.0.0.1", 0), "packing") as server:
        handle = server.scene.add_gaussian_splats(
            "/g", np.zeros((50, 3)), np.zeros((50, 3, 3)), np.zeros((50, 3)), np.zeros((50, 1))
        )
        handle.buffer = buffer
        np.testing.assert_array_equal(handle.centers, centres)
        np.testing.assert_array_equal(handle.covariances, matrices(six))
        np.testing.assert_array_equal(handle.rgbs, rgba[:, :3])
        np.testing.assert_array_equal(handle.opacities, rgba[:, 3:])


def test_nothing_packs_to_nothing():
    empty = RenderInput(
        means=np.zeros((0, 3)), opacities=np.zeros(0), harmonics=np.zeros((0, 1, 3)), covariances=np.zeros((0, 6))
    )
    assert pack_splats(empty, np.zeros((0, 3)), STAGE).buffer.shape == (0, 8)
