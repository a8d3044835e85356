"""The checks every GASP point engine has to pass: a pytest plugin that names no engine.

pytest --pyargs gasp_conformance --gasp-engine=NAME [--gasp-precision=float32] [--gasp-oracle=OTHER]
"""
