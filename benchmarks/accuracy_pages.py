"""Measures what docs/accuracy.md shows, and writes it there.

    python benchmarks/accuracy_pages.py                       every scene and engine; twenty minutes on two cores
    python benchmarks/accuracy_pages.py --only bar/warp-mpm   one of them
    python benchmarks/accuracy_pages.py --write               tables and plots of what has been measured, into docs/

Results lie in build/accuracy, a folder for each scene and engine as `gasp tradeoff` writes it; what is there is not
measured again unless told to. What is not there stays in the page as it is, and so do the plot of its scene and the
line about the machine. An engine that cannot do a scene has its reason there instead.
"""

import argparse
import io
import json
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "accuracy"
DOCS = ROOT / "docs"
BAR = "vibrating_bar.toml --truth vibrating_bar.py:position"
DROP = "soft_drop.toml"
JOBS = {
    "bar/warp-mpm": f"{BAR} --resolutions 12,16,24,32 --fractions all,0.1",
    "bar/taichi-mpm": f"{BAR} --resolutions 12,24 --fractions all,0.1 --precisions float32",
    "bar/reference-mpm": f"{BAR} --resolutions 12,24 --fractions all,0.1",
    "bar/mujoco-flex": f"{BAR} --resolutions 12,24 --fractions all,0.1",
    "bar/genesis-mpm": f"{BAR} --resolutions 12,24 --fractions all",
    "bar/blender": f"{BAR} --resolutions 12,24 --fractions all,0.1",
    "drop/warp-mpm": f"{DROP} --resolutions 6,8,12 --fractions all,0.3 --precisions float32",
    "drop/taichi-mpm": f"{DROP} --resolutions 6,8 --fractions all --precisions float32",
    "drop/mujoco-flex": f"{DROP} --resolutions 6,8 --fractions all",
    "drop/genesis-mpm": f"{DROP} --resolutions 6,8 --fractions all",
    "drop/blender": f"{DROP} --resolutions 6,8 --fractions all",
}
ONCE = tuple(job for job in JOBS if not job.endswith("/warp-mpm"))
"""Whose settings are timed once; all others twice."""
LEFT_OUT = {
    "drop": "`reference-mpm` is left out: it computes what `warp-mpm` computes in float64, in plain NumPy, and would"
    " take minutes for each of the finer runs."
}
SCENES = {"bar": "vibrating_bar.toml", "drop": "soft_drop.toml"}
# Told apart by those who see few colours too (Okabe and Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")


def command_of(job):
    """The command as the page shows it, in the folder of the examples."""
    engine = job.partition("/")[2]
    return f"gasp tradeoff {JOBS[job]} --repeats {1 if job in ONCE else 2} --engine {engine}"


def measure(job, time_limit):
    out = BUILD / job
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    words = shlex.split(command_of(job))[1:]
    command = [sys.executable, "-m", "gasp_core.cli.main", *words, "--out", str(out), "--time-limit", str(time_limit)]
    done = subprocess.run(command, cwd=ROOT / "examples", capture_output=True, text=True)
    print(f"== {command_of(job)}\n{done.stdout}{done.stderr}", flush=True)
    if done.returncode:
        out.mkdir(parents=True, exist_ok=True)
        (out / "reason.txt").write_text(done.stderr.strip().removeprefix("gasp: ") + "\n")


def cell(value, digits=3):
    return "" if value is None else f"{value:.{digits}g}"


def table(result):
    lines = ["| cells | cores | precision | error, % | true one between | run, s | CPU, s | start, s | |"]
    lines.append("|---|---|---|---|---|---|---|---|---|")
    for row in result["settings"]:
        name = f"| {row['resolution']} | {row['cores']} | {row['precision']} |"
        if row["error_share"] is None:
            lines.append(f"{name} {row['ending']}: {row['reason']} | | | | | |")
            continue
        low, high = (cell(100 * row[key]) for key in ("error_low", "error_high"))
        between = "" if low == high else f"{low} .. {high}"
        times = " | ".join(cell(row[key], 2) for key in ("run_seconds", "cpu_seconds", "start_seconds"))
        mark = "unbeaten" if row["on_front"] else ""
        lines.append(f"{name} {cell(100 * row['error_share'])} | {between} | {times} | {mark} |")
    return "\n".join(lines)


def has_result(job):
    """Whether it has been measured, here."""
    return any((BUILD / job / name).exists() for name in ("tradeoff.json", "reason.txt"))


def measured(scene):
    """Whether all of a scene's jobs have been."""
    return all(has_result(job) for job in JOBS if job.startswith(f"{scene}/"))


def kept(scene, engine):
    """What the page says of an engine now."""
    begin, end = marks(scene)
    own = (DOCS / "accuracy.md").read_text().partition(begin)[2].partition(end)[0]
    text = own.partition(f"### {engine}\n")[2].partition("\n### ")[0]
    return text.partition(LEFT_OUT.get(scene, "\0"))[0].strip("\n")


def marks(name):
    return f"<!-- {name}: written by benchmarks/accuracy_pages.py -->", f"<!-- end of {name} -->"


def section(scene):
    parts = [f"![{SCENES[scene]}: error over processor time, a panel an engine](accuracy-{scene}.svg)"]
    for job in (job for job in JOBS if job.startswith(f"{scene}/")):
        folder, engine = BUILD / job, job.partition("/")[2]
        head = f"### {engine}\n\n    {command_of(job)}\n\n"
        if (folder / "tradeoff.json").exists():
            result = json.loads((folder / "tradeoff.json").read_text())
            said = result["truth"]["sentence"]
            parts.append(f"{head}{table(result)}\n\n{said[0].upper()}{said[1:]}.")
        elif (folder / "reason.txt").exists():
            parts.append(f"{head}Cannot: {(folder / 'reason.txt').read_text().strip()}")
        else:
            parts.append(f"### {engine}\n\n{kept(scene, engine)}")
    parts += [LEFT_OUT[scene]] if scene in LEFT_OUT else []
    return "\n\n".join(parts)


def machine_line():
    found = [json.loads(path.read_text())["machine"] for path in sorted(BUILD.glob("*/*/tradeoff.json"))]
    loads = [value for each in found for value in (each["load"][:1] + each["load_afterwards"][:1])]
    first = found[0]
    return (
        f"{first['processor']}, {first['processors_allowed']} processors, Python {first['python']}, no GPU;"
        f" load while it was measured {min(loads):.1f} to {max(loads):.1f}"
        " (above the number of processors others were at work, and times are longer than they need be)."
    )


def plot(scene):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    jobs = [job for job in JOBS if job.startswith(f"{scene}/") and (BUILD / job / "tradeoff.json").exists()]
    figure, panels = plt.subplots(2, 3, figsize=(11, 6.5), sharex=True, sharey=True, layout="constrained")
    for axes in panels.flat[len(jobs) :]:
        axes.set_axis_off()
    for axes, job in zip(panels.flat, jobs):
        rows = [
            row for row in json.loads((BUILD / job / "tradeoff.json").read_text())["settings"] if row["error_share"]
        ]
        kinds = list(dict.fromkeys((row["cores"], row["precision"]) for row in rows))
        for number, kind in enumerate(kinds):
            own = [row for row in rows if (row["cores"], row["precision"]) == kind]
            time, error = ([row[key] for row in own] for key in ("cpu_seconds", "error_share"))
            error = [100 * value for value in error]
            below = [value - 100 * max(row["error_low"], row["error_share"] / 50) for value, row in zip(error, own)]
            above = [100 * row["error_high"] - value for value, row in zip(error, own)]
            label = f"{'all vertices' if kind[0] == 'all' else f'{100 * float(kind[0]):g} % cores'}, {kind[1]}"
            style = {"color": COLOURS[number], "marker": "os^D"[number], "capsize": 2, "elinewidth": 0.7}
            axes.errorbar(time, error, yerr=[below, above], linewidth=1, label=label, **style)
            for row, place in zip(own, zip(time, error)):
                axes.annotate(row["resolution"], place, xytext=(4, 4), textcoords="offset points", size=8)
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
        axes.set_title(job.partition("/")[2], size=10)
        axes.grid(alpha=0.2)
        axes.tick_params(labelbottom=True)
        axes.legend(fontsize="x-small")
    figure.supxlabel("processor time of the frames, without the start [s]", size=10)
    figure.supylabel("error, rms over vertices and frames [% of the diagonal]", size=10)
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "gasp", "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    figure.savefig(BUILD / f"accuracy-{scene}.png", dpi=110)
    plt.close(figure)
    text = "\n".join(line.rstrip() for line in stream.getvalue().splitlines())
    (DOCS / f"accuracy-{scene}.svg").write_text(text + "\n")


def write():
    page = DOCS / "accuracy.md"
    text = page.read_text()
    parts = {scene: section(scene) for scene in SCENES}
    if all(measured(scene) for scene in SCENES):
        parts["machine"] = machine_line()
    for name, content in parts.items():
        begin, end = marks(name)
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(end)
        text = f"{before}{begin}\n{content}\n{end}{after}"
    page.write_text(text)
    for scene in SCENES:
        if measured(scene):
            plot(scene)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=list(JOBS), default=list(JOBS))
    parser.add_argument("--again", action="store_true", help="measure what has been measured already")
    parser.add_argument("--write", action="store_true", help="write the page from what has been measured, no more")
    parser.add_argument("--time-limit", type=float, default=300.0, help="of each run [s]")
    arguments = parser.parse_args()
    if not arguments.write:
        for maker in ("vibrating_bar.py", "make_ball.py"):
            runpy.run_path(str(ROOT / "examples" / maker), run_name="__main__")
        for job in arguments.only:
            if arguments.again or not has_result(job):
                measure(job, arguments.time_limit)
    write()


if __name__ == "__main__":
    main()
