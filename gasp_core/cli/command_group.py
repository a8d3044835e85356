"""The group of subcommands: none is imported to list them, and only the one that is run is imported at all."""

from __future__ import annotations

import difflib
import importlib
from typing import cast

import click

from gasp_core.errors import PluginLoadError

__all__ = ["BUILT_IN", "CommandGroup", "gasp"]

BUILT_IN = {
    "new": ("gasp_core.cli.new_scene:new", "Write a scene for a splat: it falls on a floor."),
    "run": ("gasp_core.cli.run:run", "Simulate a scene and keep its frames."),
    "demo": ("gasp_core.cli.demo:demo", "Drop a soft toy, without any data of your own."),
    "render": ("gasp_core.cli.render:render", "Show a run as a film, pictures, or a sheet of key frames."),
    "compare": ("gasp_core.cli.compare:compare", "Run a scene with several engines and show how far apart they are."),
    "tradeoff": (
        "gasp_core.cli.tradeoff:tradeoff",
        "Measure error against time, and say which settings are worth it.",
    ),
    "sweep": ("gasp_core.cli.sweep:sweep", "Run a scene with many settings: a table with a row a run."),
    "engines": ("gasp_core.cli.engines:engines", "List the engines: what they can do, and which are broken."),
    "materials": (
        "gasp_core.cli.materials:materials",
        "List the materials that have a name: numbers, sources, engines.",
    ),
    "inspect": ("gasp_core.cli.inspect:inspect", "Describe a splat file and say what is odd about it."),
    "convert": ("gasp_core.cli.convert:convert", "Turn a splat file into another format."),
    "verify": ("gasp_core.cli.verify:verify", "Look at every file of a recording, and say what is damaged."),
    "export": ("gasp_core.cli.export:export", "Write the frames of a run as splat files."),
    "soup": ("gasp_core.cli.soup:soup", "Lend a splat's triangles to other programs, and take them back."),
    "bind": ("gasp_core.cli.bind:bind", "Move a splat with a mesh that another program moves."),
    "track": ("gasp_core.cli.track:track", "Follow Gaussians through frames that were made one by one."),
    "pack": ("gasp_core.cli.pack:pack", "Write a run as a moving splat, one file that one can send."),
}
"""Subcommands by name: where they are, and their line in the help."""


class CommandGroup(click.Group):
    """Subcommands of GASP itself and those that plugins offer through the hook `gasp_commands`."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Built-in names in the order one meets them, then those of plugins."""
        return [*BUILT_IN, *(name for name in _plugin_summaries() if name not in BUILT_IN)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a subcommand; None where there is none of that name."""
        if cmd_name in BUILT_IN:
            module, _, attribute = BUILT_IN[cmd_name][0].partition(":")
            return cast(click.Command, getattr(importlib.import_module(module), attribute))
        return _plugin_command(cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The subcommand of an argument list.

        Raises
        ------
        click.UsageError
            Where there is none of that name; a similar one is suggested.
        """
        name = args[0]
        command = None if name.startswith("-") else self.get_command(ctx, name)
        if command is None:
            names = self.list_commands(ctx)
            close = difflib.get_close_matches(name, names, n=1)
            hint = f'did you mean "{close[0]}"?' if close else f"the commands are {', '.join(names)}"
            ctx.fail(f'no command "{name}" ({hint})')
        return name, command, args[1:]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands from their summaries."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in BUILT_IN.items()])
        extra = [(name, summary) for name, summary in _plugin_summaries().items() if name not in BUILT_IN]
        if extra:
            with formatter.section("Commands of plugins"):
                formatter.write_dl(extra)


def _plugin_summaries() -> dict[str, str]:
    # Discovery imports NumPy, which built-in commands may not need.
    from gasp_core.discovery.registry import discover

    return {name: offer.command.summary for name, offer in discover().commands.items()}


def _plugin_command(name: str) -> click.Command | None:
    from gasp_core.discovery.loading import import_factory
    from gasp_core.discovery.registry import discover

    registry = discover()
    if name not in registry.commands:
        return None
    offer = registry.commands[name]
    command: object = import_factory(offer.command.factory, f'command "{name}"', offer.distribution)
    if not isinstance(command, click.Command):
        raise PluginLoadError(
            f'command "{name}": {offer.command.factory} of {offer.distribution} is no click command;'
            f" update {offer.distribution}"
        )
    return command


def _print_version(ctx: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        import importlib.metadata

        click.echo(f"gasp {importlib.metadata.version('gasp-core')}")
        ctx.exit()


@click.group(
    cls=CommandGroup,
    epilog="""\b
First steps:
  gasp demo                            see it work, no data needed
  gasp new plant.splat                 a scene for it: plant.toml
  gasp run plant.toml --preview        a first look
  gasp run plant.toml --render plant.mp4
  gasp export plant.gasp --all --format ply

\b
A scene is a small TOML file: "gasp new" writes one, "gasp run --help" shows one.

\b
Completion in the shell, for bash (zsh and fish likewise):
  eval "$(_GASP_COMPLETE=bash_source gasp)"
""",
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_version, help="Print the version."
)
def gasp() -> None:
    """Trained Gaussian splats, moved by physics, with any engine.

    Take a splat file, say in a scene file what it is made of and what it meets, name an engine, and get splats back
    for every frame.
    """
