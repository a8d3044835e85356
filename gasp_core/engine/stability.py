"""Deprecated: `gasp_core.stepping.time_step`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.stepping.time_step", until="0.3")
