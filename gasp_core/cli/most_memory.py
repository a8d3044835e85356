"""``--most-memory``, for all commands that read splat files."""

from __future__ import annotations

import re

import click

__all__ = ["Memory", "most_memory_option"]

_SIZE = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,3})?) ?([KMGT]?)B?", re.IGNORECASE)
_UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}


class Memory(click.ParamType[int]):
    """Bytes, as 8G or 500M."""

    name = "SIZE"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number of bytes."""
        found = _SIZE.fullmatch(str(value).strip())
        size = int(float(found[1]) * _UNITS[found[2].upper()]) if found else 0
        if size == 0:
            self.fail(f'"{value}" is no size; write 8G or 500M', param, ctx)
        return size


def _hold(ctx: click.Context, parameter: click.Parameter, most: int | None) -> None:
    if most is not None and not ctx.resilient_parsing:
        from gasp_core.io.memory_limit import memory_limit

        ctx.with_resource(memory_limit(most))


most_memory_option = click.option(
    "--most-memory",
    metavar="SIZE",
    type=Memory(),
    expose_value=False,
    callback=_hold,
    help="Memory that reading one splat may take: 8G, 500M. [default: by its size, and what is free]",
)
