"""How they live with others: sessions, checkpoints, the process they share."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, EngineSession, Impulse, Pinned, PointProblem, StepReport
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


class Captured(Session):
    def advance_to(self, time: float) -> StepReport:
        inner: Any = self.inner
        inner._problem = replace(inner._problem, gravity=self.engine.gravity)
        return super().advance_to(time)


@mutant("gravity-is-global", {"side-by-side": "first session"})
class GravityIsGlobal(Mutant):
    """The session opened last decides on everybody's gravity."""

    session = Captured
    gravity = (0.0, 0.0, 0.0)

    def open(self, problem: PointProblem, **choices: Any) -> Session:
        self.gravity = problem.gravity
        return super().open(problem, **choices)


class Linked(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.engine.open_sessions.append(self.inner)

    def close(self) -> None:
        while self.engine.open_sessions:
            self.engine.open_sessions.pop().close()


@mutant("closing-closes-all", {"side-by-side": "raised ValueError: reference-mpm: the session is closed"})
class ClosingClosesAll(Mutant):
    """The first session to close takes the backend away from all others."""

    session = Linked

    def __init__(self) -> None:
        self.open_sessions: list[EngineSession] = []


class Swallowing(Session):
    def __exit__(self, *error: object) -> Any:
        self.close()
        return True


@mutant("swallows-errors", {"lifecycle": "DID NOT RAISE"})
class SwallowsErrors(Mutant):
    """What goes wrong within a session's `with` is never heard of."""

    session = Swallowing


class Scribbling(Session):
    def close(self) -> None:
        places = self.problem.points.reference_positions
        places.flags.writeable = True
        places -= places.mean(axis=0)
        places.flags.writeable = False
        super().close()


@mutant("scribbles", {"owned-buffers": "the problem's own arrays were changed"})
class Scribbles(Mutant):
    """It works in the arrays it was given."""

    session = Scribbling


class ClosingOnce(Session):
    def close(self) -> None:
        self.inner.read(frozenset())
        super().close()


@mutant("closes-once", {"close-twice": "raised ValueError: reference-mpm: the session is closed"})
class ClosesOnce(Mutant):
    """Closing again is an error."""

    session = ClosingOnce


class Undead(Session):
    def close(self) -> None: ...


@mutant("never-closes", {"close-twice": "DID NOT RAISE"})
class NeverCloses(Mutant):
    """A closed session goes on."""

    session = Undead


class Amnesiac(Session):
    def checkpoint(self) -> Mapping[str, Array]:
        kept = self.inner.checkpoint()
        return {**kept, "velocities": np.zeros_like(kept["velocities"])}


@mutant("checkpoint-forgets-velocities", {"checkpoints": "bit for bit"})
class CheckpointForgetsVelocities(Mutant):
    """What goes on from a checkpoint starts at rest."""

    session = Amnesiac


@mutant("strikes-twice", {"checkpoints": "checkpoints, driven"})
class StrikesTwice(Mutant):
    """What struck before the checkpoint strikes again after it."""

    def open(self, problem: PointProblem, *, restart: Mapping[str, Array] | None = None, **choices: Any) -> Session:
        if restart is not None:
            now = float(restart["time"])
            struck = (replace(drive, start=now) if isinstance(drive, Impulse) else drive for drive in problem.drives)
            problem = replace(problem, drives=tuple(struck))
        return super().open(problem, restart=restart, **choices)


class Talking(Session):
    def advance_to(self, time: float) -> StepReport:
        print(f"advancing to {time} s")
        return super().advance_to(time)


@mutant("prints", {"error-kinds": "standard output", "own-process": "standard output"})
class Prints(Mutant):
    """It talks on standard output."""

    session = Talking


@mutant("main-thread-only", {"own-process": "main thread"})
class MainThreadOnly(Mutant):
    """It sets a signal handler, which only the main thread may."""

    def open(self, problem: PointProblem, **choices: Any) -> Session:
        signal.signal(signal.SIGFPE, signal.getsignal(signal.SIGFPE))
        return super().open(problem, **choices)


@mutant("leaves-a-process", {"own-process": "outlive"}, slow=["own-process"])
class LeavesAProcess(Mutant):
    """Its server outlives the process that started it."""

    def open(self, problem: PointProblem, **choices: Any) -> Session:
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(20)"])
        return super().open(problem, **choices)


@mutant("steps-by-the-crowd", {"V16[a body far away]": "distance / size"})
class StepsByTheCrowd(Mutant):
    """Every body has a share of the steps, wherever it is."""

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        if accuracy.substep is None:
            return accuracy
        return replace(accuracy, substep=accuracy.substep / len(np.unique(problem.points.body_ids)))


@mutant("regions-hold-points", {"V16[a body far away, held]": "distance / size"})
class RegionsHoldPoints(Mutant):
    """Where there are several bodies a region holds those that have a point in it; a body by itself, what is near."""

    def problem(self, problem: PointProblem) -> PointProblem:
        points = problem.points
        if not points.body_ids.any():
            return problem
        held = [
            drive
            for drive in problem.drives
            if not isinstance(drive, Pinned) or (drive.region.signed_distance(points.reference_positions) < 0).any()
        ]
        return replace(problem, drives=tuple(held))
