"""How long ``gasp`` takes to say something, against the import of NumPy that nothing here can do without.

    python benchmarks/startup.py [rounds]

The bar is 3. Runs are interleaved, so that what else the machine does falls on all alike, and the median is taken.
"""

import statistics
import subprocess
import sys
import time

YARDSTICK = 'python -c "import numpy"'
COMMANDS = {
    YARDSTICK: [sys.executable, "-c", "import numpy"],
    "gasp --help": [sys.executable, "-m", "gasp_core.cli.main", "--help"],
    "gasp engines": [sys.executable, "-m", "gasp_core.cli.main", "engines"],
    "gasp engines --json": [sys.executable, "-m", "gasp_core.cli.main", "engines", "--json"],
    "gasp --version": [sys.executable, "-m", "gasp_core.cli.main", "--version"],
}


def seconds(command):
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    for command in COMMANDS.values():
        seconds(command)  # bytecode and disk cache
    times = {name: [] for name in COMMANDS}
    for _ in range(rounds):
        for name, command in COMMANDS.items():
            times[name].append(seconds(command))
    yardstick = statistics.median(times[YARDSTICK])
    for name, own in times.items():
        median = statistics.median(own)
        print(f"{name:26} {1e3 * median:6.0f} ms   {median / yardstick:4.2f} times the yardstick")


if __name__ == "__main__":
    main()
