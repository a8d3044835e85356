"""A recording on the command line: a folder, or an address that its copy is fetched from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

__all__ = ["RunPath"]


class RunPath(click.Path):
    """A path; of a recording at an address, s3://bucket/run.gasp, that of its copy on this machine."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path of what is on this machine, fetched where it was not."""
        from gasp_core.recording.addresses import address_of, local_copy

        return super().convert(value, param, ctx) if address_of(str(value)) is None else local_copy(str(value))
