"""A run in a fresh interpreter, as `python -m gasp_conformance.elsewhere ENGINE PRECISION DEVICE THREAD JOB RESULT`.

The child finds the engine as everybody does, by the registry. It must end by itself, leave nothing running, and print
nothing to standard output, which belongs to whoever started it.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, PointProblem, PointState
from gasp_core.processes import guard
from gasp_core.processes.group import end_group, outlived_by_group
from gasp_core.processes.scratch import scratch_folder

__all__ = ["Elsewhere", "run_elsewhere"]

Array = NDArray[Any]

_PATIENCE = 300.0
"""Seconds after which a process that ought to have ended long ago is said to hang."""
_LINGER = 10.0
"""Seconds that its children may take to follow it."""
_ARRAYS = ("positions", "velocities", "deformation_gradients", "tracer_positions")


@dataclass(frozen=True, slots=True, kw_only=True)
class Elsewhere:
    """What a run in a process of its own left.

    Parameters
    ----------
    state
        At the last time; None where it did not get there.
    ended
        Whether the process ended by itself.
    status
        It ended with; negative for a signal.
    printed, complaints
        On standard output and standard error.
    left_behind
        Whether processes that it started outlived it.
    """

    state: PointState | None
    ended: bool
    status: int
    printed: str
    complaints: str
    left_behind: bool


def run_elsewhere(
    engine: str,
    precision: str,
    device: str,
    problem: PointProblem,
    accuracy: EngineAccuracy,
    times: Sequence[float],
    fields: frozenset[Field],
    *,
    in_thread: bool = False,
) -> Elsewhere:
    """Run a problem in a fresh interpreter, in its main thread or in another one."""
    with scratch_folder("gasp-conformance-") as folder:
        job, result = Path(folder, "job.pickle"), Path(folder, "result.npz")
        job.write_bytes(pickle.dumps((problem, accuracy, list(times), fields)))
        command = [sys.executable, "-m", guard.__name__, __name__, engine, precision, device]
        command += [str(int(in_thread)), str(job), str(result)]
        # Files, not pipes: a grandchild that keeps a pipe open would keep us waiting.
        with (
            Path(folder, "out").open("w+b") as out,
            Path(folder, "err").open("w+b") as err,
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=out, stderr=err, start_new_session=True) as process,
        ):
            ended, left_behind = True, False
            try:
                process.wait(_PATIENCE)
                left_behind = outlived_by_group(process, _LINGER)
            except subprocess.TimeoutExpired:
                ended = False
            finally:
                status = end_group(process)
            out.seek(0)
            err.seek(0)
            return Elsewhere(
                state=_loaded(result),
                ended=ended,
                status=status,
                printed=out.read().decode(errors="replace"),
                complaints=err.read().decode(errors="replace"),
                left_behind=left_behind,
            )


def _loaded(path: Path) -> PointState | None:
    if not path.exists():
        return None
    with np.load(path) as found:
        arrays = {name: found[name] for name in _ARRAYS if name in found}
        return PointState(time=float(found["time"]), **arrays)


def _run(engine: str, precision: str, device: str, job: Path, result: Path) -> None:
    from gasp_conformance.subject import find_subject
    from gasp_core.contract import Precision

    # Written by our own parent a moment ago.
    problem, accuracy, times, fields = pickle.loads(job.read_bytes())
    *_, state = find_subject(engine, Precision(precision), device).states(problem, accuracy, times, fields)
    arrays = {name: getattr(state, name) for name in _ARRAYS if getattr(state, name) is not None}
    partial = result.with_suffix(".partial.npz")
    np.savez(partial, time=state.time, **arrays)
    partial.replace(result)


def _main() -> None:
    engine, precision, device, in_thread, job, result = sys.argv[1:]
    arguments = (engine, precision, device, Path(job), Path(result))
    if in_thread == "0":
        _run(*arguments)
        return
    thread = threading.Thread(target=_run, args=arguments)
    thread.start()
    thread.join()


if __name__ == "__main__":
    _main()
