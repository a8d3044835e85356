"""Who makes the runs, and what each may take: the same options for all commands that make many."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.most_memory import Memory

if TYPE_CHECKING:
    from gasp_core.studies.runs import Backend, Limits

__all__ = ["Makers", "makers_options"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Makers:
    """What the options said.

    Parameters
    ----------
    backend, scheduler
        Of `chosen_backend`.
    jobs, threads
        Runs at a time, and threads of each; None: not said.
    time_limit [s], memory_limit [bytes]
        Of each run.
    """

    backend: str
    scheduler: str | None
    jobs: int | None
    threads: int | None
    time_limit: float | None
    memory_limit: int | None

    def at_once(self) -> int:
        """Runs at a time: as many as there are processors for their threads, where nothing was said."""
        from gasp_core.stepping.threads import processors

        return self.jobs or max(1, processors() // (self.threads or 1))

    def chosen(self, at_once: int) -> Backend:
        """Who makes them."""
        from gasp_core.studies.runs import chosen_backend

        return chosen_backend(self.backend, scheduler=self.scheduler, at_once=at_once)

    def limits(self, at_once: int) -> Limits:
        """Of each run; runs that share a machine share its processors."""
        from gasp_core.stepping.threads import processors
        from gasp_core.studies.runs import Limits

        if self.threads is None and self.scheduler is not None:
            # Of workers elsewhere nobody here knows the processors.
            return Limits(seconds=self.time_limit, memory=self.memory_limit, threads=1)
        threads = self.threads or (max(1, processors() // at_once) if at_once > 1 or self.backend != "loky" else None)
        return Limits(seconds=self.time_limit, memory=self.memory_limit, threads=threads)


def makers_options(jobs: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options, and what they say as its argument `makers`; `jobs` is the help of that."""

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def with_makers(
            *args: Any,
            backend: str,
            scheduler: str | None,
            jobs: int | None,
            threads: int | None,
            time_limit: float | None,
            memory_limit: int | None,
            **others: Any,
        ) -> None:
            makers = Makers(
                backend=backend,
                scheduler=scheduler,
                jobs=jobs,
                threads=threads,
                time_limit=time_limit,
                memory_limit=memory_limit,
            )
            command(*args, makers=makers, **others)

        options = (
            click.option(
                "--backend",
                type=click.Choice(["loky", "dask", "ray"]),
                default="loky",
                show_default=True,
                help="loky: processes here; dask, ray: workers of a cluster (docs/cluster.md).",
            ),
            click.option(
                "--scheduler",
                metavar="ADDRESS",
                help="Of dask: tcp://host:8786, or a scheduler file; of ray: auto, or an address."
                " [default: a cluster of its own on this machine]",
            ),
            click.option("--jobs", metavar="N", type=click.IntRange(min=1), help=jobs),
            click.option(
                "--threads",
                metavar="N",
                type=click.IntRange(min=1),
                help="Of each run. [default: the processors, shared out among the runs at a time; 1 with --scheduler]",
            ),
            click.option(
                "--time-limit",
                metavar="S",
                type=click.FloatRange(min=0, min_open=True),
                help="Give a run up after S seconds.",
            ),
            click.option(
                "--memory-limit", metavar="SIZE", type=Memory(), help="Give a run up that takes more: 4G, 500M."
            ),
        )
        return functools.reduce(lambda wrapped, option: option(wrapped), reversed(options), with_makers)

    return decorated
