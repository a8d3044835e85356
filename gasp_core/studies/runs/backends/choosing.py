"""A backend by its name."""

from __future__ import annotations

from gasp_core.errors import BackendError, SceneError
from gasp_core.studies.runs.backends.interface import Backend
from gasp_core.studies.runs.backends.local import LocalRuns

__all__ = ["BACKENDS", "chosen_backend"]

BACKENDS = ("loky", "dask", "ray")


def chosen_backend(name: str = "loky", *, scheduler: str | None = None, at_once: int = 1) -> Backend:
    """The backend of a name.

    Parameters
    ----------
    name
        "loky": processes of this machine, by joblib; "dask", "ray": the workers of a cluster.
    scheduler
        Of dask an address (tcp://host:8786) or a scheduler file; of ray "auto" or an address. None: a cluster of its
        own on this machine, of `at_once` workers.
    at_once
        Runs at a time; workers of a cluster that is there already are as many as they are.

    Raises
    ------
    SceneError
        Where `at_once` is not > 0.
    BackendError
        Where there is no such backend, its package is not installed, or a scheduler is named that it has none of.
    """
    if at_once < 1:
        raise SceneError(f"at_once must be at least 1, found {at_once!r}")
    if name == "loky":
        if scheduler is not None:
            raise BackendError("a scheduler is of dask or ray: name one of these backends too")
        return LocalRuns(at_once=at_once)
    if name == "dask":
        from gasp_core.studies.runs.backends.dask_cluster import DaskRuns

        return DaskRuns(scheduler=scheduler, workers=at_once)
    if name == "ray":
        from gasp_core.studies.runs.backends.ray_cluster import RayRuns

        return RayRuns(scheduler=scheduler, workers=at_once)
    raise BackendError(f'there is no backend "{name}": choose one of {", ".join(BACKENDS)}')
