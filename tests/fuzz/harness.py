"""Mutants of everything that comes from outside, read in processes of their own; Linux only.

    python tests/fuzz/harness.py                          200 of each kind
    python tests/fuzz/harness.py --count 100000 splats    as long as you like
    python tests/fuzz/harness.py --first 4711 --count 1 --keep out splats

A mutant is read, or refused by a `GaspError` of one line. Anything else, more than 5 s of processor time, or more
memory than 64 MB and four times the file, is a fault: printed with its number, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from batch import mutant_of
from targets import HIDDEN, TARGETS

BATCH = 2000
"""Mutants a process reads."""
MEGABYTE = 1 << 20
REPEATED = 3
"""So often a fault is printed; the rest of its kind are counted."""


def memory_allowed(size: int) -> int:
    """Bytes that reading a file of this size may take."""
    return 64 * MEGABYTE + 4 * size


@dataclass(slots=True)
class Tally:
    """What became of the mutants of a target."""

    outcomes: Counter[str] = field(default_factory=Counter)
    faults: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    seconds: float = 0.0
    grown: int = 0

    def take(self, number: int, line: dict[str, object]) -> None:
        """Count one that was read to its end."""
        outcome, told = str(line["outcome"]), str(line["told"])
        grown, size, seconds = int(str(line["grown"])), int(str(line["size"])), float(str(line["seconds"]))
        self.seconds, self.grown = max(self.seconds, seconds), max(self.grown, grown)
        if outcome not in ("read", "refused"):
            self.fault(number, outcome, told)
        elif grown > memory_allowed(size):
            self.fault(number, "memory", f"{grown // MEGABYTE} MB for {size:,} bytes")
        else:
            self.outcomes[outcome] += 1

    def fault(self, number: int, what: str, told: str = "") -> None:
        """Count one that failed."""
        self.outcomes["fault"] += 1
        self.faults.setdefault(what, []).append((number, told))


def fuzz(name: str, first: int, count: int) -> Tally:
    """Read the mutants `first` to `first + count - 1` of a target."""
    tally = Tally()
    end = first + count
    while first < end:
        with tempfile.TemporaryDirectory(prefix="gasp-fuzz-") as folder:
            first = _batch(name, first, min(BATCH, end - first), Path(folder), tally)
    return tally


def _batch(name: str, first: int, count: int, folder: Path, tally: Tally) -> int:
    """Read mutants in one process until it ends; the number of the first that is left."""
    script = Path(__file__).with_name("batch.py")
    command = [sys.executable, str(script), name, str(first), str(count), str(folder)]
    ready, number = False, first - 1
    with (folder / "errors").open("w+") as errors:
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith("ready"):
                    ready = True
                elif line.startswith("{"):
                    tally.take(number, json.loads(line))
                elif line.strip().isdigit():
                    number = int(line)
        errors.seek(0)
        if not ready:
            raise SystemExit(f"{name}: the good files cannot be read:\n{errors.read()}")
    if process.returncode:
        how = {-27: "hang", -14: "hang"}.get(process.returncode, f"process ended with {process.returncode}")
        tally.fault(number, how)
    return number + 1


def table(tallies: dict[str, Tally]) -> str:
    """What was read, and what it took, a line a target."""
    head = f"{'what':<12}{'mutants':>10}{'refused':>10}{'read':>10}{'faults':>8}{'worst time':>12}{'worst memory':>14}"
    lines = [head]
    for name, tally in tallies.items():
        found = tally.outcomes
        lines.append(
            f"{name:<12}{found.total():>10,}{found['refused']:>10,}{found['read']:>10,}{found['fault']:>8,}"
            f"{tally.seconds:>10.2f} s{tally.grown / MEGABYTE:>11.0f} MB"
        )
    return "\n".join(lines)


def main() -> int:
    """Fuzz, print the table, and tell by the exit status whether there were faults."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--count", type=int, default=200, help="mutants of each")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--keep", type=Path, help="folder for the mutants that failed")
    asked = parser.parse_args()
    for name in asked.targets:
        if name not in TARGETS | HIDDEN:
            parser.error(f"no target {name!r}: choose from {', '.join(TARGETS)}")
    tallies: dict[str, Tally] = {}
    for name in asked.targets or TARGETS:
        tallies[name] = fuzz(name, asked.first, asked.count)
        for what, numbers in tallies[name].faults.items():
            print(f"{name}: {what}: {len(numbers)} times")
            for number, told in numbers[:REPEATED]:
                print(f"  mutant {number}: {told[:200]!r}")
                if asked.keep is not None:
                    keep(name, number, asked.keep)
    print(table(tallies))
    return int(any(tally.faults for tally in tallies.values()))


def keep(name: str, number: int, folder: Path) -> None:
    """Write a mutant to a folder."""
    file, content = mutant_of(name, (TARGETS | HIDDEN)[name].seeds(), number)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{number}_{file}").write_bytes(content)


if __name__ == "__main__":
    sys.exit(main())
