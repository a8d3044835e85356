"""The first thing a worker runs: `python -I start.py SETTINGS`, a script, since nothing of GASP can be imported yet.

It borrows the packages it is lent, is guarded from then on, takes the channel out of reach of whatever the backend
prints, and serves.
"""

from __future__ import annotations

import faulthandler
import importlib.abc
import importlib.util
import json
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

__all__ = ["LentPackages", "main"]

_LINGER = 3.0
"""Seconds a worker may take to end by itself once nobody speaks to it any more."""


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
    if settings["path"] is not None:
        sys.path[:] = settings["path"]
    sys.meta_path.insert(0, LentPackages(settings["loans"]))
    sys.argv[:] = ["gasp-worker"]

    # Lent as all of GASP, and of the standard library alone: NumPy, which starts threads, comes after the fork.
    from gasp_core.processes.guard import guard_group, read_nothing
    from gasp_core.processes.termination import ignore_termination

    guard_group(_LINGER)
    ignore_termination()
    incoming, outgoing = os.dup(0), os.dup(1)
    read_nothing()
    os.dup2(2, 1)
    faulthandler.enable(all_threads=False)  # a segfault leaves in the log where it was

    from gasp_core.engines.worker.serving import serve
    from gasp_core.engines.worker.shared_memory import Block
    from gasp_core.engines.worker.transport import Inbox

    os.set_inheritable(settings["block"], False)
    with os.fdopen(incoming, "rb") as words, os.fdopen(outgoing, "wb") as answers:
        serve(Inbox(words), answers, Block(settings["block"]))


if __name__ == "__main__":
    main()
