"""``gasp-conformance`` and ``python -m gasp_conformance``: the same as ``gasp conformance``."""

from __future__ import annotations

import sys

from gasp_core.cli.main import main as gasp

__all__ = ["main"]


def main() -> int:
    """Run ``gasp conformance`` with the arguments of the process and return its exit status."""
    return gasp(["conformance", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
