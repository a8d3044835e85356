"""``gasp view``: a run, a scene or a splat file in the browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import cast

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.run_path import RunPath
from gasp_core.errors import RenderingError
from gasp_core.scene.objects import UP_AXES, UpAxis
from gasp_viewer.colouring import COLOURINGS
from gasp_viewer.layers import LAYERS

__all__ = ["view"]


@click.command(
    epilog="""\b
Examples:
  gasp view plant.gasp                    a run, even while it is still going
  gasp view scene.toml                    a scene as it begins
  gasp view plant.splat                   a splat file, y down as 3DGS writes them
  gasp view scan.ply --up +z              one that is z up
  gasp view plant.splat --layer solid     the body that GASP finds in it
  gasp view plant.gasp --layer points --colour speed
  gasp view plant.gasp --host 0.0.0.0     for every browser in this network

\b
In the page: drag turns, drag with the right button shifts, the wheel zooms.
"""
)
@click.argument("path", type=RunPath())
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen on; any but this machine's own lets others look.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65_535),
    default=8080,
    show_default=True,
    help="The next free one is taken where it is in use; 0: any.",
)
@click.option("--open/--no-open", "opens", default=True, help="Open the browser, where there is one. [default: open]")
@click.option("--up", type=click.Choice(UP_AXES), help="A splat file's axis that points up. [default: -y]")
@click.option(
    "--layer",
    type=click.Choice(list(LAYERS)),
    default=next(iter(LAYERS)),
    show_default=True,
    help="What to show first.",
)
@click.option(
    "--colour",
    "colouring",
    type=click.Choice(COLOURINGS),
    default=COLOURINGS[0],
    show_default=True,
    help="And in which colours.",
)
@most_memory_option
def view(path: Path, host: str, port: int, opens: bool, up: str | None, layer: str, colouring: str) -> None:
    """Show a run, a scene or a splat file in the browser, until Ctrl-C.

    PATH is the folder that "gasp run" wrote, what "gasp pack" made of it, a scene file, or a splat file. A run may
    still be going: the page follows it.
    """
    from gasp_core.rendering.footage import RecordedFootage, Still, open_footage
    from gasp_viewer.server import free_port, is_loopback, page_address, serving
    from gasp_viewer.session import Exhibit, Session, wait_for_frame

    footage = open_footage(path, cast(UpAxis, up or "-y"))
    if up is not None and not isinstance(footage, Still):
        raise click.UsageError(f"--up is for splat files: {path} is none, and upright")
    if isinstance(footage, RecordedFootage):
        wait_for_frame(footage, say=lambda sentence: click.echo(sentence, err=True))
    exhibit = Exhibit(footage)
    for name, known, what in ((layer, exhibit.layers, "layer"), (colouring, exhibit.colourings, "colour")):
        if name not in known:
            raise RenderingError(f"{path}: has no {what} {name}, it has {', '.join(known)}")
    with serving(host, free_port(host, port), f"gasp view {path.name or path}") as server:
        session = Session(exhibit, server, layer=layer, colouring=colouring)
        address = page_address(host, server.get_port())
        click.echo(f"{path}: {address} (Ctrl-C ends it)")
        if not is_loopback(host):
            click.echo(f"warning: everyone who can reach {host} can see this: there is no password", err=True)
        if opens and _has_browser():
            webbrowser.open(address)
        try:
            session.run()
        finally:
            session.close()


def _has_browser() -> bool:
    """Whether there is a browser with a window: one in the terminal could not show this."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True
