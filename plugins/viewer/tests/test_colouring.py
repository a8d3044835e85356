import numpy as np
import pytest
from gasp_viewer.colouring import (
    BODY_COLOURS,
    STATIC,
    VIRIDIS,
    Elements,
    Quantity,
    Scale,
    body_colours,
    body_of,
    colourings_of,
    robust_largest,
    round_up,
    trained_colours,
    viridis,
)

from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import turn_coefficients
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import open_footage


def lightness(colours):
    """CIE L* of display colours (sRGB, D65)."""
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(y > (6 / 29) ** 3, 116 * np.cbrt(y) - 16, y * (29 / 3) ** 3)


def test_viridis_can_be_read_without_hue():
    levels = lightness(viridis(np.linspace(0, 1, 65)))
    # Lighter at every step, which a rainbow is not, and over most of the range from black (0) to white (100).
    assert (np.diff(levels) > 0).all()
    assert levels[-1] - levels[0] > 70


def test_viridis_meets_its_anchors_and_ends_at_its_ends():
    np.testing.assert_allclose(viridis(np.linspace(0, 1, 9)), VIRIDIS, atol=1e-15)
    np.testing.assert_array_equal(viridis(np.array([-1.0, 2.0])), VIRIDIS[[0, -1]])


def test_a_scale_spans_zero_to_its_top():
    scale = Scale(name="speed", unit="m/s", top=4.0)
    np.testing.assert_allclose(scale.colours(np.array([0.0, 2.0, 4.0, 9.0])), VIRIDIS[[0, 4, 8, 8]], atol=1e-15)


def test_a_scale_of_nothing_has_one_colour():
    np.testing.assert_array_equal(Scale(name="speed", unit="m/s", top=0.0).colours(np.zeros(2)), VIRIDIS[[0, 0]])


@pytest.mark.parametrize(
    ("value", "expected"), [(0, 0), (1, 1), (1.01, 2), (2, 2), (3, 5), (7, 10), (0.03, 0.05), (1e-9, 1e-9), (260, 500)]
)
def test_ranges_end_at_round_numbers(value, expected):
    assert round_up(value) == pytest.approx(expected, rel=1e-12)


def test_one_lost_point_does_not_set_the_range():
    values = np.append(np.linspace(0, 1, 5000), 1e6)
    assert robust_largest(values) <= 1.0
    assert robust_largest(np.zeros(0)) == 0.0


def test_trained_colours_are_the_basis_times_the_coefficients(cloud):
    gaussians = cloud(20, degree=1)
    eye = np.array([0.3, -4.0, 1.0])
    found = trained_colours(RenderInput.of(gaussians), eye)
    directions = gaussians.means - eye
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    h = gaussians.harmonics.astype(np.float64)
    c0, c1 = 0.5 / np.sqrt(np.pi), np.sqrt(3 / (4 * np.pi))
    raw = 0.5 + c0 * h[:, 0] - c1 * y[:, None] * h[:, 1] + c1 * z[:, None] * h[:, 2] - c1 * x[:, None] * h[:, 3]
    # A handful of float64 roundings of numbers below 2.
    np.testing.assert_allclose(found, np.clip(raw, 0, 1), atol=1e-14)


def test_turned_matter_shows_its_turned_colours(cloud):
    gaussians = cloud(50, degree=3)
    turns = rotation_matrices(np.random.default_rng(4).normal(size=(50, 4)))
    splats = RenderInput.of(gaussians)
    turned = RenderInput(
        means=splats.means,
        opacities=splats.opacities,
        harmonics=splats.harmonics,
        quaternions=splats.quaternions,
        scales=splats.scales,
        turns=turns,
    )
    exported = RenderInput.of(gaussians.with_(harmonics=turn_coefficients(gaussians.harmonics, turns)))
    eye = np.array([2.0, -3.0, 1.0])
    # The exported coefficients are float32 and sixteen of them, of size 1, add up.
    np.testing.assert_allclose(trained_colours(turned, eye), trained_colours(exported, eye), atol=16 * 2.0**-23)


def test_constant_colour_does_not_depend_on_the_eye(cloud):
    splats = RenderInput.of(cloud(10))
    a, b = (trained_colours(splats, np.array(eye)) for eye in ([5.0, 0, 0], [0, -9.0, 2.0]))
    np.testing.assert_array_equal(a, b)
    np.testing.assert_allclose(a, np.clip(0.5 + 0.28209479177387814 * splats.harmonics[:, 0], 0, 1), atol=1e-7)


def test_an_eye_on_a_mean_is_no_reason_for_a_nan(cloud):
    splats = RenderInput.of(cloud(5, degree=2))
    assert np.isfinite(trained_colours(splats, splats.means[2])).all()


def test_bodies_differ_in_colour_and_what_stands_still_is_grey():
    colours = body_colours(np.array([0, 1, -1, len(BODY_COLOURS)]))
    np.testing.assert_array_equal(colours, [BODY_COLOURS[0], BODY_COLOURS[1], STATIC, BODY_COLOURS[0]])


def test_elements_take_the_values_of_their_points_and_static_ones_none():
    quantity = Quantity(name="q", unit="m", measure=lambda moment: np.array([10.0, 20.0, 30.0]))
    elements = Elements(gaussians=np.arange(4), points=np.array([2, -1, 0, 2]))
    np.testing.assert_array_equal(quantity.of(None, elements), [30.0, 0.0, 10.0, 30.0])


def test_a_file_has_no_motion_to_be_coloured_by(tmp_path, toy, toy_footage):
    from gasp_core.io import write_splat

    write_splat(tmp_path / "toy.ply", toy)
    assert colourings_of(open_footage(tmp_path / "toy.ply", "+z")) == ("trained",)
    assert colourings_of(toy_footage) == ("trained", "displacement", "speed", "body")
    assert (body_of(toy_footage, np.arange(2000)) == 0).all()
