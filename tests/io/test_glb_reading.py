""".glb with KHR_gaussian_splatting: written here by hand from the Khronos' text, and by our own writer."""

import struct

import numpy as np
import pytest
from splat_files import KHR, Gltf, cloud_arrays, cloud_glb, spz_glb

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis
from gasp_core.io import read_splat, write_splat
from gasp_core.io.convert import convert
from gasp_core.io.detect import read as read_with_kind

TURN = np.diag([1.0, -1.0, -1.0])
"""From y up, as glTF has it, to y down, as trained splats lie."""
C0 = 0.28209479177387814


def expected_covariances(arrays, linear=TURN):
    """linear R S S R^T linear^T of the attributes, as the text has it."""
    edges = linear @ rotation_matrices(np.roll(arrays["ROTATION"], 1, axis=1)) * arrays["SCALE"][:, None]
    return edges @ edges.transpose(0, 2, 1)


def agree(found, expected, relative):
    """Matrices, each to a share of its own largest entry."""
    assert np.all(np.abs(found - expected).max(axis=(1, 2)) <= relative * np.abs(expected).max(axis=(1, 2)))


def seen(g, views):
    """Colours (D, N, 3) from directions."""
    return np.einsum("dk,nkc->dnc", basis(views, g.sh_degree), g.harmonics)


def directions(count=30):
    found = np.random.default_rng(7).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


# --- as the Khronos has it


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_by_the_text_of_the_khronos(read, degree):
    """Scales linear, opacities 0..1, quaternions x y z w, harmonics by degree and order, y up."""
    arrays = cloud_arrays(50, degree)
    g = read(cloud_glb(50, degree), "a.glb")
    assert np.array_equal(g.means, (arrays["POSITION"] @ TURN).astype("f4"))
    assert np.array_equal(g.scales, arrays["SCALE"].astype("f4"))
    assert np.array_equal(g.opacities, arrays["OPACITY"].astype("f4"))
    # Attributes are float32: 2^-24 in each component of two rotations and two scales.
    agree(g.covariances(), expected_covariances(arrays), 16 * 2.0**-24)
    stored = [arrays[f"SH_DEGREE_{d}_COEF_{n}"] for d in range(degree + 1) for n in range(2 * d + 1)]
    # From where it is red there it is red here: Color = sum Y_lm(d) SH_lm.
    before = np.einsum("dk,knc->dnc", basis(directions(), degree), np.array(stored))
    np.testing.assert_allclose(seen(g, directions() @ TURN), before, atol=1e-5)


def test_the_degree_1_functions_of_the_text(read):
    """Y_1,-1 = -.4886 y, Y_10 = .4886 z, Y_11 = -.4886 x, in the frame of the .glb."""
    arrays = cloud_arrays(1, 1)
    for n in range(3):
        arrays[f"SH_DEGREE_1_COEF_{n}"] = np.eye(3)[n][None]
    gltf = Gltf()
    gltf.mesh(gltf.cloud(arrays))
    g = read(gltf.packed(), "a.glb")
    for direction, expected in (([1, 0, 0], [0, 0, -1]), ([0, 1, 0], [-1, 0, 0]), ([0, 0, 1], [0, 1, 0])):
        colour = seen(g, np.array([direction]) @ TURN)[0, 0] - C0 * arrays["SH_DEGREE_0_COEF_0"][0]
        np.testing.assert_allclose(colour, 0.4886025119029199 * np.array(expected), atol=1e-6)


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_our_own_comes_back(some, tmp_path, degree):
    """All to the last bit, but for rotations, which leave as unit quaternions of float32."""
    g = some(60, degree)
    write_splat(tmp_path / "a.glb", g)
    found, kind = read_with_kind(tmp_path / "a.glb")
    assert kind == "glb"
    for name in ("means", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(found, name), getattr(g, name))
        assert getattr(found, name).dtype == np.float32
    agree(found.covariances(), g.covariances(), 16 * 2.0**-24)
    assert convert(tmp_path / "a.glb", tmp_path / "b.glb") == ()
    assert (tmp_path / "b.glb").read_bytes() == (tmp_path / "a.glb").read_bytes()


def test_suffixes_do_not_matter(read):
    assert len(read(cloud_glb(), "a.bin")) == 5


# --- nodes

SQUEEZE = {"scale": [2.0, 0.5, 1.25]}
TILT = {"rotation": [0.5, -0.5, 0.1, 0.7], "translation": [3.0, -1.0, 2.0]}
SHEAR = {"matrix": [1, 0.3, 0, 0, 0, 1, 0, 0, 0.5, -0.7, 2, 0, 4, 5, 6, 1]}
MIRROR = {"scale": [-1.0, 1.0, 1.0]}


def local(node):
    """Map (4, 4) of a node, by the rules of glTF."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    found = np.eye(4)
    found[:3, :3] = rotation_matrices([np.roll(node.get("rotation", [0, 0, 0, 1]), 1)])[0] * node.get("scale", 1.0)
    found[:3, 3] = node.get("translation", 0.0)
    return found


@pytest.mark.parametrize(
    "chain",
    [
        [TILT],
        [{"scale": [3.0, 3.0, 3.0], **TILT}, TILT],
        [SQUEEZE],
        [TILT, SQUEEZE, TILT],
        [SHEAR],
        [MIRROR],
        [TILT, {"scale": [-2.0, -2.0, -2.0]}],
        [SHEAR, MIRROR, TILT],
    ],
    ids=["turn", "similarity", "squeeze", "squeezed and turned", "shear", "mirror", "point mirror", "all"],
)
def test_nodes_move_gaussians(read, chain):
    """Covariances become A Sigma A^T for every affine map; harmonics turn where the map does."""
    arrays = cloud_arrays(40, 3)
    gltf = Gltf()
    gltf.mesh(gltf.cloud(arrays))
    nodes = [{**node, "children": [k + 1]} for k, node in enumerate(chain)] + [{"mesh": 0}]
    g = read(gltf.packed(nodes), "a.glb")
    matrix = np.linalg.multi_dot([np.eye(4), *map(local, chain), np.eye(4)])
    means = (arrays["POSITION"] @ matrix[:3, :3].T + matrix[:3, 3]) @ TURN
    # Positions are float32 in the file.
    np.testing.assert_allclose(g.means, means, atol=2.0**-24 * 8 * np.abs(means).max())
    agree(g.covariances(), expected_covariances(arrays, TURN @ matrix[:3, :3]), 1e-5)
    left, stretches, right = np.linalg.svd(matrix[:3, :3])
    if np.ptp(stretches) < 1e-9:
        stored = [arrays[f"SH_DEGREE_{d}_COEF_{n}"] for d in range(4) for n in range(2 * d + 1)]
        before = np.einsum("dk,knc->dnc", basis(directions(), 3), np.array(stored))
        np.testing.assert_allclose(seen(g, directions() @ (TURN @ left @ right).T), before, atol=1e-5)


def test_far_from_the_origin_means_stay_apart(read):
    """As in tiles of the globe; float32 would leave half a metre there."""
    g = read(cloud_glb(30, 0, nodes=[{"mesh": 0, "translation": [6.4e6, 1.0, 0.0]}]), "a.glb")
    assert g.means.dtype == np.float64
    np.testing.assert_allclose(g.means[:, 0] - 6.4e6, cloud_arrays(30, 0)["POSITION"][:, 0], atol=1e-6)


def test_clouds_are_put_together(read):
    """Of several primitives, meshes and nodes, one mesh twice; triangles are left out, degrees filled up."""
    first, second = cloud_arrays(4, 0), cloud_arrays(3, 2, seed=1)
    gltf = Gltf()
    triangles = {"attributes": {"POSITION": gltf.accessor(np.eye(3))}}
    gltf.mesh(gltf.cloud(first), triangles, gltf.cloud(second))
    gltf.mesh(triangles)
    nodes = [{"mesh": 0}, {"mesh": 1}, {"mesh": 0, "translation": [10.0, 0.0, 0.0]}]
    g = read(gltf.packed(nodes), "a.glb")
    assert (len(g), g.sh_degree) == (14, 2)
    x = np.concatenate([first["POSITION"], second["POSITION"]])[:, 0]
    np.testing.assert_allclose(g.means[:, 0], np.concatenate([x, x + 10]), atol=1e-6)
    assert not g.harmonics[:4, 1:].any()
    assert g.harmonics[4:7, 1:].any()


def test_the_scene_says_what_is_shown(read):
    gltf = Gltf()
    for seed in (0, 1):
        gltf.mesh(gltf.cloud(cloud_arrays(4 + seed, 0, seed)))
    nodes = [{"mesh": 0}, {"children": [2]}, {"mesh": 1}]
    assert len(read(gltf.packed(nodes, scenes=[{"nodes": [0]}, {"nodes": [1]}], scene=1), "a.glb")) == 5
    assert len(read(gltf.packed(nodes, scenes=None, scene=None), "a.glb")) == 9
    with pytest.raises(SplatFormatError, match="does not show the splat that it holds"):
        read(gltf.packed(nodes, scenes=[{}]), "a.glb")


# --- accessors


def test_quantised_attributes(read):
    """Normalised: c / 127, c / 32767 (at least -1), c / 255, c / 65535; whole numbers as they are."""
    arrays = cloud_arrays(4, 0)
    gltf = Gltf()
    rotations = np.array([[0, 0, 0, 127], [-128, 0, 0, 0], [90, 90, 0, 0], [0, 90, 0, -90]], "i1")
    arrays["ROTATION"] = gltf.accessor(rotations, normalized=True)
    arrays["OPACITY"] = gltf.accessor(np.array([0, 1, 65535, 32768], "<u2"), normalized=True)
    arrays["SCALE"] = gltf.accessor(np.array([[0, 1, 255], [2, 3, 4], [5, 6, 7], [8, 9, 10]], "u1"), normalized=True)
    arrays["POSITION"] = gltf.accessor(np.array([[1, -2, 3], [0, 0, 0], [4, 5, 6], [300, 0, 0]], "<i2"))
    gltf.mesh(gltf.cloud(arrays))
    g = read(gltf.packed(), "a.glb")
    np.testing.assert_allclose(g.quaternions[0], [1, 0, 0, 0])
    np.testing.assert_allclose(g.quaternions[1], [0, -1, 0, 0])
    np.testing.assert_allclose(g.opacities, [0, 1 / 65535, 1, 32768 / 65535], rtol=1e-6)
    np.testing.assert_allclose(g.scales[0], [0, 1 / 255, 1], rtol=1e-6)
    assert g.means.tolist() == [[1, 2, -3], [0, 0, 0], [4, -5, -6], [300, 0, 0]]


def test_rows_between_other_rows(read):
    """One bufferView for all, with a byteStride."""
    arrays = cloud_arrays(6, 0)
    table = np.concatenate([np.asarray(a).reshape(6, -1) for a in arrays.values()], axis=1).astype("<f4")
    gltf = Gltf()
    view = gltf.view(table.tobytes(), byteStride=table.strides[0])
    place, numbers = 0, {}
    for name, array in arrays.items():
        width = np.asarray(array).reshape(6, -1).shape[1]
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[width]
        entry = {"bufferView": view, "byteOffset": place, "componentType": 5126, "count": 6, "type": kind}
        gltf.accessors.append(entry)
        numbers[name] = len(gltf.accessors) - 1
        place += 4 * width
    gltf.mesh(gltf.cloud(numbers))
    g, expected = read(gltf.packed(), "a.glb"), read(cloud_glb(6, 0), "b.glb")
    for name in ("means", "quaternions", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(g, name), getattr(expected, name))


@pytest.mark.parametrize("alone", [True, False])
def test_sparse_accessors(read, alone):
    """Rows 1 and 3 are replaced, of zeros or of others."""
    arrays = cloud_arrays(5, 0)
    gltf = Gltf()
    opacities = gltf.accessor(np.full(5, 0.25))
    entry = gltf.accessors[opacities]
    if alone:
        del entry["bufferView"]
    entry["sparse"] = {
        "count": 2,
        "indices": {"bufferView": gltf.view(np.array([1, 3], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": gltf.view(np.array([0.5, 0.75], "<f4").tobytes())},
    }
    gltf.mesh(gltf.cloud({**arrays, "OPACITY": opacities}))
    other = 0 if alone else 0.25
    assert read(gltf.packed(), "a.glb").opacities.tolist() == [other, 0.5, other, 0.75, other]


# --- drafts


def test_logarithms_of_the_draft_of_2025(tmp_path):
    """No scale is negative, so one that is tells of logarithms, of all."""
    arrays = cloud_arrays(20, 1)
    gltf = Gltf()
    gltf.mesh(gltf.cloud({**arrays, "SCALE": np.log(arrays["SCALE"])}))
    (tmp_path / "a.glb").write_bytes(gltf.packed())
    g, kind = read_with_kind(tmp_path / "a.glb")
    assert kind == "glb, with logarithms for scales"
    np.testing.assert_allclose(g.scales, arrays["SCALE"], rtol=1e-5)


@pytest.mark.parametrize("bytes_", [True, False])
def test_names_and_colours_of_the_first_draft(read, bytes_):
    """_SCALE and _ROTATION, and COLOR_0 for the constant harmonic and the opacity; nothing said of the kernel."""
    arrays = cloud_arrays(9, 1)
    rgba = np.random.default_rng(1).uniform(size=(9, 4))
    gltf = Gltf()
    stored = (rgba * 255).round().astype("u1") if bytes_ else rgba
    named = {f"_{n}": a for n, a in arrays.items() if n in ("SCALE", "ROTATION") or n.startswith("SH_DEGREE_1")}
    colour = gltf.accessor(stored, **({"normalized": True} if bytes_ else {}))
    primitive = gltf.cloud({"POSITION": arrays["POSITION"], "COLOR_0": colour, **named})
    primitive["extensions"][KHR] = {}
    gltf.mesh(primitive)
    g = read(gltf.packed(), "a.glb")
    off = 0.5 / 255 + 1e-6 if bytes_ else 1e-6
    np.testing.assert_allclose(C0 * g.harmonics[:, 0] + 0.5, rgba[:, :3], atol=off)
    np.testing.assert_allclose(g.opacities, rgba[:, 3], atol=off)
    assert g.sh_degree == 1
    agree(g.covariances(), expected_covariances(arrays), 1e-6)


@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize(
    "name",
    [
        "KHR_gaussian_splatting_compression_spz_2",
        "KHR_gaussian_splatting_compression_spz",
        "KHR_spz_gaussian_splats_compression",
    ],
)
def test_what_is_packed_as_spz_is_what_the_spz_is(build, read, tmp_path, name, version):
    content = build.spz(version, 7, 2)[0]
    (tmp_path / "a.glb").write_bytes(spz_glb(content, name))
    g, kind = read_with_kind(tmp_path / "a.glb")
    assert kind == "glb, packed as spz"
    expected = read(content, "a.spz")
    for field in ("means", "quaternions", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(g, field), getattr(expected, field))


def test_rows_that_are_not_finite_are_kept(read):
    arrays = cloud_arrays(6, 1)
    for k, name in enumerate(("POSITION", "ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0")):
        arrays[name][k] = np.nan
    for node in ({}, TILT, SQUEEZE):
        gltf = Gltf()
        gltf.mesh(gltf.cloud(arrays))
        g = read(gltf.packed([{"mesh": 0, **node}]), "a.glb")
        for k, field in enumerate(("means", "quaternions", "scales", "opacities", "harmonics")):
            bad = ~np.isfinite(getattr(g, field)).reshape(6, -1).all(axis=1)
            # What a node stretches has no scales where it has no axes.
            assert np.flatnonzero(bad).tolist() == ([1, 2] if field == "scales" and node is SQUEEZE else [k])


# --- damage

PLAIN = {"mesh": 0}


def changed(**changes):
    return lambda: cloud_glb(**changes)


def with_primitive(change):
    """A .glb whose primitive was changed."""

    def make():
        gltf = Gltf()
        primitive = gltf.cloud(cloud_arrays())
        change(gltf, primitive)
        gltf.mesh(primitive)
        return gltf.packed()

    return make


def with_accessor(name, **changes):
    def change(gltf, primitive):
        gltf.accessors[primitive["attributes"][name if name == "POSITION" else f"{KHR}:{name}"]].update(changes)

    return with_primitive(change)


def without(name):
    return with_primitive(lambda gltf, primitive: primitive["attributes"].pop(f"{KHR}:{name}"))


def about(**changes):
    return with_primitive(lambda gltf, primitive: primitive["extensions"][KHR].update(changes))


def sparse(**changes):
    def change(gltf, primitive):
        entry = {
            "count": 2,
            "indices": {"bufferView": gltf.view(np.array([1, 9], "u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": gltf.view(np.zeros(2, "<f4").tobytes())},
        }
        gltf.accessors[primitive["attributes"][f"{KHR}:OPACITY"]]["sparse"] = {**entry, **changes}

    return with_primitive(change)


def raw(text, binary=b""):
    from splat_files import glb

    return lambda: glb(text, binary)


def whole(start, stop=None, filled=None):
    def make():
        content = cloud_glb()
        return content[:start] + (filled or b"") + (content[stop:] if stop is not None else b"")

    return make


REFUSED = {
    "header cut": (whole(15), "ends within its header"),
    "file cut": (whole(-1), "ends too early: its header says"),
    "half of it": (whole(900), "ends too early"),
    "version 1": (whole(4, 8, struct.pack("<I", 1)), "glTF of version 1"),
    "json cut": (lambda: cloud_glb()[:12] + struct.pack("<I", 1 << 30) + cloud_glb()[16:], "ends within its JSON"),
    "no json": (whole(16, 20, b"NOSJ"), "something else where its JSON belongs"),
    "wrong json": (raw(b'{"asset": '), "its JSON cannot be read"),
    "json list": (raw(b"[]"), "holds no object"),
    "json deep": (raw(b'{"asset":' + b"[" * 100_000), "nested too deep"),
    "json NaN": (raw(b'{"asset": NaN}'), "NaN is no number"),
    "json long": (raw(b'{"asset": "' + b"x" * (1 << 21) + b'"}'), "its JSON is .* bytes long; write the splat into"),
    "nothing": (raw(b"{}"), "is no splat; of a mesh `gasp convert` makes one, and a collider takes the mesh itself"),
    "nodes below themselves": (changed(nodes=[{"mesh": 0, "children": [0]}], scenes=[{"nodes": [0]}]), "hangs below"),
    "node of two": (changed(nodes=[{"children": [2]}, {"children": [2]}, PLAIN]), "hangs below two others"),
    "no such node": (changed(scenes=[{"nodes": [7]}]), r"names nodes\[7\], there are 1"),
    "no such mesh": (changed(nodes=[{"mesh": 3}]), r"names meshes\[3\], there are 1"),
    "node no number": (changed(scenes=[{"nodes": ["a"]}]), "for scenes.0..nodes, where a list of whole numbers"),
    "node flat": (changed(nodes=[{"mesh": 0, "scale": [1, 0, 1]}]), r"nodes\[0\] squeezes"),
    "node infinite": (changed(nodes=[{"mesh": 0, "scale": [1e300] * 3, "children": [1]}, PLAIN]), "squeezes"),
    "node beyond": (
        changed(nodes=[{"scale": [1e300] * 3, "children": [1]}, {"mesh": 0, "scale": [1e300] * 3}]),
        "beyond all bounds",
    ),
    "node projects": (changed(nodes=[{"mesh": 0, "matrix": [1.0] * 16}]), "an affine map belongs"),
    "matrix short": (changed(nodes=[{"mesh": 0, "matrix": [1.0] * 15}]), "a list of 16 numbers belongs"),
    "many at once": (
        changed(nodes=[{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}]),
        "EXT_mesh_gpu_instancing, which is not read; export a node for each",
    ),
    "many copies": (changed(count=1000, nodes=[PLAIN] * 2000), "its 2,000,000 Gaussians would take .* cannot honestly"),
    "huge count": (with_accessor("POSITION", count=10**15), "more Gaussians than any file can hold"),
    "large count": (with_accessor("POSITION", count=10**9), "would take .* cannot honestly mean"),
    "count beyond": (
        with_primitive(lambda gltf, p: [entry.update(count=6) for entry in gltf.accessors]),
        r"its SH_DEGREE_0_COEF_0 needs 72 bytes in rows of 12, bufferViews\[4\] has 60",
    ),
    "no rows": (with_accessor("POSITION", count=0), "declares 0 Gaussians"),
    "counts differ": (with_accessor("SCALE", count=4), "it has 5 positions, but 4 of SCALE"),
    "another type": (with_accessor("SCALE", type="VEC2"), "SCALE is of type 'VEC2', where VEC3 belongs"),
    "unknown numbers": (with_accessor("SCALE", componentType=5130), "unknown componentType 5130"),
    "offset beyond": (with_accessor("SCALE", byteOffset=8), "its SCALE needs 68 bytes"),
    "huge offset": (with_accessor("SCALE", byteOffset=10**30), "its SCALE needs"),
    "negative offset": (with_accessor("SCALE", byteOffset=-4), "where a whole number belongs"),
    "view beyond": (
        lambda: cloud_glb(bufferViews=[{"buffer": 0, "byteLength": 10**9}] * 8),
        r"bufferViews\[4\] ends at byte 1,000,000,000 of",
    ),
    "narrow stride": (
        with_primitive(lambda gltf, primitive: [view.update(byteStride=4) for view in gltf.views]),
        "in rows of 4",
    ),
    "no such accessor": (
        with_primitive(lambda gltf, primitive: primitive["attributes"].update(POSITION=99)),
        r"names accessors\[99\]",
    ),
    "numbers elsewhere": (changed(buffers=[{"byteLength": 9, "uri": "a.bin"}]), "numbers lie outside of it"),
    "meshopt": (
        with_primitive(lambda gltf, p: [v.update(extensions={"EXT_meshopt_compression": {}}) for v in gltf.views]),
        "its numbers are packed by 'EXT_meshopt_compression', which is not read",
    ),
    "packed otherwise": (about(extensions={"XX_packed": {}}), "has the extension 'XX_packed', which is not read"),
    "placeholder": (
        with_primitive(lambda gltf, p: gltf.accessors[0].pop("bufferView")),
        "its POSITION has no bufferView, so an extension packs it",
    ),
    "another kernel": (about(kernel="box"), "has the kernel 'box', which is not read; export it with 'ellipse'"),
    "linear colours": (about(colorSpace="lin_rec709_display"), "colorSpace 'lin_rec709_display', which is not read"),
    "kernel a list": (about(kernel=["ellipse"]), "has the kernel"),
    "triangles": (with_primitive(lambda gltf, p: p.update(mode=4)), "no cloud of points"),
    "no rotations": (without("ROTATION"), "its splat has no ROTATION"),
    "no scales": (without("SCALE"), "its splat has no SCALE"),
    "no opacities": (without("OPACITY"), "its splat has no OPACITY"),
    "no colours": (without("SH_DEGREE_0_COEF_0"), "its splat has no SH_DEGREE_0_COEF_0"),
    "part of a degree": (without("SH_DEGREE_1_COEF_1"), "its splat has no SH_DEGREE_1_COEF_1"),
    "sparse beyond": (sparse(), "OPACITY replaces row 9 of 5"),
    "sparse too many": (sparse(count=10**12), "a sparse part of 1,000,000,000,000 rows of 5"),
    "sparse of reals": (sparse(indices={"bufferView": 0, "componentType": 5126}), "that is damaged"),
    "spz of nothing": (
        about(extensions={"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}),
        r"\.spz version \d+ is unknown",
    ),
    "spz nowhere": (
        about(extensions={"KHR_gaussian_splatting_compression_spz_2": {}}),
        "where a whole number belongs",
    ),
    "opacity of 2": (
        with_primitive(lambda gltf, p: p["attributes"].update({f"{KHR}:OPACITY": gltf.accessor(np.full(5, 2.0))})),
        "Gaussian 0 has the opacity 2, where 0 to 1 belongs",
    ),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line(tmp_path, case):
    import tracemalloc

    content, says = REFUSED[case]
    path = tmp_path / "a.glb"
    path.write_bytes(content())
    tracemalloc.start()
    try:
        with pytest.raises(SplatFormatError, match=says) as refused:
            read_splat(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    text = str(refused.value)
    assert text.isprintable()
    assert text.startswith(f"{path}: ")
    assert text.rsplit(";", 1)[-1].strip()
    # JSON of a megabyte may become 25 of objects; nothing is made by what a file merely says.
    assert peak < 4 * path.stat().st_size + (40 << 20)


def test_text_of_gltf_is_told_what_to_do(read):
    with pytest.raises(SplatFormatError, match=r"is glTF as text, .*; export it as one \.glb"):
        read(b'{"asset": {"version": "2.0"}}', "a.gltf")
