"""Genesis in its process when that dies, or takes too long: in the middle of a run, as a user has it."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from gasp_core import EngineAccuracy, Recording, simulate
from gasp_core.contract import Elastic
from gasp_core.errors import EngineCrashedError
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.settings import EngineChoice, RecordingChoice
from gasp_core.toy import make_toy

# Each needs Genesis in a process of its own, which comes up in eight seconds.
pytestmark = pytest.mark.thorough

SOON = 5.0
"""Seconds within which the death of a worker has to be an error."""
PATIENCE = 300.0
"""Seconds for what is compiled, on any machine."""
MATERIAL = Elastic(density=200.0, youngs_modulus=2e4, poissons_ratio=0.3)


def scene(substep: float, **choice: float) -> Scene:
    """Ten frames of a falling toy."""
    return Scene(
        duration=1.0,
        frame_rate=10,
        objects=(SplatObject(name="toy", splat=make_toy(200), material=MATERIAL),),
        accuracy=EngineAccuracy(resolution=8, substep=substep, substep_limit=10**9),
        engine=EngineChoice(name="genesis-mpm", **choice),
        recording=RecordingChoice(checkpoint_frames=1),
    )


def descendants() -> set[int]:
    return {child.pid for child in psutil.Process().children(recursive=True)}


def gone(pids: set[int]) -> bool:
    deadline = time.monotonic() + SOON
    while time.monotonic() < deadline and pids & descendants():
        time.sleep(0.02)
    return not pids & descendants()


class Watch:
    """What a run's worker has of the machine while it runs."""

    def __init__(self) -> None:
        self.others = descendants()
        self.shared: set[str] = set()
        self.cpu = math.inf

    def workers(self) -> set[int]:
        return descendants() - self.others

    def look(self, frame: int) -> None:
        """Once a frame is recorded."""
        # Its guard is a child of its own.
        (worker,) = (child for child in psutil.Process().children() if child.pid not in self.others)
        self.cpu = worker.cpu_times().user
        self.shared |= {one.path for one in worker.memory_maps() if one.path.startswith("/dev/shm/")}


@pytest.fixture
def watch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: object) -> Iterator[Watch]:
    """To give a run; sees that no process and no shared memory is left afterwards, and no file but one log."""
    logs = tmp_path / "logs"
    logs.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(logs))
    watched = Watch()
    yield watched
    assert math.isfinite(watched.cpu)
    assert gone(watched.workers())
    assert not [path for path in watched.shared if Path(path).exists()]
    assert len(list(logs.glob("gasp-worker-*/genesis-mpm.log"))) == 1


def died(run: Callable[[], object], out: Path) -> EngineCrashedError:
    with pytest.raises(EngineCrashedError, match="the frames so far are kept in") as caught:
        run()
    assert caught.value.recording == out
    return caught.value


def test_killed_in_the_middle_of_a_frame(tmp_path: Path, watch: Watch) -> None:
    """kill -9, a second into the first frame, which would take a quarter of an hour."""
    out = tmp_path / "run.gasp"
    killed_at: list[float] = []

    def kill() -> None:
        deadline = time.monotonic() + PATIENCE
        while not killed_at and time.monotonic() < deadline:
            for worker in watch.workers():
                if psutil.Process(worker).cpu_times().user > watch.cpu + 1:
                    killed_at.append(time.monotonic())
                    os.kill(worker, signal.SIGKILL)
            time.sleep(0.05)

    killer = threading.Thread(target=kill)
    killer.start()
    error = died(lambda: simulate(scene(1e-7), out=out, recorded=watch.look), out)
    assert time.monotonic() - killed_at[0] < SOON
    killer.join()
    assert "was killed by SIGKILL" in str(error) and "advancing to 0.1 s" in str(error)
    recording = Recording.open(out)
    assert (recording.status, recording.frame_count) == ("incomplete", 1)


def test_given_up_after_its_limit(tmp_path: Path, watch: Watch) -> None:
    """A frame of a million substeps, of which two seconds are allowed; what is compiled does not count."""
    out = tmp_path / "run.gasp"
    whole = simulate(scene(1e-3, frame_limit=2.0), out=tmp_path / "whole.gasp", frames=3)
    assert whole.frame_count == 3
    error = died(lambda: simulate(scene(1e-7, frame_limit=2.0), out=out, recorded=watch.look), out)
    assert "was given up after 2 s while advancing to 0.1 s (set a longer frame_limit)" in str(error)
    assert Recording.open(out).frame_count == 1
