"""Soups: what did not move comes back to the last bit, what moved affinely as it should, the rest is refused."""

import json
import re
import struct

import numpy as np
import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io.soups import make_soup, read_positions, read_soup, splat_of, write_soup
from gasp_core.scene.placement import upright

TURN = upright("-y")


def some_splat(count=50, *, flat=False, seed=0, place=0.0):
    rng = np.random.default_rng(seed)
    scales = 10 ** rng.uniform(-4, -1, (count, 3))
    if flat:
        scales[:, 2] = 0
    arrays = {
        "means": rng.normal(size=(count, 3)) + place,
        "quaternions": rng.normal(size=(count, 4)),
        "scales": scales,
        "opacities": rng.random(count),
        "harmonics": rng.normal(size=(count, 4, 3)),
    }
    return Gaussians(**{name: array.astype(np.float32) for name, array in arrays.items()})


def written(tmp_path, splat, **others):
    path = tmp_path / "a.soup.ply"
    with path.open("wb") as stream:
        write_soup(stream, make_soup(splat, turn=TURN, **others))
    return path, read_soup(path)


def alike(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in Gaussians.__dataclass_fields__)


@pytest.mark.parametrize("flat", [True, False])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), place=st.sampled_from([0.0, 1e3]), edge=st.sampled_from([0.0, 1e-3, 0.1]))
def test_what_did_not_move_is_what_it_was(tmp_path_factory, flat, seed, place, edge):
    splat = some_splat(flat=flat, seed=seed, place=place)
    path, soup = written(tmp_path_factory.mktemp("soup"), splat, shortest_edge=edge)
    assert soup.vertices == (3 if flat else 4)
    (positions,) = read_positions(path, soup)
    assert positions.dtype == np.float32 and np.array_equal(positions, soup.positions)
    assert alike(splat_of(soup, splat, positions), splat)
    # One vertex of one Gaussian moves: the others are what they were.
    positions = positions.copy()
    positions[7, 1] *= 1.5
    became = splat_of(soup, splat, positions)
    others = np.arange(len(splat)) != 7
    assert alike(became.select(others), splat.select(others))
    assert not np.array_equal(became.scales[7], splat.scales[7])


@pytest.mark.parametrize("flat", [True, False])
def test_an_affine_motion_is_f_sigma_f(tmp_path, flat):
    splat = some_splat(flat=flat)
    _, soup = written(tmp_path, splat)
    rng = np.random.default_rng(1)
    gradient, shift = np.eye(3) + 0.4 * rng.normal(size=(3, 3)), rng.normal(size=3)
    positions = (soup.positions.astype(np.float64) @ gradient.T + shift).astype(np.float32)
    became = splat_of(soup, splat, positions)
    # In the frame of the splat.
    own = TURN.T @ gradient @ TURN
    means = (splat.means - soup.centre) @ own.T + TURN.T @ shift + soup.centre
    # Places of 5 in float32, twice: 6e-7 of an edge of 6e-3 that float32 is given, 1e-4 of it and of the covariance.
    assert np.abs(became.means - means).max() < 2e-6
    expected = own @ splat.covariances() @ own.T
    size = np.trace(expected, axis1=1, axis2=2)
    assert (np.abs(became.covariances() - expected).max(axis=(1, 2)) / size).max() < 1e-3
    assert became.means.dtype == np.float32


def test_the_longer_the_shortest_edge_the_nearer(tmp_path):
    """Why edges are lengthened: float32 about a centre knows little of an edge of 1e-5."""
    splat = some_splat(400)
    splat = splat.with_(scales=1e-5 * splat.scales / splat.scales.max())
    errors = []
    for edge in (0.0, 1e-3):
        _, soup = written(tmp_path, splat, shortest_edge=edge)
        gradient = np.array([[1.2, 0.5, 0], [0, 0.8, 0.1], [0.3, 0, 1]])
        became = splat_of(soup, splat, (soup.positions.astype(np.float64) @ gradient.T).astype(np.float32))
        own = TURN.T @ gradient @ TURN
        expected = own @ splat.covariances() @ own.T
        off = np.abs(became.covariances() - expected).max(axis=(1, 2))
        errors.append((off / np.trace(expected, axis1=1, axis2=2)).max())
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.parametrize("flat", [True, False])
def test_another_program_may_order_and_write_it_as_it_likes(tmp_path, flat):
    """plyfile, which is not ours: rows shuffled, whole numbers as floats, faces gone, big-endian or text."""
    splat = some_splat(flat=flat)
    path, soup = written(tmp_path, splat)
    mesh = plyfile.PlyData.read(path)
    vertices = mesh["vertex"].data
    assert len(mesh["face"]) == (1 if flat else 4) * len(splat)
    corners = np.stack(mesh["face"]["vertex_indices"])
    assert (corners // soup.vertices == corners[:, :1] // soup.vertices).all(), "a face is of one Gaussian"
    columns = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("gaussian", "f4"), ("corner", "f4")]
    shuffled = np.random.default_rng(0).permutation(vertices).astype(columns)
    moved = shuffled.copy()
    moved["x"] += 0.5
    expected = soup.positions + np.float32([0.5, 0, 0])
    for order, text in (("<", False), (">", False), ("<", True)):
        element = plyfile.PlyElement.describe(moved, "vertex")
        plyfile.PlyData([element], text=text, byte_order=order).write(tmp_path / "moved.ply")
        (found,) = read_positions(tmp_path / "moved.ply", soup)
        assert np.array_equal(found, expected)
    # Without its numbers, in its own order.
    plain = vertices[["x", "y", "z"]]
    packed = np.array(plain.tolist(), dtype=columns[:3])
    plyfile.PlyData([plyfile.PlyElement.describe(packed, "vertex")]).write(tmp_path / "plain.ply")
    assert np.array_equal(read_positions(tmp_path / "plain.ply", soup)[0], soup.positions)


def test_arrays_of_frames(tmp_path):
    splat = some_splat()
    _, soup = written(tmp_path, splat)
    rows = soup.positions.reshape(-1, 3)
    np.save(tmp_path / "one.npy", rows.astype(np.float64))
    np.save(tmp_path / "more.npy", np.stack([rows, rows + 1, rows + 2]))
    assert np.array_equal(read_positions(tmp_path / "one.npy", soup), soup.positions[None])
    frames = read_positions(tmp_path / "more.npy", soup)
    assert frames.shape == (3, *soup.positions.shape)
    assert np.array_equal(frames[2], soup.positions + np.float32(2))


def test_what_lies_in_a_line_or_a_point_is_thin(tmp_path):
    splat = some_splat(flat=True)
    _, soup = written(tmp_path, splat)
    positions = soup.positions.copy()
    positions[3] = positions[3, :1] + np.arange(3, dtype=np.float32)[:, None] * np.float32([1, 0, 0])
    positions[4] = positions[4, :1]
    became = splat_of(soup, splat, positions)
    assert all(np.isfinite(getattr(became, name)).all() for name in Gaussians.__dataclass_fields__)
    longest = np.sort(became.scales[[3, 4]], axis=1)
    assert longest[0, 1] < 1e-6 < longest[0, 2] and longest[1, 2] < 1e-6


def test_refuses_what_is_not_of_the_soup(tmp_path):
    splat = some_splat()
    path, soup = written(tmp_path, splat)
    with pytest.raises(SplatFormatError, match="is that of another splat, or the splat has changed"):
        splat_of(soup, some_splat(seed=1), soup.positions)
    with pytest.raises(SplatFormatError, match="needs finite Gaussians"):
        make_soup(splat.with_(means=np.full_like(splat.means, np.nan)))
    mesh = plyfile.PlyData.read(path)
    vertices = mesh["vertex"].data

    def refused(name, rows, said, reader=lambda file: read_positions(file, soup)):
        plyfile.PlyData([plyfile.PlyElement.describe(rows, "vertex")]).write(tmp_path / name)
        with pytest.raises(SplatFormatError, match=said) as caught:
            reader(tmp_path / name)
        assert name in str(caught.value) and "\n" not in str(caught.value)

    refused("fewer.ply", vertices[:-1], "has 199 vertices, the soup 200; nothing may be merged")
    twice = vertices.copy()
    twice["gaussian"][0] = 1
    refused("twice.ply", twice, "are not each there once")
    beyond = vertices.copy()
    beyond["gaussian"] += 2**30
    refused("beyond.ply", beyond, "are not each there once")
    lost = vertices.copy()
    lost["x"][9] = np.nan
    refused("lost.ply", lost, "vertices of 1 Gaussians are not finite, the first is 2;")
    refused("again.ply", vertices, "the line that tells its splat is gone", read_soup)
    np.save(tmp_path / "short.npy", np.zeros((199, 3)))
    np.save(tmp_path / "words.npy", np.array(["a"] * 200))
    (tmp_path / "no.npy").write_bytes(b"\x93NUMPY\x01\x00")
    np.save(tmp_path / "code.npy", np.array([{}], dtype=object), allow_pickle=True)
    for name, said in (
        ("short.npy", r"is of shape \(199, 3\), not \(200, 3\) or"),
        ("words.npy", "no numbers"),
        ("no.npy", r"is no \.npy of numbers"),
        ("code.npy", "no numbers|no .npy"),
        ("nowhere.npy", "cannot be read: No such file"),
        ("a.obj", "is no file of moved vertices; write .ply or .npy"),
    ):
        with pytest.raises(SplatFormatError, match=said):
            read_positions(tmp_path / name, soup)


DAMAGES = {
    "no JSON": lambda told: "{",
    "a list": lambda told: "[1]",
    "another number": lambda told: json.dumps({**told, "shape": [49, 4]}),
    "of five vertices": lambda told: json.dumps({**told, "shape": [40, 5]}),
    "a text": lambda told: json.dumps({**told, "shape": "ab"}),
    "no turn": lambda told: json.dumps({**told, "turn": [[1, 0, 0], [0, 1, 0], [0, 1, 0]]}),
    "no centre": lambda told: json.dumps({**told, "centre": None}),
    "centre nowhere": lambda told: json.dumps({**told, "centre": [1, 2, float("nan")]}),
    "edge below zero": lambda told: json.dumps({**told, "shortest_edge": -1}),
    "nested": lambda told: "[" * 100_000,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_refuses_a_damaged_soup(tmp_path, damage):
    path, _ = written(tmp_path, some_splat())
    data = path.read_bytes()
    line = re.search(rb"gasp-soup 1 (.*)\n", data)
    told = DAMAGES[damage](json.loads(line.group(1))).encode()
    path.write_bytes(data[: line.start(1)] + told + data[line.end(1) :])
    with pytest.raises(SplatFormatError, match=r"a\.soup\.ply: ") as caught:
        read_soup(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.7])
def test_refuses_a_soup_cut_off(tmp_path, share):
    path, _ = written(tmp_path, some_splat())
    vertices = path.read_bytes().index(b"end_header\n") + 11 + 200 * struct.calcsize("<fffiB")
    path.write_bytes(path.read_bytes()[: int(share * vertices)])
    with pytest.raises(SplatFormatError, match=r"a\.soup\.ply: "):
        read_soup(path)
