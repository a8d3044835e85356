"""A plugin that fails while it is imported."""

raise RuntimeError("the flux capacitor\nis missing")
