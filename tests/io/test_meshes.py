"""Meshes of four formats, whole and damaged."""

import os

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io.meshes import MESH_SUFFIXES, read_mesh
from gasp_core.io.moved_meshes import read_mesh_as_it_is
from gasp_core.io.painted_meshes import read_painted_mesh

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def written(tmp_path):
    def write(suffix, mesh=None):
        path = tmp_path / f"mesh{suffix}"
        (mesh or trimesh.creation.box(extents=(1, 2, 3))).export(path)
        return path

    return write


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_a_box_comes_back(written, suffix):
    mesh = read_mesh(written(suffix))
    assert len(mesh.faces) == 12
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(6.0, rel=1e-6)  # single precision in .stl and .glb


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
@pytest.mark.parametrize("kept", [0, 1, 17, 84, 200])
def test_a_truncated_file_says_so_in_a_line(written, suffix, kept):
    path = written(suffix)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(SplatFormatError) as caught:
        read_mesh(path)
    assert path.name in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_bytes_of_chance_are_read_or_refused(written, suffix):
    path = written(suffix)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), rng.integers(1, 9)):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            mesh = read_mesh(path)
        except SplatFormatError as refused:
            assert "\n" not in str(refused)
        else:
            assert np.isfinite(mesh.vertices).all() and mesh.faces.max() < len(mesh.vertices)


def test_triangles_without_area_are_left_out(written):
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]]
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2], [0, 1, 3], [1, 1, 2]], process=False)
    assert len(read_mesh(written(".ply", mesh)).faces) == 1


def test_nothing_beside_the_file_is_opened(tmp_path):
    (tmp_path / "other.mtl").write_text("newmtl a\nmap_Kd other.png\n")
    (tmp_path / "mesh.obj").write_text("mtllib other.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(read_mesh(tmp_path / "mesh.obj").faces) == 1


def test_other_files_are_no_meshes(tmp_path):
    with pytest.raises(SplatFormatError, match=r"is no mesh that is read here: \.obj, \.glb"):
        read_mesh(tmp_path / "mesh.blend")
    with pytest.raises(SplatFormatError, match="cannot be read"):
        read_mesh(tmp_path / "gone.obj")


def test_what_has_no_end_is_no_mesh(tmp_path):
    os.mkfifo(tmp_path / "endless.obj")
    with pytest.raises(SplatFormatError, match="is no ordinary file"):
        read_mesh(tmp_path / "endless.obj")


def test_vertices_that_are_not_finite_leave_no_hole_behind(tmp_path):
    """Left out with their faces they would open a closed body."""
    ball = trimesh.creation.icosphere(1)
    lines = ball.export(file_type="obj").splitlines()
    first = next(row for row, line in enumerate(lines) if line.startswith("v "))
    lines[first + 3] = "v nan 0 0"
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    for read in (read_mesh, read_painted_mesh, read_mesh_as_it_is):
        with pytest.raises(
            SplatFormatError, match=r"ball\.obj: 1 vertex is not finite, the first is \d+: mend the mesh"
        ):
            read(tmp_path / "ball.obj")
