"""Splats in glTF and USD, where the command takes a splat file."""

import json

import numpy as np
import pytest
import splat_files

from gasp_core import load_scene
from gasp_core.io import read_splat


@pytest.fixture(params=[".glb", ".usdc"])
def other(request, gasp, workplace):
    """Name of the toy's splat in another format."""
    if request.param == ".usdc":
        pytest.importorskip("pxr", reason='no usd-core here: pip install "gasp-core[usd]"')
    assert gasp("convert", "toy.ply", f"other{request.param}").status == 0
    return f"other{request.param}"


def test_inspected_converted_and_simulated_as_the_ply(gasp, workplace, other):
    told, expected = (json.loads(gasp("inspect", name, "--json").out) for name in (other, "toy.ply"))
    for part in ("count", "sh_degree", "extents", "scale", "opacity"):
        assert told[part] == expected[part]
    assert gasp("convert", other, "back.ply").status == 0
    assert np.array_equal(read_splat(workplace / "back.ply").means, read_splat(workplace / "toy.ply").means)
    assert gasp("run", "scene.toml", "--set", f"object.toy.splat={other}").status == 0
    assert gasp("new", other, "--yes", "-o", "new.toml").status == 0
    assert load_scene(workplace / "new.toml").objects[0].splat == workplace / other


def test_no_scene_file(refused, workplace, other):
    refused("run", other, says=[f"{other}: is a splat, and no scene file: gasp new {other} writes a scene of it"])


def test_a_splat_is_no_mesh(refused, workplace):
    pytest.importorskip("trimesh")
    (workplace / "a.glb").write_bytes(splat_files.cloud_glb())
    refused("convert", "a.glb", "b.ply", "--gaussians", 9, says=["--gaussians and --up are of meshes"])
    refused("bind", "toy.ply", "a.glb", "a.glb", says=["a.glb: has no triangle with an area, but a splat"])
