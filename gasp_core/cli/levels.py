"""``--level``: which level of detail of a streamed SOG is meant."""

from __future__ import annotations

import click

__all__ = ["level_option"]

level_option = click.option(
    "--level",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of a streamed SOG (lod-meta.json), 0 the finest.",
)
