"""What cores cost and what they win: `cores` against `all`, soft objects dropped on a floor.

    GASP_DATA=... python benchmarks/core_fractions.py [--objects plant skull] [--fractions 0.01 0.05] [--duration 2]
        [--resolution 48] [--engine warp-mpm] [--out FOLDER] [--again]

For each object one run with every vertex, and one for each fraction. The engine moves the same points whatever the
transfer: its run is carried by both. Error: distance of all vertices from those of the full run, root mean square over
vertices and frames, as a share of the object's diagonal. Of the transfer alone: the same where each core moves as the
full run moved its cluster (the affine fit to it), so that nothing but the transfer errs. PSNR: pictures of both from
the same place, mean over sixteen frames. Time: of `simulate` as a whole (reading, clustering, opening, all frames on
disk), on the wall and of the processors, with least squares; kernels are compiled before. FOLDER gets recordings,
results.json, a table and a plot; runs that are in results.json already are not run again unless told to.
"""

import argparse
import dataclasses
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
from gasp_core.reduction.cores import Level, Levels
from gasp_core.reduction.transfer import OneFrame
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
FRACTIONS = (0.001, 0.003, 0.01, 0.03, 0.05, 0.1, 0.3)
POSES = {"guitar": (0.0, 90.0, 0.0), "plant": (90.0, 0.0, 0.0), "statue-angel": (90.0, 0.0, 0.0)}
"""So that all of them lie or stand where they would stay: what falls over falls another way each time."""
TRANSFERS = ("least-squares", "frame")
SETTING = ("duration", "drop", "youngs_modulus", "contact", "resolution", "engine")
PICTURES = 16
SIZE = (480, 480)
ALL = "all"


def scene_of(name, arguments, reduction):
    item = gasp.SplatObject(
        name=name,
        splat=DATA / "splats" / FILES[name],
        height=0.4,
        rotation=POSES.get(name),
        position=(0, 0, arguments.drop),
        material=gasp.Elastic(density=400, youngs_modulus=arguments.youngs_modulus, poissons_ratio=0.3),
        floaters=gasp.Floaters.DROP,
        reduction=reduction,
    )
    floor = gasp.Collider(
        shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)),
        contact=gasp.ContactCondition(arguments.contact),
        friction=0.4 if arguments.contact == "separate" else 0.0,
    )
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


def errors_of(run, reference, carriers):
    """RMS distance of all vertices in all frames, as a share of the object's diagonal, by transfer; and of it alone."""
    (whole,), (body,) = reference.bodies, run.bodies
    rest = whole.block.rest
    diagonal = np.linalg.norm(np.ptp(rest[:, 0], axis=0))
    squares = {(transfer, alone): [] for transfer in carriers for alone in (False, True)}
    for frame in range(reference.frame_count):
        expected = reference.simplices(frame)[whole.name] - whole.block.centre
        relative, (mean,) = run.displacements(frame)
        for transfer, carrier in carriers.items():
            own = carrier.carry(rest, relative[body.points]) + mean
            ideal = carrier.carry(rest, carrier.gather(rest, expected - rest))
            for alone, moved in ((False, own), (True, ideal)):
                squares[transfer, alone].append(((moved - expected) ** 2).sum(axis=-1).mean())
    return {key: float(np.sqrt(np.mean(values)) / diagonal) for key, values in squares.items()}


def carriers_of(run):
    """The motion of one run's cores carried in both ways."""
    (body,) = run.bodies
    (level,) = body.carrier.levels
    frame = Level(cores=level.cores, transfer=OneFrame(labels=level.transfer.labels))
    return {"least-squares": body.carrier, "frame": Levels(levels=(frame,))}


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
    """Fill in what is missing of an object's rows."""
    rows = results.setdefault(name, {})
    path = out / f"{name}-all.gasp"
    if ALL not in rows or not path.exists():
        gasp.simulate(
            scene_of(name, arguments, gasp.Reduction(mode="all")), out=out / "warm.gasp", frames=2, overwrite=True
        )
        run, rows[ALL] = timed_run(scene_of(name, arguments, gasp.Reduction(mode="all")), path)
        rows[ALL]["points"] = len(run.start_points)
        yield
    reference = gasp.Recording.open(path)
    for fraction in arguments.fractions:
        if f"{fraction:g}" in rows:
            continue
        scene = scene_of(name, arguments, gasp.Reduction(mode="cores", fraction=fraction))
        run, row = timed_run(scene, out / f"{name}-{fraction:g}.gasp")
        row |= {"fraction": fraction, "points": len(run.start_points), "note": run.notes[-1]}
        carriers = carriers_of(run)
        errors = errors_of(run, reference, carriers)
        (body,) = run.bodies
        for transfer, carrier in carriers.items():
            run.bodies = (dataclasses.replace(body, carrier=carrier),)
            row[transfer] = {
                "error": errors[transfer, False],
                "alone": errors[transfer, True],
                "psnr": likeness_of(run, reference),
            }
        rows[f"{fraction:g}"] = row
        yield


def table_of(results):
    names = " | ".join(TRANSFERS)
    lines = [
        f"| object | cores | points | error, % of the diagonal: {names} | transfer alone, %: {names} "
        f"| PSNR, dB: {names} | time, s | CPU, s | less CPU |",
        "|---|---" + "|---" * (3 * len(TRANSFERS) + 4) + "|",
    ]
    for name, rows in results.items():
        whole = rows[ALL]
        blank = " | " * 3 * len(TRANSFERS)
        lines.append(f"| {name} | all | {whole['points']:,} |{blank}{whole['wall']:.0f} | {whole['cpu']:.0f} | |")
        for row in (rows[key] for key in sorted(rows.keys() - {ALL}, key=float)):
            cells = [f"{100 * row['fraction']:g} %", f"{row['points']:,}"]
            cells += [f"{100 * row[transfer][what]:.3f}" for what in ("error", "alone") for transfer in TRANSFERS]
            cells += [f"{row[transfer]['psnr']:.2f}" for transfer in TRANSFERS]
            cells += [f"{row['wall']:.0f}", f"{row['cpu']:.0f}", f"{whole['cpu'] / row['cpu']:.1f} x"]
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def plot(results, path):
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")
    for colour, (name, rows) in enumerate(results.items()):
        own = [rows[key] for key in sorted(rows.keys() - {ALL}, key=float)]
        shares = [100 * row["fraction"] for row in own]
        less = [rows[ALL]["cpu"] / row["cpu"] for row in own]
        for transfer, line in zip(TRANSFERS, ("-o", "--s")):
            label, style = f"{name}, {transfer}", {"color": f"C{colour}"}
            errors = [100 * row[transfer]["error"] for row in own]
            axes[0].loglog(shares, errors, line, label=label, **style)
            alone = [100 * row[transfer]["alone"] for row in own]
            axes[1].loglog(shares, alone, line, **style)
            axes[2].loglog(less, errors, line, **style)
    axes[0].set(xlabel="cores, % of the Gaussians", ylabel="error, % of the diagonal")
    axes[1].set(xlabel="cores, % of the Gaussians", ylabel="error of the transfer alone, % of the diagonal")
    axes[2].set(xlabel="times less processor time than every vertex", ylabel="error, % of the diagonal")
    axes[2].axhline(1, color="grey", linewidth=0.8)
    axes[2].axvline(10, color="grey", linewidth=0.8)
    for axis in axes:
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        axis.yaxis.set_major_formatter("{x:g}")
    axes[2].set_xticks([3, 10, 30, 100])
    figure.legend(loc="outside right center", fontsize="small")
    figure.savefig(path, metadata={"Date": None})
    path.write_text("\n".join(line.rstrip() for line in path.read_text().splitlines()) + "\n")
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", nargs="+", default=list(FILES), choices=list(FILES))
    parser.add_argument("--fractions", nargs="+", type=float, default=list(FRACTIONS))
    parser.add_argument("--duration", type=float, default=2.0)
    parser.add_argument("--drop", type=float, default=0.02, help="height of the fall [m]")
    parser.add_argument("--youngs-modulus", type=float, default=2e5)
    parser.add_argument("--contact", default="separate", choices=["separate", "stick"], help="with the floor")
    parser.add_argument("--resolution", type=int, default=48)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--out", type=Path, default=Path("core_fractions"))
    parser.add_argument("--again", action="store_true", help="run all of it anew")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(f"no data at {DATA}: set GASP_DATA")
    arguments.out.mkdir(parents=True, exist_ok=True)
    kept = arguments.out / "results.json"
    setting = {key: getattr(arguments, key) for key in SETTING}
    found = json.loads(kept.read_text()) if kept.exists() and not arguments.again else {"setting": setting, "rows": {}}
    if found["setting"] != setting:
        raise SystemExit(f"{kept}: was made with {found['setting']}: choose another --out, or say --again")
    for name in arguments.objects:
        for _ in measured(name, arguments, found["rows"], arguments.out):
            kept.write_text(json.dumps(found, indent=1))
            print(table_of({name: found["rows"][name]}).splitlines()[-1], flush=True)
    table = table_of(found["rows"])
    (arguments.out / "table.md").write_text(table + "\n")
    plot(found["rows"], arguments.out / "core_fractions.svg")
    print(f"\n{setting}\n{table}")


if __name__ == "__main__":
    main()
