"""What files made to do harm cost before they are refused: ``gasp export`` or ``inspect`` of each, in its own process.

    python benchmarks/hostile_files.py

Each has to end in one line and status 2, under 2 s and 256 MB, the start of Python and its libraries included.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS / folder) for folder in ("support", "io", "recording")]

COMMAND = """
import pathlib, sys
from gasp_core.cli.main import main
status = main(sys.argv[1:])
peak = pathlib.Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]
print("peak", peak)
sys.exit(status)
"""


def recording(folder: Path) -> Path:
    """A small one, carried by cores."""
    import flying_points

    from gasp_core import Elastic, EngineChoice, Gaussians, Reduction, Scene, SplatObject, simulate

    draw = np.random.default_rng(0)
    splat = Gaussians(
        means=draw.normal(size=(700, 3)) / 3,
        quaternions=draw.normal(size=(700, 4)),
        scales=np.full((700, 3), 0.02),
        opacities=np.full(700, 0.9),
        harmonics=draw.normal(size=(700, 1, 3)),
    )
    jelly = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    thing = SplatObject(name="thing", splat=splat, material=jelly, reduction=Reduction(mode="cores", count=30))
    scene = Scene(duration=0.08, frame_rate=25.0, objects=(thing,), engine=EngineChoice(name="ballistic"))
    engine = (flying_points.descriptor(), flying_points.Ballistic())
    simulate(scene, engine=engine, out=folder / "whole.gasp", progress=False)
    return folder / "whole.gasp"


def recording_attacks():
    """By what they are, functions that make a good recording one."""
    from test_hostile import Payload, forge, forge_node, rewritten

    from gasp_core.recording.arrays import encoded
    from gasp_core.recording.nodes import sealed

    mark = Path(tempfile.gettempdir()) / "gasp-hostile-files-ran"

    def pickled(path: Path) -> None:
        import pickle

        forge(path, "reference/means/c.0.0", pickle.dumps(Payload(f"'{mark}'")))
        forge_node(path, "reference/means/zarr.json", lambda node: node.update(filters=[{"id": "pickle"}]))

    def consolidated(path: Path) -> None:
        root = json.loads((path / "zarr.json").read_text())
        old = {"zarr_format": 2, "shape": [700, 3], "chunks": [700, 3], "dtype": "|O", "compressor": {"id": "pickle"}}
        root["consolidated_metadata"] = {"kind": "inline", "metadata": {"reference/means": old}}
        (path / "zarr.json").write_bytes(sealed(root))

    def out_of_range(name: str, value: int):
        return lambda path: rewritten(path, name, lambda values: values.reshape(-1).__setitem__(11, value))

    def instead(key: str, put):
        def change(path: Path) -> None:
            (path / key).unlink()
            put(path / key)

        return change

    def deep(path: Path) -> None:
        (path / "zarr.json").write_text('{"a":' * 1_300_000 + "1" + "}" * 1_300_000)

    def one_row(path: Path) -> None:
        grid = {"name": "regular", "configuration": {"chunk_shape": [1, 3]}}
        change = {"chunk_grid": grid, "shape": [1 << 30, 3]}
        forge_node(path, "reference/means/zarr.json", lambda node: node.update(change))

    def large_chunk(values: int):
        return lambda path: forge(path, "reference/means/c.0.0", encoded(np.zeros(values)))

    chunk = "reference/means/c.0.0"
    return {
        "pickle in a chunk, named by a filter": pickled,
        "pickle in consolidated metadata": consolidated,
        "order = 5000 of 700 rows": out_of_range("order", 5000),
        "neighbours = -5": out_of_range("neighbours", -5),
        "labels = 30 of 30 cores": out_of_range("labels", 30),
        "pipe in the place of a chunk": instead(chunk, os.mkfifo),
        "pipe in the place of the header": instead("zarr.json", os.mkfifo),
        "/dev/zero in the place of a chunk": instead(chunk, lambda file: file.symlink_to("/dev/zero")),
        "JSON of 1,300,000 levels": deep,
        "chunks of one row, a billion of them": one_row,
        "Blosc chunk of 1 GB": large_chunk(1 << 27),
        "Blosc chunk of 8 MB": large_chunk(1 << 20),
    }, mark


def tried(command: list[str]) -> tuple[int, float, float, str]:
    """Status, seconds, peak of memory [MB], and what was said."""
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", COMMAND, *command], capture_output=True, text=True)
    seconds = time.perf_counter() - start
    peak = int(done.stdout.rpartition("peak ")[2] or 0) / 1024
    return done.returncode, seconds, peak, done.stderr.strip()


def main() -> int:
    import splat_files
    from test_memory import BOMBS

    print(f"{'WHAT':42} {'BYTES':>10} {'STATUS':>6} {'SECONDS':>8} {'MB':>6}   SAID")
    fine = True
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        good = recording(folder)
        attacks, mark = recording_attacks()
        mark.unlink(missing_ok=True)
        cases = []
        for what, change in attacks.items():
            path = folder / "a.gasp"
            shutil.rmtree(path, ignore_errors=True)
            shutil.copytree(good, path)
            change(path)
            size = sum(file.lstat().st_size for file in path.rglob("*"))
            cases.append((what, size, tried(["export", str(path), "--all", "--out", str(folder / "out")])))
        for name, make in BOMBS.items():
            path = folder / name
            path.write_bytes(make(splat_files))
            cases.append((name, path.stat().st_size, tried(["inspect", str(path)])))
        for what, size, (status, seconds, peak, said) in cases:
            ok = status == 2 and said.count("\n") == 0 and seconds < 2 and peak < 256
            fine &= ok
            print(f"{what:42} {size:>10,} {status:>6} {seconds:>8.2f} {peak:>6.0f}   {'' if ok else '!! '}{said[-70:]}")
        if mark.exists():
            fine = False
            print(f"!! a command of a sender was run: {mark}")
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
