"""Deprecated: `gasp_core.contract.capabilities`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.contract.capabilities", until="0.3")
