"""The process of one run: `python -m gasp_core.studies.runs.child FOLDER`.

FOLDER has the pickled `Run`; written there are when each frame was recorded, and in the end what came of it. Nobody
talks to this process; it lives as long as its stdin is held open.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from gasp_core.processes.guard import guard_group, read_nothing
from gasp_core.processes.termination import ignore_termination
from gasp_core.studies.runs.outcome import RunStatus

if TYPE_CHECKING:
    from gasp_core.studies.runs.outcome import Run

__all__ = ["ENDING", "OUTPUT", "RUN", "STAMPS", "main"]

RUN = "run.pickle"
STAMPS = "stamps.jsonl"
ENDING = "ending.json"
OUTPUT = "output.log"

_LOOK = 2.0
"""Seconds between looks at memory and processor time, which take milliseconds."""


def main() -> None:
    """Make the run."""
    # First of all, while there are no threads and next to no memory to fork.
    guard = guard_group()
    ignore_termination()
    read_nothing()

    import faulthandler
    import json
    import pickle
    import warnings

    faulthandler.enable(all_threads=False)  # a segfault leaves in the log where it was
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    folder = Path(sys.argv[1])
    sys.argv[:] = ["gasp-run"]
    with (folder / STAMPS).open("w", buffering=1) as stamps:
        run: Run = pickle.loads((folder / RUN).read_bytes())
        # It may hold a whole splat, and whoever would remove it may be killed.
        (folder / RUN).unlink()
        ending, reason = _carried_out(run, _Stamps(stamps, run, guard))
    beside = folder / f"{ENDING}.part"
    beside.write_text(json.dumps({"ending": ending.value, "reason": reason}))
    beside.replace(folder / ENDING)


class _Stamps:
    """Writes down when each frame was recorded, and now and then what has been used so far."""

    def __init__(self, stream: TextIO, run: Run, guard: int) -> None:
        from gasp_core.processes.usage import usage_so_far

        self._stream = stream
        wanted = run.scene.frame_count if run.frames is None else min(run.frames, run.scene.frame_count)
        self._looked_at = {0, 1, wanted - 1}
        self._usage = lambda: usage_so_far(less=[guard])
        self._looked = 0.0

    def __call__(self, frame: int) -> None:
        import json

        now = time.monotonic()
        stamp: dict[str, Any] = {"at": now}
        if frame in self._looked_at or now - self._looked > _LOOK:
            usage = self._usage()
            stamp |= {"cpu": usage.cpu_seconds, "peak": usage.peak_bytes}
            self._looked = now
        self._stream.write(json.dumps(stamp) + "\n")


def _carried_out(run: Run, stamps: _Stamps) -> tuple[RunStatus, str]:
    """Simulate; how that ended, and why where it is not complete."""
    from contextlib import nullcontext

    from gasp_core import errors
    from gasp_core.discovery.loading import one_line
    from gasp_core.recording.addresses import mirrored, pushing
    from gasp_core.simulation import simulate

    kept = mirrored(run.address, resume=False, overwrite=True, here=run.out) if run.address else nullcontext()
    try:
        with kept as mirror:
            recording = simulate(
                run.scene,
                out=run.out,
                frames=run.frames,
                trust_code=run.trust_code,
                progress=False,
                recorded=stamps if mirror is None else pushing(mirror, stamps),
            )
    except (
        errors.UnsupportedSceneError,
        errors.UnknownEngineError,
        errors.DuplicateEngineError,
        errors.PluginLoadError,
        errors.EngineEnvironmentError,
    ) as error:
        return RunStatus.UNABLE, one_line(error)
    except ImportError as error:  # an engine may import its backend when it is opened
        return RunStatus.UNABLE, f'engine "{run.scene.engine.name}" lacks its backend: {one_line(error)}'
    except errors.EngineDivergedError as error:
        return RunStatus.DIVERGED, one_line(error)
    except errors.EngineCrashedError as error:
        return RunStatus.CRASHED, one_line(error)
    except errors.GaspError as error:
        return RunStatus.FAILED, one_line(error)
    except OSError as error:
        return RunStatus.FAILED, one_line(error)
    except BaseException as error:  # an engine may raise anything, exits too
        return RunStatus.CRASHED, f'engine "{run.scene.engine.name}" failed: {one_line(error)}'
    asked = run.scene.frame_count if run.frames is None else min(run.frames, run.scene.frame_count)
    if recording.frame_count < asked:
        return RunStatus.FAILED, recording.reason
    return RunStatus.COMPLETE, ""


if __name__ == "__main__":
    main()
