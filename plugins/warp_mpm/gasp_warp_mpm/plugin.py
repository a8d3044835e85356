"""Registers the engine; imports no backend, so that listing engines stays instant."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_core.contract import EngineDescriptor
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.stepping.mpm_descriptor import mpm_descriptor

__all__ = ["gasp_point_engines"]


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The one engine of this distribution."""
    return [
        mpm_descriptor(
            name="warp-mpm",
            summary="Explicit MLS-MPM in NVIDIA Warp: sorted points, coloured scatter; CPU and CUDA",
            factory="gasp_warp_mpm.engine:WarpMpm",
            contract_version=(1, 5),
            device_indices=True,
        )
    ]
