"""PSNR, SSIM and FLIP against their formulas, written out where a few lines do."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.accuracy.images import flip, psnr, ssim
from gasp_core.errors import RenderingError

UNIT_ROUNDOFF = 2.0**-53
SINGLE_ROUNDOFF = 2.0**-24


def flat(*colour, side=16):
    return np.full((side, side, 3), colour, dtype=float)


# PSNR.


@given(st.floats(1e-6, 1))
def test_psnr_of_a_constant_offset(offset):
    # 768 equal squares, summed in a few levels: the mean is off by less than 30 roundings, the logarithm of it by
    # 10 / ln 10 times as many, and both sides by one of 120 dB.
    tolerance = (30 * 10 / math.log(10) + 120) * UNIT_ROUNDOFF
    assert psnr(flat(0), flat(offset)) == pytest.approx(-20 * math.log10(offset), rel=0, abs=tolerance)


def test_psnr_of_equal_pictures_is_infinite(random_picture, recwarn):
    assert psnr(random_picture(), random_picture()) == math.inf
    assert not recwarn.list


def test_psnr_is_symmetric(random_picture):
    assert psnr(random_picture(seed=1), random_picture(seed=2)) == psnr(random_picture(seed=2), random_picture(seed=1))


def test_psnr_counts_all_pixels_and_channels_alike():
    picture = flat(0)
    picture[3, 5, 1] = 0.5
    assert psnr(flat(0), picture) == pytest.approx(-10 * math.log10(0.25 / picture.size), rel=0, abs=1e-13)


# SSIM.


def ssim_by_hand(first, second):
    """Wang et al. 2004, eq. 13, one window at a time."""
    distance = np.arange(-5, 6)
    bell = np.exp(-(distance**2) / (2 * 1.5**2))
    window = np.outer(bell, bell) / bell.sum() ** 2
    c1, c2 = 0.01**2, 0.03**2
    values = []
    for channel in range(3):
        for y in range(first.shape[0] - 10):
            for x in range(first.shape[1] - 10):
                a = first[y : y + 11, x : x + 11, channel]
                b = second[y : y + 11, x : x + 11, channel]
                mean_a, mean_b = (window * a).sum(), (window * b).sum()
                variance_a, variance_b = (window * (a - mean_a) ** 2).sum(), (window * (b - mean_b) ** 2).sum()
                covariance = (window * (a - mean_a) * (b - mean_b)).sum()
                values.append(
                    (2 * mean_a * mean_b + c1)
                    * (2 * covariance + c2)
                    / ((mean_a**2 + mean_b**2 + c1) * (variance_a + variance_b + c2))
                )
    return np.mean(values)


@settings(max_examples=20, deadline=None)
@given(st.integers(11, 15), st.integers(11, 15), st.floats(0, 1), st.integers(0, 99))
def test_ssim_is_the_formula_over_gaussian_windows(height, width, contrast, seed):
    rng = np.random.default_rng(seed)
    first, second = 0.5 + contrast * (rng.uniform(size=(2, height, width, 3)) - 0.5)
    # Variances as differences of means of squares are off by the roundings of sums of 22 numbers below 1, some 50,
    # twice over; c2 = 9e-4 is the least that the quotient divides by, and the same again for the numerator.
    tolerance = 4 * 2 * 50 * UNIT_ROUNDOFF / 0.03**2
    assert ssim(first, second) == pytest.approx(ssim_by_hand(first, second), rel=0, abs=tolerance)


def test_ssim_of_equal_pictures_is_one(random_picture):
    # Numerator and denominator are the same numbers, joined in another order.
    assert ssim(random_picture(), random_picture()) == pytest.approx(1, rel=0, abs=1e-12)


def test_ssim_of_constant_pictures_is_the_luminance_term_alone():
    # Without variance the second factor is c2 / c2.
    expected = (2 * 0.2 * 0.6 + 1e-4) / (0.2**2 + 0.6**2 + 1e-4)
    tolerance = 4 * 2 * 50 * UNIT_ROUNDOFF / 0.03**2
    assert ssim(flat(0.2), flat(0.6)) == pytest.approx(expected, rel=0, abs=tolerance)


def test_ssim_falls_as_noise_grows(random_picture):
    grain = random_picture(seed=1) - 0.5
    similarities = [ssim(flat(0.5, side=64), flat(0.5, side=64) + size * grain) for size in (0, 0.02, 0.1, 0.5, 1)]
    assert similarities == sorted(similarities, reverse=True)
    assert similarities[0] > similarities[-1]


@pytest.mark.parametrize("shape", [(10, 64, 3), (64, 10, 3), (1, 1, 3)])
def test_ssim_refuses_pictures_smaller_than_its_window(shape):
    with pytest.raises(RenderingError, match=r"the reference is \d+ x \d+ px, this measure needs 11 px a side"):
        ssim(np.zeros(shape), np.zeros(shape))
    assert ssim(np.zeros((11, 11, 3)), np.zeros((11, 11, 3))) == 1


# FLIP.


# FLIP runs in float32. A colour passes some 30 operations on the way to Lab; there a and b are differences of numbers
# of order 1, times 500, and the colours below are 19 apart or more. The features of a flat picture are sums of weights
# that cancel: two passes of 19 numbers in two pictures, some 200 roundings. FLIP takes their root x, and the colour
# error to the power 1 - x, which changes it by x / e at most.
FLIP_TOLERANCE = 30 * SINGLE_ROUNDOFF * 500 / 19 + math.sqrt(200 * SINGLE_ROUNDOFF) / math.e


def flip_of_flat_colours(first, second):
    """Andersson et al. 2020, section 4.1, for two pictures of one colour each: filters and features drop out."""
    to_xyz = np.array(
        [
            [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
            [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
            [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
        ]
    )

    def hunt(linear):
        ratio = to_xyz @ linear / (to_xyz @ np.ones(3))
        root = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
        lightness = 116 * root[1] - 16
        return lightness, *(0.01 * lightness * np.array([500 * (root[0] - root[1]), 200 * (root[1] - root[2])]))

    def hyab(one, other):
        difference = np.subtract(hunt(one), hunt(other))
        return abs(difference[0]) + math.hypot(*difference[1:])

    def linear(colour):
        colour = np.asarray(colour, dtype=float)
        return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)

    largest = hyab([0, 1, 0], [0, 0, 1]) ** 0.7
    error = hyab(linear(first), linear(second)) ** 0.7
    knee = 0.4 * largest
    return error * 0.95 / knee if error < knee else 0.95 + (error - knee) / (largest - knee) * 0.05


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((0, 0, 0), (1, 1, 1)),
        ((0, 1, 0), (0, 0, 1)),
        ((1, 0, 0), (0, 1, 1)),
        ((0.5, 0.5, 0.5), (0.7, 0.7, 0.7)),
        ((0.2, 0.4, 0.9), (0.3, 0.1, 0.5)),
        ((0.01, 0.02, 0.03), (0.9, 0.3, 0.6)),
    ],
)
def test_flip_of_flat_colours(first, second):
    expected = flip_of_flat_colours(first, second)
    assert flip(flat(*first), flat(*second)) == pytest.approx(expected, rel=0, abs=FLIP_TOLERANCE)


def test_flip_of_large_pictures_is_as_exact():
    """A mean summed in float32 is off by 0.0037 at this size."""
    grey, lighter = (0.5,) * 3, (0.7,) * 3
    found = flip(flat(*grey, side=1024), flat(*lighter, side=1024))
    assert found == pytest.approx(flip_of_flat_colours(grey, lighter), rel=0, abs=FLIP_TOLERANCE)


def test_flip_of_equal_pictures_is_zero(random_picture):
    assert flip(random_picture(), random_picture()) == 0


def test_flip_grows_with_noise_and_stays_below_one(random_picture):
    grain = random_picture(seed=1) - 0.5
    errors = [flip(flat(0.5, side=64), flat(0.5, side=64) + size * grain) for size in (0, 0.02, 0.1, 0.3, 1)]
    assert errors == sorted(set(errors))
    assert errors[-1] <= 1


def test_flip_sees_less_of_finer_pixels(random_picture):
    pair = random_picture(seed=1), random_picture(seed=2)
    errors = [flip(*pair, pixels_per_degree=density) for density in (20, 67.02, 200)]
    assert errors == sorted(set(errors), reverse=True)
    assert flip(*pair) == errors[1]


def test_flip_takes_views_as_they_lie(random_picture):
    first, second = random_picture(40, 30, 1), random_picture(40, 30, 2)
    packed = np.ascontiguousarray(first[::-1, ::2]), np.ascontiguousarray(second[::-1, ::2])
    assert flip(first[::-1, ::2], second[::-1, ::2]) == flip(*packed)


@pytest.mark.parametrize("density", [0, -1, math.nan, math.inf, 1001])
def test_flip_refuses_impossible_densities(density):
    with pytest.raises(RenderingError, match="pixels per degree must be above 0 and at most 1000, found"):
        flip(flat(0), flat(1), pixels_per_degree=density)


# Input that is no pair of pictures, and packages that are not there.


@pytest.mark.parametrize("measure", [psnr, ssim, flip])
@pytest.mark.parametrize(
    ("reference", "picture", "message"),
    [
        (flat(0).astype(np.uint8), flat(0), "the reference holds uint8 values.*divide by 255"),
        (flat(0), flat(0).astype(np.uint8), "the picture holds uint8 values.*divide by 255"),
        (flat(0), flat(0).astype(int), "the picture holds int64 values"),
        (flat(0), flat(0).astype(complex), "the picture holds complex128 values"),
        (flat(0), [[[None] * 3]], "the picture holds object values"),
        (flat(0), [[0.0], [0.0, 1.0]], "the picture is no array"),
        (flat(0), np.zeros((16, 16)), r"the picture has shape \(16, 16\), expected \(height, width, 3\)"),
        (np.zeros((16, 16, 4)), flat(0), r"the reference has shape \(16, 16, 4\)"),
        (np.zeros((2, 16, 16, 3)), flat(0), r"the reference has shape \(2, 16, 16, 3\)"),
        (np.zeros((0, 16, 3)), np.zeros((0, 16, 3)), r"the reference is 16 x 0 px"),
        (flat(0), np.zeros((16, 17, 3)), r"reference has shape \(16, 16, 3\), the picture \(16, 17, 3\): draw both"),
        (flat(0), flat(math.nan), "the picture holds a NaN"),
        (flat(math.inf), flat(0), "the reference holds a NaN or an infinity"),
        (flat(0), flat(255), "the picture holds values from 255 to 255, expected 0 to 1.*divide by 255"),
        (flat(0), flat(-0.1), "the picture holds values from -0.1 to -0.1.*clip it"),
    ],
)
def test_bad_input_is_refused(measure, reference, picture, message):
    with pytest.raises(RenderingError, match=message) as caught:
        measure(reference, picture)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("measure", "module"), [(psnr, "skimage.metrics"), (ssim, "skimage.metrics"), (flip, "flip_evaluator")]
)
def test_a_missing_package_is_named_with_the_remedy(monkeypatch, measure, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RenderingError, match=rf'needs {module} .*pip install "gasp-core\[images\]"'):
        measure(flat(0), flat(1))


def test_importing_the_measures_imports_none_of_their_packages():
    code = "import sys, gasp_core.accuracy.images; print({'skimage', 'flip_evaluator'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
