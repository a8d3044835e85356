"""Soft and rigid bodies in MuJoCo."""
