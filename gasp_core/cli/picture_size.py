"""The size of a picture on the command line."""

from __future__ import annotations

import re
from typing import cast

import click

__all__ = ["Size"]

_SIZE = re.compile(r"(\d+)(?:x(\d+))?")


class Size(click.ParamType[tuple[int, int]]):
    """WIDTHxHEIGHT, or one number for both."""

    name = "WIDTHxHEIGHT"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Two numbers of pixels."""
        if isinstance(value, tuple):
            return cast("tuple[int, int]", value)
        found = _SIZE.fullmatch(str(value))
        if found is None:
            self.fail(f'must be WIDTHxHEIGHT in pixels, e.g. 1280x720, found "{value}"', param, ctx)
        return int(found[1]), int(found[2] or found[1])
