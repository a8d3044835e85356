"""Deprecated: `gasp_core.contract.validation`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.contract.validation", until="0.3")
