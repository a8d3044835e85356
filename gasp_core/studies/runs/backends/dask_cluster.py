"""Runs by the workers of a Dask cluster: one that is there, or one of its own on this machine.

A worker that is lost has its run made again by another one; Dask gives a run up that takes a fourth worker along.
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
            results = _results(client, parcels)
            stack.callback(results.close)
            yield results


def _results(client: Any, parcels: Sequence[Parcel]) -> Generator[Ended]:
    from distributed import as_completed

    parcels = begun_now(parcels)
    token = uuid.uuid4().hex[:8]
    sent: dict[str, Any] = {}
    numbers: dict[Any, int] = {}
    attempts = [0] * len(parcels)

    def submitted(index: int, attempt: int) -> Any:
        parcel = parcels[index]
        along = {source.digest: sent[source.digest] for source in parcel.sources if source.digest in sent}
        future = client.submit(
            _on_worker, parcel, list(along), *along.values(), key=f"gasp-{token}-{index}-{attempt}", pure=False
        )
        numbers[future] = index
        return future

    waiting: Any = as_completed([submitted(index, 0) for index in range(len(parcels))])
    try:
        for future in waiting:
            index = numbers.pop(future)
            outcome = outcome_of(future.result, parcels[index])
            if isinstance(outcome, Missing):
                for digest in outcome.digests:
                    if digest not in sent:
                        content = parcels[index].packed_source(digest)
                        # On all workers that there are: the loss of one loses nothing.
                        sent[digest] = client.scatter(content, hash=False, broadcast=True)
                attempts[index] += 1
                waiting.add(submitted(index, attempts[index]))
            else:
                yield index, outcome
            # What is not needed any more the scheduler forgets.
            future.release()
    finally:
        # What is under way notices on its worker that nobody wants it any more.
        client.cancel(list(numbers), force=True)


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
