"""Many random scenes in a process of their own: what hangs or crashes there is told by number, and the rest goes on.

To see again what one of them did: python -m gasp_conformance.random_batch NAME PRECISION DEVICE FIRST LAST
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from gasp_conformance.random_scenes import describe, random_scene
from gasp_conformance.subject import Subject, find_subject
from gasp_conformance.watched_runs import watch_run
from gasp_core.contract import Precision
from gasp_core.processes import guard
from gasp_core.processes.exit_report import ending, tail
from gasp_core.processes.group import end_group
from gasp_core.processes.scratch import scratch_folder

__all__ = ["HUNG_AFTER", "Outcome", "run_batch", "run_scene"]

HUNG_AFTER = 600.0
"""Wall-clock time [s] without a scene begun or ended. Each takes less than a second, but for what is compiled before:
large kernels take a minute, and two where others use the machine."""
_POLL = 0.05
"""[s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a scene.

    Parameters
    ----------
    number
        The scene's.
    ending
        The last status, "refused", "hung" or "crashed".
    reason
        What the engine said where it did not finish.
    faults
        What must never happen.
    scene
        The scene with its numbers.
    """

    number: int
    ending: str
    reason: str
    faults: tuple[str, ...]
    scene: str


def run_scene(subject: Subject, number: int) -> Outcome:
    """Run a scene in this process."""
    scene = random_scene(number, subject.descriptor.capabilities)
    # An engine that is given a step may need a frame to find out that it does not bear it.
    grace = 0 if scene.accuracy.substep is None else 1
    run = watch_run(subject, scene.problem, scene.accuracy, scene.times, grace)
    reason = "" if run.finished else run.refusal or "; ".join(run.reports[-1].warnings if run.reports else ())
    return Outcome(number=number, ending=run.ending, reason=reason, faults=tuple(run.faults), scene=describe(scene))


def run_batch(subject: Subject, first: int, last: int, hung_after: float = HUNG_AFTER) -> list[Outcome]:
    """Run scenes `first` to `last`, both included, outside this process.

    Parameters
    ----------
    subject
        The engine, which the other process finds by its name.
    first, last
        Numbers of scenes.
    hung_after
        Seconds after which a scene that does not end is given up.

    Raises
    ------
    RuntimeError
        Where the process is lost before or after its scenes.
    """
    outcomes: list[Outcome] = []
    while first <= last:
        with scratch_folder("gasp-conformance-") as folder:
            done, lost = _one_process(subject, first, last, hung_after, Path(folder))
        outcomes += done
        if lost is None:
            break
        outcomes.append(lost)
        first = lost.number + 1
    return outcomes


def _one_process(
    subject: Subject, first: int, last: int, hung_after: float, folder: Path
) -> tuple[list[Outcome], Outcome | None]:
    """What a process got done, and the scene in which it was lost."""
    progress, words = folder / "progress", folder / "words"
    progress.touch()
    command = [sys.executable, "-m", guard.__name__, __spec__.name]
    command += [subject.name, subject.precision.value, subject.device, str(first), str(last)]
    environment = {**os.environ, _PROGRESS: str(progress)}
    with (
        words.open("wb") as sink,
        subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=sink, stderr=sink, start_new_session=True
        ) as process,
    ):
        try:
            hung = not _ended(process, progress, hung_after)
        finally:
            status = end_group(process)
    lines = [json.loads(line) for line in progress.read_text().splitlines()]
    done = [Outcome(**{**line, "faults": tuple(line["faults"])}) for line in lines if "ending" in line]
    if status == 0 and not hung:
        return done, None
    how = f"hung for {hung_after:g} s" if hung else ending(status)
    last_words = tail(words)
    said = f"; its output ends: {last_words}" if last_words else ""
    begun = [line["number"] for line in lines if "ending" not in line]
    if len(begun) == len(done):
        raise RuntimeError(f"{subject.name}: the process of its own {how} outside any scene{said}")
    number: int = begun[-1]
    scene = describe(random_scene(number, subject.descriptor.capabilities))
    fault = how if hung else f"took its process down, which {how}{said}"
    return done, Outcome(number=number, ending="hung" if hung else "crashed", reason="", faults=(fault,), scene=scene)


def _ended(process: subprocess.Popen[bytes], progress: Path, hung_after: float) -> bool:
    """Wait for the end of a process; False where its progress stops before."""
    size, since = 0, time.monotonic()
    while process.poll() is None:
        if progress.stat().st_size != size:
            size, since = progress.stat().st_size, time.monotonic()
        elif time.monotonic() - since > hung_after:
            return False
        time.sleep(_POLL)
    return True


_PROGRESS = "GASP_CONFORMANCE_PROGRESS"
"""Environment variable: the file a process tells its progress to, a line of JSON when a scene begins and ends."""


def _main() -> None:
    name, precision, device, first, last = sys.argv[1:]
    told = os.environ.get(_PROGRESS)
    with Path(told or os.devnull).open("a") as progress:
        subject = find_subject(name, Precision(precision), device)
        for number in range(int(first), int(last) + 1):
            print(json.dumps({"number": number}), file=progress, flush=True)
            outcome = run_scene(subject, number)
            print(json.dumps(asdict(outcome)), file=progress, flush=True)
            if not told:
                print(
                    f"{number:4d} {outcome.ending:<14} {outcome.reason}", *outcome.faults, outcome.scene, sep="\n     "
                )


if __name__ == "__main__":
    _main()
