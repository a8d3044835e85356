"""Bodies behind splats: errors against shells whose body is known, volumes of captures by the cells, and time.

    GASP_DATA=... python benchmarks/solids.py [--seeds 5]

Errors are means over the seeds, in percent of the volume, of the size (centre) and of the largest moment (inertia), and
in cells of 1/64 for distances within two cells of the surface: root mean square, and the largest of all seeds. "seen":
how far off the body's surface, in details, what one sees of a capture is, sheets left out: quartiles, with every
Gaussian counted alike (surface = "middle") and by default.
"""

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from seen_surface import places_seen
from splat_shells import SHAPES, shell

from gasp_core import SplatObject, read_splat
from gasp_core.scene.selection import place_object
from gasp_core.solid import Sheets, SolidOptions, solid_of

DATA = Path(os.environ.get("GASP_DATA", "../shared/data")).absolute() / "splats"
CAPTURES = (
    "statue-angel.sog",
    "statue-massa.sog",
    "statue-st-peter.sog",
    "skull.sog",
    "plant.splat",
    "guitar.compressed.ply",
)
CELLS = 64


def errors(shape, **options):
    solid = solid_of(shell(shape, **options), SolidOptions(cells=CELLS))
    found = replace(solid, sheets=Sheets.none()).mass_properties()
    expected = shape.volume * np.array(shape.inertia)
    nodes = solid.grid.origin + solid.grid.spacing * np.indices(solid.grid.shape).reshape(3, -1).T
    true = shape.distance(nodes)
    off = ((solid.distance.reshape(-1) - true) / solid.grid.spacing)[np.abs(true) < 2 * solid.grid.spacing]
    return (
        100 * abs(found.volume / shape.volume - 1),
        100 * np.abs(found.centre - shape.centre).max() / shape.size,
        100 * np.abs(np.diag(found.inertia) - expected).max() / expected.max(),
        np.sqrt(np.mean(off**2)),
        np.abs(off).max(),
    )


def off_what_one_sees(gaussians, solid):
    """Quartiles of the distance to the surface, in details, of what one sees and is no sheet."""
    places = places_seen(gaussians, 100)
    if len(solid.sheets.positions):
        places = places[KDTree(solid.sheets.positions).query(places)[0] > solid.detail]
    return np.percentile(solid.distance_at(places) / solid.detail, [25, 50, 75])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    print(f"{'shell':12}{'':8}{'volume %':>10}{'centre %':>10}{'inertia %':>11}{'distance':>10}{'largest':>9}")
    for name, shape in SHAPES.items():
        for kind, flaws in (("clean", {}), ("noisy", {"holes": 0.05, "noise": 0.5 * shape.size / CELLS})):
            rows = np.array([errors(shape, seed=seed, **flaws) for seed in range(arguments.seeds)])
            volume, centre, inertia, distance, _ = rows.mean(axis=0)
            print(
                f"{name:12}{kind:8}{volume:10.2f}{centre:10.2f}{inertia:11.2f}{distance:10.3f}{rows[:, 4].max():9.2f}"
            )
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    cells = (32, 48, 64, 96)
    print(f"\n{'capture':24}{'Gaussians':>10}" + "".join(f"{f'{count} cells':>16}" for count in cells)
          + f"{'found in s':>12}")  # fmt: skip
    for name in CAPTURES:
        item = SplatObject(name=name, splat=DATA / name, height=0.4, static=True)
        gaussians = place_object(item, read_splat(DATA / name)).gaussians
        begin = time.perf_counter()
        solid_of(gaussians)
        seconds = time.perf_counter() - begin
        solids = [solid_of(gaussians, SolidOptions(cells=count)) for count in cells]
        told = [f"{1e3 * one.volume:.3f} +- {1e3 * one.doubts.volume_uncertainty:.3f}" for one in solids]
        print(f"{name:24}{len(gaussians):10,}" + "".join(f"{each:>16}" for each in told) + f"{seconds:12.1f}",
              flush=True)  # fmt: skip
    print("(litres at a height of .4 m)")
    print(f"\n{'seen [details]':24}{'middle: 25, 50, 75 %':>24}{'litres':>9}{'sheets':>9}"
          f"{'default: 25, 50, 75 %':>26}{'litres':>9}{'sheets':>9}")  # fmt: skip
    for name in CAPTURES:
        item = SplatObject(name=name, splat=DATA / name, height=0.4, static=True)
        gaussians = place_object(item, read_splat(DATA / name)).gaussians
        told = ""
        for options in (SolidOptions(surface="middle"), SolidOptions()):
            solid = solid_of(gaussians, options)
            quartiles = " ".join(f"{each:+.2f}" for each in off_what_one_sees(gaussians, solid))
            told += f"{quartiles:>24}{1e3 * solid.volume:9.3f}{1e3 * solid.sheets.volumes.sum():9.3f}  "
        print(f"{name:24}{told}", flush=True)


if __name__ == "__main__":
    main()
