"""What cores cost and what they win: `cores` against `all`, soft objects dropped on a floor.

    GASP_DATA=... python benchmarks/core_fractions.py [--objects plant skull] [--fractions 0.01 0.05] [--duration 2]
        [--resolution 48] [--transfers least-squares frame] [--engine warp-mpm] [--out FOLDER] [--again]

For each object one run with every vertex, and one for each fraction and transfer. Error: distance of all vertices from
those of the full run, root mean square over vertices and frames, as a share of the object's diagonal. PSNR: pictures of
both from the same place, mean over sixteen frames. Time: of `simulate` as a whole (reading, clustering, opening, all
frames on disk), on the wall and of the processors; kernels are compiled before. FOLDER gets recordings, results.json,
a table and a plot; runs that are in results.json already are not run again unless told to.
"""

import argparse
import json
import os
import time
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import gasp_core as gasp
from gasp_core.accuracy.images import psnr
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import frame_motion, motion_of
from gasp_core.rendering.painting import FramePainter
from gasp_core.rendering.renderers import open_renderer

DATA = Path(os.environ.get("GASP_DATA", "../shared/data"))
FILES = {
    "plant": "plant.splat",
    "statue-angel": "statue-angel.sog",
    "guitar": "guitar.compressed.ply",
    "skull": "skull.sog",
}
FRACTIONS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
TRANSFERS = ("least-squares", "frame")
PICTURES = 16
SIZE = (480, 480)
ALL = "all"


def scene_of(name, arguments, reduction):
    item = gasp.SplatObject(
        name=name,
        splat=DATA / "splats" / FILES[name],
        height=0.4,
        position=(0, 0, arguments.drop),
        material=gasp.Elastic(density=400, youngs_modulus=arguments.youngs_modulus, poissons_ratio=0.3),
        floaters=gasp.Floaters.DROP,
        reduction=reduction,
    )
    floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
    return gasp.Scene(
        duration=arguments.duration,
        frame_rate=25,
        objects=(item,),
        colliders=(floor,),
        engine=gasp.EngineChoice(name=arguments.engine),
        accuracy=gasp.EngineAccuracy(resolution=arguments.resolution),
    )


def timed_run(scene, out, frames=None):
    wall, cpu = time.perf_counter(), time.process_time()
    run = gasp.simulate(scene, out=out, frames=frames, overwrite=True)
    return run, {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}


def error_of(run, reference):
    """RMS distance of all vertices in all frames, as a share of the object's diagonal."""
    (body,) = reference.bodies
    diagonal = np.linalg.norm(np.ptp(body.block.rest[:, 0], axis=0))
    squares = []
    for frame in range(reference.frame_count):
        offset = run.simplices(frame)[body.name] - reference.simplices(frame)[body.name]
        squares.append((offset**2).sum(axis=-1).mean())
    return float(np.sqrt(np.mean(squares)) / diagonal)


def likeness_of(run, reference):
    """Mean PSNR [dB] of pictures of both, from where all of the reference's motion is seen."""
    motion = motion_of(RecordedFootage(reference))
    camera = frame_motion(motion, width=SIZE[0], height=SIZE[1], around=35.0, above=20.0)
    frames = np.unique(np.linspace(1, reference.frame_count - 1, PICTURES).round().astype(int))
    painters = [
        FramePainter(RecordedFootage(each), open_renderer(), motion=motion, background=(1.0, 1.0, 1.0))
        for each in (reference, run)
    ]
    found = [psnr(*(painter.paint(int(frame), camera) / 255 for painter in painters)) for frame in frames]
    return float(np.mean(found))


def measured(name, arguments, results, out):
    """Fill in what is missing of an object's row."""
    rows = results.setdefault(name, {})
    path = out / f"{name}-all.gasp"
    if ALL not in rows or not path.exists():
        gasp.simulate(scene_of(name, arguments, gasp.Reduction()), out=out / "warm.gasp", frames=2, overwrite=True)
        run, rows[ALL] = timed_run(scene_of(name, arguments, gasp.Reduction()), path)
        rows[ALL]["points"] = len(run.start_points)
        yield
    reference = gasp.Recording.open(path)
    for fraction in arguments.fractions:
        for transfer in arguments.transfers:
            key = f"{fraction:g} {transfer}"
            if key in rows:
                continue
            scene = scene_of(name, arguments, gasp.Reduction(mode="cores", fraction=fraction, transfer=transfer))
            run, row = timed_run(scene, out / f"{name}-cores.gasp")
            row |= {"fraction": fraction, "transfer": transfer, "points": len(run.start_points)}
            row |= {"error": error_of(run, reference), "psnr": likeness_of(run, reference)}
            row["note"] = run.notes[-1]
            rows[key] = row
            yield


def table_of(results):
    lines = ["| object | cores | transfer | points | error, % of the diagonal | PSNR, dB | time, s | CPU, s | faster |"]
    lines.append("|---|---|---|---|---|---|---|---|---|")
    for name, rows in results.items():
        whole = rows[ALL]
        lines.append(f"| {name} | all | | {whole['points']:,} | | | {whole['wall']:.1f} | {whole['cpu']:.1f} | |")
        for row in (row for key, row in rows.items() if key != ALL):
            lines.append(
                f"| {name} | {100 * row['fraction']:g} % | {row['transfer']} | {row['points']:,} |"
                f" {100 * row['error']:.2f} | {row['psnr']:.1f} | {row['wall']:.1f} | {row['cpu']:.1f} |"
                f" {whole['wall'] / row['wall']:.1f} x |"
            )
    return "\n".join(lines)


def plot(results, path):
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")
    for colour, (name, rows) in enumerate(results.items()):
        for transfer, line in zip(TRANSFERS, ("-o", "--s")):
            own = sorted(
                (row for key, row in rows.items() if key != ALL and row["transfer"] == transfer),
                key=lambda row: row["fraction"],
            )
            label, style = f"{name}, {transfer}", {"color": f"C{colour}"}
            shares = [100 * row["fraction"] for row in own]
            errors = [100 * row["error"] for row in own]
            axes[0].loglog(shares, errors, line, label=label, **style)
            axes[1].semilogx(shares, [row["psnr"] for row in own], line, **style)
            axes[2].loglog([rows[ALL]["wall"] / row["wall"] for row in own], errors, line, **style)
    axes[0].set(xlabel="cores, % of the Gaussians", ylabel="error, % of the diagonal")
    axes[1].set(xlabel="cores, % of the Gaussians", ylabel="PSNR [dB]")
    axes[2].set(xlabel="times faster than every vertex, from file to recording", ylabel="error, % of the diagonal")
    axes[2].axhline(1, color="grey", linewidth=0.8)
    axes[2].axvline(10, color="grey", linewidth=0.8)
    axes[0].legend(fontsize="small")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", nargs="+", default=list(FILES), choices=list(FILES))
    parser.add_argument("--fractions", nargs="+", type=float, default=list(FRACTIONS))
    parser.add_argument("--transfers", nargs="+", default=list(TRANSFERS), choices=TRANSFERS)
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--drop", type=float, default=0.3, help="height of the fall [m]")
    parser.add_argument("--youngs-modulus", type=float, default=5e4)
    parser.add_argument("--resolution", type=int, default=48)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--out", type=Path, default=Path("core_fractions"))
    parser.add_argument("--again", action="store_true", help="run all of it anew")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    arguments.out.mkdir(parents=True, exist_ok=True)
    kept = arguments.out / "results.json"
    setting = {key: getattr(arguments, key) for key in ("duration", "drop", "youngs_modulus", "resolution", "engine")}
    found = json.loads(kept.read_text()) if kept.exists() and not arguments.again else {"setting": setting, "rows": {}}
    if found["setting"] != setting:
        raise SystemExit(f"{kept}: was made with {found['setting']}: choose another --out, or say --again")
    for name in arguments.objects:
        for _ in measured(name, arguments, found["rows"], arguments.out):
            kept.write_text(json.dumps(found, indent=1))
            print(table_of({name: found["rows"][name]}).splitlines()[-1], flush=True)
    table = table_of(found["rows"])
    (arguments.out / "table.md").write_text(table + "\n")
    plot(found["rows"], arguments.out / "core_fractions.png")
    print(f"\n{setting}\n{table}")


if __name__ == "__main__":
    main()
