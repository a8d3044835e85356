"""Blender's soft bodies, cloth and rigid bodies as an engine of GASP."""
