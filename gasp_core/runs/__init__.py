"""Deprecated: `gasp_core.studies.runs`."""

from gasp_core.deprecation import moved

__getattr__ = moved(__name__, "gasp_core.studies.runs", until="0.3")
