"""Deprecated: `gasp_core.stepping.grid`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.stepping.grid", until="0.3")
