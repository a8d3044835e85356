"""Deprecated: `gasp_core.stepping.mpm`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.stepping.mpm", until="0.3")
