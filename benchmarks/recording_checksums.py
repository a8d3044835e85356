"""What checksums and checks cost a recording: opening it, reading a frame, writing one, verifying and resuming it.

    python benchmarks/recording_checksums.py [--frames 250] [--gaussians 100000] [--before FOLDER]
    python benchmarks/recording_checksums.py --run [--engine NAME]

`--before` names a checkout of an earlier GASP (its root, with gasp_core in it); the same is measured with it in a
process of its own, in turns, and ratios are printed. Times are the least of several, flushing included in writing.

`--run` drops a toy of so many Gaussians, every vertex a point, and prints what share of the run went into checksums, an
upper bound: what `sealed` does besides its own checksum was done before too.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

REPEATS = 7
DIAGNOSTICS = {
    **dict.fromkeys(("substeps", "degenerate", "clipped", "inverted", "stretched"), 0),
    **dict.fromkeys(("smallest_substep", "largest_substep", "kinetic_energy", "potential_energy"), 0.0),
    "warnings": [],
}


def least(function, repeats: int = REPEATS) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def measure(path: Path, frames: int, count: int) -> dict[str, float]:
    """Seconds, by what they are for, with the gasp_core that is imported."""
    from gasp_core import Gaussians
    from gasp_core.recording import Recording
    from gasp_core.recording.layout import BodyEntry, EngineRecord, Header, ObjectEntry
    from gasp_core.recording.writer import RecordingWriter
    from gasp_core.reduction.all_vertices import block_of, sample_all

    draw = np.random.default_rng(0)
    reference = Gaussians(
        means=draw.uniform(-0.5, 0.5, size=(count, 3)).astype(np.float32),
        quaternions=draw.normal(size=(count, 4)).astype(np.float32),
        scales=draw.uniform(0.002, 0.01, size=(count, 3)).astype(np.float32),
        opacities=draw.uniform(0.2, 1, size=count).astype(np.float32),
        harmonics=draw.normal(size=(count, 1, 3)).astype(np.float32),
    )
    block = block_of(reference, 4)
    sample = sample_all(block, 1e-4, 0.01)
    points = sample.positions + block.centre
    header = Header(
        gasp_version="0",
        scene="",
        scene_digest="",
        points_digest="",
        frame_rate=25.0,
        spacing=0.01,
        maps={"covariance": "exact", "alpha": 2.0},
        objects=(ObjectEntry(name="thing", first=0, last=count, splat_digest="", set_aside={}),),
        bodies=(BodyEntry(item=0, vertices=4, first=0, last=len(points), carrier="all", drifts=False, motion=None),),
        notes=(),
        engine=EngineRecord(
            name="none", version="0", device="cpu", precision="float64", seed=0, options={}, checkpoints=False
        ),
    )
    writer = RecordingWriter.create(
        path,
        header,
        reference=reference,
        moving=np.ones(count, dtype=bool),
        points=points,
        carriers=[sample.carrier.arrays()],
        frames_wanted=frames,
        velocities=False,
        overwrite=False,
    )
    still = [np.zeros((0, 2), dtype=np.int64)]
    moves = [(0.01 * draw.normal(size=points.shape)).astype(np.float32) for _ in range(4)]

    def write(frame: int) -> None:
        writer.write_frame(
            frame,
            frame / 25,
            relative=moves[frame % 4],
            means=np.zeros((1, 3)),
            velocities=None,
            degenerate=still,
            diagnostics=DIAGNOSTICS,
        )

    times = []
    for frame in range(frames):
        start = time.perf_counter()
        write(frame)
        times.append(time.perf_counter() - start)
    writer.finish("complete", "")
    writer.close()

    def opened() -> None:
        recording = Recording.open(path)
        assert (recording.frame_count, recording.status) == (frames, "complete")

    def opened_whole() -> None:
        recording = Recording.open(path)
        assert recording.frame_count == frames
        _ = recording.bodies

    recording = Recording.open(path)
    recording.gaussians(0)
    found = {
        "opening (header, frames, status)": least(opened),
        "opening (and the scene at rest)": least(opened_whole),
        "reading the displacements of a frame": least(lambda: recording.displacements(frames // 2)),
        "reading the Gaussians of a frame": least(lambda: recording.gaussians(frames // 2)),
        "writing a frame": min(times),
    }
    try:
        from gasp_core.recording.verifying import verify
    except ImportError:
        return found
    return found | {"verifying all of it": least(lambda: verify(path), 1)}


def share_of_a_run(engine: str | None, count: int) -> None:
    """Print the share of a run that its checksums take."""
    import cProfile
    import pstats

    from gasp_core import Elastic, EngineAccuracy, EngineChoice, Reduction, Scene, SplatObject, simulate
    from gasp_core.toy import make_toy

    jelly = Elastic(density=300, youngs_modulus=5e4, poissons_ratio=0.3)
    toy = SplatObject(name="toy", splat=make_toy(count), material=jelly, height=0.3, reduction=Reduction(mode="all"))
    scene = Scene(
        duration=0.4,
        frame_rate=25.0,
        objects=(toy,),
        engine=EngineChoice(name=engine or "warp-mpm"),
        accuracy=EngineAccuracy(resolution=32),
    )
    with tempfile.TemporaryDirectory() as folder:
        simulate(scene, out=Path(folder) / "warm.gasp", frames=2, progress=False)
        profile = cProfile.Profile()
        start = time.perf_counter()
        profile.runcall(simulate, scene, out=Path(folder) / "run.gasp", progress=False)
        seconds = time.perf_counter() - start
    spent = {
        name: cumulative
        for (file, _, name), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items()
        if (file.endswith("recording/files.py") and name == "checksum")
        or (file.endswith("recording/nodes.py") and name in ("sealed", "whole"))
    }
    told = ", ".join(f"{name} {1e3 * value:.1f} ms" for name, value in sorted(spent.items()))
    share = sum(spent.values()) / seconds
    print(f"{scene.engine.name}, {count:,} Gaussians, 11 frames in {seconds:.1f} s: {told}: {100 * share:.2f} % of it")


def in_a_process(root: Path, frames: int, count: int) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--frames", str(frames), "--gaussians", str(count)]
        done = subprocess.run(
            [*command, "--only", str(Path(folder) / "run.gasp")],
            env={**os.environ, "PYTHONPATH": str(root)},
            capture_output=True,
            text=True,
            check=True,
        )
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=250)
    parser.add_argument("--gaussians", type=int, default=100_000)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--run", action="store_true")
    parser.add_argument("--engine")
    parser.add_argument("--only", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.run:
        share_of_a_run(asked.engine, asked.gaussians)
        return
    if asked.only is not None:
        print(json.dumps(measure(asked.only, asked.frames, asked.gaussians)))
        return
    now: dict[str, float] = {}
    before: dict[str, float] = {}
    for _ in range(asked.turns):
        for root, found in ((Path(__file__).parents[1], now), (asked.before, before)):
            if root is not None:
                times = in_a_process(root, asked.frames, asked.gaussians)
                found |= {name: min(seconds, found.get(name, seconds)) for name, seconds in times.items()}
    print(f"{asked.frames} frames of {asked.gaussians:,} Gaussians, {len(os.sched_getaffinity(0))} processors")
    for name, seconds in now.items():
        ratio = f"  {seconds / before[name]:.2f} times {1e3 * before[name]:.2f} ms" if name in before else ""
        print(f"{name:40} {1e3 * seconds:9.2f} ms{ratio}")


if __name__ == "__main__":
    main()
