"""A point engine for GASP."""
