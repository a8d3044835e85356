"""The checks every GASP point engine has to pass; it names no engine.

gasp-conformance NAME [--quick] [--json FILE]
pytest --pyargs gasp_conformance --gasp-engine=NAME
"""
