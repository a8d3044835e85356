"""Deprecated: `gasp_core.contract`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.contract", until="0.3")
