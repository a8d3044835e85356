"""The INRIA .ply in every shape it comes in."""

import io

import numpy as np
import plyfile
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io import read_splat, write_splat


def rows_of(some, build, degree=3, count=7, seed=0):
    """Names and numbers of an INRIA file, and the Gaussians in it but for rounding."""
    g = some(count, degree, seed)
    table = np.concatenate(
        [
            g.means,
            g.harmonics[:, 0],
            g.harmonics[:, 1:].transpose(0, 2, 1).reshape(count, 3 * (degree + 1) ** 2 - 3),
            np.log(g.opacities / (1 - g.opacities))[:, None],
            np.log(g.scales),
            g.quaternions,
        ],
        axis=1,
    )
    return build.inria_names(degree), table.astype(np.float32), g


def same(a, b):
    for field in ("means", "quaternions", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(a, field), getattr(b, field), equal_nan=True), field


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_every_degree_and_any_order_of_properties(some, build, read, degree):
    names, table, g = rows_of(some, build, degree)
    plain = read(build.ply([(name, "float") for name in names], table), "a.ply")
    assert plain.sh_degree == degree
    assert np.array_equal(plain.means, g.means)
    assert np.array_equal(plain.quaternions, g.quaternions)
    assert np.array_equal(plain.harmonics, g.harmonics)
    order = np.random.default_rng(1).permutation(len(names))
    shuffled = build.ply([(names[i], "float") for i in order], table[:, order])
    same(read(shuffled, "b.ply"), plain)


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_mixed_types_extra_properties_and_byte_orders(some, build, read, order):
    names, table, _ = rows_of(some, build, 1)
    plain = read(build.ply([(name, "float") for name in names], table), "a.ply")
    kinds = dict.fromkeys(names, "float") | {"opacity": "double", "rot_2": "double", "f_dc_1": "double"}
    extra = [("nx", "float"), ("label", "uchar"), ("transform", "int")]
    properties = [extra[0], *((name, kinds[name]) for name in names), *extra[1:]]
    filled = np.concatenate([np.full((len(table), 1), 9.0), table, np.full((len(table), 2), 3.0)], axis=1)
    content = build.ply(properties, filled, order=order, comments=["comment end_header is not here", "obj_info x"])
    same(read(content, "b.ply"), plain)
    oracle = plyfile.PlyData.read(io.BytesIO(content))["vertex"]
    assert np.array_equal(read(content, "c.ply").quaternions[:, 2], oracle["rot_2"].astype(np.float32))


def test_carriage_returns_and_other_elements(some, build, read):
    names, table, _ = rows_of(some, build, 0)
    content = build.ply([(name, "float") for name in names], table)
    plain = read(content, "a.ply")
    head, body = content.split(b"end_header\n", 1)
    same(read(head.replace(b"\n", b"\r\n") + b"end_header\r\n" + body, "b.ply"), plain)
    camera = b"element camera 2\nproperty double angle\nproperty uchar kind\nelement vertex"
    face = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    padded = head.replace(b"element vertex", camera) + face + bytes(18) + body + b"\x03" + bytes(12)
    same(read(padded, "c.ply"), plain)


def test_double_positions_stay_double(some, build, read):
    names, table, _ = rows_of(some, build, 0)
    wide = table.astype(np.float64)
    wide[:, :3] += 1e6
    g = read(build.ply([(name, "double" if name in "xyz" else "float") for name in names], wide), "a.ply")
    assert g.means.dtype == np.float64
    assert np.array_equal(g.means, wide[:, :3])


@pytest.mark.parametrize(("flat_axis", "thin"), [(2, 2), (0, 0)])
def test_two_scales_are_a_disc(some, build, read, flat_axis, thin):
    names, table, _ = rows_of(some, build, 0)
    keep = [i for i, name in enumerate(names) if name != "scale_2"]
    content = build.ply([(names[i], "float") for i in keep], table[:, keep])
    g = read(content, "a.ply", flat_axis=flat_axis)
    assert np.all(g.scales[:, thin] == 0)
    logs = table[:, [names.index("scale_0"), names.index("scale_1")]].astype(np.float64)
    assert np.array_equal(np.delete(g.scales, thin, axis=1), np.exp(logs).astype(np.float32))
    # The normal is the axis without extent: no variance along it.
    from gasp_core.gaussians import rotation_matrices

    normal = rotation_matrices(g.quaternions)[:, :, thin]
    variance = np.einsum("ni,nij,nj->n", normal, g.covariances(), normal)
    assert np.all(np.abs(variance) <= 1e-14 * g.scales.max() ** 2)


def test_a_missing_scale_is_the_thin_one(some, build, read):
    names, table, _ = rows_of(some, build, 0)
    keep = [i for i, name in enumerate(names) if name != "scale_0"]
    g = read(build.ply([(names[i], "float") for i in keep], table[:, keep]), "a.ply")
    assert np.all(g.scales[:, 0] == 0)
    assert np.all(g.scales[:, 1:] > 0)


def test_non_finite_rows_are_kept(some, build, read):
    names, table, _ = rows_of(some, build, 0)
    table[2, 0], table[3, names.index("scale_1")], table[4, names.index("opacity")] = np.nan, np.inf, -np.inf
    g = read(build.ply([(name, "float") for name in names], table), "a.ply")
    assert len(g) == len(table)
    assert np.isnan(g.means[2, 0])
    assert np.isinf(g.scales[3, 1])
    assert g.opacities[4] == 0


def test_what_is_written_is_what_plyfile_reads(some, tmp_path):
    g = some(1000, 3)
    write_splat(tmp_path / "a.ply", g)
    data = plyfile.PlyData.read(tmp_path / "a.ply")
    vertex = data["vertex"]
    names = [p.name for p in vertex.properties]
    assert names[:9] == ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    assert names[9:54] == [f"f_rest_{i}" for i in range(45)]
    assert names[54:] == ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    assert all(p.val_dtype == "f4" for p in vertex.properties)
    assert np.array_equal(vertex["f_rest_16"], g.harmonics[:, 2, 1])
    assert not (tmp_path / "a.ply").read_bytes().startswith(b"ply\r")


def test_zero_and_one_are_written_without_infinities(some, tmp_path):
    g = some(4, 0).with_(
        opacities=np.array([0, 1, 0.5, 1 - 2.0**-24], np.float32),
        scales=np.array([[0, 1, 2], [1e-38, 1, 1], [3, 0, 0], [1e30, 1, 1]], np.float32),
    )
    write_splat(tmp_path / "a.ply", g)
    vertex = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    assert all(np.isfinite(vertex[p.name]).all() for p in vertex.properties)
    back = read_splat(tmp_path / "a.ply")
    assert np.array_equal(back.opacities, g.opacities)
    assert np.array_equal(back.scales == 0, g.scales == 0)


def test_missing_properties_are_named(some, build, read):
    names, table, _ = rows_of(some, build, 0)
    keep = [i for i, name in enumerate(names) if name not in ("opacity", "rot_1")]
    with pytest.raises(SplatFormatError, match=r"a\.ply: .*lacks the properties rot_1, opacity"):
        read(build.ply([(names[i], "float") for i in keep], table[:, keep]), "a.ply")
