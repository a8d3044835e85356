"""Runs by the workers of a Dask cluster: one that is there, or one of its own on this machine.

A worker that is lost has its run made again by another one; Dask gives a run up that takes a fourth worker along. Of
what workers lacked and were sent Dask keeps no more copies than there are workers that wait for it: with the last of
these it forgets the runs that wait, and they are sent again from here.
"""

from __future__ import annotations

import importlib
import logging
import uuid
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import BackendError
from gasp_core.studies.runs.backends.interface import Ended
from gasp_core.studies.runs.backends.parcels import Missing, Parcel, begun_now, on_worker, outcome_of, parcels_of
from gasp_core.studies.runs.outcome import Limits, Outcome, Run

__all__ = ["DaskRuns"]

_PATIENCE = 30.0
"""Seconds for which a scheduler is waited for."""
_AGAIN = 3
"""How often a run is sent again whose files were lost with a worker: as often as Dask makes one again by itself."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class DaskRuns:
    """A `Backend`.

    Parameters
    ----------
    scheduler
        Its address, or its file; None: a cluster of its own.
    workers
        Of that one.
    """

    scheduler: str | None = None
    workers: int = 1

    @contextmanager
    def made(self, runs: Sequence[Run], limits: Limits) -> Generator[Generator[Ended]]:
        """See `Backend`."""
        parcels = parcels_of(runs, limits)
        with ExitStack() as stack:
            client = _client(self.scheduler, self.workers, stack)
            results = _results(client, parcels, self.scheduler or "its own")
            stack.callback(results.close)
            yield results


def _results(client: Any, parcels: Sequence[Parcel], where: str) -> Generator[Ended]:
    from distributed import as_completed

    parcels = begun_now(parcels)
    token = uuid.uuid4().hex[:8]
    sent: dict[str, Any] = {}
    numbers: dict[Any, int] = {}
    attempts = [0] * len(parcels)
    lost = [0] * len(parcels)

    def is_there(digest: str) -> bool:
        return digest in sent and sent[digest].status == "finished"

    def submitted(index: int) -> Any:
        parcel = parcels[index]
        along = {source.digest: sent[source.digest] for source in parcel.sources if is_there(source.digest)}
        key = f"gasp-{token}-{index}-{attempts[index]}"
        future = client.submit(_on_worker, parcel, list(along), *along.values(), key=key, pure=False)
        numbers[future] = index
        attempts[index] += 1
        return future

    waiting: Any = as_completed([submitted(index) for index in range(len(parcels))])
    try:
        for future in waiting:
            index = numbers.pop(future)
            if future.cancelled():
                _refuse_lost(client, where)
                lost[index] += 1
                if lost[index] <= _AGAIN:
                    waiting.add(submitted(index))
                    continue
            outcome = outcome_of(future.result, parcels[index])
            if isinstance(outcome, Missing):
                for digest in outcome.digests:
                    if not is_there(digest):
                        sent[digest] = client.scatter(parcels[index].packed_source(digest), hash=False, broadcast=True)
                waiting.add(submitted(index))
            else:
                yield index, outcome
            # What is not needed any more the scheduler forgets.
            future.release()
    finally:
        # What is under way notices on its worker that nobody wants it any more.
        if client.status == "running":
            client.cancel(list(numbers), force=True)


def _refuse_lost(client: Any, where: str) -> None:
    """Refuse to go on where it is the scheduler that has gone, with all that it knew of."""
    if client.status != "running":
        raise BackendError(
            f"the connection to the dask scheduler ({where}) is lost: what was done is kept, gasp sweep goes on with"
            " the rest when it is called again"
        )


def _on_worker(parcel: Parcel, digests: Sequence[str], *contents: bytes) -> Outcome | Missing:
    return on_worker(parcel, digests, contents, _still_wanted())


def _still_wanted() -> Callable[[], bool]:
    """Whether the scheduler still wants the task that asks: not once its client has cancelled it, or is gone."""
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state in ("executing", "long-running")

    return wanted


def _client(scheduler: str | None, workers: int, stack: ExitStack) -> Any:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise BackendError("runs by dask need its package: pip install 'gasp-core[dask]'") from None
    _quietly()
    if scheduler is None:
        cluster = stack.enter_context(
            distributed.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
        )
        return stack.enter_context(distributed.Client(cluster))
    where: Mapping[str, str] = {"address": scheduler} if "://" in scheduler else {"scheduler_file": scheduler}
    if "scheduler_file" in where and not Path(scheduler).is_file():
        raise BackendError(
            f"{scheduler}: is neither a scheduler file nor an address such as tcp://host:8786 (dask prints its own)"
        )
    try:
        client = stack.enter_context(distributed.Client(timeout=_PATIENCE, **where))
    except (OSError, TimeoutError, ValueError) as error:
        said = " ".join(str(error).split())[:200]
        raise BackendError(f"no dask scheduler at {scheduler} within {_PATIENCE:g} s: {said}") from None
    if not client.nthreads():
        # A queue may be long, and a cluster that grows with its tasks has none before there are some.
        _LOG.warning("%s has no worker yet: the first run begins once one comes, Ctrl-C ends the waiting", scheduler)
    return client


def _quietly() -> None:
    """A run that is cancelled, and a worker that goes, are told as outcomes, and not in the middle of a table."""
    for name in ("distributed", "distributed.nanny", "distributed.scheduler", "distributed.worker", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
