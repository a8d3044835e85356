"""Registers the command; imports nothing of its own, so that listing commands stays instant."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.discovery.hookspecs import Command, hookimpl

__all__ = ["gasp_commands"]


@hookimpl
def gasp_commands() -> Sequence[Command]:
    """The one command of this distribution."""
    return [
        Command(
            name="view",
            summary="Show a run, a scene or a splat file in the browser.",
            factory="gasp_viewer.command:view",
        )
    ]
