"""The first thing a worker runs: `python -I start.py SETTINGS`, a script, since nothing of GASP can be imported yet.

It takes the channel out of reach of whatever the backend prints, ties its life to its parent's, borrows the packages it
is lent, and serves.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import importlib.abc
import importlib.util
import json
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

__all__ = ["LentPackages", "main"]

_LINGER = 3.0
"""Seconds a worker may take to end by itself once nobody speaks to it any more."""
_PR_SET_PDEATHSIG = 1


class LentPackages(importlib.abc.MetaPathFinder):
    """Finds the packages that are lent, before anything of the same name in this environment.

    Parameters
    ----------
    loans
        By top-level name; see `gasp_core.engines.worker.package_paths`.
    """

    def __init__(self, loans: Mapping[str, Mapping[str, Any]]) -> None:
        self._loans = loans

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None, /
    ) -> ModuleSpec | None:
        """Where a lent package is; what lies in it is then found in its own folders."""
        loan = self._loans.get(fullname)
        if loan is None:
            return None
        if loan["origin"] is None:
            spec = ModuleSpec(fullname, None, is_package=True)
            spec.submodule_search_locations = list(loan["folders"])
            return spec
        return importlib.util.spec_from_file_location(
            fullname, loan["origin"], submodule_search_locations=loan["folders"]
        )


def main() -> None:
    """Serve until nobody speaks to us any more."""
    settings: dict[str, Any] = json.loads(sys.argv[1])
    incoming, outgoing = os.dup(0), os.dup(1)
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123  (pathlib is not needed before the first line is read)
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    faulthandler.enable(all_threads=False)  # a segfault leaves in the log where it was
    if settings["dies_with_parent"]:
        _die_with_parent()
    if settings["path"] is not None:
        sys.path[:] = settings["path"]
    sys.meta_path.insert(0, LentPackages(settings["loans"]))
    sys.argv[:] = ["gasp-worker"]

    from gasp_core.engines.worker.serving import serve
    from gasp_core.engines.worker.shared_memory import Block
    from gasp_core.engines.worker.transport import Inbox

    os.set_inheritable(settings["block"], False)
    with os.fdopen(incoming, "rb") as words, os.fdopen(outgoing, "wb") as answers:
        serve(Inbox(words, _end_soon), answers, Block(settings["block"]))


def _die_with_parent() -> None:
    """Have the system kill us when our parent dies; a backend in native code notices nothing else."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _end_soon() -> None:
    """End this process and those it started, if they have not ended by themselves in a while."""
    time.sleep(_LINGER)
    if os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    main()
