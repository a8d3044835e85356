"""From an engine that is offered to one that opens sessions: in this process, or in workers of their own."""

from __future__ import annotations

from typing import cast

from gasp_core.contract import PointEngine
from gasp_core.discovery.environments import ready_python
from gasp_core.discovery.loading import contained, how_to_mend, import_factory, one_line
from gasp_core.discovery.registry import EngineOffer
from gasp_core.engines.worker.engine import Interpreter, WorkerEngine, own_interpreter
from gasp_core.engines.worker.session import Limits
from gasp_core.errors import PluginLoadError

__all__ = ["open_engine", "open_worker"]


def open_engine(offer: EngineOffer) -> PointEngine:
    """Import an engine's own code and return the engine; one with an environment of its own is run there instead.

    Parameters
    ----------
    offer
        As `Registry.offer` gives it.

    Raises
    ------
    PluginLoadError
        Where its code, or the backend it stands on, cannot be imported: says what to install.
    EngineEnvironmentError
        Where its environment is missing or outdated.
    """
    if offer.descriptor.environment is not None:
        return open_worker(offer)
    what = f'engine "{offer.descriptor.name}"'
    factory = import_factory(offer.descriptor.factory, what, offer.distribution)
    try:
        return cast(PointEngine, contained(factory))
    except ImportError as error:
        # An engine may import its backend only now.
        remedy = how_to_mend(offer.distribution)
        raise PluginLoadError(f"{what} cannot be loaded: {one_line(error)}; {remedy}") from error


def open_worker(offer: EngineOffer, limits: Limits | None = None) -> WorkerEngine:
    """An engine whose sessions run in processes of their own, in its environment or else in this one.

    Parameters
    ----------
    offer
        As `Registry.offer` gives it.
    limits
        How long to wait for it.

    Raises
    ------
    EngineEnvironmentError
        Where its environment is missing or outdated.
    """
    name = offer.descriptor.name
    if offer.descriptor.environment is None:
        return WorkerEngine(offer.descriptor, own_interpreter(), how_to_mend(offer.distribution), limits)
    interpreter = Interpreter(python=ready_python(offer.descriptor), path=None)
    remedy = f"install it anew: gasp engines remove {name}, then gasp engines install {name}"
    return WorkerEngine(offer.descriptor, interpreter, remedy, limits)
