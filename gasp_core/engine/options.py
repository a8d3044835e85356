"""Deprecated: `gasp_core.contract.options`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.contract.options", until="0.3")
