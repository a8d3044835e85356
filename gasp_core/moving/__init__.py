"""Moving splats that one can send: a .sog, and how its Gaussians move. docs/moving_splats.md says what lies in it."""
