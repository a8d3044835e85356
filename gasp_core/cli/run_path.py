"""Paths on the command line: of this machine, or of a recording at an address, whose copy is fetched."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

__all__ = ["PathHere", "RunPath", "keep_at_option"]


class PathHere(click.Path):
    """A path on this machine, ``file:///tmp/film.mp4`` too: an address would become a folder called "s3:"."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path."""
        from gasp_core.recording.address_names import address_of, path_here

        path = path_here(os.fspath(value))
        if address_of(path) is not None:
            self.fail(
                f"{value} is an address, and only recordings can be at one: give a path on this machine", param, ctx
            )
        return super().convert(path, param, ctx)


class RunPath(click.Path):
    """A path; of a recording at an address, s3://bucket/run.gasp, that of its copy on this machine."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path of what is on this machine, fetched where it was not."""
        from gasp_core.recording.addresses import local_copy

        return super().convert(local_copy(os.fspath(value)), param, ctx)


class _Address(click.ParamType[str]):
    """An address, and no folder of this machine."""

    name = "address"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from gasp_core.recording.addresses import address_of

        address = address_of(value)
        if address is None:
            self.fail(f"{value} is none, such as s3://bucket/runs; a folder of this machine is for --out", param, ctx)
        return address


keep_at_option = click.option(
    "--keep-at",
    metavar="ADDRESS",
    type=_Address(),
    help="Keep the recordings there instead, by whoever makes them: s3://bucket/runs.",
)
