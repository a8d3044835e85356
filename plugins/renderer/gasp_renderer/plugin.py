"""Registers the renderers; imports no backend, so that listing them stays instant."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from gasp_core.discovery.hookspecs import RendererDescriptor, hookimpl

__all__ = ["gasp_splat_renderers"]


@hookimpl
def gasp_splat_renderers() -> Sequence[RendererDescriptor]:
    """The renderers of this distribution; "gsplat" only where it is installed."""
    offered = [
        RendererDescriptor(
            name="numba",
            summary="Tile rasteriser on the CPU, all processors",
            contract_version=(1, 0),
            factory="gasp_renderer.rasteriser:NumbaRenderer",
        ),
        RendererDescriptor(
            name="reference",
            summary="The image model in float64 by brute force: slow, what others are measured against",
            contract_version=(1, 0),
            factory="gasp_renderer.reference:ReferenceRenderer",
        ),
    ]
    if find_spec("gsplat") and find_spec("torch"):
        offered.append(
            RendererDescriptor(
                name="gsplat",
                summary="gsplat on an NVIDIA GPU",
                contract_version=(1, 0),
                factory="gasp_renderer.cuda:GsplatRenderer",
            )
        )
    return offered
