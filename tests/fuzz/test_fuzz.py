"""Some mutants of everything that comes from outside; `make fuzz` reads more."""

import subprocess
import sys
from pathlib import Path

import pytest

HARNESS = Path(__file__).with_name("harness.py")
linux = pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="needs Linux's /proc to measure memory")


def harness(*arguments):
    return subprocess.run([sys.executable, str(HARNESS), *arguments], capture_output=True, text=True)


@linux
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("target", "count"),
    [
        ("splats", 500),
        # A process for each.
        ("stages", 60),
        ("scenes", 500),
        ("columns", 500),
        ("cameras", 500),
        ("archives", 500),
        ("soups", 500),
        ("conversations", 500),
        ("recordings", 60),
    ],
)
def test_mutants_are_read_or_refused(target, count):
    done = harness(target, "--count", str(count))
    assert done.returncode == 0, done.stdout + done.stderr


@linux
@pytest.mark.thorough
def test_the_harness_tells_every_fault_there_is(tmp_path):
    done = harness("faulty", "--count", "12", "--first", "1181", "--keep", str(tmp_path))
    assert done.returncode == 1, done.stdout + done.stderr
    for kind in ("memory: ", "hang: ", "process ended with -11: ", "ValueError (", "SystemExit (", "refused badly: "):
        assert f"faulty: {kind}" in done.stdout
    assert all(path.read_bytes()[:1] not in (b"g", b"r") for path in tmp_path.iterdir())
    assert list(tmp_path.iterdir())


@linux
def test_one_number_gives_one_mutant(tmp_path):
    for folder in ("a", "b"):
        harness("faulty", "--count", "1", "--first", "1182", "--keep", str(tmp_path / folder))
    (one,), (other,) = (list((tmp_path / folder).iterdir()) for folder in ("a", "b"))
    assert one.name == other.name
    assert one.read_bytes() == other.read_bytes()
