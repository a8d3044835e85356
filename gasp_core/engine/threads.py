"""Deprecated: `gasp_core.stepping.threads`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.stepping.threads", until="0.3")
