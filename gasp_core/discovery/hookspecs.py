"""What a plugin may offer: the hooks, and the descriptors they return.

A plugin is a module named by an entry point of group ``gasp``. It defines any of the functions below, marked with
`hookimpl`, and imports nothing heavy: descriptors name their code as "package.module:attribute", and that is imported
when somebody uses it.

    from gasp_core.discovery.hookspecs import hookimpl

    @hookimpl
    def gasp_point_engines():
        return [EngineDescriptor(name="my-engine", ...)]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pluggy

from gasp_core.contract import EngineDescriptor

__all__ = [
    "COMMAND_VERSION",
    "ENTRY_POINT_GROUP",
    "PROJECT",
    "RENDERER_VERSION",
    "Command",
    "RendererDescriptor",
    "gasp_commands",
    "gasp_point_engines",
    "gasp_splat_renderers",
    "hookimpl",
    "hookspec",
]

PROJECT = "gasp"
"""The name Pluggy keys its markers by."""

ENTRY_POINT_GROUP = "gasp"
"""Entry points of this group name plugin modules."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
"""Marks a plugin's function as the implementation of the hook of its name."""


RENDERER_VERSION = (1, 0)
"""Major, minor, of what a renderer is, `gasp_core.rendering.contract`; another major is refused at discovery."""

COMMAND_VERSION = (1, 0)
"""Major, minor, of what a command is: a `click.Command` that ends with an exit status, and raises GASP's errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RendererDescriptor:
    """A renderer of splats as its plugin registers it; building one imports no backend.

    Parameters
    ----------
    name
        As users write it.
    summary
        One line.
    contract_version
        The plugin's own copy of the number it was written against, not `RENDERER_VERSION` imported.
    factory
        "package.module:Callable" that returns the renderer.
    """

    name: str
    summary: str
    contract_version: tuple[int, int]
    factory: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A subcommand that a plugin hangs into ``gasp``.

    Parameters
    ----------
    name
        What users type behind ``gasp``; a built-in command of the same name wins.
    summary
        One line for ``gasp --help``, so that the help imports nothing of the command's own.
    factory
        "package.module:attribute" that is a `click.Command`.
    contract_version
        The plugin's own copy of the number it was written against, not `COMMAND_VERSION` imported.
    """

    name: str
    summary: str
    factory: str
    contract_version: tuple[int, int] = (1, 0)


@hookspec
def gasp_point_engines() -> Sequence[EngineDescriptor]:  # pyright: ignore[reportReturnType]
    """Engines that move points, one descriptor each.

    Called once, at discovery. It must be quick and import no backend: an engine's own code is imported through
    `EngineDescriptor.factory` when a scene needs it. Two engines of one name, of whatever plugins, are an error as
    soon as somebody asks for that name.
    """


@hookspec
def gasp_splat_renderers() -> Sequence[RendererDescriptor]:  # pyright: ignore[reportReturnType]
    """Renderers that draw splats, one descriptor each.

    Called once, at discovery, under the same rules as `gasp_point_engines`.
    """


@hookspec
def gasp_commands() -> Sequence[Command]:  # pyright: ignore[reportReturnType]
    """Subcommands of ``gasp``, one `Command` each.

    Called when the user types a name that is not built in, or asks for ``gasp --help``. The command's own code is
    imported when it is run.
    """
