"""Splats as they leave, read by Blender's own importer: what add-ons for splats begin with, there."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import plyfile
import pytest

from gasp_core.discovery.environments import ready_python
from gasp_core.discovery.registry import discover
from gasp_core.gaussians import Gaussians
from gasp_core.io import write_splat
from gasp_core.toy import make_toy

READ = """
import sys
import bpy, numpy as np
bpy.ops.wm.ply_import(filepath=sys.argv[1], import_attributes=True)
mesh = bpy.context.object.data
found = {}
for one in mesh.attributes:
    if one.domain == "POINT":
        width = 3 if one.data_type == "FLOAT_VECTOR" else 1
        values = np.empty(width * len(mesh.vertices), np.float32)
        one.data.foreach_get("vector" if width == 3 else "value", values)
        found[one.name] = values
np.savez(sys.argv[2], **found)
"""


@pytest.mark.parametrize("degree", [0, 3])
def test_blenders_importer_reads_every_property_to_the_bit(kit, tmp_path, degree):
    toy = make_toy(300)
    harmonics = np.random.default_rng(0).normal(size=(len(toy), (degree + 1) ** 2, 3))
    splat = Gaussians(
        means=toy.means, scales=toy.scales, quaternions=toy.quaternions, opacities=toy.opacities, harmonics=harmonics
    )
    path, read = tmp_path / "frame_0000.ply", tmp_path / "read.npz"
    write_splat(path, splat)
    python = ready_python(discover().descriptor("blender"))
    command = [str(python), "-c", READ, str(path), str(read)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0 and Path(read).exists(), run.stderr[-500:]
    rows = plyfile.PlyData.read(path)["vertex"]
    with np.load(read) as found:
        places = found["position"].reshape(-1, 3)
        np.testing.assert_array_equal(places, np.stack([rows[axis] for axis in "xyz"], axis=1))
        names = [one.name for one in rows.properties if one.name not in ("x", "y", "z", "nx", "ny", "nz")]
        assert len(names) == 3 + 3 * ((degree + 1) ** 2 - 1) + 1 + 3 + 4
        for name in names:
            np.testing.assert_array_equal(found[name], rows[name])
