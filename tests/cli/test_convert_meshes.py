"""``gasp convert`` of meshes."""

import numpy as np
import pytest

from gasp_core.io import read_splat

trimesh = pytest.importorskip("trimesh")


def test_a_mesh_becomes_a_splat(gasp, workplace):
    trimesh.creation.box(extents=(1, 2, 3)).export(workplace / "box.glb")
    outcome = gasp("convert", "box.glb", "box.ply", "--gaussians", 600)
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.splitlines()[0] == "box.ply: 600 Gaussians"
    splat = read_splat(workplace / "box.ply")
    # In a .glb +y is up; trained splats have -y up.
    assert np.allclose(np.ptp(splat.means, axis=0), [1, 2, 3], atol=0.2)
    trimesh.creation.cone(radius=0.3, height=2.0).export(workplace / "cone.stl")
    assert gasp("convert", "cone.stl", "cone.ply", "--gaussians", 600).status == 0
    cone = read_splat(workplace / "cone.ply")
    narrow, wide = cone.means[:, 1] < -1.5, cone.means[:, 1] > -0.5
    assert np.ptp(cone.means[narrow, 0]) < 0.5 * np.ptp(cone.means[wide, 0]), "the tip of the cone is up, at -y"
    told = gasp("convert", "cone.stl", "grey.ply").out
    assert "has no colours: it is grey" in told and "200," in told


def test_refused(refused, workplace):
    refused("convert", "toy.ply", "other.ply", "--gaussians", 5, says=["--gaussians and --up are of meshes"])
    trimesh.creation.box().export(workplace / "box.glb")
    (workplace / "cut.glb").write_bytes((workplace / "box.glb").read_bytes()[:99])
    refused("convert", "cut.glb", "other.ply", says=["cut.glb: is no whole .glb mesh"])
    refused("inspect", "box.glb", says=["box.glb: is no splat; of a mesh `gasp convert` makes one"])
    assert not (workplace / "other.ply").exists()
