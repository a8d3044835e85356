"""``--trust-code``, for all commands that run a scene."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from gasp_core.io.format_errors import shown

if TYPE_CHECKING:
    from gasp_core.scene.model import Scene

__all__ = ["code_is_trusted", "trust_code_option"]

trust_code_option = click.option(
    "--trust-code", is_flag=True, help="Run the Python code that the scene names, without asking."
)


def code_is_trusted(scene: Scene, said: bool) -> bool:
    """Whether the code that a scene names may run: it was said so, or whoever sits at the terminal agrees.

    Raises
    ------
    SceneError
        Where it may not.
    """
    from gasp_core.scene.named_code import code_of, refuse_untrusted

    code = code_of(scene)
    trusted = said
    if code and not said and sys.stdin.isatty() and sys.stderr.isatty():
        click.echo("This scene runs code with your rights:", err=True)
        for own in code:
            click.echo(shown(f'  {own.where()} (function "{own.function}" moves "{own.owner}")'), err=True)
        trusted = click.confirm("Do you trust it?", err=True)
    refuse_untrusted(scene, trusted)
    return trusted
