""".splat, .spz, SOG, compressed .ply and .glb: against their descriptions, number by number, and there and back."""

import gzip
import json
import struct
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gasp_core.gaussians import rotation_matrices
from gasp_core.io import read_splat, write_splat
from gasp_core.io.spz import turned

C0 = 0.28209479177387814


def unit(q):
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def rotation_error(a, b):
    """Distance of unit quaternions, sign aside, (N,)."""
    a, b = unit(a.astype(np.float64)), unit(b.astype(np.float64))
    return np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))


def basis(directions):
    """The 25 real harmonics of 3DGS at unit directions, from the polynomials as its rasteriser writes them."""
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack(
        [
            np.ones_like(x),
            *(-y, z, -x),
            *(x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy),
            *(y * (3 * xx - yy), x * y * z, y * (4 * zz - xx - yy), z * (2 * zz - 3 * xx - 3 * yy)),
            *(x * (4 * zz - xx - yy), z * (xx - yy), x * (xx - 3 * yy)),
            *(x * y * (xx - yy), y * z * (3 * xx - yy), x * y * (7 * zz - 1), y * z * (7 * zz - 3)),
            *(zz * (35 * zz - 30) + 3, x * z * (7 * zz - 3), (xx - yy) * (7 * zz - 1), x * z * (xx - 3 * yy)),
            xx * (xx - 3 * yy) - yy * (3 * xx - yy),
        ],
        axis=1,
    )


# --- .splat


def test_dot_splat_by_hand(read):
    row = struct.pack("<6f8B", 1.5, -2, 3, 0.1, 0.2, 0.3, 0, 255, 51, 204, 128, 0, 255, 192)
    g = read(row, "a.splat")
    assert np.array_equal(g.means, np.array([[1.5, -2, 3]], np.float32))
    assert np.array_equal(g.scales, np.array([[0.1, 0.2, 0.3]], np.float32))
    np.testing.assert_allclose(g.harmonics[0, 0], (np.array([0, 1, 0.2]) - 0.5) / C0, rtol=1e-6)
    np.testing.assert_allclose(g.opacities, [0.8], rtol=1e-6)
    assert np.array_equal(g.quaternions, np.array([[0, -1, 127 / 128, 0.5]], np.float32))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40))
def test_dot_splat_there_and_back(some, tmp_path, seed, count):
    g = some(count, 0, seed)
    write_splat(tmp_path / "a.splat", g)
    back = read_splat(tmp_path / "a.splat")
    assert np.array_equal(back.means, g.means)
    assert np.array_equal(back.scales, g.scales)
    # Half a step of 255, and float32.
    assert np.abs(back.opacities - g.opacities).max() <= 0.5 / 255 + 1e-7
    colours = np.clip(g.harmonics[:, 0] * C0 + 0.5, 0, 1)
    assert np.abs(back.harmonics[:, 0] * C0 + 0.5 - colours).max() <= 0.5 / 255 + 1e-6
    # Three components to half a step of 1/128, one to a whole where 256 is cut to 255; normalising may double it.
    assert rotation_error(back.quaternions, g.quaternions).max() <= 2 * np.sqrt(3 * 0.25 + 1) / 128


# --- .spz


@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_spz_by_hand(build, read, version, degree):
    content, sections = build.spz(version, 40, degree, bits=11)
    g = read(content, "a.spz")
    count = 40
    assert (len(g), g.sh_degree) == (count, degree)
    flip = np.array([1, -1, -1])
    if version == 1:
        means = np.frombuffer(sections[0], "<f2").reshape(count, 3).astype(np.float32)
    else:
        triples = np.frombuffer(sections[0], np.uint8).reshape(-1, 3)
        means = (
            np.array([int.from_bytes(t.tobytes(), "little", signed=True) for t in triples]).reshape(count, 3) / 2**11
        )
    assert np.array_equal(g.means, (means * flip).astype(np.float32))
    byte = [np.frombuffer(section, np.uint8).astype(np.float64) for section in sections]
    np.testing.assert_allclose(g.opacities, byte[1] / 255, rtol=1e-7)
    dc = (byte[2].reshape(count, 3) / 255 - 0.5) / 0.15
    np.testing.assert_allclose(g.harmonics[:, 0], dc, atol=4e-7)
    np.testing.assert_allclose(g.scales, np.exp(byte[3].reshape(count, 3) / 16 - 10), rtol=1e-7)
    expected = np.zeros((count, 4))
    if version <= 2:
        xyz = byte[4].reshape(count, 3) / 127.5 - 1
        expected[:, 1:], expected[:, 0] = xyz, np.sqrt(np.maximum(0, 1 - (xyz**2).sum(1)))
    else:
        for row, word in enumerate(np.frombuffer(sections[4], "<u4")):
            # As load-spz.cc has it: x y z w, unpacked from the last component to the first.
            word, largest, xyzw, total = int(word), int(word) >> 30, [0.0] * 4, 0.0
            for axis in (3, 2, 1, 0):
                if axis != largest:
                    value = np.sqrt(0.5) * (word & 511) / 511
                    xyzw[axis] = -value if (word >> 9) & 1 else value
                    total += value**2
                    word >>= 10
            xyzw[largest] = np.sqrt(max(0.0, 1 - total))
            expected[row] = [xyzw[3], *xyzw[:3]]
    np.testing.assert_allclose(g.quaternions, expected * [1, 1, -1, -1], atol=2e-7)


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_the_turn_of_spz_is_half_a_turn_about_x(some, degree):
    g = some(20, degree)
    t = turned(g)
    half_turn = np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(t.covariances(), half_turn @ g.covariances() @ half_turn, rtol=1e-12, atol=1e-15)
    assert np.array_equal(t.means, (g.means @ half_turn).astype(np.float32))
    directions = unit(np.random.default_rng(3).normal(size=(50, 3)))
    k = g.harmonics.shape[1]
    seen = np.einsum("dk,nkc->dnc", basis(directions)[:, :k], g.harmonics.astype(np.float64))
    seen_turned = np.einsum("dk,nkc->dnc", basis(directions @ half_turn)[:, :k], t.harmonics.astype(np.float64))
    np.testing.assert_allclose(seen_turned, seen, atol=1e-12)
    again = turned(t)
    assert np.array_equal(again.harmonics, g.harmonics)
    assert np.array_equal(again.quaternions, g.quaternions)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    degree=st.integers(0, 3),
    count=st.integers(1, 40),
    size=st.sampled_from([1e-3, 1.0, 50.0, 3e4]),
)
def test_spz_there_and_back(some, tmp_path, seed, degree, count, size):
    g = some(count, degree, seed)
    g = g.with_(means=(g.means * np.float32(size)).astype(np.float32))
    write_splat(tmp_path / "a.spz", g)
    back = read_splat(tmp_path / "a.spz")
    assert back.sh_degree == degree
    # As many fractional bits as fit into 24 with sign, at most 24: half a step.
    largest = np.abs(g.means).max()
    bits = min(24, int(np.floor(np.log2((2**23 - 1) / largest))))
    assert np.abs(back.means.astype(np.float64) - g.means).max() <= 0.5 * 2.0**-bits
    assert np.abs(back.opacities - g.opacities).max() <= 0.5 / 255 + 1e-6
    assert np.abs(back.harmonics[:, 0] - g.harmonics[:, 0]).max() <= 0.5 / 255 / 0.15 + 1e-6
    if degree:
        assert np.abs(back.harmonics[:, 1:] - g.harmonics[:, 1:]).max() <= 0.5 / 128 + 1e-6
    assert np.abs(np.log(back.scales / g.scales)).max() <= 0.5 / 16 + 1e-5
    # Three components to half a step of sqrt(1/2)/511; the largest, at least 1/2, follows with sqrt 3 of that.
    assert rotation_error(back.quaternions, g.quaternions).max() <= 2 * np.sqrt(3) * 0.5 * np.sqrt(0.5) / 511 + 1e-6


def test_spz_of_a_ply_reads_as_the_ply(some, tmp_path):
    """Seen, not stored: the same colours from the same side."""
    g = some(50, 3)
    write_splat(tmp_path / "a.ply", g)
    write_splat(tmp_path / "a.spz", read_splat(tmp_path / "a.ply"))
    back = read_splat(tmp_path / "a.spz")
    directions = unit(np.random.default_rng(3).normal(size=(50, 3)))
    seen, again = (
        np.einsum("dk,nkc->dnc", basis(directions)[:, :16], h.astype(np.float64)) for h in (g.harmonics, back.harmonics)
    )
    step = np.r_[0.5 / 255 / 0.15, np.full(15, 0.5 / 128)] + 1e-6
    assert np.all(np.abs(seen - again) <= (np.abs(basis(directions)[:, :16]) @ step)[:, None, None])
    # In the file itself y and z have the other sign.
    raw = gzip.decompress((tmp_path / "a.spz").read_bytes())
    y = int.from_bytes(raw[16 + 3 : 16 + 6], "little", signed=True)
    assert np.sign(y) == -np.sign(g.means[0, 1])


def test_spz_of_rotations_without_a_largest_component(some, tmp_path):
    q = np.array([[1, 1, 1, 1], [0, 0, 0, 1], [1, 0, 0, 0], [-1, 1, 0, 0], [0, 0, 0, 0], [1e-30, 0, 1e-30, 0]])
    g = some(6, 0).with_(quaternions=q.astype(np.float32))
    for suffix, bound in ((".spz", 3e-3), (".splat", 0.03)):
        write_splat(tmp_path / f"a{suffix}", g)
        back = read_splat(tmp_path / f"a{suffix}")
        error = np.abs(rotation_matrices(back.quaternions) - rotation_matrices(g.quaternions)).max()
        assert error <= 2 * bound


# --- SOG


def decoded(files, name):
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(files[name])).convert("RGBA")).reshape(-1, 4).astype(np.float64)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_sog_by_hand(build, read, tmp_path, version, degree):
    count = 10
    files = build.sog(version, count, degree)
    g = read(build.zipped(files), "a.sog")
    meta = json.loads(files["meta.json"])
    assert (len(g), g.sh_degree) == (count, degree)
    low, high = decoded(files, "means_l.webp")[:count, :3], decoded(files, "means_u.webp")[:count, :3]
    mins, maxs = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
    folded = mins + (maxs - mins) * (low + 256 * high) / 65535
    np.testing.assert_allclose(g.means, np.sign(folded) * (np.exp(np.abs(folded)) - 1), rtol=1e-6, atol=1e-12)
    scales, colours = decoded(files, "scales.webp")[:count, :3], decoded(files, "sh0.webp")[:count]
    if version == 2:
        logs = np.array(meta["scales"]["codebook"])[scales.astype(int)]
        dc, opacities = np.array(meta["sh0"]["codebook"])[colours[:, :3].astype(int)], colours[:, 3] / 255
    else:
        logs = np.array([-9, -8, -7]) + np.array([8, 6, 7]) * scales / 255
        values = np.array([-1, -1.5, -2, -6]) + np.array([3, 2.5, 3.5, 13]) * colours / 255
        dc, opacities = values[:, :3], 1 / (1 + np.exp(-values[:, 3]))
    np.testing.assert_allclose(g.scales, np.exp(logs), rtol=1e-6)
    np.testing.assert_allclose(g.opacities, opacities, rtol=1e-6)
    np.testing.assert_allclose(g.harmonics[:, 0], dc, rtol=1e-6, atol=1e-7)
    quats = decoded(files, "quats.webp")[:count]
    for row in range(count):
        largest, others = int(quats[row, 3]) - 252, (quats[row, :3] / 255 * 2 - 1) / np.sqrt(2)
        expected = np.insert(others, largest, np.sqrt(max(0, 1 - (others**2).sum())))
        np.testing.assert_allclose(g.quaternions[row], expected, atol=2e-7)
    if degree:
        bases = {1: 3, 2: 8, 3: 15}[degree]
        centroids = decoded(files, "shN_centroids.webp")[:, :3].reshape(2, 64 * bases, 3)
        labels = decoded(files, "shN_labels.webp")
        for row in range(count):
            label = int(labels[row, 0] + 256 * labels[row, 1])
            cells = centroids[label // 64, (label % 64) * bases : (label % 64 + 1) * bases]
            book = np.array(meta["shN"]["codebook"]) if version == 2 else -0.5 + 1.25 * np.arange(256) / 255
            np.testing.assert_allclose(g.harmonics[row, 1:], book[cells.astype(int)], rtol=1e-6, atol=1e-7)

    # The same as a folder, by its meta.json, deflated, and below a folder of the zip.
    folder = tmp_path / "folder"
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    below = {f"splat/{name}": content for name, content in files.items()}
    others = [
        read_splat(folder),
        read_splat(folder / "meta.json"),
        read(build.zipped(files, zipfile.ZIP_DEFLATED), "b.sog"),
        read(build.zipped(below), "c.sog"),
    ]
    for other in others:
        assert np.array_equal(other.means, g.means)
        assert np.array_equal(other.harmonics, g.harmonics)


def test_sog_codebook_with_a_null_first_entry(build, read):
    """As PlayCanvas' viewer mends the files of an early writer."""
    book = [None, *np.linspace(-4, 4, 255).tolist()]
    g = read(build.zipped(build.sog(2, 100, 0, scales__codebook=book)), "a.sog")
    first = -4 + (-4 - 4) / 255
    levels = np.log(g.scales.astype(np.float64))
    assert levels.min() >= first - 1e-6


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    seed=st.integers(0, 9),
    degree=st.integers(0, 3),
    count=st.integers(1, 400),
    size=st.sampled_from([1e-3, 1.0, 50.0, 3e4]),
)
def test_sog_there_and_back(some, tmp_path, seed, degree, count, size):
    g = some(count, degree, seed)
    g = g.with_(means=(g.means * np.float32(size)).astype(np.float32))
    write_splat(tmp_path / "a.sog", g)
    back = read_splat(tmp_path / "a.sog")
    assert (len(back), back.sh_degree) == (count, degree)
    # Half a step of 2^16 in ln(1 + |x|), whose slope is largest where |x| is; float32 of the result.
    largest = np.abs(g.means).max().astype(np.float64)
    step = 2 * np.log1p(largest) / 65535
    assert np.abs(back.means - g.means.astype(np.float64)).max() <= (0.5 * step + 2.0**-23) * (1 + largest) * (1 + step)
    assert np.abs(back.opacities - g.opacities).max() <= 0.5 / 255 + 1e-6
    # As with .spz, from a step of sqrt(2) / 255.
    assert rotation_error(back.quaternions, g.quaternions).max() <= 2 * np.sqrt(3) * 0.5 * np.sqrt(2) / 255 + 1e-6
    for mine, theirs in (
        (np.log(g.scales), np.log(back.scales)),
        (g.harmonics[:, 0], back.harmonics[:, 0]),
        (g.harmonics[:, 1:], back.harmonics[:, 1:]),
    ):
        assert_nearest(mine.astype(np.float64), theirs.astype(np.float64))


def assert_nearest(values, rounded):
    """At most 256 distinct ones, each value rounded to the nearest, and none spread out where 256 are enough."""
    if not values.size:
        return
    book = np.unique(rounded)
    slack = 1e-5 * (1 + np.abs(values).max())
    # Rounding to float32 may split one entry in two, not beyond that.
    assert np.count_nonzero(np.diff(book) > slack) < 256
    nearest = np.abs(values.reshape(-1, 1) - book).min(axis=1)
    assert np.all(np.abs(values - rounded).reshape(-1) <= nearest + slack)
    if len(np.unique(values)) <= 256:
        assert np.abs(values - rounded).max() <= slack


def test_sog_writes_what_it_reads_whatever_the_order_of_its_rows(some, tmp_path):
    """Rows stay where they are: those of a sequence are the same Gaussians in every file."""
    g = some(500, 2, 4)
    turned_round = g.select(np.arange(500)[::-1])
    write_splat(tmp_path / "a.sog", g)
    write_splat(tmp_path / "b.sog", turned_round)
    there, back = read_splat(tmp_path / "a.sog"), read_splat(tmp_path / "b.sog")
    for name in ("means", "scales", "opacities", "harmonics", "quaternions"):
        np.testing.assert_array_equal(getattr(there, name), getattr(back, name)[::-1], err_msg=name)


def test_codebook_is_as_good_as_a_library_finds_it():
    """Against k-means of scikit-learn, begun many times over: squared errors of log scales as they are trained."""
    from sklearn.cluster import KMeans

    from gasp_core.io.sog_writing import codebook

    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(-4.5, 0.8, 5000), rng.normal(-9, 2, 1000), [-16.0, 1.0]])
    book, entries = codebook(values)
    best = KMeans(256, n_init=3, random_state=0).fit(values[:, None]).inertia_
    assert ((book[entries] - values) ** 2).sum() <= 1.25 * best


def test_palette_of_many_harmonics():
    """Clusters that are as many as rows of the palette, and of two sizes, are told apart."""
    from gasp_core.io.sog_writing import palette

    rng = np.random.default_rng(1)
    centres = rng.normal(size=(64, 3, 3))
    own = np.repeat(np.arange(64), 16)
    rows, labels = palette(centres[own] + rng.normal(scale=1e-3, size=(1024, 3, 3)), 64)
    assert rows.shape == (64, 3, 3)
    np.testing.assert_allclose(rows[labels], centres[own], atol=6e-3)
    few, labels = palette(centres[own].astype(np.float32), 64)
    np.testing.assert_array_equal(few[labels], centres[own].astype(np.float32))


# --- compressed .ply


def word_fields(words, widths):
    shift, fields = 32, []
    shift = sum(widths)
    for width in widths:
        shift -= width
        fields.append(((words.astype(np.int64) >> shift) & (2**width - 1)) / (2**width - 1))
    return np.stack(fields, axis=1)


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_compressed_ply_by_hand(build, read, old, degree):
    import io

    import plyfile

    content = build.compressed_ply(300, degree, old=old)
    g = read(content, "a.compressed.ply")
    assert (len(g), g.sh_degree) == (300, degree)
    data = plyfile.PlyData.read(io.BytesIO(content))
    chunk, vertex = data["chunk"], data["vertex"]
    of_row = np.arange(300) // 256

    def between(names, t):
        low = np.stack([chunk[f"min_{name}"] for name in names], 1).astype(np.float64)[of_row]
        high = np.stack([chunk[f"max_{name}"] for name in names], 1).astype(np.float64)[of_row]
        return low + (high - low) * t

    means = between("xyz", word_fields(vertex["packed_position"], (11, 10, 11)))
    np.testing.assert_allclose(g.means, means, rtol=1e-6, atol=1e-6)
    logs = between(("scale_x", "scale_y", "scale_z"), word_fields(vertex["packed_scale"], (11, 10, 11)))
    np.testing.assert_allclose(g.scales, np.exp(logs), rtol=1e-6)
    rgba = word_fields(vertex["packed_color"], (8, 8, 8, 8))
    colours = rgba[:, :3] if old else between("rgb", rgba[:, :3])
    np.testing.assert_allclose(g.harmonics[:, 0], (colours - 0.5) / C0, rtol=1e-6, atol=2e-6)
    np.testing.assert_allclose(g.opacities, rgba[:, 3], rtol=1e-6)
    for row in range(300):
        others = (word_fields(vertex["packed_rotation"][row : row + 1], (10, 10, 10))[0] - 0.5) * np.sqrt(2)
        largest = int(vertex["packed_rotation"][row]) >> 30
        expected = np.insert(others, largest, np.sqrt(max(0, 1 - (others**2).sum())))
        np.testing.assert_allclose(g.quaternions[row], expected, atol=2e-7)
    if degree:
        bases = {1: 3, 2: 8, 3: 15}[degree]
        sh = np.stack([data["sh"][f"f_rest_{i}"] for i in range(3 * bases)], 1).astype(np.float64)
        values = (sh - 127.5) / 32
        np.testing.assert_allclose(g.harmonics[:, 1:], values.reshape(300, 3, bases).transpose(0, 2, 1), atol=1e-6)


def test_the_outermost_harmonics_of_a_compressed_ply_are_the_ends(build, read):
    levels = np.tile(np.array([0, 255, 128], np.uint8), (3, 3))
    g = read(build.compressed_ply(3, 1, levels=levels), "a.ply")
    assert np.array_equal(g.harmonics[0, 1:, 0], np.array([-4, 4, 1 / 64], np.float32))


# --- .glb


def gltf(path):
    """A .glb by the rules of glTF 2.0: its document, and accessors by the name of their attribute."""
    content = path.read_bytes()
    magic, version, length, size, kind = struct.unpack("<4sIIII", content[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), 0x4E4F534A)
    document = json.loads(content[20 : 20 + size])
    held, kind = struct.unpack("<II", content[20 + size : 28 + size])
    buffer = content[28 + size :]
    assert (kind, held, document["buffers"]) == (0x004E4942, len(buffer), [{"byteLength": len(buffer)}])
    found = {}
    for name, number in document["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        kind = {5126: np.dtype("<f4"), 5121: np.dtype("u1")}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert view["byteLength"] == accessor["count"] * width * kind.itemsize
        values = np.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"])
        found[name] = values.reshape(-1, width)
    return document, found


def test_glb_by_the_rules_of_gltf(some, tmp_path):
    """Half a turn about x, which a covariance shows whatever the order of its axes; all else to the last bit."""
    g = some(40, 3)
    write_splat(tmp_path / "a.glb", g)
    document, found = gltf(tmp_path / "a.glb")
    assert document["extensionsUsed"] == ["KHR_gaussian_splatting"]
    assert document["meshes"][0]["primitives"][0]["mode"] == 0
    turn = np.diag([1.0, -1.0, -1.0])
    np.testing.assert_array_equal(found["POSITION"], g.means @ turn.astype(np.float32))
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    np.testing.assert_array_equal(
        [accessor["min"], accessor["max"]], [f(found["POSITION"], 0) for f in (np.min, np.max)]
    )
    np.testing.assert_array_equal(found["KHR_gaussian_splatting:SCALE"], g.scales)
    np.testing.assert_array_equal(found["KHR_gaussian_splatting:OPACITY"][:, 0], g.opacities)
    stored = np.roll(found["KHR_gaussian_splatting:ROTATION"], 1, axis=1)
    np.testing.assert_allclose(np.linalg.norm(stored, axis=1), 1, atol=1e-6)
    expected = np.einsum("ij,njk,lk->nil", turn, g.covariances(), turn)
    # Rotations rounded to float32: 2^-24 in each of the components of two factors.
    bound = 16 * 2.0**-24 * (g.scales.max(axis=1) ** 2)[:, None, None]
    assert np.all(np.abs(g.with_(quaternions=stored).covariances() - expected) <= bound)
    # Seen from where it was seen before, it has the colour that it had.
    views = unit(np.random.default_rng(1).normal(size=(20, 3)))
    names = [f"KHR_gaussian_splatting:SH_DEGREE_{d}_COEF_{m}" for d in range(4) for m in range(2 * d + 1)]
    harmonics = np.stack([found[name] for name in names], axis=1)
    before = np.einsum("dk,nkc->dnc", basis(views)[:, :16], g.harmonics)
    after = np.einsum("dk,nkc->dnc", basis(views @ turn)[:, :16], harmonics)
    np.testing.assert_allclose(after, before, atol=1e-5)
    colours = np.clip(0.28209479177387814 * g.harmonics[:, 0] + 0.5, 0, 1)
    np.testing.assert_allclose(found["COLOR_0"] / 255, np.c_[colours, g.opacities], atol=0.5 / 255 + 1e-6)


def test_trimesh_shows_a_glb_as_points(some, tmp_path):
    """A program that knows glTF and no splats."""
    trimesh = pytest.importorskip("trimesh")
    g = some(40, 0)
    write_splat(tmp_path / "a.glb", g)
    (points,) = trimesh.load(tmp_path / "a.glb").geometry.values()
    np.testing.assert_array_equal(np.asarray(points.vertices, np.float32), g.means * np.float32([1, -1, -1]))
