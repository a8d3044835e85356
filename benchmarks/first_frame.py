"""How long `gasp demo` takes to its first frame: with empty caches, and with what the first time left.

Every cache is in a new folder: compiled Python, Numba's, Taichi's, Warp's. "first frame" is when the first simulated
frame is in the recording; "whole" is the command's end, with the frame at rest and one more, filmed and exported.

    python benchmarks/first_frame.py [--engines warp-mpm taichi-mpm]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gasp_core.recording.layout import commit_key


def run(engine: str, folder: Path, caches: Path) -> tuple[float, float]:
    """Seconds to the first simulated frame, and to the end."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment |= {
        "PYTHONPYCACHEPREFIX": str(caches / "python"),
        "NUMBA_CACHE_DIR": str(caches / "numba"),
        "TI_OFFLINE_CACHE_FILE_PATH": str(caches / "taichi"),
        "WARP_CACHE_PATH": str(caches / "warp"),
    }
    command = [sys.executable, "-m", "gasp_core.cli.main", "demo", "--engine", engine, "--frames", "2", "--out", folder]
    begin = time.perf_counter()
    first, commit = None, folder / "toy.gasp" / commit_key(1)
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            if first is None and commit.exists():
                first = time.perf_counter() - begin
            time.sleep(0.02)
    if process.returncode or first is None:
        raise SystemExit(f"gasp demo --engine {engine} ended with status {process.returncode}")
    return first, time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["warp-mpm", "taichi-mpm"])
    parser.add_argument("--warm", type=int, default=3, help="warm runs; the median is shown")
    arguments = parser.parse_args()
    print(f"{'engine':<11} {'':<5} {'first frame s':>14} {'whole s':>8}")
    for engine in arguments.engines:
        with tempfile.TemporaryDirectory() as folder:
            caches = Path(folder) / "caches"
            runs = [run(engine, Path(folder) / f"demo-{index}", caches) for index in range(arguments.warm + 1)]
        first, whole = runs[0]
        print(f"{engine:<11} {'cold':<5} {first:>14.1f} {whole:>8.1f}")
        first, whole = sorted(runs[1:])[len(runs[1:]) // 2]
        print(f"{engine:<11} {'warm':<5} {first:>14.1f} {whole:>8.1f}")


if __name__ == "__main__":
    main()
