"""Colliders made of captures and of meshes: how far their surfaces are off, in cells, and what they say of that.

    GASP_DATA=... python benchmarks/collider_fields.py [--only angel ...]

A capture's collider is held against one of itself on a grid twice as fine; a mesh's against its triangles, by libigl.
Places are within two cells of the surface. "Covered": share of them that are off by no more than the stated error.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

from gasp_core import SplatObject, read_splat
from gasp_core.scene.selection import place_object
from gasp_core.scene.solid_fields import field_of
from gasp_core.solid import SolidOptions
from gasp_core.solid.mesh_distance import field_of_mesh

DATA = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute() / "splats"
CAPTURES = {
    "angel": "statue-angel.sog",
    "massa": "statue-massa.sog",
    "peter": "statue-st-peter.sog",
    "skull": "skull.sog",
    "plant": "plant.splat",
    "guitar": "guitar.compressed.ply",
    "playbot": "playbot/2_0",
}
HEAD = f"{'collider':22}{'cells':>16}{'cell mm':>9}{'rms':>8}{'95 %':>8}{'largest':>9}{'stated':>8}{'covered %':>11}"


def row(name, field, errors, seconds):
    off = np.abs(errors) / field.spacing
    stated = field.error / field.spacing
    shape = "x".join(str(count) for count in field.values.shape)
    print(f"{name:22}{shape:>16}{1e3 * field.spacing:9.2f}{np.sqrt(np.mean(off**2)):8.3f}{np.percentile(off, 95):8.3f}"
          f"{off.max():9.2f}{stated:8.2f}{100 * np.mean(off <= stated):11.1f}{seconds:11.1f}", flush=True)  # fmt: skip


def beside(field, count=200_000, seed=0):
    """Places within two cells of a field's surface."""
    rng = np.random.default_rng(seed)
    size = field.spacing * (np.array(field.values.shape) - 1)
    places = np.asarray(field.origin) + size * rng.random((20 * count, 3))
    return places[np.abs(field.signed_distance(places)) < 2 * field.spacing][:count]


def collider_of(path, options):
    item = SplatObject(name=path.name, splat=path, height=0.4, static=True, solid=options)
    return field_of(place_object(item, read_splat(path)).solid(), path.name)


def captures(names):
    for name in names:
        path = DATA / CAPTURES[name]
        begin = time.perf_counter()
        field = collider_of(path, SolidOptions())
        seconds = time.perf_counter() - begin
        longest = max(field.values.shape) - 7
        finer = collider_of(path, SolidOptions(cells=2 * longest))
        places = beside(field)
        row(name, field, field.signed_distance(places) - finer.signed_distance(places), seconds)


def meshes():
    import igl
    import trimesh

    bodies = {
        "ball": trimesh.creation.icosphere(subdivisions=5, radius=0.2),
        "box": trimesh.creation.box(extents=(0.2, 0.3, 0.4)),
        "capsule": trimesh.creation.capsule(height=0.3, radius=0.1),
        "torus": trimesh.creation.torus(major_radius=0.15, minor_radius=0.05),
        "a million triangles": trimesh.creation.icosphere(subdivisions=8, radius=0.2),
    }
    for name, body in bodies.items():
        vertices, faces = np.asarray(body.vertices, dtype=np.float64), np.asarray(body.faces, dtype=np.int64)
        begin = time.perf_counter()
        field = field_of_mesh(vertices, faces, 96)
        seconds = time.perf_counter() - begin
        places = beside(field, count=50_000)
        sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
        true = igl.signed_distance(places, vertices, faces, sign_type=sign)[0]
        row(name, field, field.signed_distance(places) - true, seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=CAPTURES, default=list(CAPTURES))
    arguments = parser.parse_args()
    print(HEAD + f"{'made in s':>11}")
    meshes()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    captures(arguments.only)


if __name__ == "__main__":
    main()
