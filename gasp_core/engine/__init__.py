"""Deprecated: what engines are to GASP is in `gasp_core.contract`, `stepping`, `discovery` and `engines`."""
