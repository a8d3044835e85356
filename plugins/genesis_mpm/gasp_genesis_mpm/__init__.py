"""Genesis' material point method as an engine of points."""
