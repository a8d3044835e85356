"""One process that reads mutants, and prints what became of each; whatever it does, the harness survives it.

    python tests/fuzz/batch.py TARGET FIRST COUNT FOLDER

For each mutant a line with its number before it is read, and a line of JSON afterwards.
"""

from __future__ import annotations

import json
import random
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

from recordings import RecordingSeed
from targets import HIDDEN, TARGETS, Seed

SECONDS = 5
"""Of processor time, after which a mutant hangs."""
ADDRESSES = 8 << 30
"""Bytes of address space: what is not refused must not take the machine with it. Threads and Numba want half."""


def mutant_of(name: str, seeds: Sequence[Seed | RecordingSeed], number: int) -> tuple[str, bytes]:
    """File name and content of a mutant."""
    chance = random.Random(f"{name} {number}")
    seed = chance.choice(seeds)
    others = [part for other in seeds for part in other.parts.values()]
    return seed.name, seed.mutant(others, chance)


def main(name: str, first: int, count: int, folder: Path) -> None:
    """Read mutants `first` to `first + count - 1` of a target."""
    from gasp_core.errors import GaspError

    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    # Which of them end the process.
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    warnings.simplefilter("ignore")
    target = (TARGETS | HIDDEN)[name]
    target.prepare(folder)
    seeds = target.seeds()
    for seed in seeds:
        # What is imported or compiled once is no mutant's fault; and a seed that cannot be read tests nothing.
        path = folder / seed.name
        path.write_bytes(seed.pack(seed.parts))
        target.read(path)
    print("ready", flush=True)
    for number in range(first, first + count):
        print(number, flush=True)
        file, content = mutant_of(name, seeds, number)
        path = folder / file
        path.write_bytes(content)
        before = _settle()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(10 * SECONDS)
        start = time.process_time()
        outcome, told = "read", ""
        try:
            target.read(path)
        except GaspError as error:
            outcome, told = "refused", str(error)
            if not told.isprintable() or len(told) > 2000:
                outcome = "refused badly"
        except BaseException as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            outcome = f"{type(error).__name__} ({Path(place.filename).name}:{place.lineno})"
            told = str(error)
        seconds = time.process_time() - start
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        grown = max(0, _memory("VmHWM") - before)
        line = {"outcome": outcome, "told": told, "seconds": seconds, "grown": grown, "size": len(content)}
        print(json.dumps(line), flush=True)


def _settle() -> int:
    """Resident bytes now; from here on the kernel counts the peak anew."""
    Path("/proc/self/clear_refs").write_text("5")
    return _memory("VmRSS")


def _memory(field: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{field}:")[1].split()[0]) * 1024


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
