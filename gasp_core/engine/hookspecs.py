"""Deprecated: `gasp_core.discovery.hookspecs`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.discovery.hookspecs", until="0.3")
