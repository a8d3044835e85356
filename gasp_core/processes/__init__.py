"""Processes that are watched: what they use, and what is said of one that is no more."""
