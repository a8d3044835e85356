"""How long ``make test ROOM=...`` takes, room by room, and which tests cost most.

    python benchmarks/test_rooms.py [rooms]

The bar is 20 s on two cores for a room whose kernels are compiled: every room is run twice and the second run counts.
Beside it is what the processors did meanwhile, which another program on the machine does not change so much. Without
rooms, all of them. Exit status 1 where tests fail, whatever they took.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
MOST = 3
"""Tests that are named."""


def all_rooms():
    inside = {path.relative_to(ROOT / "tests").parts[0] for path in (ROOT / "tests").rglob("test_*.py")}
    plugins = {path.parent.name for path in (ROOT / "plugins").glob("*/tests")}
    return [*sorted(inside), *sorted(plugins), "conformance"]


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(room, report):
    """Seconds that the command took, those of its processors, and whether the tests passed."""
    # What make set for itself is not for the one that is started here.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    environment["PYTEST_ADDOPTS"] = f"--junitxml={report}"
    start, used = time.perf_counter(), processor_seconds()
    done = subprocess.run(
        ["make", "--no-print-directory", "test", f"ROOM={room}"],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    seconds, used = time.perf_counter() - start, processor_seconds() - used
    if done.returncode != 0:
        print(done.stdout, file=sys.stderr)
    return seconds, used, done.returncode == 0


def main(rooms):
    failed = False
    print(f"{'ROOM':14} {'TESTS':>6} {'SECONDS':>8} {'CPU':>6}   COST MOST [s]")
    for room in rooms:
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.xml"
            run(room, report)
            seconds, used, passed = run(room, report)
            failed |= not passed
            cases = list(ElementTree.parse(report).iter("testcase")) if report.exists() else []
        costly = sorted(cases, key=lambda case: -float(case.get("time")))[:MOST]
        named = ", ".join(f"{case.get('name')} {float(case.get('time')):.1f}" for case in costly)
        print(f"{room:14} {len(cases):6} {seconds:8.1f} {used:6.1f}   {named if passed else 'FAILED'}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or all_rooms()))
