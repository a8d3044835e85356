import numpy as np
from gasp_viewer.faces import FACE, pack_faces, simplex_faces

from gasp_core.gaussians import rotation_matrices

# float32 positions, quaternions and scales of numbers up to about 4: some roundings of 2^-24 each. A quaternion's
# component off by u turns by 2 u, what it turns is at most 4 long.
BOUND = 64 * 2.0**-24


def drawn(packed):
    """Corners of what the page draws, (2 N, 3, 3): the copied triangle scaled, turned, moved."""
    vertices = FACE[0][FACE[1][0]].astype(np.float64)
    turns = rotation_matrices(packed.quaternions)
    return (
        np.einsum("nij,nkj->nki", turns, vertices * packed.scales[:, None, :].astype(np.float64))
        + (packed.positions.astype(np.float64)[:, None, :])
    )


def areas(triangles):
    return np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2


def check(triangles):
    """The two halves share the foot of the height and the apex, and their other corners are the base's ends."""
    halves = drawn(pack_faces(triangles, np.zeros((len(triangles), 3)))).reshape(-1, 2, 3, 3)
    np.testing.assert_allclose(halves[:, 0, 0], halves[:, 1, 0], atol=BOUND)
    np.testing.assert_allclose(halves[:, 0, 2], halves[:, 1, 2], atol=BOUND)
    outline = np.stack([halves[:, 0, 2], halves[:, 0, 1], halves[:, 1, 1]], axis=1)
    distances = np.linalg.norm(outline[:, :, None] - triangles[:, None], axis=3)
    assert (distances.min(axis=1) <= 2 * BOUND).all()
    assert (distances.min(axis=2) <= 2 * BOUND).all()
    np.testing.assert_allclose(areas(halves[:, 0]) + areas(halves[:, 1]), areas(triangles), atol=16 * BOUND)


def test_two_right_angled_copies_are_the_triangle():
    rng = np.random.default_rng(1)
    check(rng.uniform(-1, 1, (5000, 3, 3)))


def test_slivers_and_lines_and_dots_stay_what_they_are():
    rng = np.random.default_rng(2)
    ends = rng.uniform(-1, 1, (300, 2, 3))
    share = rng.uniform(0, 1, (300, 1))
    third = share * ends[:, 0] + (1 - share) * ends[:, 1] + rng.normal(0, 1e-9, (300, 3))
    slivers = np.concatenate([ends, third[:, None]], axis=1)
    lines = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]], [[0, 0, 0], [1, 0, 0], [1, 0, 0]]], dtype=float)
    dots = np.zeros((1, 3, 3)) + 0.3
    triangles = np.concatenate([slivers, lines, dots])
    packed = pack_faces(triangles, np.zeros((len(triangles), 3)))
    assert np.isfinite(packed.quaternions).all() and np.isfinite(packed.scales).all()
    check(triangles)


def test_every_triangle_wears_its_colour_in_linear_light():
    colours = np.array([[0.0, 0.5, 1.0], [0.04, 0.2, -3.0]])
    packed = pack_faces(np.random.default_rng(0).normal(size=(2, 3, 3)), colours)
    # IEC 61966-2-1: 0.5 is 0.21404 of the light, 0.2 is 0.03310, 0.04 (on the straight part) 0.04 / 12.92.
    expected = [[0, 55, 255], [round(255 * 0.04 / 12.92), 8, 0]]
    np.testing.assert_array_equal(packed.colours, np.repeat(expected, 2, axis=0))


def test_a_triangle_is_its_own_face_and_a_tetrahedron_has_four():
    rng = np.random.default_rng(0)
    flat, full = rng.normal(size=(5, 3, 3)), rng.normal(size=(5, 4, 3))
    np.testing.assert_array_equal(simplex_faces(flat), flat)
    faces = simplex_faces(full).reshape(5, 4, 3, 3)
    for tetrahedron, own in zip(full, faces):
        missing = []
        for face in own:
            rows = [int(np.flatnonzero((tetrahedron == corner).all(axis=1))[0]) for corner in face]
            assert len(set(rows)) == 3
            missing += set(range(4)) - set(rows)
        assert sorted(missing) == [0, 1, 2, 3]
