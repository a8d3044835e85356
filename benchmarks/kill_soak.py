"""What a kill costs: runs of every engine ended by ``kill -9`` at random moments, and every command by TERM and KILL.

    python benchmarks/kill_soak.py runs [--trials 200] [--engines A,B] [--variants C,D] [--seed 0]
    python benchmarks/kill_soak.py commands [--moments 5]

`runs`: each is gone on with afterwards; frames that were there must be those of a run that never stopped, and so must
all be in the end. Plain, by cores, with a film, with a motion, with drives and isolated, in turns.

`commands`: 5 s after the signal, or after the next call of the same command, nothing of it may be left: no process, no
shared memory, no temporary folder, nothing beside its output. Linux only.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from gasp_core import Recording
from gasp_core.discovery.registry import discover
from gasp_core.discovery.status import engine_rows
from gasp_core.errors import GaspError
from gasp_core.io import write_splat
from gasp_core.toy import make_toy

GASP = [sys.executable, "-m", "gasp_core.cli.main"]
FRAMES = 9
SOON = 5.0
"""Seconds after which nothing may be left."""
MARK = "GASP_KILL_SOAK"
"""Variable in the environment of all that is started here, by which it is found."""

SCENE = f"""
[scene]
duration = {(FRAMES - 1) / 25}
frame_rate = 25
[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
height = 0.3
position = [0, 0, 0.05]
material = {{ model = "elastic", density = 300, youngs_modulus = 5e4, poissons_ratio = 0.3 }}
reduction = {{ mode = "all" }}
%s
[[collider]]
shape = "plane"
height = 0.0
[engine]
name = "reference-mpm"
[accuracy]
resolution = 8
[recording]
checkpoint_frames = 2
"""
MOTION = """[object.motion]
kind = "bend"
composition = "carried"
axis = [0, 1, 0]
pivot = [0, 0, 0.05]
length = 0.3
amplitude = 10
frequency = 2
"""
DRIVES = """[[drive]]
kind = "pinned"
region = { shape = "sphere", center = [0, 0, 0.3], radius = 0.08 }
end = 0.2
[[drive]]
kind = "impulse"
region = { shape = "sphere", center = [0, 0, 0.2], radius = 1 }
impulse = [0.05, 0, 0.05]
start = 0.1
"""
VARIANTS: dict[str, tuple[str, list[str]]] = {
    "plain": ("plain.toml", []),
    "cores": ("plain.toml", ["--cores", "0.3"]),
    "film": ("plain.toml", ["--render", "film.mp4", "--size", "160x120"]),
    "motion": ("moving.toml", ["--cores", "0.3"]),
    "driven": ("driven.toml", []),
    "isolated": ("plain.toml", ["--isolate"]),
}


def prepared(folder: Path) -> None:
    """The scenes, and the toy that they name."""
    write_splat(folder / "toy.ply", make_toy(300))
    (folder / "plain.toml").write_text(SCENE % "")
    (folder / "moving.toml").write_text(SCENE % MOTION)
    (folder / "driven.toml").write_text(SCENE % DRIVES)


# --- runs -----------------------------------------------------------------------------------------------------------


def same(one: Any, other: Any) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("means", "quaternions", "scales", "opacities", "harmonics")
    )


class Killed:
    """Runs of one engine in one variant, and what became of them."""

    def __init__(self, folder: Path, engine: str, variant: str) -> None:
        self.folder = folder
        scene, options = VARIANTS[variant]
        self.command = [*GASP, "run", scene, "--engine", engine, *options]
        self.tally: Counter[str] = Counter()
        # Twice: the first one may compile.
        for _ in range(2):
            start = time.monotonic()
            whole_command = [*self.command, "--out", "whole.gasp", "--overwrite"]
            done = subprocess.run(whole_command, cwd=folder, capture_output=True, text=True, timeout=600)
            self.seconds = time.monotonic() - start
        self.refusal = done.stderr.strip() if done.returncode else ""
        if not self.refusal:
            whole = Recording.open(folder / "whole.gasp")
            first, *_, last = sorted(
                path.stat().st_mtime for path in (folder / "whole.gasp").glob("commits/*/zarr.json")
            )
            self.among_frames = last - first
            self.truth = [whole.gaussians(frame) for frame in range(whole.frame_count)]

    def trial(self, chance: random.Random) -> None:
        """One run, killed and gone on with."""
        out = self.folder / "killed.gasp"
        shutil.rmtree(out, ignore_errors=True)
        (self.folder / "film.mp4").unlink(missing_ok=True)
        process = subprocess.Popen(
            [*self.command, "--out", out.name],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        wait = chance.uniform(0, self.seconds)
        if chance.random() < 0.5:
            # Starting takes most of the time: half of them are killed among their frames.
            until = time.monotonic() + 2 * self.seconds
            while not (out / "commits" / "00000000").exists() and time.monotonic() < until:
                time.sleep(0.005)
            wait = chance.uniform(0, self.among_frames)
        time.sleep(wait)
        self.tally["trials"] += 1
        self.tally["killed"] += process.poll() is None
        process.kill()
        process.wait()
        if out.exists():
            there = sorted(int(path.parent.name) for path in out.glob("commits/*/zarr.json"))
            self.tally["within"] += 0 < len(there) < len(self.truth)
            try:
                recording = Recording.open(out)
                self.tally["lost"] += len(there) - recording.frame_count + len(recording.lost) * (len(there) > 0)
                for frame in there:
                    self.tally["different"] += not same(recording.gaussians(frame), self.truth[frame])
            except GaspError as error:
                self.fault("unreadable", str(error))
        done = subprocess.run(
            [*self.command, "--out", out.name, "--resume"],
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=600,
        )
        if done.returncode:
            self.fault("not resumed", done.stderr)
            return
        again = Recording.open(out)
        equal = again.frame_count == len(self.truth) and again.status == "complete"
        equal &= all(same(again.gaussians(frame), truth) for frame, truth in enumerate(self.truth))
        if not equal:
            self.fault("resumed otherwise", repr(again))
        if "--render" in self.command and not (self.folder / "film.mp4").exists():
            self.fault("no film", "")

    def fault(self, kind: str, told: str) -> None:
        """Count and tell it."""
        self.tally[kind] += 1
        print(f"!! {' '.join(self.command[3:])}: {kind}: {told.strip()[-300:]}", flush=True)


def runs(trials: int, engines: list[str], variants: list[str], seed: int) -> bool:
    """Kill runs, print a table, and say whether all was well."""
    chance = random.Random(seed)
    total: Counter[str] = Counter()
    share = -(-trials // (len(engines) * len(variants)))
    print(f"{'ENGINE':15}{'VARIANT':10}{'SECONDS':>8}{'KILLED':>8}{'IN FRAMES':>10}{'LOST':>6}{'OTHER':>6}  FAULTS")
    for engine in engines:
        for variant in variants:
            with tempfile.TemporaryDirectory() as temporary:
                folder = Path(temporary)
                prepared(folder)
                killed = Killed(folder, engine, variant)
                if killed.refusal:
                    print(f"{engine:15}{variant:10} cannot: {killed.refusal[-150:]}", flush=True)
                    continue
                for _ in range(share):
                    killed.trial(chance)
                left = sorted(path.name for path in folder.iterdir())
                expected = {
                    "toy.ply",
                    "plain.toml",
                    "moving.toml",
                    "driven.toml",
                    "whole.gasp",
                    "killed.gasp",
                    "film.mp4",
                }
                if set(left) - expected:
                    killed.fault("left over", ", ".join(sorted(set(left) - expected)))
            found = killed.tally
            faults = {
                kind: number
                for kind, number in found.items()
                if kind not in ("trials", "killed", "within", "lost", "different")
            }
            print(
                f"{engine:15}{variant:10}{killed.seconds:>8.1f}{found['killed']:>5}/{found['trials']}"
                f"{found['within']:>10}{found['lost']:>6}{found['different']:>6}  {faults or ''}",
                flush=True,
            )
            total.update(found)
    bad = {kind: number for kind, number in total.items() if kind not in ("trials", "killed", "within") and number}
    told = f"{total['killed']} killed, {total['within']} of them within their frames"
    print(f"{total['trials']} runs, {told}; faults: {bad or 'none'}")
    return not bad and total["killed"] > 0


# --- commands -------------------------------------------------------------------------------------------------------


def commands(folder: Path) -> dict[str, list[str]]:
    """Every command, as one would call it in a folder with a scene and a recording."""
    return {
        "run": ["run", "plain.toml", "--out", "out.gasp", "--overwrite", "--render", "out.mp4", "--size", "160x120"],
        "run isolated": ["run", "plain.toml", "--out", "out.gasp", "--overwrite", "--isolate", "--engine", "warp-mpm"],
        "compare": ["compare", "plain.toml", "--engines", "reference-mpm,mujoco-flex", "--out", "out", "--overwrite"],
        "tradeoff": ["tradeoff", "plain.toml", "--resolutions", "8,10", "--fractions", "0.3", "--repeats", "1",
                     "--out", "out", "--overwrite"],
        "render": ["render", "good.gasp", "--out", "out.mp4", "--size", "320x240", "--slower", "8"],
        "render pictures": ["render", "good.gasp", "--out", "out/", "--size", "320x240"],
        "export": ["export", "good.gasp", "--all", "--out", "out"],
        "convert": ["convert", "toy.ply", "out.spz"],
        "inspect": ["inspect", "toy.ply"],
        "verify": ["verify", "good.gasp"],
        "demo": ["demo", "--out", "out", "--engine", "reference-mpm"],
        "view": ["view", "good.gasp", "--no-open", "--port", "0"],
        "engines check": ["engines", "check", "reference-mpm", "mujoco-flex"],
        "conformance": ["conformance", "reference-mpm", "--quick"],
    }  # fmt: skip


def living(mark: str) -> list[psutil.Process]:
    """Processes that were started with the mark, by whomever."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get(MARK) == mark and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except psutil.Error:
            continue
    return found


def shared() -> set[str]:
    return {entry.name for entry in Path("/dev/shm").iterdir()} if Path("/dev/shm").is_dir() else set()


def signalled(name: str, words: list[str], moments: int, number: signal.Signals) -> list[str]:
    """End a command at some moments; what was left, a line each."""
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder, scratch = Path(temporary) / "work", Path(temporary) / "scratch"
        folder.mkdir(), scratch.mkdir()
        prepared(folder)
        mark = f"{name} {number.name} {os.getpid()}"
        environment = {**os.environ, MARK: mark, "TMPDIR": str(scratch)}
        if "good.gasp" in words:
            subprocess.run(
                [*GASP, "run", "plain.toml", "--out", "good.gasp"], cwd=folder, capture_output=True, check=True
            )
        inputs = {path.name for path in folder.iterdir()}

        def called(**how: Any) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                [*GASP, *words],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )

        start = time.monotonic()
        whole = called()
        try:
            whole.communicate(timeout=6.0 if name == "view" else 300)
            seconds = time.monotonic() - start
        except subprocess.TimeoutExpired:
            seconds = 4.0
            whole.terminate()
            whole.communicate()
        outputs = {path.name for path in folder.iterdir()} - inputs
        before = shared()
        for moment in range(moments):
            process = called()
            time.sleep(seconds * (moment + 0.5) / moments)
            process.send_signal(number)
            process.communicate()
            deadline = time.monotonic() + SOON
            while living(mark) and time.monotonic() < deadline:
                time.sleep(0.05)
            for left in living(mark):
                faults.append(f"process {' '.join(left.cmdline())[-80:]}")
                left.kill()
            faults += [f"shared memory {left}" for left in shared() - before]
        # Whatever the dead ones left, the next call takes away.
        last = called()
        try:
            last.communicate(timeout=6.0 if name == "view" else 300)
        except subprocess.TimeoutExpired:
            last.terminate()
            last.communicate()
        faults += [f"temporary {path.name}" for path in scratch.iterdir()]
        faults += [f"beside its output {path.name}" for path in folder.iterdir() if path.name not in inputs | outputs]
        for path in folder.rglob("*"):
            if ".part" in path.name or path.name.startswith(".runs-"):
                faults.append(f"within its output {path.relative_to(folder)}")
    return faults


def ended(moments: int, chosen: list[str]) -> bool:
    """End every command, print a table, and say whether all was well."""
    fine = True
    for name, words in commands(Path()).items():
        if chosen and name not in chosen:
            continue
        for number in (signal.SIGTERM, signal.SIGKILL):
            faults = signalled(name, words, moments, number)
            fine &= not faults
            print(f"{name:16}{number.name:8} at {moments} moments: {'nothing left' if not faults else ''}", flush=True)
            for fault, times in Counter(faults).items():
                print(f"    !! {fault} ({times} times)", flush=True)
    return fine


def main() -> int:
    """Do what is asked for; status 1 where anything was lost or left."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["runs", "commands"])
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--engines", default="")
    parser.add_argument("--variants", default=",".join(VARIANTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--moments", type=int, default=5)
    parser.add_argument("--only", default="", help="commands, with commas between")
    asked = parser.parse_args()
    if asked.what == "commands":
        return int(not ended(asked.moments, [name for name in asked.only.split(",") if name]))
    ready = [row.name for row in engine_rows(discover()) if row.status == "ready"]
    engines = asked.engines.split(",") if asked.engines else ready
    return int(not runs(asked.trials, engines, asked.variants.split(","), asked.seed))


if __name__ == "__main__":
    sys.exit(main())
