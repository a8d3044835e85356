"""What a format cannot hold, said by the commands that write it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians

__all__ = ["say_losses"]


def say_losses(gaussians: Gaussians, suffix: str) -> None:
    """Say what is lost of Gaussians in files that end so; nothing of .ply and USD, which only round to float32."""
    from gasp_core.io.convert import losses
    from gasp_core.io.usd import USD_SUFFIXES

    if suffix not in (".ply", *USD_SUFFIXES):
        for loss in losses(gaussians, suffix):
            click.echo(f"  {suffix}: {loss}", err=True)
