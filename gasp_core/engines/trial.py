"""Whether an engine's own code loads: tried in a process of its own, where nothing it does can do harm."""

from __future__ import annotations

from gasp_core.discovery.registry import EngineOffer
from gasp_core.engines.opening import open_worker
from gasp_core.engines.worker.session import Limits
from gasp_core.errors import GaspError

__all__ = ["loading_fault"]


def loading_fault(offer: EngineOffer, limit: float) -> str | None:
    """Why an engine cannot be made, in one line; None where it can.

    Parameters
    ----------
    offer
        As `Registry.offer` gives it.
    limit
        Seconds after which it is given up.
    """
    try:
        open_worker(offer, Limits(opening=limit)).load()
    except GaspError as error:
        return str(error)
    return None
