"""GASP point engine."""
