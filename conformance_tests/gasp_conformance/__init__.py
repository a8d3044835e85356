"""The checks every GASP point engine has to pass."""
