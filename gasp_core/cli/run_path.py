"""A recording on the command line: a folder, or an address that its copy is fetched from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

__all__ = ["RunPath", "keep_at_option"]


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
