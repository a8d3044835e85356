"""Runs by the workers of a Ray cluster: one that is there, or one of its own on this machine.

A worker, or a machine, that is lost has its run made again by another one.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import socket
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from gasp_core.errors import BackendError
from gasp_core.studies.runs.backends.interface import Ended
from gasp_core.studies.runs.backends.parcels import Missing, Parcel, begun_now, on_worker, outcome_of, parcels_of
from gasp_core.studies.runs.outcome import Limits, Outcome, Run

__all__ = ["RayRuns"]

_AGAIN = 3
"""Workers that a run may take along before it is given up."""
_PATIENCE = 10.0
"""Seconds for which an answer is waited for."""
_AHEAD = 2
"""Runs for each processor of the cluster that are handed over before they can begin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RayRuns:
    """A `Backend`.

    Parameters
    ----------
    scheduler
        "auto", or the address of a cluster; None: one of its own.
    workers
        Of that one.
    """

    scheduler: str | None = None
    workers: int = 1

    @contextmanager
    def made(self, runs: Sequence[Run], limits: Limits) -> Generator[Generator[Ended]]:
        """See `Backend`."""
        parcels = parcels_of(runs, limits)
        ray = _connected(self.scheduler, self.workers)
        results = _results(ray, parcels)
        try:
            yield results
        finally:
            results.close()
            ray.shutdown()


def _results(ray: Any, parcels: Sequence[Parcel]) -> Generator[Ended]:
    parcels = begun_now(parcels)
    remote = ray.remote(num_cpus=1, max_retries=_AGAIN, retry_exceptions=False)(_on_worker)
    sent: dict[str, Any] = {}
    under_way: dict[Any, int] = {}
    left = list(range(len(parcels)))[::-1]

    def submit(index: int) -> None:
        parcel = parcels[index]
        along = {source.digest: sent[source.digest] for source in parcel.sources if source.digest in sent}
        under_way[remote.remote(parcel, list(along), *along.values())] = index

    try:
        while left or under_way:
            # A cluster may grow.
            ahead = max(1, round(_AHEAD * float(ray.cluster_resources().get("CPU", 1))))
            while left and len(under_way) < ahead:
                submit(left.pop())
            (done,), _ = ray.wait(list(under_way), num_returns=1)
            index = under_way.pop(done)
            outcome = outcome_of(partial(ray.get, done), parcels[index])
            if isinstance(outcome, Missing):
                for digest in outcome.digests:
                    if digest not in sent:
                        sent[digest] = ray.put(parcels[index].packed_source(digest))
                submit(index)
            else:
                yield index, outcome
    finally:
        for reference in under_way:
            with contextlib.suppress(Exception):
                ray.cancel(reference, force=True)


def _on_worker(parcel: Parcel, digests: Sequence[str], *contents: bytes) -> Outcome | Missing:
    # The end of a worker ends what it started: a run holds on to nothing but its worker's life.
    return on_worker(parcel, digests, contents, lambda: True)


def _refuse_silent(scheduler: str) -> None:
    """Refuse an address at which nobody answers: Ray itself would try for a quarter of an hour."""
    host, colon, port = scheduler.rpartition("://")[2].rpartition(":")
    if not colon or not port.isdecimal():
        if scheduler == "auto":
            return
        raise BackendError(f'{scheduler}: is no address of ray: "auto", host:6379 or ray://host:10001')
    try:
        socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
    except (OSError, OverflowError) as error:
        raise BackendError(
            f"no ray cluster at {scheduler}: {getattr(error, 'strerror', None) or error}: ray start --head begins one"
        ) from None


def _connected(scheduler: str | None, workers: int) -> Any:
    # Nobody who simulates has asked to send reports to anybody.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    try:
        ray: Any = importlib.import_module("ray")
    except ImportError:
        raise BackendError("runs by ray need its package: pip install 'gasp-core[ray]'") from None
    if scheduler is not None:
        _refuse_silent(scheduler)
    own = {"address": scheduler} if scheduler is not None else {"num_cpus": workers, "include_dashboard": False}
    try:
        ray.init(log_to_driver=False, logging_level="ERROR", ignore_reinit_error=False, **own)
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        where = f"at {scheduler}" if scheduler is not None else "of its own"
        raise BackendError(f"no ray cluster {where}: {said}") from None
    return ray
