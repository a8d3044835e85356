"""GASP: trained Gaussian splats, moved by physics, with any engine."""
