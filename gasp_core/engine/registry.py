"""Deprecated: `gasp_core.discovery.registry`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.discovery.registry", until="0.3")
