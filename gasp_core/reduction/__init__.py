"""Which points of an object an engine is given, and how their motion becomes that of all its Gaussians."""
