"""The process that Blender is in: how it ends, what it leaves, and what only Blender itself can be asked."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from time import sleep

import gasp_blender
import pytest

import gasp_core
from gasp_core.discovery.environments import ready_python
from gasp_core.discovery.registry import discover

ROUNDING = 2.0**-24


def in_its_environment(code):
    """A Python in the engine's environment that runs `code`, in a process group of its own."""
    python = ready_python(discover().descriptor("blender"))
    homes = [str(Path(package.__file__).parents[1]) for package in (gasp_core, gasp_blender)]
    surroundings = os.environ | {"PYTHONPATH": os.pathsep.join(homes)}
    # What is printed is to wait in a buffer, as it does wherever nobody asks otherwise.
    surroundings.pop("PYTHONUNBUFFERED", None)
    return subprocess.run(
        [str(python), "-c", code],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=surroundings,
        start_new_session=True,
    )


def test_the_process_ends_with_its_status_and_nothing_printed(kit):
    """Blender prints to standard output, and its clearing up crashes outside the main thread, or hangs."""
    run = in_its_environment(
        "import sys, threading\n"
        "from gasp_blender.engine import Blender\n"
        "thread = threading.Thread(target=Blender); thread.start(); thread.join()\n"
        "sys.exit(7)\n"
    )
    assert (run.returncode, run.stdout) == (7, ""), run.stderr[-500:]


@pytest.mark.parametrize("ending", ["sys.exit(0)", "os._exit(3)", "os.killpg(os.getpid(), signal.SIGKILL)"])
def test_nothing_is_left_however_the_process_ends(kit, ending):
    """States of soft bodies lie in files, in memory where there is a folder for that, and Blender has a folder, too."""
    run = in_its_environment(
        "import os, signal, sys\n"
        "from gasp_blender.bpy_runtime import studio\n"
        "bpy, folder = studio()\n"
        "assert folder.is_dir() and os.path.isdir(bpy.app.tempdir)\n"
        "print(folder.parent, bpy.app.tempdir, flush=True)\n"
        f"{ending}\n"
    )
    folders = [Path(name) for name in run.stdout.split()]
    assert len(folders) == 2, run.stderr[-500:]
    # Who removes them waits for the end of the process, and may take a moment where much else runs.
    for _ in range(100):
        if not any(folder.exists() for folder in folders):
            break
        sleep(0.1)
    assert not [folder for folder in folders if folder.exists()]


def test_points_are_carried_as_blenders_lattice_carries_them(kit):
    """Trilinear weights are what its Lattice modifier has between linear keys."""
    run = in_its_environment(
        "import numpy as np\n"
        "from gasp_blender.cage import build_cage, gather\n"
        "from gasp_blender.meshes import mesh_object\n"
        "from gasp_blender.bpy_runtime import evaluated, new_scene, quiet, studio\n"
        "rng = np.random.default_rng(3)\n"
        "size, counts = np.array([0.4, 0.3, 0.2]), np.array([4, 3, 2])\n"
        "points = np.concatenate([rng.random((20_000, 3)), np.eye(3), 1 - np.eye(3)]) * size\n"
        "cage = build_cage(points, 0.0, 0.1, 1000)\n"
        "moves = rng.normal(0, 0.03, cage.nodes.shape)\n"
        "with quiet():\n"
        "    bpy, _ = studio()\n"
        "    scene = new_scene()\n"
        "    lattice = bpy.data.lattices.new('lattice')\n"
        "    lattice.points_u, lattice.points_v, lattice.points_w = (counts + 1).tolist()\n"
        "    for axis in 'uvw':\n"
        "        setattr(lattice, 'interpolation_type_' + axis, 'KEY_LINEAR')\n"
        "    keys = np.array([key.co for key in lattice.points])\n"
        "    spread = np.ptp(keys, axis=0)\n"
        "    places = (keys - keys.min(axis=0)) / spread * size\n"
        "    for key, rest, place in zip(lattice.points, keys, places):\n"
        "        node = int(np.argmin(np.abs(cage.nodes - place).sum(axis=1)))\n"
        "        assert np.abs(cage.nodes[node] - place).max() < 1e-6\n"
        "        key.co_deform = (rest + moves[node] * spread / size).tolist()\n"
        "    around = bpy.data.objects.new('around', lattice)\n"
        "    around.scale = (size / spread).tolist()\n"
        "    around.location = (-keys.min(axis=0) * size / spread).tolist()\n"
        "    scene.collection.objects.link(around)\n"
        "    carried = mesh_object(scene, points)\n"
        "    carried.modifiers.new('lattice', 'LATTICE').object = around\n"
        "    mesh = carried.evaluated_get(evaluated(scene, 1)).data\n"
        "    found = np.empty(points.size, np.float32)\n"
        "    mesh.vertices.foreach_get('co', found)\n"
        "found = found.reshape(-1, 3)\n"
        "ours = points + gather(cage, moves)\n"
        "print(np.abs(ours - found).max(), np.abs(ours - points).max())\n"
    )
    assert run.returncode == 0, run.stderr[-2000:]
    off, moved = map(float, run.stdout.split())
    # Some eight sums of products in float32, of numbers below the lattice's four keys, in voxels of 0.1 m.
    assert off < 8 * 4 * ROUNDING * 0.1 + 8 * ROUNDING * 0.4
    assert moved > 0.03
