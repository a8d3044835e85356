"""The renderer that draws: one of those that plugins offer."""

from __future__ import annotations

from typing import cast

from gasp_core.discovery.loading import contained, how_to_mend, import_factory, one_line
from gasp_core.discovery.registry import discover
from gasp_core.errors import PluginLoadError, RenderingError
from gasp_core.rendering.contract import SplatRenderer

__all__ = ["DEFAULT_RENDERER", "open_renderer"]

DEFAULT_RENDERER = "numba"
"""Draws on any machine; others are taken when they are asked for, or when it is not there."""


def open_renderer(name: str | None = None) -> SplatRenderer:
    """A renderer by name; without one the default, or whichever is installed.

    Raises
    ------
    RenderingError
        Where there is none, or none of that name.
    PluginLoadError
        Where its code cannot be imported.
    """
    offers = discover().renderers
    if not offers:
        raise RenderingError("no renderer is installed: pip install gasp-renderer")
    if name is None:
        name = DEFAULT_RENDERER if DEFAULT_RENDERER in offers else next(iter(offers))
    if name not in offers:
        raise RenderingError(f'no renderer named "{name}" is installed; choose one of {", ".join(offers)}')
    offer = offers[name]
    what = f'renderer "{name}"'
    factory = import_factory(offer.descriptor.factory, what, offer.distribution)
    try:
        return cast(SplatRenderer, contained(factory))
    except ImportError as error:
        remedy = how_to_mend(offer.distribution)
        raise PluginLoadError(f"{what} cannot be loaded: {one_line(error)}; {remedy}") from error
