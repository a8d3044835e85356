"""T and T^-1 against a plain reference, closed forms and the accuracy that the arithmetic allows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gasp_core import games
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.harmonics import turn_coefficients


def random_gaussians(rng, count, *, low=-6.0, high=3.0, extent=1e3, flat=False, degree=0):
    scales = 10 ** rng.uniform(low, high, (count, 3))
    if flat:
        scales[np.arange(count), rng.integers(0, 3, count)] = 0
    return Gaussians(
        means=rng.uniform(-extent, extent, (count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=rng.random(count),
        harmonics=rng.normal(size=(count, (degree + 1) ** 2, 3)),
    )


def relative_errors(found, wanted):
    return np.linalg.norm(found - wanted, axis=(1, 2)) / np.linalg.norm(wanted, axis=(1, 2))


def random_affine(rng):
    """Stretches .1 to 10 and shears to 3 between two random rotations."""
    turn, back = (rotation_matrices(rng.normal(size=(1, 4)))[0] for _ in range(2))
    shear = np.eye(3) + np.triu(rng.uniform(-3, 3, (3, 3)), 1)
    return turn @ np.diag(10 ** rng.uniform(-1, 1, 3)) @ shear @ back


@pytest.mark.parametrize(("vertices", "flat"), [(3, True), (4, False)])
def test_round_trip_over_nine_decades_of_scale(vertices, flat):
    gaussians = random_gaussians(np.random.default_rng(1), 100_000, flat=flat)
    back = games.from_simplices(games.to_simplices(gaussians, vertices), reference=gaussians)
    # An edge of 1e-6 at a coordinate of 1e3 is the difference of two numbers known to 1.1e-13/2 each: 1.1e-7 of the
    # edge in each component at worst, twice that in its square, over three components: well below 1e-6.
    assert relative_errors(back.covariances(), gaussians.covariances()).max() <= 1e-6
    assert np.linalg.det(rotation_matrices(back.quaternions)) == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(back.means, gaussians.means)


@pytest.mark.parametrize(("vertices", "flat"), [(3, True), (4, False)])
def test_exact_inverse_equals_f_sigma_ft_for_a_thousand_affine_motions(vertices, flat):
    rng = np.random.default_rng(2)
    gaussians = random_gaussians(rng, 100, low=-2, high=0, extent=1, flat=flat)
    simplices, covariances = games.to_simplices(gaussians, vertices), gaussians.covariances()
    worst = 0.0
    for _ in range(1000):
        affine = random_affine(rng)
        moved = games.from_simplices(simplices @ affine.T + rng.normal(size=3), reference=gaussians)
        worst = max(worst, relative_errors(moved.covariances(), affine @ covariances @ affine.T).max())
    # Rounding of the positions (1e-16 of ~10) over the shortest edges (1e-2 .1): 1e-12, squared edges double it.
    assert worst <= 1e-9


def test_gram_schmidt_is_exact_for_rotations_and_loses_shear():
    rng = np.random.default_rng(3)
    gaussians = random_gaussians(rng, 200, low=-1, high=0, extent=1, flat=True)
    simplices, covariances = games.to_simplices(gaussians), gaussians.covariances()
    turn = rotation_matrices(rng.normal(size=(1, 4)))[0]
    turned = games.from_simplices(simplices @ turn.T, reference=gaussians, covariance="gram_schmidt")
    assert relative_errors(turned.covariances(), turn @ covariances @ turn.T).max() <= 1e-12
    shear = np.array([[1, 2, 0], [0, 1, 0], [0, 0, 1.0]])
    sheared = games.from_simplices(simplices @ shear.T, reference=gaussians, covariance="gram_schmidt")
    assert np.median(relative_errors(sheared.covariances(), shear @ covariances @ shear.T)) > 0.05


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_gram_schmidt_turns_what_has_no_extent_along_any_one_axis(missing):
    """Of four vertices too, whichever edge is missing: the other two span the plane."""
    rng = np.random.default_rng(22)
    gaussians = random_gaussians(rng, 200, low=-1, high=0, extent=1)
    scales = np.array(gaussians.scales)
    scales[:, missing] = 0
    gaussians = gaussians.with_(scales=scales)
    simplices, covariances = games.to_simplices(gaussians, 4), gaussians.covariances()
    turn = rotation_matrices(rng.normal(size=(1, 4)))[0]
    turned = games.invert_simplices(simplices @ turn.T, reference=gaussians, covariance="gram_schmidt")
    assert not turned.degenerate.any()
    assert relative_errors(turned.gaussians.covariances(), turn @ covariances @ turn.T).max() <= 1e-12
    assert np.linalg.det(rotation_matrices(turned.gaussians.quaternions)) == pytest.approx(1, abs=1e-12)
    still = games.from_simplices(simplices, reference=gaussians, covariance="gram_schmidt")
    np.testing.assert_allclose(still.scales, scales, rtol=1e-12, atol=1e-15)
    first = np.where(scales[:, (missing + 1) % 3] >= scales[:, (missing + 2) % 3], (missing + 1) % 3, (missing + 2) % 3)
    assert missing == 0 or (games.gram_schmidt_edges(scales, 4)[:, 1] == first).all(), "the longer one first"


def plain_gram_schmidt(simplex):
    """GASP, equation 5, word for word."""
    v1, v2, v3 = simplex
    r1 = np.cross(v2 - v1, v3 - v1)
    r1 /= np.linalg.norm(r1)
    r2 = (v2 - v1) / np.linalg.norm(v2 - v1)
    r3 = (v3 - v1) - ((v3 - v1) @ r1) * r1 - ((v3 - v1) @ r2) * r2
    r3 /= np.linalg.norm(r3)
    s2, s3 = np.linalg.norm(v2 - v1), (v3 - v1) @ r3
    return s2**2 * np.outer(r2, r2) + s3**2 * np.outer(r3, r3)


def test_gram_schmidt_is_the_paper_s():
    rng = np.random.default_rng(4)
    gaussians = random_gaussians(rng, 50, low=-1, high=0, extent=1, flat=True)
    simplices = games.to_simplices(gaussians) @ random_affine(rng).T
    found = games.from_simplices(simplices, reference=gaussians, covariance="gram_schmidt").covariances()
    wanted = np.array([plain_gram_schmidt(simplex) for simplex in simplices])
    assert relative_errors(found, wanted).max() <= 1e-10


@pytest.mark.parametrize("vertices", [3, 4])
def test_at_rest_quaternions_and_scales_are_the_file_s(vertices):
    gaussians = random_gaussians(np.random.default_rng(5), 1000, low=-2, high=0, extent=1, flat=vertices == 3)
    back = games.from_simplices(games.to_simplices(gaussians, vertices), reference=gaussians)
    np.testing.assert_allclose(back.scales, gaussians.scales, rtol=1e-9, atol=1e-12)
    found, wanted = rotation_matrices(back.quaternions), rotation_matrices(gaussians.quaternions)
    np.testing.assert_allclose(found, wanted, atol=1e-7)


@pytest.mark.parametrize("vertices", [3, 4])
def test_float32_engine_needs_magnified_edges(vertices):
    rng = np.random.default_rng(6)
    gaussians = random_gaussians(rng, 5000, low=-6, high=-2, extent=1, flat=vertices == 3)
    simplices = games.to_simplices(gaussians, vertices)
    floor = 0.25 * 2 / 64

    def through_float32(points):
        return points.astype(np.float32).astype(np.float64)

    magnified, factors = games.magnify(simplices, floor)
    assert (factors >= 1).all()
    lengths = np.linalg.norm(magnified[:, 1:] - magnified[:, :1], axis=2)
    assert (lengths[lengths > 0] >= floor * (1 - 1e-9)).all()
    carried = games.from_simplices(games.demagnify(through_float32(magnified), factors), reference=gaussians)
    bare = games.from_simplices(through_float32(simplices), reference=gaussians)
    # Coordinates below 1 are known to 6e-8/2, an edge of `floor` to 6e-8 sqrt(3) of 8e-3: 1.3e-5, its square to 2.7e-5.
    assert relative_errors(carried.covariances(), gaussians.covariances()).max() <= 1e-3
    # Both ends of an edge are off by 1.7e-8 (rms of rounding at 6e-8): the edge by 4e-8, a covariance of edges under
    # 3e-5 by twice 4e-8 over 3e-5, above 1e-3. Of scales spread evenly over 1e-6..1e-2 a share of .369 is below 3e-5.
    hurt = np.log10(3e-5 / 1e-6) / 4
    assert (relative_errors(bare.covariances(), gaussians.covariances()) > 1e-3).mean() >= hurt ** (vertices - 1)


def test_demagnify_undoes_magnify():
    gaussians = random_gaussians(np.random.default_rng(7), 500, low=-6, high=0, extent=1)
    simplices = games.to_simplices(gaussians, 4)
    magnified, factors = games.magnify(simplices, 0.01)
    np.testing.assert_allclose(games.demagnify(magnified, factors), simplices, rtol=0, atol=1e-15)
    untouched, ones = games.magnify(simplices, 0.0)
    np.testing.assert_array_equal(untouched, simplices)
    assert (ones == 1).all()


def test_auto_keeps_what_is_not_flat():
    rng = np.random.default_rng(8)
    assert games.choose_vertices(random_gaussians(rng, 100, low=-1, high=0, flat=True)) == 3
    round_ones = random_gaussians(rng, 100, low=-1, high=0)
    assert games.choose_vertices(round_ones) == 4
    assert games.choose_vertices(round_ones.with_(opacities=np.full(100, 0.01))) == 4, "faint ones have a shape too"


def test_flatten_says_what_it_lost():
    ball = random_gaussians(np.random.default_rng(9), 10).with_(scales=np.full((10, 3), 0.5))
    flattened = games.flatten(ball)
    np.testing.assert_allclose(flattened.lost_share, 1 / 3)
    assert (flattened.gaussians.scales.min(axis=1) == 0).all()


DEGENERATE = {
    "zero area": [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
    "needle": [[0, 0, 0], [1, 0, 0], [1, 1e-17, 0]],
    "one place": [[1, 2, 3], [1, 2, 3], [1, 2, 3]],
    "one edge gone": [[0, 0, 0], [0, 0, 0], [0, 1, 0]],
    "nan": [[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]],
    "nan at the mean": [[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]],
    "infinite": [[0, 0, 0], [np.inf, 0, 0], [0, 1, 0]],
    "tiny": [[0, 0, 0], [1e-200, 0, 0], [0, 1e-200, 0]],
    "huge": [[0, 0, 0], [1e200, 0, 0], [0, 1e200, 0]],
}


@pytest.mark.parametrize("covariance", ["exact", "gram_schmidt"])
@pytest.mark.parametrize("case", DEGENERATE)
def test_no_triangle_gives_a_nan(case, covariance):
    gaussians = random_gaussians(np.random.default_rng(10), 1, degree=1)
    simplices = np.array([DEGENERATE[case]], dtype=float)
    result = games.invert_simplices(simplices, reference=gaussians, covariance=covariance)
    for array in (result.gaussians.means, result.gaussians.quaternions, result.gaussians.scales):
        assert np.isfinite(array).all()
    assert np.isfinite(result.gaussians.harmonics).all()
    assert np.linalg.det(rotation_matrices(result.gaussians.quaternions))[0] == pytest.approx(1)
    always = case in ("one place", "nan", "nan at the mean", "infinite")
    flat = case in ("zero area", "needle", "one edge gone")
    assert bool(result.degenerate[0]) == (always or (flat and covariance == "gram_schmidt"))


def test_a_degenerate_simplex_keeps_its_last_valid_frame():
    gaussians = random_gaussians(np.random.default_rng(11), 2, low=-1, high=0, extent=1, flat=True)
    simplices = games.to_simplices(gaussians)
    turn = rotation_matrices([[1, 1, 0, 0]])[0]
    last = games.from_simplices(simplices @ turn.T, reference=gaussians)
    broken = simplices @ turn.T
    broken[1] = broken[1, 0]
    kept = games.invert_simplices(broken, reference=gaussians, previous=last)
    assert kept.degenerate.tolist() == [False, True]
    np.testing.assert_allclose(kept.gaussians.covariances(), last.covariances(), atol=1e-14)


def test_harmonics_turn_with_the_material_not_with_the_principal_axes():
    """A round disc has no principal axes to speak of, and under shear they turn by 45 degrees at once."""
    rng = np.random.default_rng(12)
    disc = random_gaussians(rng, 20, extent=1, degree=3).with_(scales=np.full((20, 3), 0.1))
    for vertices in (3, 4):
        simplices = games.to_simplices(disc, vertices)
        still = games.from_simplices(simplices, reference=disc)
        np.testing.assert_array_equal(still.harmonics, disc.harmonics)
        shear = np.eye(3)
        shear[0, 1] = 1e-3
        sheared = games.from_simplices(simplices @ shear.T, reference=disc)
        # The polar rotation of a shear g is by g/2; degree 3 turns at most three times as fast, |c| <~ 4.
        assert np.abs(sheared.harmonics - disc.harmonics).max() <= 3 * 1e-3 * 4


@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 4]))
@settings(max_examples=50, deadline=None)
def test_rigid_motion_is_recovered(seed, vertices):
    rng = np.random.default_rng(seed)
    gaussians = random_gaussians(rng, 5, low=-2, high=0, extent=1, flat=vertices == 3)
    turn = rotation_matrices(rng.normal(size=(1, 4)))[0]
    moved = games.to_simplices(gaussians, vertices) @ turn.T
    gradients = games.deformation_gradients(moved, gaussians)
    np.testing.assert_allclose(gradients, np.broadcast_to(turn, gradients.shape), atol=1e-11)
    np.testing.assert_allclose(games.polar_rotations(gradients), gradients, atol=1e-11)


def test_deformation_gradient_of_a_full_simplex_is_the_affine_map():
    rng = np.random.default_rng(13)
    gaussians = random_gaussians(rng, 30, low=-2, high=0, extent=1)
    affine = random_affine(rng)
    gradients = games.deformation_gradients(games.to_simplices(gaussians, 4) @ affine.T, gaussians)
    np.testing.assert_allclose(gradients, np.broadcast_to(affine, gradients.shape), atol=1e-10)


def plain_gradients(simplices, reference):
    """Row by row: edges now over edges at rest, with unit normals of the other two for one that is missing.

    Where two are: the stretch along the one there is, and then the rotation by the angle to where it points.
    """
    found = []
    axes = games.edge_axes(np.asarray(reference.scales), simplices.shape[1])
    for simplex, turn, scales, row in zip(
        simplices, rotation_matrices(reference.quaternions), reference.scales, axes, strict=True
    ):
        rest, now = np.zeros((2, 3, 3))
        there = [edge for edge, axis in enumerate(row) if scales[axis] > 0]
        if not there:
            found.append(np.eye(3))
            continue
        if len(there) == 1:
            edge = there[0]
            before, after = turn[:, row[edge]], (simplex[edge + 1] - simplex[0]) / scales[row[edge]]
            stretch = np.linalg.norm(after)
            normal = np.cross(before, after / stretch)
            angle = np.arctan2(np.linalg.norm(normal), before @ after / stretch)
            shortest = Rotation.from_rotvec(angle * normal / np.linalg.norm(normal)).as_matrix()
            found.append(shortest @ (np.eye(3) + (stretch - 1) * np.outer(before, before)))
            continue
        for edge in there:
            rest[edge] = turn[:, row[edge]] * scales[row[edge]]
            now[edge] = simplex[edge + 1] - simplex[0]
        if len(there) == 2:
            (missing,) = {0, 1, 2} - set(there)
            for edges in (rest, now):
                normal = np.cross(edges[there[0]], edges[there[1]])
                edges[missing] = normal / np.linalg.norm(normal)
        found.append(np.linalg.solve(rest, now).T)
    return np.array(found)


@pytest.mark.parametrize("vertices", [3, 4])
def test_deformation_gradients_against_a_plain_reference(vertices):
    """With edges of any length, quaternions of any, some edges missing, and none that are almost in line."""
    rng = np.random.default_rng(17)
    gaussians = random_gaussians(rng, 300, low=-5, high=1, extent=1, flat=vertices == 3)
    scales, quaternions = np.array(gaussians.scales), np.array(gaussians.quaternions)
    scales[rng.random(scales.shape) < 0.3] = 0
    quaternions *= 10 ** rng.uniform(-200, 100, (300, 1))
    quaternions[:2] = [[0, 0, 0, 0], [np.nan, 0, 0, 1]]
    gaussians = gaussians.with_(scales=scales, quaternions=quaternions)
    affine = np.eye(3) + rng.uniform(-0.3, 0.3, (300, 3, 3))
    still = games.to_simplices(gaussians.with_(means=np.zeros((300, 3))), vertices)
    moved = np.einsum("nij,nvj->nvi", affine, still)
    wanted = plain_gradients(moved, gaussians)
    np.testing.assert_allclose(games.deformation_gradients(moved, gaussians), wanted, atol=1e-11)


def needles(axis, count, *, degree=0, vertices=4):
    """Along an axis of theirs, which lies anywhere; without any width."""
    made = random_gaussians(np.random.default_rng(21), count, low=-1, high=0, extent=1, degree=degree)
    scales = np.zeros((count, 3))
    scales[:, axis] = made.scales[:, axis]
    made = made.with_(scales=scales, means=np.zeros((count, 3)))
    return made, games.to_simplices(made, vertices)


@pytest.mark.parametrize("vertices", [3, 4])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_needle_turns_by_the_shortest_way_however_far_that_is(axis, vertices):
    """To the opposite direction as well, where there are many, and next to it, where the sum of both has no digits."""
    near = np.pi - np.array([0, 1e-17, 1e-15, 1e-12, 1e-9, 1e-8, 1e-7, 1e-4])
    angles = np.concatenate([np.linspace(0, 3, 50), near])
    gaussians, simplices = needles(axis, len(angles), vertices=vertices)
    along = rotation_matrices(gaussians.quaternions)[:, :, axis]
    across = np.cross(along, np.roll(along, 1, axis=1))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turns = Rotation.from_rotvec(angles[:, None] * across).as_matrix()
    moved = 3 * np.einsum("nij,nvj->nvi", turns, simplices)
    gradients = games.deformation_gradients(moved, gaussians)
    # What is midway is known to 2^-53 over the sum of the two, which is 1e-8 at least, and enters four times; nearer to
    # opposite a half-turn stands in, off by up to these 1e-8.
    bound = 4 * 2**-53 / 1e-8 + 1e-8
    stretches = np.einsum("nji,njk->nik", gradients, gradients)
    np.testing.assert_allclose(stretches, np.eye(3) + 8 * np.einsum("ni,nj->nij", along, along), atol=9 * bound)
    assert (np.linalg.det(gradients) > 0).all()
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", gradients, along), 3 * np.einsum("nij,nj->ni", turns, along), atol=1e-14
    )
    far = np.pi - angles > 1e-3
    expected = turns + 2 * np.einsum("nij,nj,nk->nik", turns, along, along)
    np.testing.assert_allclose(gradients[far], expected[far], atol=1e-12)


@pytest.mark.parametrize("vertices", [3, 4])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_colours_of_needles_turn_with_them(axis, vertices):
    gaussians, simplices = needles(axis, 20, degree=3, vertices=vertices)
    along = rotation_matrices(gaussians.quaternions)[:, :, axis]
    across = np.cross(along, [1.0, 0, 0])
    turns = Rotation.from_rotvec(across / np.linalg.norm(across, axis=1, keepdims=True)).as_matrix()
    moved = games.from_simplices(np.einsum("nij,nvj->nvi", turns, simplices), reference=gaussians)
    # A rotation is known to 1e-14, what two columns count as orthogonal at; degree 3 turns three times as fast, and a
    # coefficient is a sum of seven below 4.
    np.testing.assert_allclose(
        moved.harmonics, turn_coefficients(gaussians.harmonics, turns), atol=1e-14 * 3 * 7 * 4, rtol=0
    )


def test_edges_in_line_and_points_that_are_lost_give_no_surprise():
    """What is in line keeps its direction at rest; what is not finite stays in its row."""
    scales = np.tile([0.0, 0.5, 0.25], (3, 1))
    gaussians = Gaussians(
        means=np.zeros((3, 3)),
        quaternions=np.tile([1.0, 0, 0, 0], (3, 1)),
        scales=scales,
        opacities=np.ones(3),
        harmonics=np.zeros((3, 1, 3)),
    )
    simplices = games.to_simplices(gaussians, 3)
    simplices[0, 2] = [0, 0.75, 0]
    simplices[1, 1] = np.nan
    gradients = games.deformation_gradients(simplices, gaussians)
    np.testing.assert_array_equal(gradients[0], [[1, 0, 0], [0, 1, 3], [0, 0, 0]])
    assert np.isnan(gradients[1]).any()
    np.testing.assert_array_equal(gradients[2], np.eye(3))


def test_polar_rotation_against_numpy():
    matrices = np.random.default_rng(14).normal(size=(2000, 3, 3))
    left, _, right = np.linalg.svd(matrices)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    # Rotation is undefined where the two smallest stretches cancel; relative gap 1e-4 costs four digits.
    np.testing.assert_allclose(games.polar_rotations(matrices), left @ right, atol=1e-10)
    assert games.polar_rotations(np.full((1, 3, 3), np.nan))[0].tolist() == np.eye(3).tolist()
    assert games.polar_rotations(np.zeros((1, 3, 3)))[0].tolist() == np.eye(3).tolist()


def test_quaternions_and_matrices_are_inverse():
    quaternions = np.random.default_rng(15).normal(size=(2000, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions[quaternions[:, 0] < 0] *= -1
    np.testing.assert_allclose(rotation_quaternions(rotation_matrices(quaternions)), quaternions, atol=1e-12)
    np.testing.assert_array_equal(rotation_matrices([[0, 0, 0, 0], [np.nan, 0, 0, 1]]), [np.eye(3)] * 2)


def test_wrong_shapes_are_refused():
    gaussians = random_gaussians(np.random.default_rng(16), 2)
    with pytest.raises(SceneError, match="shape"):
        games.from_simplices(np.zeros((3, 3, 3)), reference=gaussians)
    with pytest.raises(SceneError, match="covariance"):
        games.from_simplices(np.zeros((2, 3, 3)), reference=gaussians, covariance="best")
    with pytest.raises(SceneError, match="vertices"):
        games.to_simplices(gaussians, 5)
