"""Deprecated: `gasp_core.simulation.monitor`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.simulation.monitor", until="0.3")
